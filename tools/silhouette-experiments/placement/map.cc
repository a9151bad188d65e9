#include "tools/silhouette-experiments/placement/map.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_format.h"
#include "common/picture/sheet.h"
#include "common/picture/text.h"

namespace silhouette {
namespace {

constexpr int kPlot = 640;  // pixels of the longer side
constexpr int kLeft = 70;
constexpr int kTop = 56;
constexpr int kBelow = 60;
constexpr int kRight = 24;
constexpr int kText = 15;
constexpr int kTitle = 20;

cv::Scalar Bgr(Colour colour) {
  return {double(colour.blue), double(colour.green), double(colour.red)};
}

class MapDrawing {
 public:
  explicit MapDrawing(const PlaceMap& map) : map_(map) {
    Eigen::AlignedBox2d area;
    for (const MappedPlace& place : map.places) area.extend(place.position.head<2>());
    for (const Eigen::Vector2d& point : map.footprint) area.extend(point);
    const double margin = 0.06 * std::max(area.sizes().maxCoeff(), 0.5);
    lower_ = area.min() - Eigen::Vector2d::Constant(margin);
    upper_ = area.max() + Eigen::Vector2d::Constant(margin);
    scale_ = kPlot / (upper_ - lower_).maxCoeff();
    width_ = static_cast<int>(std::lround(scale_ * (upper_ - lower_).x()));
    height_ = static_cast<int>(std::lround(scale_ * (upper_ - lower_).y()));
  }

  Picture Draw() {
    const std::vector<LegendEntry> legend = {{palette::kRobot, "the robot's reach"},
                                             {palette::kObstacle, "chosen, in this order"},
                                             {palette::kFaint, "not chosen"},
                                             {palette::kInk, "robot not whole in its image"}};
    const int width = std::max(kLeft + width_ + kRight, 520);
    const int legend_top = kTop + height_ + kBelow;
    const int legend_height = LegendHeight(legend, width - 2 * kRight);
    picture_ = BlankPicture(width, legend_top + legend_height + 14);
    DrawText(picture_, Shortened(map_.title, width - 2 * kRight, kTitle), {kRight, 26},
             {.height = kTitle});
    DrawFrusta();
    DrawFootprint();
    DrawPlaces();
    DrawAxes();
    DrawLegend(picture_, legend, kRight, legend_top, width - 2 * kRight);
    return picture_;
  }

 private:
  cv::Point At(const Eigen::Vector2d& point) const {
    return {kLeft + static_cast<int>(std::lround(scale_ * (point.x() - lower_.x()))),
            kTop + static_cast<int>(std::lround(scale_ * (upper_.y() - point.y())))};
  }

  void Veil(const std::vector<cv::Point>& polygon, Colour colour, double opacity) {
    cv::Mat layer = picture_.clone();
    cv::fillPoly(layer, std::vector<std::vector<cv::Point>>{polygon}, Bgr(colour), cv::LINE_AA);
    cv::addWeighted(layer, opacity, picture_, 1 - opacity, 0, picture_);
  }

  // What a camera looks at, as far as the point it is turned to.
  void DrawFrusta() {
    for (const MappedPlace& place : map_.places) {
      if (place.kind != PlaceKind::kChosen) continue;
      const Eigen::Vector2d along = (place.look_at - place.position).head<2>();
      if (along.norm() < 0.05 * (place.look_at - place.position).norm()) continue;
      const double half = (place.look_at - place.position).norm() *
                          std::tan(std::min(0.5 * map_.field_of_view, 1.4));
      const Eigen::Vector2d across = Eigen::Vector2d(-along.y(), along.x()).normalized() * half;
      const Eigen::Vector2d from = place.position.head<2>();
      const std::vector<cv::Point> wedge = {At(from), At(from + along + across),
                                            At(from + along - across)};
      Veil(wedge, palette::kObstacle, 0.10);
      cv::polylines(picture_, wedge, true, Bgr(palette::kObstacle), 1, cv::LINE_AA);
    }
  }

  void DrawFootprint() {
    std::vector<cv::Point> points;
    for (const Eigen::Vector2d& point : map_.footprint) points.push_back(At(point));
    if (points.empty()) return;
    std::vector<cv::Point> hull;
    cv::convexHull(points, hull);
    Veil(hull, palette::kRobot, 0.25);
    cv::polylines(picture_, hull, true, Bgr(palette::kRobot), 2, cv::LINE_AA);
  }

  void DrawPlaces() {
    for (PlaceKind kind : {PlaceKind::kUnusable, PlaceKind::kNotChosen, PlaceKind::kChosen}) {
      for (const MappedPlace& place : map_.places) {
        if (place.kind == kind) DrawPlace(place);
      }
    }
  }

  void DrawPlace(const MappedPlace& place) {
    const cv::Point at = At(place.position.head<2>());
    if (place.kind == PlaceKind::kUnusable) {
      for (int sign : {-1, 1}) {
        cv::line(picture_, at + cv::Point(-4, -4 * sign), at + cv::Point(4, 4 * sign),
                 Bgr(palette::kInk), 1, cv::LINE_AA);
      }
      return;
    }
    const bool chosen = place.kind == PlaceKind::kChosen;
    cv::circle(picture_, at, chosen ? 11 : 5, Bgr(chosen ? palette::kObstacle : palette::kFaint),
               cv::FILLED, cv::LINE_AA);
    cv::circle(picture_, at, chosen ? 11 : 5, Bgr(palette::kInk), 1, cv::LINE_AA);
    if (!chosen) return;
    DrawText(picture_, place.label, at,
             {.height = kText, .colour = palette::kPaper, .across = Align::kMiddle});
    const std::string height = absl::StrFormat("%.1f m up", place.position.z());
    const bool left = at.x + 90 > kLeft + width_;
    DrawText(picture_, height, at + cv::Point(left ? -16 : 16, 0),
             {.height = kText - 2, .across = left ? Align::kEnd : Align::kStart});
  }

  void DrawAxes() {
    const cv::Rect frame(kLeft, kTop, width_, height_);
    cv::rectangle(picture_, frame, Bgr(palette::kInk), 1);
    double step = 1;
    while ((upper_ - lower_).maxCoeff() / step > 10) step *= 2;
    while ((upper_ - lower_).maxCoeff() / step < 4) step /= 2;
    for (double x = std::ceil(lower_.x() / step) * step; x <= upper_.x(); x += step) {
      const int at = At({x, lower_.y()}).x;
      cv::line(picture_, {at, kTop + height_}, {at, kTop + height_ + 5}, Bgr(palette::kInk));
      DrawText(picture_, absl::StrFormat("%g", x), {at, kTop + height_ + 15},
               {.height = kText, .across = Align::kMiddle});
    }
    for (double y = std::ceil(lower_.y() / step) * step; y <= upper_.y(); y += step) {
      const int at = At({lower_.x(), y}).y;
      cv::line(picture_, {kLeft - 5, at}, {kLeft, at}, Bgr(palette::kInk));
      DrawText(picture_, absl::StrFormat("%g", y), {kLeft - 9, at},
               {.height = kText, .across = Align::kEnd});
    }
    DrawText(picture_, "x (m)", {kLeft + width_ / 2, kTop + height_ + 38},
             {.height = kText, .across = Align::kMiddle});
    DrawText(picture_, "y (m)", {20, kTop + height_ / 2},
             {.height = kText, .across = Align::kMiddle, .upwards = true});
  }

  const PlaceMap& map_;
  Eigen::Vector2d lower_;
  Eigen::Vector2d upper_;
  double scale_ = 1;  // pixels per metre
  int width_ = 0;
  int height_ = 0;
  Picture picture_;
};

}  // namespace

Picture Draw(const PlaceMap& map) { return MapDrawing(map).Draw(); }

}  // namespace silhouette
