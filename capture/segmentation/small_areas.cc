#include "capture/segmentation/small_areas.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <vector>

namespace silhouette {
namespace {

// Pixels [begin, end) of row y that are not 0. Runs that are connected have the same root, which
// knows the pixels of all.
struct Run {
  int y = 0;
  int begin = 0;
  int end = 0;
  size_t parent = 0;
  int64_t area = 0;
};

// The first pixel at or after `x` that is not 0; `width` if there is none.
int NextSet(const uint8_t* row, int x, int width) {
  for (; x + 8 <= width; x += 8) {
    uint64_t pixels = 0;
    std::memcpy(&pixels, row + x, sizeof(pixels));
    if (pixels != 0) break;
  }
  while (x < width && row[x] == 0) ++x;
  return x;
}

int NextClear(const uint8_t* row, int x, int width) {
  const void* clear = std::memchr(row + x, 0, static_cast<size_t>(width - x));
  return clear == nullptr ? width : static_cast<int>(static_cast<const uint8_t*>(clear) - row);
}

class Runs {
 public:
  explicit Runs(const cv::Mat& foreground) {
    size_t above = 0;  // the first run of the row above
    for (int y = 0; y < foreground.rows; ++y) {
      const size_t first = runs_.size();
      const auto* row = foreground.ptr<uint8_t>(y);
      for (int x = NextSet(row, 0, foreground.cols); x < foreground.cols;) {
        const int end = NextClear(row, x, foreground.cols);
        runs_.push_back({.y = y, .begin = x, .end = end, .parent = runs_.size(), .area = end - x});
        x = NextSet(row, end, foreground.cols);
      }
      Connect(above, first);
      above = first;
    }
  }

  void Drop(cv::Mat& foreground, int min_pixels) {
    for (size_t i = 0; i < runs_.size(); ++i) {
      if (runs_[Root(i)].area >= min_pixels) continue;
      std::fill(foreground.ptr<uint8_t>(runs_[i].y) + runs_[i].begin,
                foreground.ptr<uint8_t>(runs_[i].y) + runs_[i].end, uint8_t{0});
    }
  }

 private:
  size_t Root(size_t i) {
    while (runs_[i].parent != i) {
      runs_[i].parent = runs_[runs_[i].parent].parent;
      i = runs_[i].parent;
    }
    return i;
  }

  // Joins the runs [above, row) of one row with those from `row` on, of the next.
  void Connect(size_t above, size_t row) {
    size_t a = above;
    for (size_t b = row; b < runs_.size(); ++b) {
      while (a < row && runs_[a].end < runs_[b].begin) ++a;
      for (size_t i = a; i < row && runs_[i].begin <= runs_[b].end; ++i) Join(Root(i), Root(b));
    }
  }

  void Join(size_t a, size_t b) {
    if (a == b) return;
    runs_[b].parent = a;
    runs_[a].area += runs_[b].area;
  }

  std::vector<Run> runs_;
};

}  // namespace

void DropSmallAreas(cv::Mat& foreground, int min_pixels) {
  if (min_pixels > 1) Runs(foreground).Drop(foreground, min_pixels);
}

}  // namespace silhouette
