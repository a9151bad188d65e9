// SPDX-License-Identifier: Apache-2.0
#include "tools/cell/sections.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <stdexcept>

namespace silhouette {
namespace {

double PositiveAngle(const YamlNode& node) {
  const double angle = node.AsAngle();
  if (!(angle > 0)) node.Fail("a number greater than 0 is expected");
  return angle;
}

// How far a joint may be from where the images show it. More is likely to be in degrees.
double JointTolerance(const YamlNode& node) {
  constexpr double kMost = 0.2;
  const double tolerance = PositiveAngle(node);
  if (tolerance > kMost) node.Fail("at most 0.2 rad is expected; write degrees as '1 deg'");
  return tolerance;
}

// Of the fastest joint per second. More is likely to be in degrees.
double JointSpeed(const YamlNode& node) {
  constexpr double kMost = 6.3;
  const double speed = PositiveAngle(node);
  if (speed > kMost) {
    node.Fail("at most 6.3 rad (of slides, m) a second are expected; write degrees as '30 deg'");
  }
  return speed;
}

// A radius; only a slip of the unit is beyond the limit.
double LeastObstacle(const YamlNode& node) {
  return node.AsPositiveLengthUpTo(
      1, "people are 0.3 to 0.5 m thick, and what is smaller than stated is not found");
}

double VoxelEdge(const YamlNode& node) {
  return node.AsPositiveLengthUpTo(1, "voxels are smaller than people");
}

// Of a view's pixels. The robot covers hardly more of a view: with more, nothing would be noticed.
double CoreError(const YamlNode& node) {
  constexpr double kMost = 0.05;
  const double share = node.AsShare();
  if (share > kMost) {
    node.Fail(
        "at most 0.05 is expected, a share of all of the view's pixels: with more, a robot "
        "that is not where it reports would not be noticed");
  }
  return share;
}

// With less, a pass over the index of a large cell takes longer than a shift.
constexpr uint64_t kLeastIndexCheckRate = 1'000'000;

int AtLeast(YamlMap& map, const std::string& key, int default_value, int least) {
  const auto node = map.Optional(key);
  if (!node) return default_value;
  const int value = node->As<int>();
  if (value < least) node->Fail("at least " + std::to_string(least) + " is expected");
  return value;
}

// m/s; more is likely to be in mm/s.
double Speed(const YamlNode& node) {
  constexpr double kMost = 20;
  const double speed = node.AsPositive();
  if (speed > kMost) node.Fail("at most 20 m/s is expected; 250 mm/s is 0.25");
  return speed;
}

SpeedLevel ReadSpeedLevel(const YamlNode& node) {
  constexpr absl::Duration kMostToStop = absl::Seconds(10);
  YamlMap map(node);
  SpeedLevel level;
  level.name = map.Required("name").As<std::string>();
  level.speed = Speed(map.Required("speed"));
  const YamlNode time = map.Required("stopping_time");
  if (time.AsTime() > kMostToStop) {
    time.Fail("at most 10 s is expected; milliseconds are written as '150 ms'");
  }
  level.stopping_time = time.AsSeconds();
  level.stopping_distance =
      map.Required("stopping_distance").AsLengthUpTo(10, "no robot needs longer to stop");
  map.Finish();
  return level;
}

// Of the grid's joint `name`. Fails if the joint is never within.
ForbiddenRegion::Range ReadForbiddenRange(const YamlNode& node, const std::string& name,
                                          const ConfigurationGrid& grid, const RobotModel* model) {
  const auto known = grid.joints();
  const auto joint = std::ranges::find(known, name, &GridJoint::name);
  if (joint == known.end()) node.Fail("'" + name + "' is not a joint of the grid");
  const auto index = model != nullptr ? model->JointIndex(name) : std::nullopt;
  const RobotJoint* in_model = index ? &model->joints()[*index] : nullptr;
  const std::vector<YamlNode> bounds = node.Items(2);
  const ForbiddenRegion::Range range{name, JointValue(bounds[0], in_model),
                                     JointValue(bounds[1], in_model)};
  if (range.lower > range.upper) node.Fail("the first bound must not exceed the second");
  if (joint->continuous) return range;
  const double lower = in_model != nullptr ? in_model->lower : joint->lower;
  const double upper = in_model != nullptr ? in_model->upper : joint->upper;
  if (range.lower > upper || range.upper < lower) {
    node.Fail(absl::StrCat("the region protects nothing: '", name, "' goes from ", lower, " to ",
                           upper, " and is never within; are these degrees, as in '90 deg'?"));
  }
  return range;
}

ForbiddenRegion ReadForbiddenRegion(const YamlNode& node, const ConfigurationGrid& grid,
                                    const RobotModel* model) {
  YamlMap map(node);
  ForbiddenRegion region;
  region.name = map.Get<std::string>("name");
  YamlMap joints(map.Required("joints"));
  map.Finish();
  for (const std::string& name : joints.Keys()) {
    region.ranges.push_back(ReadForbiddenRange(joints.Required(name), name, grid, model));
  }
  if (region.ranges.empty()) node.Fail("a forbidden region bounds at least one joint");
  return region;
}

Preset ReadPreset(const YamlNode& node) {
  const std::optional<Preset> preset = PresetFromName(node.As<std::string>());
  if (preset) return *preset;
  std::vector<std::string> names;
  for (const Preset known : AllPresets()) names.push_back(NameOf(known));
  node.Fail("the presets are " + ListOfWords(names));
}

// "1 px"
double ReadPixels(const YamlNode& node) {
  const LengthText length = ReadLength(node);
  if (!(length.number > 0) || length.unit != "px") {
    node.Fail("a number of pixels is expected, as in '1 px'");
  }
  return length.number;
}

// `check`: what the keys that are not stated are.
ViewCheckSettings ReadViewCheck(const YamlNode& node, ViewCheckSettings check) {
  YamlMap map(node);
  map.Read("least_gain", check.least_gain, &YamlNode::AsNotNegative);
  map.Read("greatest_gain", check.greatest_gain, &YamlNode::AsPositive);
  map.Read("most_saturated", check.most_saturated, &YamlNode::AsShare);
  map.Read("least_structure", check.least_structure, &YamlNode::AsShare);
  map.Read("most_shift", check.most_shift, ReadPixels);
  map.Read("most_foreground", check.most_foreground, &YamlNode::AsShare);
  map.Read("most_robot_missing", check.most_robot_missing, &YamlNode::AsShare);
  map.Finish();
  return check;
}

// Less would not hold the images of a scene.
constexpr uint64_t kLeastRequestMemory = 256'000'000;

ClientLimits ReadLimits(const YamlNode& node) {
  YamlMap map(node);
  ClientLimits limits;
  const auto read = [&map](const char* key, int& limit) {
    limit = AtLeast(map, key, limit, 1);
    if (limit > 1'000'000) map.Required(key).Fail("at most 1000000 is expected");
  };
  read("connections", limits.connections);
  read("connections_per_client", limits.connections_per_client);
  read("streams", limits.streams);
  read("streams_per_client", limits.streams_per_client);
  map.Read("calls_per_second", limits.calls_per_second, &YamlNode::AsPositive);
  read("waiting", limits.waiting);
  read("waiting_per_client", limits.waiting_per_client);
  map.Read("request_memory", limits.request_memory, &YamlNode::AsBytes);
  if (limits.request_memory < kLeastRequestMemory) {
    map.Required("request_memory").Fail("at least 256 MB is expected");
  }
  map.Finish();
  return limits;
}

// `live`: what the keys that are not stated are.
LiveSettings ReadLive(const YamlNode& node, LiveSettings live) {
  YamlMap map(node);
  live.variant = map.Get<std::string>("variant", live.variant);
  map.Read("interval", live.interval, &YamlNode::AsTime);
  map.Read("joints_interval", live.joints_interval, &YamlNode::AsPositiveTime);
  map.Read("joints_gap", live.joints_gap, &YamlNode::AsPositiveTime);
  map.Read("reopen_after", live.reopen_after, &YamlNode::AsPositiveTime);
  map.Read("least_noise", live.life.least_noise, &YamlNode::AsShare);
  map.Read("least_change", live.life.least_change, &YamlNode::AsShare);
  map.Finish();
  return live;
}

RawImages ReadRawImages(const YamlNode& node) {
  constexpr RawImages kChoices[] = {RawImages::kNone, RawImages::kSentinels, RawImages::kAll};
  return kChoices[node.AsWordOf({"none", "sentinels", "all"})];
}

SentinelSettings ReadSentinels(const YamlNode& node) {
  YamlMap map(node);
  SentinelSettings sentinels;
  sentinels.count = AtLeast(map, "count", sentinels.count, 0);
  map.Read("every", sentinels.every, &YamlNode::AsTime);
  map.Read("most_shift", sentinels.most_shift, ReadPixels);
  map.Finish();
  return sentinels;
}

FirstLookSettings ReadFirstLook(const YamlNode& node) {
  YamlMap map(node);
  FirstLookSettings look;
  constexpr int kMost = 10;
  look.configurations = AtLeast(map, "configurations", look.configurations, 0);
  if (look.configurations > kMost) {
    map.Required("configurations")
        .Fail("at most 10 is expected: a session that ends before it has seen them stores none");
  }
  map.Read("least_area", look.least_area, &YamlNode::AsShare);
  map.Read("least_overlap", look.least_overlap, &YamlNode::AsShare);
  look.may_be_cut = map.Get<bool>("may_be_cut", look.may_be_cut);
  map.Finish();
  return look;
}

}  // namespace

Workspace ReadWorkspace(const YamlNode& node) {
  YamlMap map(node);
  const auto corner = [](const YamlNode& at) {
    const std::vector<double> values = at.Values<double>(3);
    return Eigen::Vector3d(values[0], values[1], values[2]);
  };
  const YamlNode upper = map.Required("upper");
  const Workspace workspace(corner(map.Required("lower")), corner(upper));
  map.Finish();
  if (!(workspace.sizes().minCoeff() > 0)) upper.Fail("it must lie above 'lower' in x, y and z");
  constexpr double kLongest = 100;
  if (workspace.sizes().maxCoeff() > kLongest) {
    upper.Fail("it is more than 100 m from 'lower'; both are in metres");
  }
  return workspace;
}

CaptureSettings ReadCapture(const YamlNode& node, const ConfigurationGrid& grid,
                            const RobotModel* model) {
  YamlMap map(node);
  CaptureSettings capture;
  map.Read("settle", capture.settle, &YamlNode::AsTime);
  map.Read("settle_timeout", capture.settle_timeout, &YamlNode::AsTime);
  capture.still_images = AtLeast(map, "still_images", capture.still_images, 1);
  map.Read("commit_interval", capture.commit_interval, &YamlNode::AsTime);
  if (capture.commit_interval > absl::Seconds(2)) {
    map.Required("commit_interval").Fail("at most 2 s, so that little work is at risk");
  }
  map.Read("joint_tolerance", capture.joint_tolerance, JointTolerance);
  map.Read("joint_speed", capture.joint_speed, JointSpeed);
  map.Read("arrival_timeout", capture.arrival_timeout, &YamlNode::AsPositiveTime);
  capture.reference_images = AtLeast(map, "reference_images", capture.reference_images, 2);
  if (const auto regions = map.Optional("forbidden_regions")) {
    for (const YamlNode& region : regions->Items()) {
      capture.forbidden_regions.push_back(ReadForbiddenRegion(region, grid, model));
    }
  }
  map.Read("raw_images", capture.raw_images, ReadRawImages);
  map.Read("sentinels", capture.sentinels, ReadSentinels);
  map.Read("first_look", capture.first_look, ReadFirstLook);
  map.Read("retry", capture.retry, &YamlNode::AsTime);
  capture.continue_after_reconnect =
      map.Get<bool>("continue_after_reconnect", capture.continue_after_reconnect);
  map.Read("keep_free", capture.keep_free, &YamlNode::AsBytes);
  map.Finish();
  return capture;
}

ComparisonSettings ReadVerification(const YamlNode& node) {
  YamlMap map(node);
  ComparisonSettings settings;
  map.Read("growth_step", settings.growth_step, &YamlNode::AsLength);
  map.Read("most_growth", settings.most_growth, &YamlNode::AsLength);
  settings.most_noise_pixels = static_cast<size_t>(
      AtLeast(map, "most_noise_pixels", static_cast<int>(settings.most_noise_pixels), 0));
  map.Read("most_noise", settings.most_noise, &YamlNode::AsShare);
  map.Read("most_uncaptured", settings.most_uncaptured, &YamlNode::AsShare);
  map.Read("most_uncaptured_of_link", settings.most_uncaptured_of_link, &YamlNode::AsShare);
  map.Read("most_shift", settings.most_shift, ReadPixels);
  map.Read("most_held_out", settings.most_held_out, &YamlNode::AsShare);
  map.Read("least_moved", settings.least_moved, &YamlNode::AsShare);
  settings.least_configurations = static_cast<size_t>(
      AtLeast(map, "least_configurations", static_cast<int>(settings.least_configurations), 2));
  map.Finish();
  try {
    GrowthSteps(settings);
  } catch (const std::invalid_argument& error) {
    node.Fail(error.what());
  }
  return settings;
}

SegmentationSettings ReadSegmentation(const YamlNode& node, const SegmentationSettings& usual) {
  YamlMap map(node);
  SegmentationSettings settings = usual;
  map.Read("noise_factor", settings.noise_factor, &YamlNode::AsNotNegative);
  map.Read("min_difference", settings.min_difference, &YamlNode::AsNotNegative);
  map.Read("faint_difference", settings.faint_difference, &YamlNode::AsNotNegative);
  map.Read("texture_difference", settings.texture_difference, &YamlNode::AsNotNegative);
  settings.faint_side = AtLeast(map, "faint_side", settings.faint_side, 3);
  if (settings.faint_side > SegmentationSettings::kMostFaintSide || settings.faint_side % 2 == 0) {
    map.Required("faint_side").Fail("an odd number from 3 to 15 is expected");
  }
  settings.follow_brightness = map.Get<bool>("follow_brightness", settings.follow_brightness);
  settings.clean_up_radius = AtLeast(map, "clean_up_radius", settings.clean_up_radius, 0);
  if (settings.clean_up_radius > SegmentationSettings::kMostCleanUpRadius) {
    map.Required("clean_up_radius")
        .Fail(absl::StrCat("at most ", SegmentationSettings::kMostCleanUpRadius,
                           " is expected: what is thinner than twice as many pixels is removed"));
  }
  settings.keep_thin_parts = map.Get<bool>("keep_thin_parts", settings.keep_thin_parts);
  settings.min_blob_pixels = AtLeast(map, "min_blob_pixels", settings.min_blob_pixels, 0);
  map.Read("min_cover", settings.min_cover, &YamlNode::AsNotNegative);
  if (settings.min_cover >= 1) map.Required("min_cover").Fail("a share below 1 is expected");
  map.Read("shadows", settings.shadows, [](const YamlNode& shadows) {
    return shadows.AsWordOf({"foreground", "ignore"}) == 0 ? Shadows::kForeground
                                                           : Shadows::kIgnore;
  });
  map.Finish();
  return settings;
}

PolicySettings ReadPolicy(const YamlNode& node, int views) {
  YamlMap map(node);
  Policy policy;
  const auto preset = map.Optional("preset");
  if (preset) policy.preset = ReadPreset(*preset);
  map.Read("min_views", policy.min_views, &YamlNode::As<int>);
  map.Read("max_occluded_views", policy.max_occluded_views, &YamlNode::As<int>);
  map.Read("off_grid", policy.off_grid, [](const YamlNode& off_grid) {
    return off_grid.AsWordOf({"cell", "nearest"}) == 0 ? OffGrid::kCell : OffGrid::kNearest;
  });
  map.Finish();
  try {
    MinViews(policy, views);
  } catch (const std::invalid_argument& error) {
    node.Fail(error.what());
  }
  return {policy, preset.has_value()};
}

CalibrationSettings ReadCalibration(const YamlNode& node) {
  YamlMap map(node);
  CalibrationSettings settings;
  map.Read("margin", settings.margin, &YamlNode::AsNotNegative);
  map.Finish();
  return settings;
}

BodyGeometry ReadGeometry(const YamlNode& node) {
  return node.AsWordOf({"visual", "collision"}) == 0 ? BodyGeometry::kVisual
                                                     : BodyGeometry::kCollision;
}

SoundSettings ReadSound(const YamlNode& node) {
  YamlMap map(node);
  SoundSettings settings;
  settings.least_obstacle = LeastObstacle(map.Required("least_obstacle"));
  if (const auto edge = map.Optional("voxel_edge")) {
    settings.voxel_edge = VoxelEdge(*edge);
    if (*settings.voxel_edge > settings.least_obstacle) {
      edge->Fail(
          "it must not exceed least_obstacle, or obstacles cannot be distinguished from the robot");
    }
  }
  map.Read("geometry", settings.geometry, ReadGeometry);
  map.Read("model_tolerance", settings.model_tolerance, [](const YamlNode& tolerance) {
    return tolerance.AsLengthUpTo(0.5, "no obstacle is expected so near to the model");
  });
  settings.whole_model = map.Get<bool>("whole_model", settings.whole_model);
  map.Finish();
  return settings;
}

SeparationCell ReadSeparation(const YamlNode& node) {
  YamlMap map(node);
  SeparationCell cell;
  SeparationSettings& settings = cell.settings;
  map.Read("human_speed", settings.human_speed, Speed);
  settings.near_human_speed = std::max(settings.near_human_speed, settings.human_speed);
  map.Read("near_human_speed", settings.near_human_speed, Speed);
  map.Read("reaction_time", settings.reaction_time,
           [](const YamlNode& time) { return absl::ToDoubleSeconds(time.AsTime()); });
  const auto few_metres = [](const YamlNode& length) {
    return length.AsLengthUpTo(2, "no distance could be kept");
  };
  map.Read("intrusion", settings.intrusion, few_metres);
  map.Read("uncertainty", settings.uncertainty, few_metres);
  for (const YamlNode& level : map.Required("levels").Items()) {
    settings.levels.push_back(ReadSpeedLevel(level));
  }
  if (const auto zone = map.Optional("zone")) cell.zone = ReadWorkspace(*zone);
  map.Read("voxel_edge", cell.voxel_edge, VoxelEdge);
  map.Read("unseen", cell.unseen_is_empty, [](const YamlNode& unseen) {
    return unseen.AsWordOf({"possible", "empty"}) == 1;
  });
  map.Finish();
  try {
    RequireValid(settings);
  } catch (const std::invalid_argument& error) {
    node.Fail(error.what());
  }
  return cell;
}

namespace {

TlsFiles ReadTlsFiles(const YamlNode& node, const std::filesystem::path& folder) {
  YamlMap map(node);
  TlsFiles files{.certificate = ResolvePath(folder, map.Get<std::string>("certificate")),
                 .key = ResolvePath(folder, map.Get<std::string>("key")),
                 .client_ca = ResolvePath(folder, map.Get<std::string>("client_ca"))};
  map.Finish();
  return files;
}

Roles ReadRoles(const YamlNode& node) {
  YamlMap map(node);
  std::map<Role, std::vector<std::string>> names;
  for (const Role role : kRoles) {
    map.Read(NameOf(role), names[role],
             [](const YamlNode& clients) { return clients.Values<std::string>(); });
  }
  map.Finish();
  try {
    return Roles(std::move(names));
  } catch (const std::invalid_argument& error) {
    node.Fail(error.what());
  }
}

// "0660"
mode_t ReadMode(const YamlNode& node) {
  const std::string text = node.As<std::string>();
  mode_t mode = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), mode, 8);
  if (error != std::errc() || end != text.data() + text.size() || mode > 0777) {
    node.Fail("a file mode in octal digits is expected, e.g. \"0660\"");
  }
  return mode;
}

}  // namespace

ServerSettings ReadServer(const YamlNode& node, const std::filesystem::path& folder) {
  YamlMap map(node);
  ServerSettings server;
  server.listen = map.Get<std::string>("listen", server.listen);
  map.Read("max_age", server.scene.max_age, &YamlNode::AsPositiveTime);
  server.scene.accept_arrival_times =
      map.Get<bool>("accept_arrival_times", server.scene.accept_arrival_times);
  map.Read("max_skew", server.scene.max_skew, &YamlNode::AsTime);
  map.Read("map_time", server.map_time, &YamlNode::AsTime);
  map.Read("max_core_error", server.scene.max_core_error, CoreError);
  if (const auto check = map.Optional("view_check")) {
    server.scene.view_check = ReadViewCheck(*check, server.scene.view_check);
  }
  map.Read("fixed_joint_tolerance", server.scene.fixed_joint_tolerance, JointTolerance);
  map.Read("weak_rim", server.scene.weak_rim, [](const YamlNode& weak_rim) {
    return weak_rim.AsWordOf({"unknown", "obstacle"}) == 0 ? WeakRim::kUnknown : WeakRim::kObstacle;
  });
  map.Read("robot_image_memory", server.robot_image_memory, &YamlNode::AsBytes);
  server.variants_in_memory = map.Get<bool>("variants_in_memory", server.variants_in_memory);
  if (const auto checked = map.Optional("index_check")) {
    YamlMap check(*checked);
    check.Read("rate", server.index_check.rate, &YamlNode::AsBytes);
    if (server.index_check.rate < kLeastIndexCheckRate) {
      check.Required("rate").Fail("at least 1 MB is expected");
    }
    server.index_check.samples = AtLeast(check, "samples", server.index_check.samples, 1);
    check.Finish();
  }
  map.Read("limits", server.limits, ReadLimits);
  if (const auto checked = map.Optional("calibration_check")) {
    YamlMap check(*checked);
    server.calibration_check = ResolvePath(folder, check.Get<std::string>("file"));
    check.Read("max_age", server.calibration_check_max_age, &YamlNode::AsPositiveTime);
    check.Finish();
  }
  map.Read("max_joint_movement", server.live.max_joint_movement, JointTolerance);
  if (const auto live = map.Optional("live")) server.live = ReadLive(*live, server.live);
  server.metrics = map.Get<std::string>("metrics", server.metrics);
  if (const auto tls = map.Optional("tls")) server.gate.tls = ReadTlsFiles(*tls, folder);
  map.Read("roles", server.gate.roles, ReadRoles);
  map.Read("socket_mode", server.gate.socket_mode, ReadMode);
  map.Read("socket_group", server.gate.socket_group, &YamlNode::As<std::string>);
  if (const auto audit = map.Optional("audit")) {
    server.audit = ResolvePath(folder, audit->As<std::string>());
  }
  map.Finish();
  return server;
}

}  // namespace silhouette
