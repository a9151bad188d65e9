// SPDX-License-Identifier: Apache-2.0
// Captured configurations to compare a model with: from a database, or taken by driving the robot.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "capture/session/capture_observer.h"
#include "capture/session/visitor.h"
#include "capture/verification/model_comparison.h"
#include "capture/verification/sampler.h"
#include "db/store/store.h"

namespace silhouette {

// `count` of a database's captured configurations, or as many as there are, by chance; none whose
// robot image is suspect. The joints of `cell`, whose robot is drawn, are found by their names.
// InvalidArgument, naming it: a joint or a view is not in the database, a joint moves farther in
// `cell` than in the database's grid, a view's masks have another size, or a joint that is fixed in
// `cell` was captured farther from there than `fixed_joint_tolerance`. FailedPrecondition: the
// database has no such configuration with its measured joint values.
absl::StatusOr<std::vector<ModelSample>> SamplesIn(const Database& captured,
                                                   const storage::v1::CellDescription& cell,
                                                   size_t count, double fixed_joint_tolerance,
                                                   uint64_t seed);

// "the lower face of 'workspace' across x"; `face` as NarrowGap has it.
std::string FaceName(int face);

// One sentence that names what ModelSampler::AlwaysNarrow has, and the mend; empty: it has nothing.
std::string AlwaysNarrowText(const ModelSampler& sampler, std::span<const std::string> link_names);

// Drives the robot straight from one configuration to the next until `samples` has `count`, and
// makes its masks as a capture does. Each is in `kept` (OpenKeptSamples) on the disk before the
// robot goes on; where chance finds a grid value of `kept` again, another place is taken. Fewer: a
// stop was requested. `parts.travel` is of the grid of the database whose robot is driven, which
// has the joints of the sampler's robot; `link_names`: of its links, for messages.
// FailedPrecondition: the robot stands where the sampler finds no way, or there is none anywhere;
// what is too near to what is named. Aborted: three places in a row are missed. Errors of devices
// and of `kept`; the robot is stopped then, and `samples` has what was taken.
absl::Status TakeSamples(SessionParts& parts, ModelSampler& sampler,
                         std::span<const std::string> link_names, size_t count,
                         const std::string& program, Database& kept,
                         std::vector<ModelSample>& samples, const CaptureObserver& observer);

}  // namespace silhouette
