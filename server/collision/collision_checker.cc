// SPDX-License-Identifier: Apache-2.0
#include "server/collision/collision_checker.h"

#include <algorithm>
#include <array>
#include <bit>
#include <stdexcept>

#include "server/collision/collision_images.h"

namespace silhouette {
namespace {

// What lies inside the test robot image.
struct Look {
  bool shown = false;     // of the plane that shows obstacles
  bool obstacle = false;  // obstacle pixels of the obstacle image
  bool hiding = false;    // unknown or error pixels
};

Look LookAt(const ObstacleImage& image, MaskWords shown_by, const TestRobot::View& robot) {
  const MaskWords obstacle = image.obstacle().words();
  const MaskWords unknown = image.unknown().words();
  const MaskWords error = image.error().words();
  uint64_t shown_bits = 0;
  uint64_t obstacle_bits = 0;
  uint64_t hiding_bits = 0;
  for (size_t i = 0; i < obstacle.size(); ++i) {
    const uint64_t bits = robot[i];
    shown_bits |= shown_by[i] & bits;
    obstacle_bits |= obstacle[i] & bits;
    hiding_bits |= (unknown[i] | error[i]) & bits;
  }
  return {shown_bits != 0, obstacle_bits != 0, hiding_bits != 0};
}

// The intersection images of one test configuration, in memory that is used again and again.
class IntersectionWords {
 public:
  std::span<const SearchedImage> Fill(const RobotImageTable& table, const ObstacleImages& images,
                                      const TestRobot& test_robot) {
    words_.resize(3 * table.words());
    images_.assign(images.size(), {});
    uint64_t* at = words_.data();
    for (int view = 0; view < table.views(); ++view) {
      const std::optional<ObstacleImage>& image = images[static_cast<size_t>(view)];
      if (!image) continue;
      const TestRobot::View robot = test_robot.view(view);
      const auto cut = [&](const Mask& plane) {
        const MaskWords words = plane.words();
        for (size_t i = 0; i < words.size(); ++i) at[i] = words[i] & robot[i];
        const MaskWords result(at, words.size());
        at += words.size();
        return result;
      };
      SearchedImage& searched = images_[static_cast<size_t>(view)];
      searched.obstacle = cut(image->obstacle());
      searched.unknown = cut(image->unknown());
      searched.error = cut(image->error());
    }
    return images_;
  }

 private:
  std::vector<uint64_t> words_;
  std::vector<SearchedImage> images_;
};

ViewEvidence CountIn(const ObstacleImage& image, const TestRobot::View& robot) {
  const MaskWords obstacle = image.obstacle().words();
  const MaskWords unknown = image.unknown().words();
  const MaskWords error = image.error().words();
  ViewEvidence evidence;
  for (size_t i = 0; i < obstacle.size(); ++i) {
    const uint64_t bits = robot[i];
    evidence.obstacle_pixels += static_cast<uint32_t>(std::popcount(obstacle[i] & bits));
    evidence.unknown_pixels += static_cast<uint32_t>(std::popcount(unknown[i] & bits));
    evidence.error_pixels += static_cast<uint32_t>(std::popcount(error[i] & bits));
  }
  return evidence;
}

}  // namespace

CollisionChecker::CollisionChecker(const RobotImageTable& table,
                                   const ObstacleImages& obstacle_images, const Policy& policy,
                                   const TestSupport& support)
    : table_(table),
      obstacle_images_(obstacle_images),
      min_views_(MinViews(policy, table.views())),
      off_grid_(policy.off_grid) {
  if (obstacle_images.size() != static_cast<size_t>(table.views())) {
    throw std::invalid_argument("there must be one obstacle image per view");
  }
  for (int view = 0; view < table.views(); ++view) {
    const std::optional<ObstacleImage>& image = obstacle_images[view];
    if (!image) {
      ++missing_views_;
    } else if (image->size() != table.mask_sizes()[view]) {
      throw std::invalid_argument("an obstacle image has not the size of its view's masks");
    }
  }
  if (IsCalibrated(policy.preset)) PrepareLines(policy, support);
  if (IsSound(policy.preset)) CheckSpace(policy, support);
  if (!IsCalibrated(policy.preset) && !IsSound(policy.preset)) TakePrepared(support);
}

Reason CollisionChecker::Unusable(Numbers corners, const Between& part) const {
  if (corners.empty()) return Reason::kOutsideGrid;
  if (!part.from.empty() && table_.forbidden().Between(part.from, part.to)) {
    return Reason::kExcluded;
  }
  bool missing = false;
  bool corrupt = false;
  bool elsewhere = false;
  bool suspect = false;
  for (ConfigurationNumber corner : corners) {
    const RobotImageState state = table_.state(corner);
    if (state == RobotImageState::kExcluded) return Reason::kExcluded;
    missing = missing || state == RobotImageState::kMissing;
    corrupt = corrupt || state == RobotImageState::kCorrupt || state == RobotImageState::kEmpty;
    elsewhere = elsewhere || state == RobotImageState::kElsewhere;
    suspect = suspect || state == RobotImageState::kSuspect;
  }
  if (corrupt) return Reason::kRobotImageCorrupt;
  if (suspect) return Reason::kRobotImageSuspect;
  if (elsewhere) return Reason::kFixedJointMoved;
  return missing ? Reason::kRobotImageMissing : Reason::kNone;
}

// The grid cell with some corners, as CornersAround orders them; one corner: that configuration.
class CollisionChecker::Cell {
 public:
  Cell(const ConfigurationGrid& grid, Numbers corners)
      : joints_(static_cast<size_t>(grid.dimensions())) {
    const GridIndex low = grid.IndexOf(corners.front()).value();
    const GridIndex high = grid.IndexOf(corners.back()).value();
    for (size_t j = 0; j < joints_; ++j) {
      const GridJoint& joint = grid.joints()[j];
      const bool last = !joint.continuous && joint.steps > 1 && low[j] == joint.steps - 1;
      from_[j] = last ? joint.upper : joint.lower + low[j] * joint.step();
      to_[j] = from_[j];
      if (high[j] != low[j]) to_[j] += joint.step();  // round the turn, too
    }
  }

  Between whole() const { return {{from_.data(), joints_}, {to_.data(), joints_}}; }

 private:
  size_t joints_;
  std::array<double, kMaxJoints> from_{};
  std::array<double, kMaxJoints> to_{};
};

void CollisionChecker::BeginEvidence(std::span<ViewEvidence> evidence) const {
  if (!evidence.empty() && evidence.size() != obstacle_images_.size()) {
    throw std::invalid_argument("there must be one evidence per view, or none");
  }
  for (size_t view = 0; view < evidence.size(); ++view) {
    evidence[view] = ViewEvidence{.missing = !obstacle_images_[view]};
  }
}

Verdict CollisionChecker::Judge(Numbers corners, const Between& part,
                                std::span<ViewEvidence> evidence) const {
  BeginEvidence(evidence);
  const Reason unusable = Unusable(corners, part);
  if (unusable != Reason::kNone) return Verdict::Unknown(unusable);
  thread_local TestRobot test_robot;
  if (!test_robot.Take(table_, corners)) {
    return Verdict::Unknown(table_.drawn() ? Reason::kInternal : Reason::kRobotImageCorrupt);
  }
  if (possible_space_ == nullptr) return JudgeTaken(test_robot, /*grown=*/false, {}, evidence);
  const Cell cell(table_.grid(), corners);
  return IfInWorkspace(JudgeTaken(test_robot, /*grown=*/false, {cell.whole(), part}, evidence),
                       cell.whole().from, {});
}

Verdict CollisionChecker::JudgeDrawn(std::span<const double> q, Growth growth, const Between& part,
                                     const Between& places,
                                     std::span<ViewEvidence> evidence) const {
  BeginEvidence(evidence);
  switch (table_.StateBetween(places.from, places.to)) {
    case RobotImageState::kPresent:
      break;
    case RobotImageState::kExcluded:
      return Verdict::Unknown(Reason::kExcluded);
    default:
      return Verdict::Unknown(Reason::kOutsideGrid);
  }
  // Whether an obstacle may hide is not known then.
  if (node_is_free_ && evidence.empty() && growth.empty() && IsFreeByMap(q)) {
    return Verdict::Free(/*hidden_possible=*/true);
  }
  if (drawn_ != nullptr && evidence.empty()) {
    if (const std::optional<Verdict> verdict = JudgePrepared(q, growth)) return *verdict;
  }
  thread_local TestRobot test_robot;
  if (!test_robot.Draw(table_, q, growth)) return Verdict::Unknown(Reason::kInternal);
  return IfInWorkspace(JudgeTaken(test_robot, !growth.empty(), {part, part}, evidence), q, growth);
}

Verdict CollisionChecker::IfInWorkspace(const Verdict& verdict, std::span<const double> q,
                                        Growth growth) const {
  return verdict.free() && LeavesWorkspace(q, growth) ? Verdict::Unknown(Reason::kOutsideWorkspace)
                                                      : verdict;
}

bool CollisionChecker::LeavesWorkspace(std::span<const double> q, Growth growth) const {
  if (!workspace_) return false;
  thread_local std::vector<Eigen::Isometry3d> base_from_link;
  table_.drawn()->chain().Pose(q, base_from_link);
  return table_.drawn()->Leaves(*workspace_, base_from_link, growth);
}

Verdict CollisionChecker::JudgeNode(ConfigurationNumber number,
                                    std::span<ViewEvidence> evidence) const {
  BeginEvidence(evidence);
  const Reason unusable = Unusable({&number, 1}, {});
  if (unusable != Reason::kNone) return Verdict::Unknown(unusable);
  const Verdict depends = Verdict::Unknown(Reason::kDependsOnWrist);
  if (possible_space_ != nullptr) return depends;
  thread_local TestRobot test_robot;
  try {
    test_robot.DrawNode(table_, DrawnKind::kOwn, number);
    const Verdict own = JudgeTaken(test_robot, /*grown=*/false, {}, evidence);
    if (own.state() == State::kOccupied) return own;
    test_robot.DrawNode(table_, DrawnKind::kReach, number);
    const Verdict reach = JudgeTaken(test_robot, /*grown=*/true, {}, evidence);
    return reach.state() == State::kOccupied ? depends : reach;
  } catch (const std::exception&) {
    return Verdict::Unknown(Reason::kInternal);
  }
}

bool CollisionChecker::IsFreeByMap(std::span<const double> q) const {
  const std::optional<ConfigurationNumber> node = table_.grid().Nearest(q);
  return node && node_is_free_(*node);
}

std::optional<Verdict> CollisionChecker::JudgePrepared(std::span<const double> q,
                                                       Growth growth) const {
  thread_local DrawnCheckScratch scratch;
  int showing = 0;
  try {
    showing = drawn_->Showing(q, growth, min_views_, scratch);
  } catch (const std::exception&) {
    return Verdict::Unknown(Reason::kInternal);
  }
  if (showing >= min_views_) return Verdict::Occupied(/*hidden_possible=*/false);
  if (always_hiding_) return Verdict::Free(showing == 0 || !growth.empty());
  if (showing > 0 && growth.empty()) return Verdict::Free(/*hidden_possible=*/false);
  return std::nullopt;
}

Verdict CollisionChecker::JudgeTaken(const TestRobot& test_robot, bool grown, const Asked& asked,
                                     std::span<ViewEvidence> evidence) const {
  int showing = missing_views_;
  bool hidden_possible = true;
  for (int view = 0; view < table_.views(); ++view) {
    if (!obstacle_images_[view]) continue;
    const ObstacleImage& image = *obstacle_images_[view];
    const TestRobot::View robot = test_robot.view(view);
    const Look look = LookAt(image, ShownBy(view), robot);
    if (look.shown) ++showing;
    // What a grown robot touches, the robot may not.
    hidden_possible = hidden_possible && look.hiding && (grown || !look.obstacle);
    if (!evidence.empty()) evidence[view] = CountIn(image, robot);
  }
  if (possible_space_ != nullptr) {
    if (SomethingPossible(test_robot, asked)) return Verdict::Occupied(hidden_possible);
    if (missing_views_ > 0) return Verdict::Unknown(Reason::kViewMissing);
    return Verdict::Free(/*hidden_possible=*/false);
  }
  if (searched_bands_ != nullptr && showing < min_views_) {
    showing = ShowingAlongLines(test_robot, showing);
  }
  if (showing >= min_views_) return Verdict::Occupied(hidden_possible);
  if (missing_views_ > 0) return Verdict::Unknown(Reason::kViewMissing, hidden_possible);
  return Verdict::Free(hidden_possible);
}

bool CollisionChecker::SomethingPossible(const TestRobot& test_robot, const Asked& asked) const {
  thread_local std::vector<uint64_t> room;
  thread_local std::vector<MaskWords> robot;
  room.resize(table_.words());
  robot.clear();
  std::span<uint64_t> left = room;
  for (int view = 0; view < table_.views(); ++view) {
    robot.push_back(test_robot.Words(view, left));
    left = left.subspan(robot.back().size());
  }
  PossibleSpace::MayTouch body;
  if (robot_may_touch_) {
    body = [this, &asked](const Eigen::AlignedBox3d& box) {
      return robot_may_touch_(asked.robot.from, asked.robot.to, box);
    };
  }
  const bool possible = possible_space_->PlanesMeet(robot, min_views_, body) &&
                        (!voxels_decide_ || possible_space_->VoxelsMeet(robot, min_views_, body));
  if (!possible || !robot_may_meet_) return possible;
  return possible_space_->PlainMeet(robot, body) ||
         robot_may_meet_(asked.places.from, asked.places.to);
}

int CollisionChecker::ShowingAlongLines(const TestRobot& test_robot, int showing) const {
  // Where no view shows an obstacle, none can convict.
  if (showing == 0) return 0;
  thread_local IntersectionWords intersection;
  thread_local LineSearch search;
  search.Begin(*searched_bands_, intersection.Fill(table_, obstacle_images_, test_robot));
  return search.CountShowing(min_views_);
}

Verdict CollisionChecker::Check(ConfigurationNumber number,
                                std::span<ViewEvidence> evidence) const {
  if (!table_.grid().Contains(number)) return Judge({}, {}, evidence);
  if (table_.has_nodes()) return JudgeNode(number, evidence);
  const Configuration q = table_.grid().At(number);
  return Judge({&number, 1}, {q, q}, evidence);
}

Verdict CollisionChecker::Check(std::span<const double> q, std::span<ViewEvidence> evidence) const {
  return CheckPart(q, {q, q}, evidence);
}

Verdict CollisionChecker::CheckPart(std::span<const double> q, const Between& part,
                                    std::span<ViewEvidence> evidence) const {
  if (table_.drawn() != nullptr) return JudgeDrawn(q, {}, part, part, evidence);
  if (off_grid_ == OffGrid::kCell) {
    return Judge(table_.grid().CornersAround(q).numbers(), part, evidence);
  }
  const std::optional<ConfigurationNumber> nearest = table_.grid().Nearest(q);
  return nearest ? Judge({&*nearest, 1}, part, evidence) : Judge({}, {}, evidence);
}

State CollisionChecker::StateOf(ConfigurationNumber number) const {
  if (table_.has_nodes()) return JudgeNode(number, {}).state();
  if (drawn_ != nullptr) {
    thread_local DrawnCheckScratch scratch;
    const bool occupied = drawn_->ShownBy(min_views_, table_.grid().At(number), {}, scratch);
    return occupied ? State::kOccupied : State::kFree;
  }
  thread_local TestRobot test_robot;
  const Numbers corners(&number, 1);
  if (!test_robot.Take(table_, corners)) return State::kUnknown;
  if (Occupied(corners, test_robot)) return State::kOccupied;
  const bool unknown =
      missing_views_ > 0 || (workspace_ && LeavesWorkspace(table_.grid().At(number), {}));
  return unknown ? State::kUnknown : State::kFree;
}

bool CollisionChecker::Occupied(Numbers corners, const TestRobot& test_robot) const {
  if (possible_space_ != nullptr) {
    const Cell cell(table_.grid(), corners);
    return SomethingPossible(test_robot, {cell.whole(), cell.whole()});
  }
  int showing = missing_views_;
  for (int view = 0; view < table_.views() && showing < min_views_; ++view) {
    if (!obstacle_images_[view]) continue;
    if (Intersects(ShownBy(view), test_robot.Words(view, {}))) ++showing;
  }
  if (searched_bands_ != nullptr && showing < min_views_) {
    showing = ShowingAlongLines(test_robot, showing);
  }
  return showing >= min_views_;
}

std::optional<TileVerdicts> CollisionChecker::CheckTile(uint64_t tile, const Stop& stop) const {
  TileVerdicts verdicts;
  for (uint64_t place = 0; place < kTileSize; ++place) {
    const ConfigurationNumber number = tile * kTileSize + place;
    const bool judged = table_.drawn() != nullptr
                            ? table_.state(number) == RobotImageState::kPresent
                            : table_.present(tile).Contains(place);
    if (!judged) continue;
    if (Stopped(stop)) return std::nullopt;
    const uint64_t bit = uint64_t{1} << (place % 64);
    const State state = StateOf(number);
    if (state == State::kOccupied) verdicts.occupied[place / 64] |= bit;
    if (state == State::kFree) verdicts.free[place / 64] |= bit;
  }
  return verdicts;
}

std::optional<std::vector<Mask>> CollisionChecker::TestRobotImages(std::span<const double> q,
                                                                   Growth growth) const {
  TestRobot robot;
  if (table_.drawn() != nullptr) {
    if (table_.StateBetween(q, q) != RobotImageState::kPresent) return std::nullopt;
    if (!robot.Draw(table_, q, growth)) return std::nullopt;
    return ImagesOf(robot);
  }
  const std::optional<ConfigurationNumber> nearest = table_.grid().Nearest(q);
  const CellCorners cell = table_.grid().CornersAround(q);
  Numbers corners = cell.numbers();
  if (off_grid_ == OffGrid::kNearest && nearest) corners = {&*nearest, 1};
  if (Unusable(corners, {q, q}) != Reason::kNone) return std::nullopt;
  if (!robot.Take(table_, corners)) return std::nullopt;
  return ImagesOf(robot);
}

std::vector<Mask> CollisionChecker::ImagesOf(const TestRobot& robot) const {
  std::vector<Mask> images;
  for (int view = 0; view < table_.views(); ++view) {
    const MaskSize size = table_.mask_sizes()[static_cast<size_t>(view)];
    std::vector<uint64_t> room(size.words());
    const MaskWords words = robot.Words(view, room);
    images.push_back(Mask::FromWords(size, {words.begin(), words.end()}));
  }
  return images;
}

}  // namespace silhouette
