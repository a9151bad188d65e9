// SPDX-License-Identifier: Apache-2.0
#include "silhouette/verdict.h"

namespace silhouette::client {
namespace {

struct Words {
  const char* name;
  const char* description;
};

Words WordsFor(Reason reason) {
  switch (reason) {
    case Reason::kUnspecified:
      break;
    case Reason::kNoScene:
      return {"no scene", "the server has no scene yet"};
    case Reason::kSceneStale:
      return {"scene stale", "the newest scene is older than max_age"};
    case Reason::kSceneSkewed:
      return {"scene skewed", "the images of the scene were taken further apart than max_skew"};
    case Reason::kViewMissing:
      return {"view missing", "the scene lacks a view of the database"};
    case Reason::kRobotPositionUnknown:
      return {"robot position unknown",
              "it is not known where the robot was in the scene, or it was outside the grid"};
    case Reason::kFixedJointMoved:
      return {"fixed joint moved",
              "a fixed joint is not where it was when the robot images were captured, or was not "
              "at the cell file's value then: see the scene's defects and 'silhouette-db verify'"};
    case Reason::kRobotImageOfSceneMissing:
      return {"robot image of scene missing",
              "there is no usable robot image for the robot's present configuration"};
    case Reason::kErrorArea:
      return {
          "error area",
          "too large an area shows background where the robot should be: the robot is not where "
          "it says, a camera moved, or the light changed"};
    case Reason::kOutsideGrid:
      return {"outside grid", "the configuration is outside the grid"};
    case Reason::kRobotImageMissing:
      return {"robot image missing", "no robot image was captured for the configuration"};
    case Reason::kExcluded:
      return {"excluded", "the configuration lies in a region the robot must never enter"};
    case Reason::kRobotImageCorrupt:
      return {"robot image corrupt",
              "the robot image fails its checksum or shows the robot in no view: capture it again; "
              "if no camera can see the robot there, forbid the region"};
    case Reason::kGenerationMismatch:
      return {"generation mismatch",
              "the scene was made with another generation of the database: publish a new one"};
    case Reason::kInternal:
      return {"internal", "internal error of the server: see its log"};
    case Reason::kMarginUnknown:
      return {"margin unknown",
              "a safety margin in metres cannot be computed: import the camera models, or specify "
              "the margin in pixels"};
    case Reason::kRegionEnded:
      return {"region ended", "an allowed region ended while the answer was made: ask again"};
    case Reason::kCalibrationDoubtful:
      return {"calibration doubtful",
              "a camera moved, no recent check confirms the calibration, or robot images "
              "contradict it: "
              "see the defects, calibrate again, or request the preset uncalibrated"};
    case Reason::kVariantUnknown:
      return {"variant unknown",
              "the robot's variant is unknown: see the scene's defects (silhouette scene show)"};
    case Reason::kDatabaseDamaged:
      return {
          "database damaged",
          "the database changed or was damaged while the server used it: replace its whole folder "
          "by a copy that 'silhouette-db verify' accepts, and let the server load it again "
          "(SIGHUP)"};
    case Reason::kLightChanged:
      return {"light changed",
              "a view is far darker or brighter than its reference: restore the light and the "
              "camera's exposure"};
    case Reason::kViewCovered:
      return {"view covered",
              "a view does not show the cell: uncover its lens, and see the scene's defects"};
    case Reason::kViewsSwapped:
      return {"views swapped", "a view shows what another view should: exchange their cameras"};
    case Reason::kCameraMoved:
      return {"camera moved",
              "a view shows the cell moved: turn its camera back, or capture again"};
    case Reason::kRobotElsewhere:
      return {"robot elsewhere",
              "a view shows the empty cell where the robot should be: the robot is not where it "
              "reports, or its variant is another"};
    case Reason::kMotionNotProven:
      return {"motion not proven",
              "a stretch of the path is free only where it was sampled, and the preset requires a "
              "proof: request a finer path_resolution, or keep more distance"};
    case Reason::kDependsOnWrist:
      return {"depends on wrist",
              "whether the robot is free there depends on its wrist: ask for joint values"};
    case Reason::kOutsideWorkspace:
      return {"outside workspace",
              "the robot reaches beyond the cell's workspace there, where obstacles are not found: "
              "keep it inside, or enlarge 'workspace' in the cell file"};
    case Reason::kRobotImageSuspect:
      return {"robot image suspect",
              "the robot image was captured while the cell may have changed: capture it again "
              "('silhouette-capture run --only suspect')"};
    case Reason::kNotInMap:
      return {
          "not in map",
          "the map has no verdict for the configuration, because a usable robot image or a view is "
          "missing: ask the server for the reason"};
    case Reason::kBetweenGridPoints:
      return {"between grid points", "the grid points around it do not decide: ask the server"};
    case Reason::kNoUpdate:
      return {"no update", "the server has sent nothing yet: wait for the first update"};
    case Reason::kConnectionLost:
      return {"connection lost", "no connection to the server: reconnecting"};
    case Reason::kUpdateTooOld:
      return {
          "update too old",
          "the scene of the last update is older than max_age: no newer one came, or the network "
          "stalls"};
    case Reason::kUpdateExpired:
      return {"update expired",
              "the last update of the server has expired, and no other has followed"};
    case Reason::kUpdateMalformed:
      return {"update malformed",
              "the server's message is unusable: use a silhouette-server of this version"};
    case Reason::kAgeUnknown:
      return {"age unknown",
              "the age of the scene is unknown because the server did not report its clock"};
    case Reason::kNotCheckedHere:
      return {"not checked here",
              "LocalSpace cannot check that by itself: see its status, or ask the server"};
    case Reason::kRefused:
      return {
          "refused",
          "the server refuses what is asked, or one of its limits does; of a LocalSpace the status "
          "says why"};
    case Reason::kAnswerLate:
      return {
          "answer late",
          "the answer expired before it came: ask again, and look for what holds up the network, "
          "this computer or new scenes"};
  }
  return {"unspecified", "the server gave no reason, or one that this program does not know"};
}

}  // namespace

std::string NameOf(State state) {
  switch (state) {
    case State::kFree:
      return "free";
    case State::kOccupied:
      return "occupied";
    case State::kUnknown:
      break;
  }
  return "unknown";
}

std::string NameOf(Reason reason) { return WordsFor(reason).name; }
std::string Describe(Reason reason) { return WordsFor(reason).description; }

}  // namespace silhouette::client
