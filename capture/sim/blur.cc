#include "capture/sim/blur.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace silhouette {
namespace {

// The share of each pixel from -n to n, integrated over its area.
std::vector<float> Kernel(double sigma) {
  const int reach = static_cast<int>(std::ceil(4 * sigma));
  const auto below = [&](double x) { return 0.5 * std::erfc(-x / (sigma * std::sqrt(2.0))); };
  std::vector<float> kernel;
  double sum = 0;
  for (int i = -reach; i <= reach; ++i) sum += below(i + 0.5) - below(i - 0.5);
  for (int i = -reach; i <= reach; ++i) {
    kernel.push_back(static_cast<float>((below(i + 0.5) - below(i - 0.5)) / sum));
  }
  return kernel;
}

// Convolves `count` values that lie `step` apart.
void BlurLine(float* first, int count, ptrdiff_t step, const std::vector<float>& kernel,
              std::vector<float>& line) {
  const int reach = static_cast<int>(kernel.size() / 2);
  line.clear();
  for (int i = -reach; i < count + reach; ++i) {
    line.push_back(first[std::clamp(i, 0, count - 1) * step]);
  }
  for (int i = 0; i < count; ++i) {
    float sum = 0;
    for (size_t k = 0; k < kernel.size(); ++k) sum += kernel[k] * line[static_cast<size_t>(i) + k];
    first[i * step] = sum;
  }
}

}  // namespace

void Blur(std::span<float> image, int width, double sigma) {
  if (!(sigma > 0) || image.empty()) return;
  const std::vector<float> kernel = Kernel(sigma);
  const int height = static_cast<int>(image.size()) / width;
  std::vector<float> line;
  for (int y = 0; y < height; ++y) {
    BlurLine(&image[static_cast<size_t>(y) * static_cast<size_t>(width)], width, 1, kernel, line);
  }
  for (int x = 0; x < width; ++x) {
    BlurLine(&image[static_cast<size_t>(x)], height, width, kernel, line);
  }
}

}  // namespace silhouette
