// SPDX-License-Identifier: Apache-2.0
// A small simulated cell whose views are served as cameras. Without noise: an image depends on
// where the robot stands alone.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "capture/sim/served/served_views.h"
#include "capture/sim/simulated_cell.h"
#include "tests/folders.h"
#include "tests/test_folder.h"

namespace silhouette {

class ServedCell : public testing::Test {
 protected:
  static constexpr int kWidth = 160;
  static constexpr int kHeight = 120;

  // `colour`: the cameras have colour, and the room a strong tint.
  explicit ServedCell(bool colour = false) {
    const std::string of_camera = colour ? ", colour: true}\n" : "}\n";
    const std::string of_room = colour ? ", colour: [1, 0.6, 0.3]}\n" : "}\n";
    const std::string file = (FreshFolder() / "simulation.yaml").string();
    std::ofstream text(file);
    text << "cameras:\n"
            "  top: {image_size: [160, 120], position: [0, 0, 5.4], look_at: [0, 0, 1],\n"
            "        up: [0, 1, 0], field_of_view: 58 deg"
         << of_camera
         << "  front: {image_size: [160, 120], position: [5.2, 0, 1.3], look_at: [0, 0, 1],\n"
            "          field_of_view: 50 deg"
         << of_camera
         << "  left: {image_size: [160, 120], position: [0, 5.2, 1.3], look_at: [0, 0, 1],\n"
            "         field_of_view: 50 deg"
         << of_camera
         << "  back: {image_size: [160, 120], position: [-5.2, 0, 1.3], look_at: [0, 0, 1],\n"
            "         field_of_view: 50 deg"
         << of_camera << "room: {lower: [-6, -6, 0], upper: [6, 6, 6]" << of_room << "noise: 0\n";
    text.close();
    const auto robot =
        RobotModel::FromUrdf(SourceFolder() + "/capture/sim/robots/rx130.urdf").value();
    auto cell = SimulatedCell::Load(file, robot, {});
    EXPECT_TRUE(cell.ok()) << cell.status();
    cell_ = *std::move(cell);
    std::vector<SimulatedView> views;
    for (const std::string& name : names_) views.push_back({name, kWidth, kHeight});
    auto served = ServedViews::Create(cell_, views);
    EXPECT_TRUE(served.ok()) << served.status();
    views_ = *std::move(served);
    Turn(0);
  }

  // Turns the robot about its first axis.
  void Turn(double angle) { cell_->SetPositions(std::vector<double>{angle, 0.7, 0.3, 0, 0.3, 0}); }

  // The pixels of all views as the cell is now.
  std::vector<std::vector<uint8_t>> Truth() { return Pixels(views_->TakeAll()); }

  static std::vector<std::vector<uint8_t>> Pixels(const std::vector<CameraImage>& images) {
    std::vector<std::vector<uint8_t>> pixels;
    for (const CameraImage& image : images) pixels.push_back(image.pixels);
    return pixels;
  }

  const std::vector<std::string> names_ = {"top", "front", "left", "back"};
  std::shared_ptr<SimulatedCell> cell_;
  std::unique_ptr<ServedViews> views_;
};

}  // namespace silhouette
