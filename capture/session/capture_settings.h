// SPDX-License-Identifier: Apache-2.0
// The settings of a capture session.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "absl/time/time.h"

namespace silhouette {

// A box of joint values that the robot must never enter. A joint that is not named is not bounded.
struct ForbiddenRegion {
  struct Range {
    std::string joint;  // a joint of the grid
    double lower = 0;
    double upper = 0;
  };
  std::string name;
  std::vector<Range> ranges;
};

// Of which configurations the camera images are kept beside the masks.
enum class RawImages { kNone, kSentinels, kAll };

// Configurations that a session visits again and again, to see whether the cell is as it was.
struct SentinelSettings {
  int count = 3;  // 0: none
  absl::Duration every = absl::Minutes(10);
  // By how many camera pixels a view may seem to have moved.
  double most_shift = 1;
};

// What the first robot images of a database must be like, or the session ends at once.
struct FirstLookSettings {
  // How many of them are looked at; by default the sentinels, which are far apart. 0: none.
  int configurations = 3;
  // Share of a view's mask: less is no robot, and no person. A hand in a cell of 3 m is about twice
  // that; noise leaves far less.
  double least_area = 0.002;
  // Whether the border of an image may cut the robot.
  bool may_be_cut = false;
  // Where the model says where the robot is: the share of its drawn image that a view must show as
  // foreground. A robot in the wrong place, behind a post or of the background's colour shows less,
  // and its robot images would miss as much. 0: not looked at.
  double least_overlap = 0.75;
};

struct CaptureSettings {
  // How long to wait after the robot has arrived before the images are taken.
  absl::Duration settle = absl::Milliseconds(200);
  // How long it may take the robot to settle beyond that.
  absl::Duration settle_timeout = absl::Seconds(2);
  // How many sets of images one after the other must be alike; the robot image is the union of
  // their masks (RobotMasks() in visitor.h). 1: they are not compared.
  int still_images = 2;
  // Largest deviation between a commanded and a measured joint value: radians, metres.
  double joint_tolerance = 0.002;
  // Images of the empty cell that a reference is made from.
  int reference_images = 20;
  // Speed of the fastest joint on a way, radians or metres per second; the robot is commanded
  // at it, and a dry run calculates with it.
  double joint_speed = 0.5;
  // How much longer than twice its time a way may take.
  absl::Duration arrival_timeout = absl::Seconds(5);
  // How long a captured configuration may stay unwritten.
  absl::Duration commit_interval = absl::Seconds(1);
  std::vector<ForbiddenRegion> forbidden_regions;
  RawImages raw_images = RawImages::kSentinels;
  // Views whose images have noise: the same image twice, byte for byte, is a fault of the camera.
  std::set<std::string> noisy_views;
  SentinelSettings sentinels;
  FirstLookSettings first_look;
  // How long a lost camera or robot is waited for.
  absl::Duration retry = absl::Minutes(5);
  // Whether a robot that was lost moves on by itself when it is back; else somebody is asked.
  bool continue_after_reconnect = false;
  // Bytes of the disk that a session leaves free: with less it ends.
  uint64_t keep_free = 200'000'000;
};

}  // namespace silhouette
