// SPDX-License-Identifier: Apache-2.0
// The cell of test_cell.h with a second variant: the robot with a tool.
#pragma once

#include "tests/server/test_cell.h"

namespace silhouette {

inline constexpr char kTool[] = "tool";

// Beside the post's top, to the right: the tool.
inline Mask ToolMask(int view, int a, int b) {
  const MaskSize size = kViewSizes[static_cast<size_t>(view)];
  return RobotMask(view, a, b) | Mask::FromPredicate(size, [=](int x, int y) {
           return x / 2 == a + 1 && y == size.height - 2 - b / 2;
         });
}

inline RobotImage ToolImage(const ConfigurationGrid& grid, int a, int b) {
  RobotImage image = TestRobotImage(grid, a, b);
  for (int view = 0; view < 3; ++view) {
    image.masks[static_cast<size_t>(view)] = ToolMask(view, a, b);
  }
  return image;
}

inline void PutTools(Database& database) {
  auto writer = database.Write("test");
  ASSERT_TRUE(writer.ok()) << writer.status();
  for (int a = 0; a < 5; ++a) {
    for (int b = 0; b < 8; ++b) {
      ASSERT_TRUE(writer->Put(ToolImage(database.grid(), a, b), /*replace=*/true).ok());
    }
  }
  ASSERT_TRUE(writer->Commit().ok());
}

// Adds the set to a database that is there.
inline void AddTools(const std::string& path) {
  const auto database = Database::Open(path, Database::Access::kWrite);
  ASSERT_TRUE(database.ok()) << database.status();
  const auto variant = (*database)->CreateVariant(kTool, "test");
  ASSERT_TRUE(variant.ok()) << variant.status();
  PutTools(**variant);
}

// The robot at grid point (a, b) with the tool, and obstacles.
inline SceneInput ToolScene(int a, int b, int block) {
  SceneInput input;
  input.variant = kTool;
  input.joints = JointsAt(At(a, b));
  for (int view = 0; view < 3; ++view) {
    input.views.push_back({kViewNames[static_cast<size_t>(view)], std::nullopt,
                           SceneMask{ToolMask(view, a, b) | Block(view, block)}});
  }
  return input;
}

}  // namespace silhouette
