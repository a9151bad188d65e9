// SPDX-License-Identifier: Apache-2.0
#include "calib/intrinsics/lens_problem.h"

extern "C" {
#include <mrcal/mrcal.h>
}
#include <suitesparse/cholmod.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "calib/camera/camera_model.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

bool ModelOf(const std::string& name, mrcal_lensmodel_t* model) {
  return mrcal_lensmodel_from_name(model, name.c_str()) &&
         mrcal_lensmodel_type_is_valid(model->type);
}

}  // namespace

absl::StatusOr<int> LensParameters(const std::string& lens_model) {
  mrcal_lensmodel_t model;
  if (!ModelOf(lens_model, &model)) {
    std::string known;
    for (const char* const* name = mrcal_supported_lensmodel_names(); *name != nullptr; ++name) {
      absl::StrAppend(&known, known.empty() ? "" : ", ", *name);
    }
    return InvalidArgument("no lens model is called '", lens_model, "'; there are ", known);
  }
  if (!mrcal_lensmodel_metadata(&model).has_gradients) {
    return InvalidArgument("the lens model ", lens_model,
                           " cannot be solved for; use LENSMODEL_OPENCV8");
  }
  return mrcal_lensmodel_num_params(&model);
}

bool IsSplined(const std::string& lens_model) {
  return lens_model.starts_with("LENSMODEL_SPLINED_STEREOGRAPHIC");
}

std::optional<Eigen::Vector2d> ProjectByLens(const std::string& lens_model,
                                             const std::vector<double>& intrinsics,
                                             const Eigen::Vector3d& point,
                                             LensDerivatives* derivatives) {
  mrcal_lensmodel_t model;
  if (!ModelOf(lens_model, &model)) return std::nullopt;
  if (!(point.z() > 0) && !mrcal_lensmodel_metadata(&model).can_project_behind_camera) {
    return std::nullopt;
  }
  const mrcal_point3_t p{.xyz = {point.x(), point.y(), point.z()}};
  mrcal_point2_t q;
  std::array<mrcal_point3_t, 2> by_point;
  const auto parameters = static_cast<Eigen::Index>(intrinsics.size());
  Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor> by_intrinsics(2, parameters);
  const bool wanted = derivatives != nullptr;
  if (!mrcal_project(&q, wanted ? by_point.data() : nullptr,
                     wanted ? by_intrinsics.data() : nullptr, &p, 1, &model, intrinsics.data()) ||
      !std::isfinite(q.x) || !std::isfinite(q.y)) {
    return std::nullopt;
  }
  if (wanted) {
    for (int row = 0; row < 2; ++row) {
      for (int i = 0; i < 3; ++i) {
        derivatives->by_point(row, i) = by_point[static_cast<size_t>(row)].xyz[i];
      }
    }
    derivatives->by_intrinsics = by_intrinsics;
  }
  return Eigen::Vector2d(q.x, q.y);
}

std::optional<Eigen::Vector3d> UnprojectByLens(const std::string& lens_model,
                                               const std::vector<double>& intrinsics,
                                               const Eigen::Vector2d& pixel) {
  mrcal_lensmodel_t model;
  const mrcal_point2_t q{.xy = {pixel.x(), pixel.y()}};
  mrcal_point3_t v;
  if (!ModelOf(lens_model, &model) || !mrcal_unproject(&v, &q, 1, &model, intrinsics.data()) ||
      !std::isfinite(v.x) || !std::isfinite(v.y) || !std::isfinite(v.z)) {
    return std::nullopt;
  }
  return Eigen::Vector3d(v.x, v.y, v.z).normalized();
}

Eigen::Matrix<double, 3, 6> DerivativeByPose(const Eigen::Isometry3d& pose,
                                             const Eigen::Vector3d& point) {
  Eigen::Matrix<double, 6, 1> values;
  values << RotationVectorOf(pose), pose.translation();
  std::array<double, 3> out;
  Eigen::Matrix<double, 3, 6, Eigen::RowMajor> derivative;
  mrcal_transform_point_rt(out.data(), derivative.data(), nullptr, values.data(), point.data());
  return derivative;
}

namespace {

mrcal_pose_t MrcalPose(const Eigen::Isometry3d& pose) {
  const Eigen::Vector3d r = RotationVectorOf(pose);
  const Eigen::Vector3d t = pose.translation();
  mrcal_pose_t result;
  for (int i = 0; i < 3; ++i) {
    result.r.xyz[i] = r[i];
    result.t.xyz[i] = t[i];
  }
  return result;
}

Eigen::Isometry3d PoseFrom(const mrcal_pose_t& pose) {
  return PoseOf({pose.r.x, pose.r.y, pose.r.z}, {pose.t.x, pose.t.y, pose.t.z});
}

// mrcal's regularisation weighs as much as a share of all places of the lattice, of which a board
// with Kalibr's gap has forty for each corner. With weights times this, it has its share of those
// that count.
double WeightScale(const LensProblem& problem) {
  const auto seen = static_cast<double>(std::ranges::count_if(
      problem.corners, [](const Eigen::Vector3d& corner) { return corner.z() > 0; }));
  return std::sqrt(static_cast<double>(problem.corners.size()) / std::max(seen, 1.0));
}

// A LensProblem in mrcal's types.
struct Arguments {
  mrcal_lensmodel_t model{};
  mrcal_problem_selections_t selections{};
  mrcal_problem_constants_t constants{};
  std::vector<double> intrinsics;
  std::vector<mrcal_pose_t> cameras;  // without the first
  std::vector<mrcal_pose_t> boards;
  mrcal_calobject_warp_t warp{};
  std::vector<mrcal_observation_board_t> observations;
  std::vector<mrcal_point3_t> corners;
  std::vector<int> image_sizes;
  Lattice lattice;
  double weight_scale = 1;  // of weights, and so of residuals and derivatives, as mrcal has them

  int Cameras() const { return static_cast<int>(image_sizes.size() / 2); }
  int Poses() const { return static_cast<int>(cameras.size()); }
  int Boards() const { return static_cast<int>(boards.size()); }
  int Observations() const { return static_cast<int>(observations.size()); }
  int States() const {
    return mrcal_num_states(Cameras(), Poses(), Boards(), 0, 0, Observations(), selections, &model);
  }
  int Measurements() const {
    return mrcal_num_measurements(Observations(), 0, lattice.width, lattice.height, Cameras(),
                                  Poses(), Boards(), 0, 0, selections, &model);
  }
};

absl::StatusOr<Arguments> ArgumentsOf(const LensProblem& problem, const FreeParts& free) {
  Arguments a;
  ASSIGN_OR_RETURN(const int parameters, LensParameters(problem.lens_model));
  mrcal_lensmodel_from_name(&a.model, problem.lens_model.c_str());
  a.selections.do_optimize_intrinsics_core = free.core && !IsSplined(problem.lens_model);
  a.selections.do_optimize_intrinsics_distortions = free.distortion && parameters > 4;
  a.selections.do_optimize_extrinsics = free.poses;
  a.selections.do_optimize_frames = free.poses;
  a.selections.do_optimize_calobject_warp = free.warp;
  a.selections.do_apply_regularization = free.regularisation;
  for (const auto& each : problem.intrinsics) {
    a.intrinsics.insert(a.intrinsics.end(), each.begin(), each.end());
  }
  for (size_t i = 1; i < problem.camera_from_reference.size(); ++i) {
    a.cameras.push_back(MrcalPose(problem.camera_from_reference[i]));
  }
  for (const auto& pose : problem.reference_from_board) a.boards.push_back(MrcalPose(pose));
  a.warp.x2 = problem.warp.x();
  a.warp.y2 = problem.warp.y();
  for (const auto& o : problem.observations) {
    a.observations.push_back(
        {.icam = {.intrinsics = o.camera, .extrinsics = o.camera - 1}, .iframe = o.board});
  }
  a.corners.reserve(problem.corners.size());
  a.weight_scale = WeightScale(problem);
  for (const Eigen::Vector3d& c : problem.corners) {
    a.corners.push_back({.xyz = {c.x(), c.y(), a.weight_scale * c.z()}});
  }
  for (const auto& size : problem.image_sizes) {
    a.image_sizes.insert(a.image_sizes.end(), size.begin(), size.end());
  }
  a.lattice = problem.lattice;
  return a;
}

// The derivatives of all residuals, as mrcal gives them: a column per residual, unitless states.
struct Jacobian {
  std::vector<double> x;
  std::vector<int> starts;
  std::vector<int> rows;
  std::vector<double> values;
  std::vector<double> scale;  // of each state
};

// With `derivatives`, or the residuals only.
bool Evaluate(const Arguments& a, bool derivatives, Jacobian* out) {
  const auto states = static_cast<size_t>(a.States());
  const auto measurements = static_cast<size_t>(a.Measurements());
  const int nonzero = _mrcal_num_j_nonzero(a.Observations(), 0, a.lattice.width, a.lattice.height,
                                           a.Cameras(), a.Poses(), a.Boards(), 0, 0,
                                           a.observations.data(), nullptr, a.selections, &a.model);
  std::vector<double> b(states);
  out->x.resize(measurements);
  out->starts.resize(measurements + 1);
  out->rows.resize(static_cast<size_t>(nonzero));
  out->values.resize(static_cast<size_t>(nonzero));
  cholmod_sparse_struct jt{};
  jt.nrow = states;
  jt.ncol = measurements;
  jt.nzmax = static_cast<size_t>(nonzero);
  jt.p = out->starts.data();
  jt.i = out->rows.data();
  jt.x = out->values.data();
  jt.stype = 0;
  jt.itype = CHOLMOD_INT;
  jt.xtype = CHOLMOD_REAL;
  jt.dtype = CHOLMOD_DOUBLE;
  jt.sorted = 1;
  jt.packed = 1;
  if (!mrcal_optimizer_callback(
          b.data(), static_cast<int>(b.size() * sizeof(double)), out->x.data(),
          static_cast<int>(out->x.size() * sizeof(double)), derivatives ? &jt : nullptr,
          a.intrinsics.data(), a.cameras.data(), a.boards.data(), nullptr, &a.warp, a.Cameras(),
          a.Poses(), a.Boards(), 0, 0, a.observations.data(), nullptr, a.Observations(), 0,
          a.corners.data(), &a.model, a.image_sizes.data(), a.selections, &a.constants,
          a.lattice.spacing, a.lattice.width, a.lattice.height, false)) {
    return false;
  }
  for (double& x : out->x) x /= a.weight_scale;
  for (double& value : out->values) value /= a.weight_scale;
  out->scale.assign(states, 1);
  mrcal_unpack_solver_state_vector(out->scale.data(), a.Cameras(), a.Poses(), a.Boards(), 0, 0,
                                   a.selections, &a.model);
  return true;
}

// Adds the products of the derivatives of one residual.
void AddRow(const Jacobian& jacobian, size_t row, int first_board, NormalEquations& n) {
  const int board_states = 6 * static_cast<int>(n.board.size());
  const auto begin = static_cast<size_t>(jacobian.starts[row]);
  const auto end = static_cast<size_t>(jacobian.starts[row + 1]);
  // At most one board has a part in it.
  int board = -1;
  Eigen::Matrix<long double, 6, 1> of_board = Eigen::Matrix<long double, 6, 1>::Zero();
  std::vector<std::pair<int, long double>> of_shared;
  for (size_t p = begin; p < end; ++p) {
    const int state = jacobian.rows[p];
    const double value = jacobian.values[p] / jacobian.scale[static_cast<size_t>(state)];
    if (state >= first_board && state < first_board + board_states) {
      board = (state - first_board) / 6;
      of_board[(state - first_board) % 6] = value;
    } else {
      of_shared.emplace_back(state < first_board ? state : state - board_states, value);
    }
  }
  for (const auto& [i, a] : of_shared) {
    for (const auto& [j, b] : of_shared) n.shared(i, j) += a * b;
  }
  if (board < 0) return;
  const auto placing = static_cast<size_t>(board);
  for (const auto& [i, a] : of_shared) {
    n.mixed[placing].row(i) += a * of_board.transpose();
  }
  n.board[placing] += of_board * of_board.transpose();
}

}  // namespace

absl::Status Solve(LensProblem& problem, const FreeParts& free) {
  ASSIGN_OR_RETURN(Arguments made, ArgumentsOf(problem, free));
  Arguments& a = made;
  const mrcal_stats_t stats = mrcal_optimize(
      nullptr, 0, nullptr, 0, a.intrinsics.data(), a.cameras.data(), a.boards.data(), nullptr,
      &a.warp, a.Cameras(), a.Poses(), a.Boards(), 0, 0, a.observations.data(), nullptr,
      a.Observations(), 0, a.corners.data(), &a.model, a.image_sizes.data(), a.selections,
      &a.constants, a.lattice.spacing, a.lattice.width, a.lattice.height, false, false);
  if (!(stats.rms_reproj_error__pixels >= 0)) {
    return absl::InternalError("mrcal found no solution");
  }
  const size_t parameters = a.intrinsics.size() / problem.intrinsics.size();
  for (size_t i = 0; i < problem.intrinsics.size(); ++i) {
    std::copy_n(a.intrinsics.begin() + static_cast<std::ptrdiff_t>(i * parameters), parameters,
                problem.intrinsics[i].begin());
  }
  for (size_t i = 0; i < a.cameras.size(); ++i) {
    problem.camera_from_reference[i + 1] = PoseFrom(a.cameras[i]);
  }
  for (size_t i = 0; i < a.boards.size(); ++i) {
    problem.reference_from_board[i] = PoseFrom(a.boards[i]);
  }
  problem.warp = {a.warp.x2, a.warp.y2};
  return absl::OkStatus();
}

std::vector<Eigen::Vector2d> Residuals(const LensProblem& problem) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<Eigen::Vector2d> residuals(problem.corners.size(), Eigen::Vector2d(nan, nan));
  // What counts and what does not is projected alike: all weights 1.
  LensProblem all = problem;
  for (Eigen::Vector3d& corner : all.corners) corner.z() = 1;
  const absl::StatusOr<Arguments> a = ArgumentsOf(all, {});
  Jacobian jacobian;
  if (!a.ok() || !Evaluate(*a, false, &jacobian)) return residuals;
  for (size_t i = 0; i < residuals.size(); ++i) {
    if (problem.corners[i].z() == kNoCorner) continue;
    residuals[i] = {jacobian.x[2 * i], jacobian.x[2 * i + 1]};
  }
  return residuals;
}

absl::StatusOr<NormalEquations> NormalEquationsOf(const LensProblem& problem,
                                                  const FreeParts& free) {
  ASSIGN_OR_RETURN(const Arguments made, ArgumentsOf(problem, free));
  const Arguments& a = made;
  Jacobian jacobian;
  if (!Evaluate(a, true, &jacobian)) return absl::InternalError("mrcal gives no derivatives");

  NormalEquations n;
  n.states = a.States();
  const int first_board = mrcal_state_index_frames(0, a.Cameras(), a.Poses(), a.Boards(), 0, 0,
                                                   a.Observations(), a.selections, &a.model);
  const int board_states = 6 * a.Boards();
  const int shared = n.states - board_states;
  for (int i = 0; i < a.Cameras(); ++i) {
    n.places.intrinsics.push_back(mrcal_state_index_intrinsics(
        i, a.Cameras(), a.Poses(), a.Boards(), 0, 0, a.Observations(), a.selections, &a.model));
    n.places.pose.push_back(
        i == 0 ? -1
               : mrcal_state_index_extrinsics(i - 1, a.Cameras(), a.Poses(), a.Boards(), 0, 0,
                                              a.Observations(), a.selections, &a.model));
  }
  n.places.free_intrinsics = mrcal_num_intrinsics_optimization_params(a.selections, &a.model);
  n.places.first_intrinsic = a.selections.do_optimize_intrinsics_core ? 0 : 4;
  n.shared = LongMatrix::Zero(shared, shared);
  n.board.assign(a.boards.size(), LongMatrix6::Zero());
  n.mixed.assign(a.boards.size(), LongMatrix::Zero(shared, 6));

  const auto corner_values = 2 * problem.corners.size();
  n.residuals = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(corner_values));
  std::vector<Eigen::Triplet<double>> entries;
  for (size_t row = 0; row < jacobian.x.size(); ++row) {
    if (row < corner_values && !(problem.corners[row / 2].z() > 0)) continue;
    if (row < corner_values) {
      ++n.measurements;
      n.squares += jacobian.x[row] * jacobian.x[row];
      n.residuals[static_cast<Eigen::Index>(row)] = jacobian.x[row];
      for (int p = jacobian.starts[row]; p < jacobian.starts[row + 1]; ++p) {
        const int state = jacobian.rows[static_cast<size_t>(p)];
        const bool board = state >= first_board && state < first_board + board_states;
        const int after = state < first_board ? state : state - board_states;
        entries.emplace_back(
            row, board ? shared + state - first_board : after,
            jacobian.values[static_cast<size_t>(p)] / jacobian.scale[static_cast<size_t>(state)]);
      }
    }
    AddRow(jacobian, row, first_board, n);
  }
  n.jacobian.resize(n.residuals.size(), n.states);
  n.jacobian.setFromTriplets(entries.begin(), entries.end());
  return n;
}

}  // namespace silhouette
