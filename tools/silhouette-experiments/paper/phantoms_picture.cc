// SPDX-License-Identifier: Apache-2.0
// Figure 1: what images allow, in a floor plan. Each camera sees the plan as a line of directions
// that obstacles cover; where all cameras see covered directions, something could stand.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_cat.h"
#include "common/picture/sheet.h"
#include "common/picture/text.h"
#include "tools/silhouette-experiments/paper/pictures.h"

namespace silhouette::paper {
namespace {

constexpr int kPixelsWide = 620;
constexpr int kLabel = 15;
constexpr Colour kReal{34, 34, 34};
constexpr Colour kEnlarged{230, 159, 0};
constexpr Colour kPhantom{204, 121, 167};
constexpr Colour kRays{120, 150, 180};

using Point = std::array<double, 2>;

// Directions from a camera, as angles from that to an obstacle's middle: from below to above.
struct Covered {
  double towards = 0;
  double from = 0;
  double to = 0;
};

double Angle(const Point& from, const Point& to) {
  return std::atan2(to[1] - from[1], to[0] - from[0]);
}

double Turn(double angle) { return std::remainder(angle, 2 * std::numbers::pi); }

std::vector<Covered> LineImage(const FlatCamera& camera, const std::vector<Rectangle>& obstacles) {
  std::vector<Covered> image;
  for (const Rectangle& obstacle : obstacles) {
    const Point middle = {(obstacle.from[0] + obstacle.to[0]) / 2,
                          (obstacle.from[1] + obstacle.to[1]) / 2};
    Covered covered{Angle(camera.at, middle), 0, 0};
    for (double x : {obstacle.from[0], obstacle.to[0]}) {
      for (double y : {obstacle.from[1], obstacle.to[1]}) {
        const double off = Turn(Angle(camera.at, {x, y}) - covered.towards);
        covered.from = std::min(covered.from, off);
        covered.to = std::max(covered.to, off);
      }
    }
    image.push_back(covered);
  }
  return image;
}

bool Covers(const std::vector<Covered>& image, double angle) {
  return std::any_of(image.begin(), image.end(), [&](const Covered& covered) {
    const double off = Turn(angle - covered.towards);
    return covered.from <= off && off <= covered.to;
  });
}

bool Inside(const Rectangle& rectangle, const Point& at) {
  return rectangle.from[0] <= at[0] && at[0] <= rectangle.to[0] && rectangle.from[1] <= at[1] &&
         at[1] <= rectangle.to[1];
}

class Plan {
 public:
  Plan(const FloorPlan& plan, size_t cameras)
      : plan_(plan),
        cameras_(plan.cameras.begin(), plan.cameras.begin() + static_cast<long>(cameras)),
        scale_(kPixelsWide / plan.size[0]),
        picture_(BlankPicture(kPixelsWide, static_cast<int>(std::lround(plan.size[1] * scale_)),
                              palette::kFree)) {}

  Picture Draw() {
    FindHull();
    Paint();
    for (const FlatCamera& camera : cameras_) DrawRays(camera);
    for (const Rectangle& obstacle : plan_.obstacles) {
      cv::rectangle(picture_, PixelOf(obstacle.from), PixelOf(obstacle.to), BgrOf(kReal),
                    cv::FILLED);
    }
    for (const FlatCamera& camera : cameras_) DrawCamera(camera);
    return picture_;
  }

  // Of the obstacles' own area.
  double PercentEnlarged() const { return 100.0 * enlarged_ / real_; }
  int phantoms() const { return phantoms_; }

 private:
  cv::Point PixelOf(const Point& at) const {
    return {static_cast<int>(std::lround(at[0] * scale_)),
            static_cast<int>(std::lround(picture_.rows - at[1] * scale_))};
  }
  Point At(int x, int y) const { return {(x + 0.5) / scale_, (picture_.rows - y - 0.5) / scale_}; }

  // Where every camera sees something, in pieces.
  void FindHull() {
    std::vector<std::vector<Covered>> images;
    for (const FlatCamera& camera : cameras_) {
      images.push_back(LineImage(camera, plan_.obstacles));
    }
    cv::Mat hull(picture_.rows, picture_.cols, CV_8UC1, cv::Scalar(0));
    for (int y = 0; y < hull.rows; ++y) {
      for (int x = 0; x < hull.cols; ++x) {
        bool possible = true;
        for (size_t i = 0; i < cameras_.size() && possible; ++i) {
          possible = Covers(images[i], Angle(cameras_[i].at, At(x, y)));
        }
        if (possible) hull.at<uint8_t>(y, x) = 255;
      }
    }
    pieces_ = cv::connectedComponents(hull, labels_, 4, CV_32S);
  }

  // A piece without any real obstacle is a phantom; the rest of another is its enlargement.
  void Paint() {
    std::vector<bool> real(static_cast<size_t>(pieces_), false);
    const auto is_real = [&](int x, int y) {
      return std::any_of(plan_.obstacles.begin(), plan_.obstacles.end(),
                         [&](const Rectangle& each) { return Inside(each, At(x, y)); });
    };
    for (int y = 0; y < labels_.rows; ++y) {
      for (int x = 0; x < labels_.cols; ++x) {
        if (is_real(x, y)) real[static_cast<size_t>(labels_.at<int>(y, x))] = true;
      }
    }
    for (int y = 0; y < labels_.rows; ++y) {
      for (int x = 0; x < labels_.cols; ++x) {
        const int piece = labels_.at<int>(y, x);
        if (is_real(x, y)) ++real_;
        if (piece == 0) continue;
        const bool phantom = !real[static_cast<size_t>(piece)];
        if (!phantom && !is_real(x, y)) ++enlarged_;
        const Colour colour = phantom ? kPhantom : kEnlarged;
        picture_.at<cv::Vec3b>(y, x) = {colour.blue, colour.green, colour.red};
      }
    }
    for (size_t piece = 1; piece < real.size(); ++piece) phantoms_ += real[piece] ? 0 : 1;
  }

  // The rims of what the camera sees.
  void DrawRays(const FlatCamera& camera) {
    const double far = plan_.size[0] + plan_.size[1];
    for (const Covered& covered : LineImage(camera, plan_.obstacles)) {
      for (double off : {covered.from, covered.to}) {
        const double angle = covered.towards + off;
        const Point end = {camera.at[0] + far * std::cos(angle),
                           camera.at[1] + far * std::sin(angle)};
        cv::line(picture_, PixelOf(camera.at), PixelOf(end), BgrOf(kRays), 1, cv::LINE_AA);
      }
    }
  }

  void DrawCamera(const FlatCamera& camera) {
    const cv::Point at = PixelOf(camera.at);
    cv::circle(picture_, at, 7, BgrOf(palette::kRobot), cv::FILLED, cv::LINE_AA);
    cv::circle(picture_, at, 7, BgrOf(palette::kInk), 1, cv::LINE_AA);
    const bool right = at.x > picture_.cols * 2 / 3;
    DrawText(picture_, camera.name, at + cv::Point(right ? -14 : 14, 0),
             {.height = kLabel, .across = right ? Align::kEnd : Align::kStart});
  }

  const FloorPlan& plan_;
  std::vector<FlatCamera> cameras_;
  double scale_;
  Picture picture_;
  cv::Mat labels_;
  int pieces_ = 0;
  int64_t real_ = 0;
  int64_t enlarged_ = 0;
  int phantoms_ = 0;
};

}  // namespace

Picture PhantomsPicture(const FloorPlan& plan) {
  std::vector<CaptionedPicture> pictures;
  for (size_t cameras : {2, 3}) {
    Plan drawn(plan, cameras);
    const Picture picture = drawn.Draw();
    pictures.push_back(
        {picture, absl::StrCat(cameras, " cameras: ", drawn.phantoms(), " phantom",
                               drawn.phantoms() == 1 ? "" : "s", ", obstacles enlarged by ",
                               std::lround(drawn.PercentEnlarged()), " %")});
  }
  return ContactSheet(pictures,
                      {.title = "Figure 1: what the images of two and of three cameras allow",
                       .columns = 2,
                       .legend = {{kReal, "real obstacle"},
                                  {kEnlarged, "enlargement"},
                                  {kPhantom, "phantom obstacle"},
                                  {kRays, "rim of what a camera sees"}}});
}

}  // namespace silhouette::paper
