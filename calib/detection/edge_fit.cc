// SPDX-License-Identifier: Apache-2.0
#include "calib/detection/corner_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace silhouette {
namespace {

// The unknowns of a fit: the edge's shape, its blur, and the mean grey value and half the contrast,
// both of which may change linearly along the edge.
enum Unknown { kShape0, kShape1, kShape2, kBlur, kMean0, kMean1, kHalf0, kHalf1, kUnknowns };
using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;
using Normal = Eigen::Matrix<double, kUnknowns, kUnknowns>;

constexpr int kLeastPixels = 20;
constexpr double kLeastContrast = 10;  // grey levels
constexpr double kLeastBlur = 0.15;    // pixels, before the pixels' own width is added
constexpr double kMostBlur = 3;
constexpr double kFirstEdgeBlur = 0.6;
constexpr int kMostSteps = 50;
constexpr double kMostDamping = 1e6;
constexpr double kMostNoise = 0.2;  // about the fit, as a share of the contrast

constexpr double kHalfPixel = 0.5;
constexpr double kPixelBlur = 0.2887;  // standard deviation of a pixel's width

// The integral of a step from -1 to 1 that is blurred by `blur`. A pixel shows a step's mean over
// its width.
double StepIntegral(double x, double blur) {
  const double z = x / blur;
  return x * std::erf(z / std::numbers::sqrt2) +
         blur * std::numbers::sqrt2 * std::numbers::inv_sqrtpi * std::exp(-z * z / 2);
}

struct Sample {
  double along;
  double aside;  // from the straight line through the ends, undistorted pixels
  double grey;
};

}  // namespace

Edge::Edge(const Eigen::Vector2d& from, const Eigen::Vector2d& to)
    : middle_((from + to) / 2), tangent_((to - from).normalized()), half_((to - from).norm() / 2) {}

Eigen::Vector2d Edge::Gradient(const Eigen::Vector2d& at) const {
  const double along = Along(at);
  const double slope = (shape_[1] + along * (2 * shape_[2] + 3 * along * cubic_)) / half_;
  return normal() - slope * tangent_;
}

double Edge::Variance(double along) const {
  const Eigen::Vector3d powers(1, along, along * along);
  return powers.dot(covariance_ * powers);
}

class EdgeFitter {
 public:
  EdgeFitter(const cv::Mat& image, const std::optional<CameraModel>& lens,
             const EdgeFitSettings& settings)
      : image_(image), lens_(lens), settings_(settings) {}

  std::optional<Edge> Fit(Edge edge) const {
    const auto middle = Distorted(lens_, edge.middle_);
    if (!middle) return std::nullopt;
    edge.cubic_ = settings_.bend.cubic;
    // Pixels per undistorted pixel across the edge.
    const double scale =
        1 / (UndistortedPerPixel(lens_, *middle).transpose() * edge.normal()).norm();
    std::vector<Sample> samples = SamplesBeside(edge, scale);
    for (Sample& sample : samples) sample.aside -= edge.cubic_ * std::pow(sample.along, 3);
    if (samples.size() < kLeastPixels || !Solve(samples, scale, edge)) return std::nullopt;
    edge.saturation_ = Saturation(samples, edge, scale);
    return edge;
  }

 private:
  std::vector<Sample> SamplesBeside(const Edge& edge, double scale) const {
    std::vector<Sample> samples;
    const Eigen::Vector2d half = edge.tangent_ * edge.half_;
    const auto from = Distorted(lens_, edge.middle_ - half);
    const auto to = Distorted(lens_, edge.middle_ + half);
    const auto middle = Distorted(lens_, edge.middle_);
    if (!from || !to || !middle) return samples;
    const Edge chord(*from, *to);
    // Where the lens bends the edge, the chord is as far away from it as its middle bows out.
    const double reach = settings_.reach + 1 + std::abs(chord.Distance(*middle));
    const double most = 1 - settings_.end_gap / edge.half_;
    const auto first = [&](double a, double b) {
      return std::max(0, static_cast<int>(std::floor(std::min(a, b) - reach)));
    };
    const auto last = [&](double a, double b, int size) {
      return std::min(size - 1, static_cast<int>(std::ceil(std::max(a, b) + reach)));
    };
    for (int y = first(from->y(), to->y()); y <= last(from->y(), to->y(), image_.rows); ++y) {
      for (int x = first(from->x(), to->x()); x <= last(from->x(), to->x(), image_.cols); ++x) {
        const Eigen::Vector2d pixel(x, y);
        if (std::abs(chord.Distance(pixel)) > reach) continue;
        const auto at = Undistorted(lens_, pixel);
        if (!at) continue;
        const double along = edge.Along(*at);
        if (std::abs(along) > most) continue;
        if (std::abs(edge.Distance(*at)) * scale > settings_.reach) continue;
        samples.push_back({along, edge.normal().dot(*at - edge.middle_),
                           static_cast<double>(image_.at<uint8_t>(y, x))});
      }
    }
    return samples;
  }

  // Of the samples a pixel and more beside the edge half are bright. While noise still shows, half
  // of these are below white.
  static double Saturation(const std::vector<Sample>& samples, const Edge& edge, double scale) {
    constexpr double kWhite = 255;
    double beside = 0;
    double white = 0;
    for (const Sample& sample : samples) {
      const Eigen::Vector3d powers(1, sample.along, sample.along * sample.along);
      if (std::abs(sample.aside - edge.shape_.dot(powers)) * scale < 1) continue;
      ++beside;
      white += sample.grey >= kWhite ? 1 : 0;
    }
    return std::clamp(4 * white / std::max(beside, 1.0) - 1, 0.0, 1.0);
  }

  // The residual of a sample and, on request, its derivatives.
  static double Residual(const Sample& sample, const Unknowns& u, double scale, Unknowns* row) {
    const double t = sample.along;
    const double away = scale * (sample.aside - u[kShape0] - t * (u[kShape1] + t * u[kShape2]));
    const double step =
        (StepIntegral(away + kHalfPixel, u[kBlur]) - StepIntegral(away - kHalfPixel, u[kBlur])) /
        (2 * kHalfPixel);
    const double half = u[kHalf0] + t * u[kHalf1];
    if (row != nullptr) {
      const double before = (away - kHalfPixel) / u[kBlur];
      const double after = (away + kHalfPixel) / u[kBlur];
      const double by_away =
          half * (std::erf(after / std::numbers::sqrt2) - std::erf(before / std::numbers::sqrt2)) /
          (2 * kHalfPixel);
      const double by_blur = half * std::numbers::sqrt2 * std::numbers::inv_sqrtpi *
                             (std::exp(-after * after / 2) - std::exp(-before * before / 2)) /
                             (2 * kHalfPixel);
      const double by_shape = -by_away * scale;
      *row << by_shape, by_shape * t, by_shape * t * t, by_blur, 1, t, step, t * step;
    }
    return sample.grey - (u[kMean0] + t * u[kMean1] + half * step);
  }

  static double Cost(const std::vector<Sample>& samples, const Unknowns& u, double scale) {
    double cost = 0;
    for (const Sample& sample : samples) {
      const double residual = Residual(sample, u, scale, nullptr);
      cost += residual * residual;
    }
    return cost;
  }

  Unknowns Start(const std::vector<Sample>& samples, const Edge& edge) const {
    double sum[2] = {};
    int count[2] = {};
    for (const Sample& sample : samples) {
      const double away = sample.aside - edge.shape_.dot(Eigen::Vector3d(
                                             1, sample.along, sample.along * sample.along));
      if (std::abs(away) < 1) continue;
      sum[away > 0] += sample.grey;
      ++count[away > 0];
    }
    const double low = count[0] > 0 ? sum[0] / count[0] : 0;
    const double high = count[1] > 0 ? sum[1] / count[1] : 0;
    Unknowns u = Unknowns::Zero();
    u.head<3>() = edge.shape_;
    u[kShape2] = settings_.bend.quadratic;
    u[kBlur] = kFirstEdgeBlur;
    u[kMean0] = (low + high) / 2;
    u[kHalf0] = (high - low) / 2;
    return u;
  }

  // Levenberg-Marquardt.
  bool Solve(const std::vector<Sample>& samples, double scale, Edge& edge) const {
    Unknowns u = Start(samples, edge);
    if (std::abs(u[kHalf0]) < kLeastContrast / 2) return false;
    double cost = Cost(samples, u, scale);
    double damping = 1e-3;
    bool settled = false;
    Normal normal;
    for (int step = 0; step < kMostSteps && !settled; ++step) {
      Unknowns gradient;
      Accumulate(samples, u, scale, normal, gradient);
      // A blur that wants to be less than the least stays there, and the others go on without it.
      if (u[kBlur] <= kLeastBlur && gradient[kBlur] < 0) {
        normal.row(kBlur).setZero();
        normal.col(kBlur).setZero();
        normal(kBlur, kBlur) = 1;
        gradient[kBlur] = 0;
      }
      Normal damped = normal;
      damped.diagonal() *= 1 + damping;
      Unknowns next = u + damped.ldlt().solve(gradient);
      next[kBlur] = std::clamp(next[kBlur], kLeastBlur, kMostBlur);
      const double next_cost = Cost(samples, next, scale);
      if (!(next_cost <= cost)) {  // NaN too
        damping *= 10;
        settled = damping > kMostDamping;  // no step, however small, makes it better
        continue;
      }
      settled = (next - u).head<3>().norm() < 1e-5 && cost - next_cost <= 1e-6 * cost;
      damping = std::max(1e-9, damping / 10);
      u = next;
      cost = next_cost;
    }
    if (!settled || std::abs(u[kHalf0]) < kLeastContrast / 2) return false;
    Unknowns gradient;
    Accumulate(samples, u, scale, normal, gradient);
    const int unknowns = settings_.curved ? kUnknowns : kUnknowns - 1;
    const double variance = cost / static_cast<double>(samples.size() - unknowns);
    const Normal covariance = variance * normal.ldlt().solve(Normal::Identity());
    edge.shape_ = u.head<3>();
    edge.covariance_ = covariance.topLeftCorner<3, 3>();
    if (!settings_.curved) {
      edge.covariance_.row(kShape2).setZero();
      edge.covariance_.col(kShape2).setZero();
    }
    edge.blur_ = std::hypot(u[kBlur], kPixelBlur);
    edge.contrast_ = 2 * std::abs(u[kHalf0]);
    edge.noise_ = std::sqrt(variance);
    return edge.covariance_.allFinite() && edge.noise_ < kMostNoise * edge.contrast_;
  }

  void Accumulate(const std::vector<Sample>& samples, const Unknowns& u, double scale,
                  Normal& normal, Unknowns& gradient) const {
    normal.setZero();
    gradient.setZero();
    Unknowns row;
    for (const Sample& sample : samples) {
      const double residual = Residual(sample, u, scale, &row);
      if (!settings_.curved) row[kShape2] = 0;
      normal.noalias() += row * row.transpose();
      gradient += residual * row;
    }
    if (!settings_.curved) normal(kShape2, kShape2) = 1;
  }

  const cv::Mat& image_;
  const std::optional<CameraModel>& lens_;
  const EdgeFitSettings& settings_;
};

std::optional<Edge> FitEdge(const cv::Mat& image, const std::optional<CameraModel>& lens,
                            const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                            const EdgeFitSettings& settings) {
  if (!((to - from).norm() > 2 * settings.end_gap)) return std::nullopt;
  return EdgeFitter(image, lens, settings).Fit(Edge(from, to));
}

}  // namespace silhouette
