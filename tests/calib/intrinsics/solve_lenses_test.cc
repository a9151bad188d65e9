// SPDX-License-Identifier: Apache-2.0
// Lenses from synthetic sightings of boards.
#include "calib/intrinsics/solve_lenses.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <tuple>

#include "calib/intrinsics/board_views.h"
#include "tests/calib/intrinsics/synthetic_boards.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

// Where the boards' corners are in truth and in the solution, matched by frame.
struct Truth {
  std::map<std::string, Eigen::Isometry3d> world_from_board;  // by frame
};

// The motion from the world to the reference that fits best to where the boards stood.
Eigen::Isometry3d ReferenceFromWorld(const Truth& truth, const LensSolution& solution,
                                     const Board& board) {
  const Lattice lattice = board.lattice().value();
  Eigen::Matrix3Xd in_world(3, 4 * solution.boards.size());
  Eigen::Matrix3Xd in_reference(3, 4 * solution.boards.size());
  Eigen::Index at = 0;
  for (const LensBoard& solved : solution.boards) {
    for (const int i : {0, lattice.width - 1}) {
      for (const int j : {0, lattice.height - 1}) {
        const Eigen::Vector3d corner(i * lattice.spacing, j * lattice.spacing, 0);
        in_world.col(at) = truth.world_from_board.at(solved.frame) * corner;
        in_reference.col(at++) = solved.reference_from_board * corner;
      }
    }
  }
  return Eigen::Isometry3d(Eigen::umeyama(in_world, in_reference, false));
}

struct Errors {
  double squares = 0;  // of the projections' errors, pixels
  double chi_squared = 0;
  int points = 0;

  void Add(const Errors& more) {
    squares += more.squares;
    chi_squared += more.chi_squared;
    points += more.points;
  }
  double Chi2PerDof() const { return chi_squared / (2 * points); }
  double RmsPerAxis() const { return std::sqrt(squares / (2 * points)); }
};

// Adds how far the projection of a point is off, and what was predicted.
void AddError(const CameraModel& camera, size_t c, const Eigen::Vector3d& in_world,
              const LensSolution& solution, const Eigen::Isometry3d& reference_from_world,
              Errors& errors) {
  const auto is = camera.Project(in_world);
  if (!is || !camera.Contains(*is)) return;
  const Eigen::Vector3d in_reference = reference_from_world * in_world;
  const auto solved = solution.cameras[c].model->Project(in_reference);
  const auto covariance = ProjectionCovariance(solution, c, in_reference);
  if (!solved || !covariance) {
    ADD_FAILURE() << "camera " << c << " does not see a point that it saw";
    return;
  }
  const Eigen::Vector2d off = *solved - *is;
  errors.squares += off.squaredNorm();
  errors.chi_squared += off.dot(covariance->ldlt().solve(off));
  ++errors.points;
}

// Over the rim of the images, much of which no board reached.
Errors RimErrors(const std::vector<CameraModel>& cameras, const Truth& truth,
                 const LensSolution& solution, const Board& board) {
  const Eigen::Isometry3d reference_from_world = ReferenceFromWorld(truth, solution, board);
  Errors errors;
  for (size_t c = 0; c < cameras.size(); ++c) {
    for (const double x : {0, 426, 853, 1279}) {
      for (const double y : {0, 959}) {
        const auto ray = cameras[c].Ray({x, y});
        if (!ray) continue;
        AddError(cameras[c], c, cameras[c].Centre() + solution.cameras[c].distance * *ray, solution,
                 reference_from_world, errors);
      }
    }
  }
  return errors;
}

// Over points of the workspace.
Errors WorkspaceErrors(const std::vector<CameraModel>& cameras, const Truth& truth,
                       const LensSolution& solution, const Board& board, std::mt19937& random) {
  const Eigen::Isometry3d reference_from_world = ReferenceFromWorld(truth, solution, board);
  std::uniform_real_distribution<double> unit(-1, 1);
  Errors errors;
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3d in_world =
        0.5 * Eigen::Vector3d(unit(random), 0.75 * unit(random), 0.4 * unit(random));
    for (size_t c = 0; c < cameras.size(); ++c) {
      AddError(cameras[c], c, in_world, solution, reference_from_world, errors);
    }
  }
  return errors;
}

struct Session {
  Truth truth;
  std::vector<TagSighting> sightings;
};

Session Look(const std::vector<CameraModel>& cameras, const Board& board, const BoardMotion& motion,
             std::mt19937& random) {
  Session session;
  for (int frame = 0; frame < motion.frames; ++frame) {
    const Eigen::Isometry3d pose = RandomBoardPose(random, board, motion);
    session.truth.world_from_board[FrameName(frame)] = pose;
    AddSightings(cameras, board, pose, FrameName(frame), motion.noise, random, session.sightings);
  }
  return session;
}

TEST(SolveLenses, OtherBoardsGiveLensesAsGoodAsTheyAreSaidToBe) {
  const auto cameras = CamerasOnAnArc(1);
  for (const Board& board : {Board({.name = "hand",
                            .kind = BoardKind::kChessboard,
                            .rows = 6,
                            .columns = 8,
                            .square = 0.06}),
                             Board({.name = "kalibr",
                             .rows = 2,
                             .columns = 3,
                             .tag_size = 0.14,
                             .gap = 0.042,
                             .from_bottom = true})}) {
    SCOPED_TRACE(board.description().name);
    std::mt19937 random(3);
    const Session session = Look(cameras, board, {.frames = 20}, random);
    const auto solution = SolveLenses(LensCamerasOf(cameras), {board}, session.sightings);
    ASSERT_TRUE(solution.ok()) << solution.status();
    EXPECT_NEAR(solution->groups[0].noise, 1, 0.12);
    EXPECT_GT(solution->residuals.size(),
              0.9 * static_cast<double>(session.sightings.size() * board.corners_per_mark()));
    const Errors errors = WorkspaceErrors(cameras, session.truth, *solution, board, random);
    EXPECT_LT(errors.RmsPerAxis(), 0.1);
    EXPECT_LT(errors.Chi2PerDof(), 2.5);
  }
}

TEST(SolveLenses, AnyGapBetweenTagsGivesLensesAsGoodAsTheyAreSaidToBe) {
  const auto cameras = CamerasOnAnArc(1);
  for (const double gap : {0.2954, 0.35}) {
    SCOPED_TRACE(gap);
    const Board board({.name = "kalibr",
                       .rows = 6,
                       .columns = 6,
                       .tag_size = 0.06,
                       .gap = gap * 0.06,
                       .from_bottom = true});
    ASSERT_FALSE(board.lattice()->exact);
    Errors errors;
    for (int seed = 3; seed < 3 + SampleCount(2); ++seed) {
      std::mt19937 random(seed);
      const Session session =
          Look(cameras, board, {.frames = 25, .spread = 0.5, .noise = 0.02}, random);
      const auto solution = SolveLenses(LensCamerasOf(cameras), {board}, session.sightings);
      ASSERT_TRUE(solution.ok()) << solution.status();
      EXPECT_NEAR(solution->groups[0].noise, 1, 0.1);
      const SolvedCamera& camera = solution->cameras[0];
      EXPECT_LT(camera.focal_length_sigma, 0.0001);
      EXPECT_NEAR(camera.intrinsics[0] / cameras[0].intrinsics().fx, 1,
                  3 * camera.focal_length_sigma);
      errors.Add(WorkspaceErrors(cameras, session.truth, *solution, board, random));
      const LensResidual& first = solution->residuals[0];
      const auto seen = std::ranges::find_if(session.sightings, [&](const TagSighting& sighting) {
        return sighting.frame == first.frame && sighting.tag == first.tag;
      });
      ASSERT_NE(seen, session.sightings.end());
      EXPECT_LT((first.seen - seen->corners[static_cast<size_t>(first.corner)]).norm(), 1e-9);
    }
    EXPECT_LT(errors.RmsPerAxis(), 0.01);
    EXPECT_LT(errors.Chi2PerDof(), 2.5);
  }
}

TEST(SolveLenses, AChessboardThatLooksTheSameTurnedByHalfTiesNoCameras) {
  const auto cameras = CamerasOnAnArc(2);
  const Board board(
      {.name = "hand", .kind = BoardKind::kChessboard, .rows = 6, .columns = 8, .square = 0.06});
  std::mt19937 random(4);
  const Session session = Look(cameras, board, {.frames = 20}, random);
  const auto solution = SolveLenses(LensCamerasOf(cameras), {board}, session.sightings);
  ASSERT_TRUE(solution.ok()) << solution.status();
  EXPECT_EQ(solution->groups.size(), 2u);
  EXPECT_THAT(solution->warnings, testing::Contains(HasSubstr("looks the same turned by half")));
}

struct PredictedErrors {
  Errors workspace;
  Errors rim;
};

// Of four cameras, over six sessions (with a sanitizer, one). `common`: pixels per axis, standard
// deviation of the error that the corners of a tag in an image share.
PredictedErrors PredictedAndFound(double common) {
  const auto cameras = CamerasOnAnArc(4);
  const Board board = LatticeBoard();
  PredictedErrors found;
  for (unsigned seed = 1; seed <= static_cast<unsigned>(SampleCount(6)); ++seed) {
    std::mt19937 random(seed);
    Session session = Look(cameras, board, {.frames = 40}, random);
    std::normal_distribution<double> normal(0, 1);
    for (TagSighting& sighting : session.sightings) {
      if (common == 0) break;
      const Eigen::Vector2d shift = common * Eigen::Vector2d(normal(random), normal(random));
      for (Eigen::Vector2d& corner : sighting.corners) corner += shift;
    }
    const auto solution = SolveLenses(LensCamerasOf(cameras), {board}, session.sightings);
    if (!solution.ok()) {
      ADD_FAILURE() << "seed " << seed << ": " << solution.status();
      continue;
    }
    if (common == 0) {
      EXPECT_NEAR(solution->groups[0].noise, 1, 0.03) << "seed " << seed;
    }
    found.workspace.Add(WorkspaceErrors(cameras, session.truth, *solution, board, random));
    found.rim.Add(RimErrors(cameras, session.truth, *solution, board));
  }
  return found;
}

TEST(SolveLenses, PredictsHowFarProjectionsAreOff) {
  const PredictedErrors errors = PredictedAndFound(0);
  EXPECT_LT(errors.rim.Chi2PerDof(), 1.6);
  EXPECT_LT(errors.workspace.Chi2PerDof(), 1.25);
  EXPECT_LT(errors.workspace.RmsPerAxis(), 0.02);
  if (SampleCount(6) < 6) return;  // by chance the errors of one session can be smaller
  EXPECT_GT(errors.rim.Chi2PerDof(), 0.6);
  EXPECT_GT(errors.workspace.Chi2PerDof(), 0.8);
}

TEST(SolveLenses, CountsErrorsThatTheCornersOfATagShareInThePrediction) {
  const PredictedErrors errors = PredictedAndFound(0.2);
  EXPECT_GT(errors.workspace.Chi2PerDof(), 0.7);
  EXPECT_LT(errors.workspace.Chi2PerDof(), 1.4);
}

TEST(SolveLenses, TellsOfEachCameraWhatItSawAndHowWellItIsKnown) {
  std::mt19937 random(11);
  const auto cameras = CamerasOnAnArc(2);
  const Session session = Look(cameras, LatticeBoard(), {.frames = 30}, random);
  const auto solution = SolveLenses(LensCamerasOf(cameras), {LatticeBoard()}, session.sightings);
  ASSERT_TRUE(solution.ok()) << solution.status();
  EXPECT_EQ(solution->residuals.size(), 4 * session.sightings.size());
  EXPECT_NEAR(solution->groups[0].together, 0.1, 0.005);
  EXPECT_NEAR(solution->groups[0].apart, 0.1, 0.005);
  EXPECT_THAT(solution->warnings, testing::Not(testing::Contains(HasSubstr("at one place"))));
  for (size_t i = 0; i < 2; ++i) {
    const SolvedCamera& camera = solution->cameras[i];
    EXPECT_EQ(camera.images, 30);
    EXPECT_NEAR(camera.rms, 0.1, 0.01);
    EXPECT_NEAR(camera.intrinsics[0] / cameras[i].intrinsics().fx, 1,
                4 * camera.focal_length_sigma);
    EXPECT_LT(camera.focal_length_sigma, 0.001);
    EXPECT_GT(camera.covered, 0.6);
    EXPECT_GT(camera.centre_sigma, 0);
    EXPECT_GT(camera.edge_sigma, camera.centre_sigma);
    EXPECT_LT(camera.edge_sigma, 2);
  }
  const Eigen::Isometry3d is =
      cameras[1].camera_from_world() * cameras[0].camera_from_world().inverse();
  const Eigen::Isometry3d off = is.inverse() * solution->cameras[1].camera_from_reference;
  EXPECT_LT(off.translation().norm(), 0.003);
  EXPECT_TRUE(solution->cameras[0].camera_from_reference.isApprox(Eigen::Isometry3d::Identity()));
}

TEST(SolveLenses, FindsTheBoardsBend) {
  std::mt19937 random(12);
  const auto cameras = CamerasOnAnArc(2);
  const Board board = LatticeBoard();
  // 2 mm along its width, as mrcal bends boards: 0 at the corners, most in the middle.
  const double width = 0.08 * 7;
  const auto bend = [&](const Eigen::Vector3d& at) {
    return 0.002 * 4 * at.x() / width * (1 - at.x() / width);
  };
  std::vector<TagSighting> sightings;
  for (int frame = 0; frame < 30; ++frame) {
    AddSightings(cameras, board, RandomBoardPose(random, board, {}), FrameName(frame), 0.1, random,
                 sightings, bend);
  }
  const auto solution = SolveLenses(LensCamerasOf(cameras), {board}, sightings);
  ASSERT_TRUE(solution.ok()) << solution.status();
  ASSERT_TRUE(solution->groups[0].warp.has_value());
  EXPECT_NEAR(solution->groups[0].warp->x(), 0.002, 0.0001);
  EXPECT_NEAR(solution->groups[0].warp->y(), 0, 0.0001);
  EXPECT_NEAR(solution->cameras[0].rms, 0.1, 0.01);

  const auto flat = SolveLenses(LensCamerasOf(cameras), {board}, sightings, {.board_warp = false});
  ASSERT_TRUE(flat.ok()) << flat.status();
  EXPECT_GT(flat->cameras[0].rms, 0.13);
}

TEST(SolveLenses, LeavesOutCornersThatDoNotFitAndNoOthers) {
  std::mt19937 random(13);
  const auto cameras = CamerasOnAnArc(2);
  Session session = Look(cameras, LatticeBoard(), {.frames = 25}, random);
  std::set<std::tuple<std::string, std::string, int, int>> planted;
  for (size_t i = 0; i < session.sightings.size(); i += 13) {
    TagSighting& sighting = session.sightings[i];
    sighting.corners[i % 4] += Eigen::Vector2d(i % 2 == 0 ? 3 : -8, 2);
    sighting.corners[i % 4].x() = std::clamp(sighting.corners[i % 4].x(), 0.0, 1279.0);
    sighting.corners[i % 4].y() = std::clamp(sighting.corners[i % 4].y(), 0.0, 959.0);
    planted.insert({sighting.frame, sighting.view, sighting.tag, static_cast<int>(i % 4)});
  }
  const auto solution = SolveLenses(LensCamerasOf(cameras), {LatticeBoard()}, session.sightings);
  ASSERT_TRUE(solution.ok()) << solution.status();
  size_t found = 0;
  size_t others = 0;
  for (const LensResidual& r : solution->residuals) {
    if (!r.outlier) continue;
    const bool is = planted.contains({r.frame, CameraName(r.camera), r.tag, r.corner});
    ++(is ? found : others);
  }
  EXPECT_EQ(found, planted.size());
  EXPECT_LE(others, 2u);
  EXPECT_NEAR(solution->cameras[0].rms, 0.1, 0.01);
}

TEST(SolveLenses, KeepsCornersOfAPartOfTheImageThatAreAllFartherOff) {
  std::mt19937 random(17);
  const auto cameras = CamerasOnAnArc(1);
  Session session = Look(cameras, LatticeBoard(), {.frames = 40}, random);
  std::normal_distribution<double> normal(0, 0.5);
  int there = 0;
  for (TagSighting& sighting : session.sightings) {
    for (Eigen::Vector2d& at : sighting.corners) {
      if (at.x() < 960) continue;
      ++there;
      at.x() = std::clamp(at.x() + normal(random), 960.0, 1279.0);
      at.y() = std::clamp(at.y() + normal(random), 0.0, 959.0);
    }
  }
  const auto solution = SolveLenses(LensCamerasOf(cameras), {LatticeBoard()}, session.sightings);
  ASSERT_TRUE(solution.ok()) << solution.status();
  EXPECT_GT(there, 100);
  EXPECT_LT(solution->cameras[0].outliers, 5);
}

TEST(SolveLenses, GivesALensWithWhereItIsKnown) {
  std::mt19937 random(18);
  auto cameras = CamerasOnAnArc(1);
  const Board board = LatticeBoard();
  std::vector<TagSighting> sightings;
  for (int frame = 0; frame < 30; ++frame) {
    AddSightings(cameras, board, RandomBoardPose(random, board, {}), FrameName(frame), 0.5, random,
                 sightings);
  }
  // Nothing was seen in the right half of the image.
  std::erase_if(sightings, [](const TagSighting& sighting) {
    return std::ranges::any_of(sighting.corners, [](const auto& at) { return at.x() > 640; });
  });
  const auto solution =
      SolveLenses(LensCamerasOf(cameras), {board}, sightings, {.least_known = 0.2});
  ASSERT_TRUE(solution.ok()) << solution.status();
  const LensMap& map = solution->cameras[0].map;
  ASSERT_EQ(map.sigmas.size(), static_cast<size_t>(map.columns * map.rows));
  const size_t middle_row = static_cast<size_t>(map.rows / 2 * map.columns);
  EXPECT_TRUE(map.Known(middle_row + 4));
  EXPECT_FALSE(map.Known(middle_row + static_cast<size_t>(map.columns) - 1));
  // The region of the camera's file is where the map is known.
  const LensRegion& known = solution->cameras[0].known.value();
  EXPECT_EQ(known.sigma, map.limit);
  EXPECT_TRUE(known.Contains({320, 480}));
  EXPECT_FALSE(known.Contains({1270, 480}));
  EXPECT_GT(map.KnownShare(), 0.2);
  EXPECT_LT(map.KnownShare(), 0.98);
  EXPECT_THAT(solution->warnings, testing::Contains(HasSubstr("of the image only")));
  const absl::Status refused =
      SolveLenses(LensCamerasOf(cameras), {board}, sightings, {.least_known = 1}).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(refused.message()),
              testing::AllOf(HasSubstr("--least-known"), HasSubstr("--most-uncertain")));
}

// A lens of an image of 160 x 120 pixels that is known but where `unknown` says.
LensRegion RegionWithout(const std::function<bool(int, int)>& unknown) {
  LensMap map{.columns = 17, .rows = 13, .sigmas{}, .limit = 1};
  for (int row = 0; row < map.rows; ++row) {
    for (int column = 0; column < map.columns; ++column) {
      const double towards_middle = 0.01 * (std::abs(column - 8) + std::abs(row - 6));
      map.sigmas.push_back(unknown(column, row) ? std::numeric_limits<double>::infinity()
                                                : 0.5 + towards_middle);
    }
  }
  return map.Region(160, 120);
}

TEST(LensMap, ALensThatIsKnownEverywhereHasTheWholeImageForItsRegion) {
  const LensRegion region = RegionWithout([](int, int) { return false; });
  for (const double x : {-0.49, 80.0, 159.49}) {
    for (const double y : {-0.49, 60.0, 119.49}) EXPECT_TRUE(region.Contains({x, y})) << x << y;
  }
  EXPECT_EQ(region.contour.size(), 5u);
}

TEST(LensMap, NoUnknownPlaceIsInTheRegion) {
  const auto hole = [](int column, int row) { return column == 12 && row >= 5 && row <= 7; };
  const LensRegion region = RegionWithout(hole);
  EXPECT_TRUE(region.Contains({80, 60}));
  EXPECT_TRUE(region.Contains({10, 60}));
  for (int row = 5; row <= 7; ++row) {
    EXPECT_FALSE(region.Contains({120, 10.0 * row})) << "the hole, and what is behind it";
    EXPECT_FALSE(region.Contains({155, 10.0 * row}));
  }
  EXPECT_EQ(RegionWithout([](int, int) { return true; }).contour.size(), 0u);
}

TEST(SolveLenses, LosesNoCornerOfNoiseFreeDataAndIsHardlyBiased) {
  std::mt19937 random(14);
  const auto cameras = CamerasOnAnArc(2);
  const Board board = LatticeBoard();
  const Session session = Look(cameras, board, {.frames = 25, .noise = 0}, random);
  const auto solution = SolveLenses(LensCamerasOf(cameras), {board}, session.sightings);
  ASSERT_TRUE(solution.ok()) << solution.status();
  EXPECT_EQ(solution->cameras[0].outliers, 0);
  const Errors errors = WorkspaceErrors(cameras, session.truth, *solution, board, random);
  EXPECT_LT(errors.RmsPerAxis(), 0.003);
}

TEST(SolveLenses, PlacesOfALatticeWithoutCornersDoNotBiasTheLens) {
  std::mt19937 random(14);
  const auto cameras = CamerasOnAnArc(1);
  const Board board({.name = "kalibr",
                     .rows = 6,
                     .columns = 6,
                     .tag_size = 0.06,
                     .gap = 0.018,
                     .from_bottom = true});
  ASSERT_TRUE(board.lattice()->exact);
  const Session session = Look(cameras, board, {.frames = 12, .spread = 0.5, .noise = 0}, random);
  const auto solution = SolveLenses(LensCamerasOf(cameras), {board}, session.sightings);
  ASSERT_TRUE(solution.ok()) << solution.status();
  const Errors errors = WorkspaceErrors(cameras, session.truth, *solution, board, random);
  EXPECT_LT(errors.RmsPerAxis(), 0.003);
}

TEST(SolveLenses, KeepsLensesThatAreGiven) {
  std::mt19937 random(15);
  const auto cameras = CamerasOnAnArc(3);
  const Board board = LatticeBoard();
  const Session session = Look(cameras, board, {.frames = 8}, random);
  std::vector<LensCamera> given = LensCamerasOf(cameras);
  for (size_t i = 0; i < given.size(); ++i) given[i].fixed = cameras[i].intrinsics();
  const auto solution = SolveLenses(given, {board}, session.sightings);
  ASSERT_TRUE(solution.ok()) << solution.status();
  for (size_t i = 0; i < cameras.size(); ++i) {
    EXPECT_EQ(solution->cameras[i].model->intrinsics().fx, cameras[i].intrinsics().fx);
    EXPECT_EQ(solution->cameras[i].model->intrinsics().distortion,
              cameras[i].intrinsics().distortion);
    const Eigen::Isometry3d is =
        cameras[i].camera_from_world() * cameras[0].camera_from_world().inverse();
    EXPECT_LT((is.inverse() * solution->cameras[i].camera_from_reference).translation().norm(),
              0.001);
  }
  given[1].fixed.reset();
  EXPECT_THAT(SolveLenses(given, {board}, session.sightings).status().message(),
              HasSubstr("the lens of 'cam1' is not given"));
}

TEST(SolveLenses, SolvesForOtherLensModelsByName) {
  std::mt19937 random(16);
  const auto cameras = CamerasOnAnArc(1);
  const Board board = LatticeBoard();
  const Session session = Look(cameras, board, {.frames = 40}, random);
  const auto solve = [&](const std::string& model) {
    return SolveLenses(LensCamerasOf(cameras), {board}, session.sightings,
                       {.lens_model = model, .least_known = 0});
  };
  for (const char* model : {"LENSMODEL_OPENCV5", "LENSMODEL_OPENCV12", "LENSMODEL_CAHVOR",
                            "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=8_Ny=6_fov_x_deg=90"}) {
    const auto solution = solve(model);
    ASSERT_TRUE(solution.ok()) << model << ": " << solution.status();
    EXPECT_EQ(solution->cameras[0].lens_model, model);
    EXPECT_NEAR(solution->cameras[0].rms, 0.1, 0.02) << model;
    EXPECT_EQ(solution->cameras[0].model.has_value(), std::string(model) == "LENSMODEL_OPENCV5");
  }
  EXPECT_THAT(solve("OPENCV8").status().message(),
              HasSubstr("no lens model is called 'OPENCV8'; there are LENSMODEL_PINHOLE"));
  EXPECT_THAT(solve("LENSMODEL_CAHVORE_linearity=0.34").status().message(),
              HasSubstr("cannot be solved for"));
}

}  // namespace
}  // namespace silhouette
