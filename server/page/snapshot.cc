// SPDX-License-Identifier: Apache-2.0
#include "server/page/snapshot.h"

#include <google/protobuf/message.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <exception>
#include <nlohmann/json.hpp>
#include <set>
#include <span>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "db/status/status_macros.h"
#include "server/service/answers.h"
#include "server/service/calls.h"
#include "server/service/defects.h"
#include "server/service/messages.h"

namespace silhouette {
namespace {

using nlohmann::json;

constexpr size_t kMostPaths = 8;
constexpr size_t kMostWaypoints = 200;
constexpr uint64_t kMostCells = 1 << 20;
constexpr int kImageWidth = 480;
constexpr std::chrono::milliseconds kMapTime{50};

// As the API's JSON, with the fields' names of the .proto files and without leaving out zeros.
json JsonOf(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.always_print_primitive_fields = true;
  options.preserve_proto_field_names = true;
  std::string text;
  if (!google::protobuf::util::MessageToJsonString(message, &text, options).ok()) return nullptr;
  return json::parse(text);
}

json MaskJson(const std::optional<Mask>& mask) {
  if (!mask) return nullptr;
  v1::Mask message;
  ToMessage(*mask, &message);
  return JsonOf(message);
}

// The joint values of the grid in a scene; nothing if one is not there.
std::optional<Configuration> PresentConfiguration(const Served& served) {
  if (served.scene == nullptr) return std::nullopt;
  Configuration q;
  for (const GridJoint& joint : served.database->grid().joints()) {
    const auto found = std::ranges::find(served.scene->joints, joint.name, &JointPosition::name);
    if (found == served.scene->joints.end()) return std::nullopt;
    q.push_back(found->position);
  }
  return q;
}

// What is laid over the views beside the planes of the scene: by view.
json ViewsJson(const Serving& serving, const Checker& checker,
               const std::optional<Configuration>& present) {
  const Served& served = checker.served();
  const std::shared_ptr<const LiveImages> images =
      serving.settings.live == nullptr ? nullptr : serving.settings.live->images();
  std::optional<std::vector<Mask>> robot;
  if (present) robot = checker.TestRobotImages(*present);
  json views = json::object();
  for (int view = 0; view < served.database->views(); ++view) {
    const auto i = static_cast<size_t>(view);
    json& shown = views[served.database->view_name(view)];
    shown = {{"image", nullptr}, {"robot", nullptr}, {"allowed", nullptr}, {"region", nullptr}};
    std::optional<Mask> region;
    for (const AllowedRegion& in_force : served.regions->regions) {
      if (in_force.pixels[i]) region = region ? *region | *in_force.pixels[i] : *in_force.pixels[i];
    }
    shown["region"] = MaskJson(region);
    if (served.scene == nullptr || !served.scene->views[i]) continue;
    if (robot) shown["robot"] = MaskJson((*robot)[i]);
    std::optional<Mask> allowed;
    for (const RegionEffect& effect : served.scene->region_effects) {
      if (!effect.taken[i]) continue;
      allowed = allowed ? *allowed | *effect.taken[i] : *effect.taken[i];
    }
    shown["allowed"] = MaskJson(allowed);
    if (images != nullptr && images->scene == served.scene->id && i < images->images.size() &&
        images->images[i]) {
      shown["image"] = absl::Base64Escape(JpegOf(*images->images[i], kImageWidth));
    }
  }
  return views;
}

struct Slice {
  int x = 0;
  int y = 0;
  GridIndex at{};
};

// The choice as far as the grid has it.
Slice SliceOf(const SliceChoice& choice, const ConfigurationGrid& grid,
              const std::optional<Configuration>& present) {
  const int joints = grid.dimensions();
  Slice slice{.x = choice.x < joints ? choice.x : 0, .y = choice.y < joints ? choice.y : 0};
  if (slice.y == slice.x) slice.y = (slice.x + 1) % joints;
  for (int j = 0; j < joints; ++j) {
    const auto i = static_cast<size_t>(j);
    const GridJoint& joint = grid.joints()[i];
    int& step = slice.at[i];
    step = joint.steps / 2;
    if (present) {
      const std::optional<double> place = grid.Place(j, (*present)[i]);
      if (place) step = static_cast<int>(std::lround(*place)) % joint.steps;
    }
    if (i < choice.at.size() && choice.at[i]) step = std::min(*choice.at[i], joint.steps - 1);
  }
  return slice;
}

json StepsJson(const Slice& slice, int joints) {
  return std::vector<int>(slice.at.begin(), slice.at.begin() + joints);
}

// The configurations of a slice, row by row.
std::vector<ConfigurationNumber> NumbersOf(const Slice& slice, const ConfigurationGrid& grid) {
  const auto x = static_cast<size_t>(slice.x);
  const auto y = static_cast<size_t>(slice.y);
  const int rows = x == y ? 1 : grid.joints()[y].steps;
  std::vector<ConfigurationNumber> numbers;
  GridIndex index = slice.at;
  for (int row = 0; row < rows; ++row) {
    if (x != y) index[y] = row;
    for (int column = 0; column < grid.joints()[x].steps; ++column) {
      index[x] = column;
      numbers.push_back(grid.NumberOf(index));
    }
  }
  return numbers;
}

char LetterOf(State state) {
  switch (state) {
    case State::kFree:
      return 'f';
    case State::kOccupied:
      return 'o';
    case State::kUnknown:
      break;
  }
  return 'u';
}

// How many configurations of the whole space are free, occupied, unknown; null if that has not been
// worked out.
json CountsJson(const ConfigurationSpace& space, uint64_t configurations) {
  uint64_t free = 0;
  uint64_t occupied = 0;
  for (uint64_t tile = 0; tile < space.tiles(); ++tile) {
    if (!space.ready(tile)) return nullptr;
    const TileVerdicts& verdicts = space.tile(tile);
    for (const uint64_t word : verdicts.free) free += static_cast<uint64_t>(std::popcount(word));
    for (const uint64_t word : verdicts.occupied) {
      occupied += static_cast<uint64_t>(std::popcount(word));
    }
  }
  return {{"free", free}, {"occupied", occupied}, {"unknown", configurations - free - occupied}};
}

// Whether counts are ever worked out: where the map would be drawn for them, only those of a slice
// that has all tiles are.
bool IsCounted(const ServedDatabase& database, const Slice& slice) {
  if (!DrawsMaps(database)) return true;
  const ConfigurationGrid& grid = database.grid();
  bool all_tiles = grid.tiles() <= kMaxDrawnTiles;
  for (int j = 0; j < grid.dimensions(); ++j) {
    const auto i = static_cast<size_t>(j);
    if (j != slice.x && j != slice.y && grid.joints()[i].steps > grid.tile_edges()[i]) {
      all_tiles = false;
    }
  }
  return all_tiles;
}

// The slice and the counts. Where nothing is known: no cells, no counts, and why.
json SpaceJson(Serving& serving, const Checker& checker, const SliceChoice& choice,
               const std::optional<Configuration>& present) {
  const Served& served = checker.served();
  const ConfigurationGrid& grid = served.database->grid();
  const Slice slice = SliceOf(choice, grid, present);
  json shown = {
      {"x", slice.x},     {"y", slice.y},      {"at", StepsJson(slice, grid.dimensions())},
      {"cells", nullptr}, {"counts", nullptr}, {"counted", IsCounted(*served.database, slice)},
      {"missing", ""}};
  const auto without = [&](const std::string& why) {
    shown["missing"] = why;
    return shown;
  };
  if (checker.blocked() != Reason::kNone) return without("unknown: " + NameOf(checker.blocked()));
  const auto steps = [&](int joint) {
    return static_cast<uint64_t>(grid.joints()[static_cast<size_t>(joint)].steps);
  };
  if (steps(slice.x) * steps(slice.y) > kMostCells) {
    return without("this slice has too many configurations to be shown");
  }
  const std::vector<ConfigurationNumber> numbers = NumbersOf(slice, grid);
  std::set<uint64_t> of_slice;
  for (const ConfigurationNumber number : numbers) of_slice.insert(number / kTileSize);
  const bool draws = DrawsMaps(*served.database);
  if (draws && of_slice.size() > kMaxDrawnTiles) {
    return without("the map would be drawn for every scene; 'silhouette-capture draw' stores it");
  }
  const auto space = serving.spaces.Get(served, checker.policy());
  const auto end = std::chrono::steady_clock::now() + kMapTime;
  const Stop stop = [&] { return std::chrono::steady_clock::now() >= end; };
  const std::vector<uint64_t> first(of_slice.begin(), of_slice.end());
  bool in_time = space->WorkOut(first, stop);
  for (uint64_t tile = 0; in_time && !draws && tile < space->tiles(); ++tile) {
    in_time = space->WorkOut({&tile, 1}, stop);
  }
  std::string cells;
  for (const ConfigurationNumber number : numbers) {
    cells += space->ready(number / kTileSize) ? LetterOf(space->state(number)) : 'u';
  }
  shown["cells"] = std::move(cells);
  shown["counts"] = CountsJson(*space, grid.size());
  return shown;
}

// Why the path is blocked at `q`: in each view the pixels that show an obstacle inside the robot,
// as Explain returns them.
json WhyJson(const Checker& checker, std::span<const double> q) {
  if (checker.served().scene == nullptr) return nullptr;
  json views = json::object();
  const std::optional<std::vector<Mask>> robot = checker.TestRobotImages(q);
  const CollisionImages collision = checker.CollisionImagesAt(q);
  const ServedDatabase& database = *checker.served().database;
  for (size_t view = 0; view < collision.size(); ++view) {
    json& shown = views[database.view_name(static_cast<int>(view))];
    shown = {{"robot", nullptr}, {"convicts", MaskJson(collision[view])}};
    if (robot) shown["robot"] = MaskJson((*robot)[view]);
  }
  return views;
}

json WaypointsJson(const v1::CheckPathRequest& request) {
  json waypoints = json::array();
  const auto count = static_cast<size_t>(request.waypoints_size());
  const size_t stride = count / kMostWaypoints + 1;
  for (size_t i = 0; i < count; i += stride) {
    if (i + stride >= count) i = count - 1;
    const auto& positions = request.waypoints(static_cast<int>(i)).positions();
    waypoints.push_back(std::vector<double>(positions.begin(), positions.end()));
  }
  return waypoints;
}

// What `told` says by now.
State StateOf(const WatchedPath::Told* told, const Moment& now) {
  if (told == nullptr) return State::kUnknown;
  const v1::CheckPathResponse& check = told->response.check();
  if (told->at + DurationFrom(check.basis().valid_for()) <= now.running) return State::kUnknown;
  switch (check.verdict().state()) {
    case v1::Verdict::STATE_FREE:
      return State::kFree;
    case v1::Verdict::STATE_OCCUPIED:
      return State::kOccupied;
    default:
      return State::kUnknown;
  }
}

// Of what is shown, for the variant and the policy that a client asks with.
absl::StatusOr<Checker> CheckerOf(const v1::CheckPathRequest& request, const Served& served,
                                  const Serving& serving) {
  ASSIGN_OR_RETURN(Served asked, WithVariant(served, request.variant()));
  ASSIGN_OR_RETURN(const Policy policy, PolicyFor(serving, request.policy(), *asked.database));
  return Checker(std::move(asked), policy, serving.settings.scene, serving.settings.clock());
}

// What a watched path's client was told, and whether that still holds. Why it is blocked is worked
// out by CheckerOf; null if that cannot be.
json PathJson(const WatchedPath& path, const WatchedPath::Told* told, State state,
              const Served& served, const Serving& serving) {
  json shown = {{"client", path.client},
                {"waypoints", WaypointsJson(path.request)},
                {"waypoint_count", path.request.waypoints_size()},
                {"check", nullptr},
                {"state", NameOf(state)},
                {"valid_until", 0},  // s, by the server's running clock
                {"why", nullptr}};
  if (told == nullptr) return shown;
  const v1::CheckPathResponse& check = told->response.check();
  shown["check"] = JsonOf(check);
  shown["valid_until"] = absl::ToDoubleSeconds(told->at + DurationFrom(check.basis().valid_for()));
  if (state != State::kOccupied) return shown;
  const absl::StatusOr<Checker> checker = CheckerOf(path.request, served, serving);
  const auto& q = check.configuration().positions();
  if (checker.ok() && q.size() == checker->served().database->grid().dimensions()) {
    shown["why"] = WhyJson(*checker, {q.data(), static_cast<size_t>(q.size())});
  }
  return shown;
}

// The first kMostPaths, blocked ones before unknown and free ones.
json PathsJson(const std::vector<std::shared_ptr<const WatchedPath>>& paths, const Served& served,
               const Serving& serving) {
  const Moment now = serving.settings.clock();
  json shown = json::array();
  std::vector<std::pair<std::shared_ptr<const WatchedPath::Told>, State>> told;
  for (const auto& path : paths) {
    std::shared_ptr<const WatchedPath::Told> newest = path->told();
    const State state = StateOf(newest.get(), now);
    told.emplace_back(std::move(newest), state);
  }
  for (const State state : {State::kOccupied, State::kUnknown, State::kFree}) {
    for (size_t i = 0; i < paths.size() && shown.size() < kMostPaths; ++i) {
      if (told[i].second != state) continue;
      shown.push_back(PathJson(*paths[i], told[i].first.get(), state, served, serving));
    }
  }
  return shown;
}

// The allowed regions in force: how long from `now` on, and how many pixels of each view.
json RegionsJson(const Served& served, const Moment& now) {
  json regions = json::array();
  for (const AllowedRegion& region : served.regions->regions) {
    json pixels = json::object();
    for (int view = 0; view < served.database->views(); ++view) {
      const std::optional<Mask>& mask = region.pixels[static_cast<size_t>(view)];
      if (mask && !mask->Empty()) pixels[served.database->view_name(view)] = mask->Count();
    }
    regions.push_back({{"name", region.name},
                       {"remaining", absl::ToDoubleSeconds(region.end - now.running)},
                       {"pixels", std::move(pixels)}});
  }
  return regions;
}

// By joint of the grid: "rad", "m", or "" if it is not known which of them.
json UnitsJson(const Serving& serving, const ConfigurationGrid& grid) {
  json units = json::array();
  for (const GridJoint& joint : grid.joints()) {
    const std::optional<bool> slides = Slides(serving.settings, joint);
    units.push_back(!slides ? "" : *slides ? "m" : "rad");
  }
  return units;
}

json LatencyJson(const LatencyFigures& figures) {
  return {{"count", figures.count}, {"within", figures.within}};
}

// How the server's own acquisition goes; null: it has none.
void AddAcquisition(const Serving& serving, json& shown) {
  shown["acquisition"] = nullptr;
  shown["latency"] = nullptr;
  if (serving.settings.live == nullptr) return;
  const LiveStatus status = serving.settings.live->Status();
  v1::Acquisition acquisition;
  ToMessage(status, &acquisition);
  ToMessage(serving.settings.live->known_variant(), serving.scenes.database()->variants(),
            acquisition.mutable_robot_variant());
  shown["acquisition"] = JsonOf(acquisition);
  shown["latency"] = {{"bounds", LatencyRecord::kBounds},
                      {"to_scene", LatencyJson(status.to_scene)},
                      {"to_map", LatencyJson(status.to_map)}};
}

json PresentJson(const Checker& checker, const std::optional<Configuration>& present,
                 Reason blocked) {
  if (!present) return nullptr;
  const State state = Final(checker.Check(*present), blocked).state();
  return {{"configuration", *present}, {"state", NameOf(state)}};
}

json SnapshotJson(Serving& serving, const SliceChoice& choice) {
  json shown;
  const absl::StatusOr<Checker> checker = CheckerFor(serving, {}, "");
  if (!checker.ok()) return {{"error", std::string(checker.status().message())}};
  const Served& served = checker->served();
  v1::GetDatabaseResponse database;
  ToMessage(*served.database, serving.settings, &database);
  shown["database"] = JsonOf(database);
  shown["units"] = UnitsJson(serving, served.database->grid());
  shown["max_age"] = absl::ToDoubleSeconds(serving.settings.scene.max_age);
  const std::optional<Configuration> present = PresentConfiguration(served);
  shown["views"] = ViewsJson(serving, *checker, present);
  shown["space"] = SpaceJson(serving, *checker, choice, present);
  AddAcquisition(serving, shown);
  const auto paths = serving.watched_paths.All();
  shown["path_count"] = paths.size();
  shown["paths"] = PathsJson(paths, served, serving);
  // Last: what cannot be rested on by now is unknown.
  v1::Basis basis;
  const Reason blocked = Conclude(serving, served, checker->policy(), &basis);
  const Moment now = serving.settings.clock();
  shown["clock"] = absl::ToDoubleSeconds(now.running);
  shown["time"] = absl::ToUnixMillis(now.time);
  shown["basis"] = JsonOf(basis);
  shown["regions"] = RegionsJson(served, now);
  shown["blocked"] = blocked == Reason::kNone ? "" : NameOf(blocked);
  const absl::Duration end = DurationFrom(basis.server_clock()) + DurationFrom(basis.valid_for());
  shown["valid_for"] = std::clamp(absl::ToDoubleSeconds(end - now.running), 0.0, 1e9);
  shown["scene"] = nullptr;
  if (served.scene != nullptr) {
    v1::Scene scene;
    ToMessage(*served.scene, /*include_planes=*/true,
              DefectsOf(*served.scene, serving.settings, now), &scene);
    shown["scene"] = JsonOf(scene);
  }
  shown["present"] = PresentJson(*checker, present, blocked);
  if (blocked != Reason::kNone) {
    shown["space"]["cells"] = nullptr;
    shown["space"]["counts"] = nullptr;
    shown["space"]["missing"] = "unknown: " + NameOf(blocked);
    for (json& path : shown["paths"]) path["state"] = NameOf(State::kUnknown);
  }
  return shown;
}

absl::Status NotASlice() {
  return absl::InvalidArgumentError("x and y are joints, 0 to 6, and at is a list like 3,,7");
}

}  // namespace

absl::StatusOr<SliceChoice> SliceChoiceFrom(const std::string& x, const std::string& y,
                                            const std::string& at) {
  SliceChoice choice;
  for (const auto& [text, joint] : {std::pair(&x, &choice.x), {&y, &choice.y}}) {
    if (text->empty()) continue;
    if (!absl::SimpleAtoi(*text, joint) || *joint < 0 || *joint >= kMaxJoints) return NotASlice();
  }
  if (at.empty()) return choice;
  for (const absl::string_view text : absl::StrSplit(at, ',')) {
    std::optional<int>& step = choice.at.emplace_back();
    if (text.empty()) continue;
    int value = 0;
    if (!absl::SimpleAtoi(text, &value) || value < 0) return NotASlice();
    step = value;
  }
  if (choice.at.size() > kMaxJoints) return NotASlice();
  return choice;
}

json PageSnapshot(Serving& serving, const SliceChoice& choice) {
  try {
    return SnapshotJson(serving, choice);
  } catch (const std::exception& error) {
    return {{"error", absl::StrCat("internal error: ", error.what())}};
  }
}

}  // namespace silhouette
