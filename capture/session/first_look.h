// SPDX-License-Identifier: Apache-2.0
// Whether the first robot images of a capture can be those of the robot.
#pragma once

#include <string>
#include <vector>

#include "capture/session/capture_settings.h"
#include "db/mask/configuration_grid.h"
#include "db/mask/mask.h"

namespace silhouette {

// Looks at the robot images of a capture's first configurations before any of them is stored. For
// one thread.
class FirstLook {
 public:
  // `views`: their names.
  FirstLook(const FirstLookSettings& settings, std::vector<std::string> views)
      : settings_(settings), views_(std::move(views)) {}

  // Whether it has seen as many configurations as it wants.
  bool complete() const { return numbers_.size() >= static_cast<size_t>(settings_.configurations); }

  // Takes the masks of a configuration, one per view. What is wrong with them by themselves, in one
  // sentence: no view sees the robot, or the border of an image cuts it. Empty: nothing.
  std::string Add(ConfigurationNumber number, const std::vector<Mask>& masks);

  // Whether the masks show the robot where it must be: `expected` by view, as large
  // (DrawnRobot). What is wrong, in one sentence; empty: nothing.
  std::string Compare(ConfigurationNumber number, const std::vector<Mask>& masks,
                      const std::vector<Mask>& expected);

  // What is wrong with all of them together, at least two: nothing moves with the robot, or
  // something beside it is always foreground, as where the robot stands in the reference image too.
  std::string Judge() const;

 private:
  size_t LeastArea(const Mask& mask) const;
  std::string Configurations() const;
  // In one view: whether nothing moves; what is always there, apart from all that moves, and no
  // fixed part of the robot.
  bool Still(size_t view) const;
  Mask Apart(size_t view) const;

  const FirstLookSettings settings_;
  const std::vector<std::string> views_;
  std::vector<ConfigurationNumber> numbers_;
  std::vector<std::vector<Mask>> masks_;  // by configuration, then by view
  std::vector<Mask> always_robot_;        // by view, of all that is expected; empty: not known
};

}  // namespace silhouette
