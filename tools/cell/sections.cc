// SPDX-License-Identifier: Apache-2.0
#include "tools/cell/sections.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace silhouette {
namespace {

double Positive(const YamlNode& node, double value) {
  if (!(value > 0)) node.Fail("a number greater than 0 is expected");
  return value;
}

double NotNegative(const YamlNode& node, double value) {
  if (!(value >= 0)) node.Fail("a number not below 0 is expected");
  return value;
}

absl::Duration Time(YamlMap& map, const std::string& key, absl::Duration default_value) {
  const auto node = map.Optional(key);
  return node ? absl::Seconds(node->AsSeconds()) : default_value;
}

int AtLeast(YamlMap& map, const std::string& key, int default_value, int least) {
  const auto node = map.Optional(key);
  if (!node) return default_value;
  const int value = node->As<int>();
  if (value < least) node->Fail("at least " + std::to_string(least) + " is expected");
  return value;
}

// Permissions as chmod has them.
ForbiddenRegion ReadForbiddenRegion(const YamlNode& node, const ConfigurationGrid& grid) {
  YamlMap map(node);
  ForbiddenRegion region;
  region.name = map.Get<std::string>("name");
  YamlMap joints(map.Required("joints"));
  map.Finish();
  for (const std::string& name : joints.Keys()) {
    const YamlNode value = joints.Required(name);
    const auto known = grid.joints();
    if (std::none_of(known.begin(), known.end(),
                     [&](const GridJoint& joint) { return joint.name == name; })) {
      value.Fail("'" + name + "' is not a joint of the grid");
    }
    const std::vector<YamlNode> bounds = value.Items(2);
    const ForbiddenRegion::Range range{name, bounds[0].AsAngle(), bounds[1].AsAngle()};
    if (range.lower > range.upper) value.Fail("the first bound must not exceed the second");
    region.ranges.push_back(range);
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

// Whether the word is the first of the two that it may be.
bool OneOf(const YamlNode& node, const std::string& first, const std::string& second) {
  const std::string word = node.As<std::string>();
  if (word != first && word != second) {
    node.Fail("'" + first + "' or '" + second + "' is expected");
  }
  return word == first;
}

// `live`: what the keys that are not stated are.
LiveSettings ReadLive(const YamlNode& node, LiveSettings live) {
  YamlMap map(node);
  live.variant = map.Get<std::string>("variant", live.variant);
  live.interval = Time(map, "interval", live.interval);
  const auto positive_time = [&](const std::string& key, absl::Duration& time) {
    const auto value = map.Optional(key);
    if (value) time = absl::Seconds(Positive(*value, value->AsSeconds()));
  };
  positive_time("joints_interval", live.joints_interval);
  positive_time("joints_gap", live.joints_gap);
  positive_time("reopen_after", live.reopen_after);
  map.Finish();
  return live;
}

RawImages ReadRawImages(const YamlNode& node) {
  const std::string word = node.As<std::string>();
  if (word == "none") return RawImages::kNone;
  if (word == "sentinels") return RawImages::kSentinels;
  if (word != "all") node.Fail("'none', 'sentinels' or 'all' is expected");
  return RawImages::kAll;
}

// "1 px"
double ReadPixels(const YamlNode& node) {
  const std::string text = node.As<std::string>();
  size_t end = 0;
  double pixels = 0;
  try {
    pixels = std::stod(text, &end);
  } catch (const std::exception&) {
    node.Fail("a number of pixels is expected, as in '1 px'");
  }
  const std::string unit = text.substr(std::min(text.find_first_not_of(' ', end), text.size()));
  if (unit != "px") node.Fail("a number of pixels is expected, as in '1 px'");
  return Positive(node, pixels);
}

SentinelSettings ReadSentinels(const YamlNode& node) {
  YamlMap map(node);
  SentinelSettings sentinels;
  sentinels.count = AtLeast(map, "count", sentinels.count, 0);
  sentinels.every = Time(map, "every", sentinels.every);
  if (const auto shift = map.Optional("most_shift")) sentinels.most_shift = ReadPixels(*shift);
  map.Finish();
  return sentinels;
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
  return workspace;
}

CaptureSettings ReadCapture(const YamlNode& node, const ConfigurationGrid& grid) {
  YamlMap map(node);
  CaptureSettings capture;
  capture.settle = Time(map, "settle", capture.settle);
  capture.settle_timeout = Time(map, "settle_timeout", capture.settle_timeout);
  capture.still_images = AtLeast(map, "still_images", capture.still_images, 1);
  capture.commit_interval = Time(map, "commit_interval", capture.commit_interval);
  if (capture.commit_interval > absl::Seconds(2)) {
    map.Required("commit_interval").Fail("at most 2 s, so that little work is at risk");
  }
  if (const auto tolerance = map.Optional("joint_tolerance")) {
    capture.joint_tolerance = Positive(*tolerance, tolerance->AsAngle());
  }
  if (const auto speed = map.Optional("joint_speed")) {
    capture.joint_speed = Positive(*speed, speed->AsAngle());
  }
  if (const auto timeout = map.Optional("arrival_timeout")) {
    capture.arrival_timeout = absl::Seconds(Positive(*timeout, timeout->AsSeconds()));
  }
  capture.reference_images = AtLeast(map, "reference_images", capture.reference_images, 2);
  if (const auto regions = map.Optional("forbidden_regions")) {
    for (const YamlNode& region : regions->Items()) {
      capture.forbidden_regions.push_back(ReadForbiddenRegion(region, grid));
    }
  }
  if (const auto raw_images = map.Optional("raw_images")) {
    capture.raw_images = ReadRawImages(*raw_images);
  }
  if (const auto sentinels = map.Optional("sentinels")) {
    capture.sentinels = ReadSentinels(*sentinels);
  }
  capture.retry = Time(map, "retry", capture.retry);
  capture.continue_after_reconnect =
      map.Get<bool>("continue_after_reconnect", capture.continue_after_reconnect);
  if (const auto keep_free = map.Optional("keep_free")) capture.keep_free = keep_free->AsBytes();
  map.Finish();
  return capture;
}

SegmentationSettings ReadSegmentation(const YamlNode& node, const SegmentationSettings& usual) {
  YamlMap map(node);
  SegmentationSettings settings = usual;
  const auto number = [&](const std::string& key, double default_value) {
    const auto value = map.Optional(key);
    return value ? NotNegative(*value, value->As<double>()) : default_value;
  };
  settings.noise_factor = number("noise_factor", settings.noise_factor);
  settings.min_difference = number("min_difference", settings.min_difference);
  settings.faint_difference = number("faint_difference", settings.faint_difference);
  settings.texture_difference = number("texture_difference", settings.texture_difference);
  settings.faint_side = AtLeast(map, "faint_side", settings.faint_side, 3);
  if (settings.faint_side > SegmentationSettings::kMostFaintSide || settings.faint_side % 2 == 0) {
    map.Required("faint_side").Fail("an odd number from 3 to 15 is expected");
  }
  settings.follow_brightness = map.Get<bool>("follow_brightness", settings.follow_brightness);
  settings.clean_up_radius = AtLeast(map, "clean_up_radius", settings.clean_up_radius, 0);
  settings.min_blob_pixels = AtLeast(map, "min_blob_pixels", settings.min_blob_pixels, 0);
  settings.min_cover = number("min_cover", settings.min_cover);
  if (settings.min_cover >= 1) map.Required("min_cover").Fail("a share below 1 is expected");
  if (const auto shadows = map.Optional("shadows")) {
    const auto value = shadows->As<std::string>();
    if (value != "foreground" && value != "ignore") {
      shadows->Fail("'foreground' or 'ignore' is expected");
    }
    settings.shadows = value == "ignore" ? Shadows::kIgnore : Shadows::kForeground;
  }
  map.Finish();
  return settings;
}

PolicySettings ReadPolicy(const YamlNode& node, int views) {
  YamlMap map(node);
  Policy policy;
  const auto preset = map.Optional("preset");
  if (preset) policy.preset = ReadPreset(*preset);
  if (const auto min_views = map.Optional("min_views")) policy.min_views = min_views->As<int>();
  policy.max_occluded_views = map.Get<int>("max_occluded_views", policy.max_occluded_views);
  if (const auto off_grid = map.Optional("off_grid")) {
    policy.off_grid = OneOf(*off_grid, "cell", "nearest") ? OffGrid::kCell : OffGrid::kNearest;
  }
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
  if (const auto margin = map.Optional("margin")) {
    settings.margin = NotNegative(*margin, margin->As<double>());
  }
  map.Finish();
  return settings;
}

SoundSettings ReadSound(const YamlNode& node) {
  YamlMap map(node);
  SoundSettings settings;
  const YamlNode least = map.Required("least_obstacle");
  settings.least_obstacle = Positive(least, least.As<double>());
  if (const auto edge = map.Optional("voxel_edge")) {
    settings.voxel_edge = Positive(*edge, edge->As<double>());
    if (*settings.voxel_edge > settings.least_obstacle) {
      edge->Fail("it must not exceed least_obstacle, or no obstacle is told from the robot");
    }
  }
  if (const auto tolerance = map.Optional("model_tolerance")) {
    settings.model_tolerance = NotNegative(*tolerance, tolerance->As<double>());
  }
  settings.whole_model = map.Get<bool>("whole_model", settings.whole_model);
  map.Finish();
  return settings;
}

ServerSettings ReadServer(const YamlNode& node, const std::filesystem::path& folder) {
  YamlMap map(node);
  ServerSettings server;
  server.listen = map.Get<std::string>("listen", server.listen);
  server.scene.max_age = Time(map, "max_age", server.scene.max_age);
  server.scene.max_skew = Time(map, "max_skew", server.scene.max_skew);
  server.map_time = Time(map, "map_time", server.map_time);
  if (const auto share = map.Optional("max_core_error")) {
    server.scene.max_core_error = NotNegative(*share, share->As<double>());
    if (server.scene.max_core_error > 1) share->Fail("a share of 0 to 1 is expected");
  }
  if (const auto tolerance = map.Optional("fixed_joint_tolerance")) {
    server.scene.fixed_joint_tolerance = Positive(*tolerance, tolerance->AsAngle());
  }
  if (const auto memory = map.Optional("robot_image_memory")) {
    server.robot_image_memory = memory->AsBytes();
  }
  server.variants_in_memory = map.Get<bool>("variants_in_memory", server.variants_in_memory);
  if (const auto checked = map.Optional("calibration_check")) {
    YamlMap check(*checked);
    server.calibration_check = ResolvePath(folder, check.Get<std::string>("file"));
    if (const auto age = check.Optional("max_age")) {
      server.calibration_check_max_age = absl::Seconds(Positive(*age, age->AsSeconds()));
    }
    check.Finish();
  }
  if (const auto movement = map.Optional("max_joint_movement")) {
    server.live.max_joint_movement = Positive(*movement, movement->AsAngle());
  }
  if (const auto live = map.Optional("live")) server.live = ReadLive(*live, server.live);
  server.metrics = map.Get<std::string>("metrics", server.metrics);
  map.Finish();
  return server;
}

}  // namespace silhouette
