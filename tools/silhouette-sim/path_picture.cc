// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-sim/path_picture.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "capture/sim/simulated_cell.h"
#include "common/picture/picture.h"
#include "common/picture/sheet.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr int kSilhouettes = 12;
constexpr double kOpacity = 0.35;
constexpr int kScale = 2;

// Places that divide the path evenly, measured by the joint that moves most.
std::vector<std::vector<double>> PlacesAlong(const std::vector<std::vector<double>>& waypoints,
                                             int count) {
  std::vector<double> way = {0};
  for (size_t i = 0; i + 1 < waypoints.size(); ++i) {
    double most = 0;
    for (size_t j = 0; j < waypoints[i].size(); ++j) {
      most = std::max(most, std::abs(waypoints[i + 1][j] - waypoints[i][j]));
    }
    way.push_back(way.back() + most);
  }
  std::vector<std::vector<double>> places;
  for (int k = 0; k < count; ++k) {
    const double at = way.back() * k / (count - 1);
    size_t i = 0;
    while (i + 2 < way.size() && way[i + 1] < at) ++i;
    std::vector<double> place = waypoints[i];
    const double leg = way.size() > 1 ? way[i + 1] - way[i] : 0;
    for (size_t j = 0; leg > 0 && j < place.size(); ++j) {
      place[j] += (at - way[i]) / leg * (waypoints[i + 1][j] - waypoints[i][j]);
    }
    places.push_back(std::move(place));
  }
  return places;
}

Colour Mixed(const Colour& a, const Colour& b, double share) {
  const auto mix = [&](uint8_t from, uint8_t to) {
    return static_cast<uint8_t>(std::lround(from + share * (to - from)));
  };
  return {mix(a.red, b.red), mix(a.green, b.green), mix(a.blue, b.blue)};
}

// Lays the silhouette over the picture, its rim in full colour.
void Overlay(const cv::Mat& robot, Colour colour, Picture& picture) {
  Picture veil = picture.clone();
  veil.setTo(BgrOf(colour), robot);
  cv::addWeighted(picture, 1 - kOpacity, veil, kOpacity, 0, picture);
  cv::Mat inner;
  cv::erode(robot, inner, cv::Mat());
  picture.setTo(BgrOf(colour), robot - inner);
}

}  // namespace

absl::Status WriteMotion(const Workplace& workplace,
                         const std::vector<std::vector<double>>& positions,
                         const std::string& path) {
  ASSIGN_OR_RETURN(auto settings, SimulationOf(workplace.cell));
  ASSIGN_OR_RETURN(const auto views, SimulatedViews(workplace.cell));
  ASSIGN_OR_RETURN(const std::vector<size_t> cameras, CamerasOf(settings, views));
  SimulatedCell simulated(workplace.robot, std::move(settings));
  simulated.SetObstacles(workplace.obstacles);
  simulated.SetRobotPresent(false);
  std::vector<CaptionedPicture> pictures;
  const std::vector<CameraImage> images = simulated.TakeImages(cameras);
  for (size_t v = 0; v < views.size(); ++v) {
    const CameraImage& image = images[v];
    pictures.push_back(
        {PictureOfPixels(image.width, image.height, image.channels, image.pixels), views[v].name});
  }
  simulated.SetRobotPresent(true);
  const auto places = PlacesAlong(positions, kSilhouettes);
  for (size_t i = 0; i < places.size(); ++i) {
    simulated.SetPositions(places[i]);
    const auto seen = simulated.TrueImages(cameras);
    const double share = static_cast<double>(i) / (kSilhouettes - 1);
    for (size_t v = 0; v < views.size(); ++v) {
      Picture& picture = pictures[v].picture;
      cv::Mat robot(picture.size(), CV_8UC1, cv::Scalar(0));
      for (int p = 0; p < robot.rows * robot.cols; ++p) {
        if (seen[v][static_cast<size_t>(p)] == Seen::kRobot) robot.data[p] = 255;
      }
      Overlay(robot, Mixed(palette::kStart, palette::kGoal, share), picture);
    }
  }
  for (CaptionedPicture& view : pictures) view.picture = Enlarged(view.picture, kScale);
  return WritePng(
      path,
      ContactSheet(pictures, {.title = "The robot's silhouettes along the path",
                              .columns = 2,
                              .legend = {{palette::kStart, "start"}, {palette::kGoal, "goal"}}}));
}

}  // namespace silhouette
