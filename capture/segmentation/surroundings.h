// What the values around each value say together, a row at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "capture/segmentation/open_values.h"

namespace silhouette {

// Sums over the rows around one.
class Surroundings {
 public:
  // Rows have `values` values, `channels` per pixel; `reach` pixels on all sides are surroundings,
  // 1 to 7. Squares are summed only if `squares`.
  Surroundings(int values, int channels, int reach, bool squares);

  // A row comes in, one goes: null if there is none.
  void Move(const OpenRow* in, const OpenRow* out);

  // `deviates` becomes 255 where the values around deviate in their mean or in their squares, as
  // DeviatingPixels() says, else 0.
  void Judge(const DeviationLimits& limits, uint8_t* deviates);

 private:
  // Sums over columns, with room for zeros on both sides, and, over those, sums across.
  template <typename Sum>
  struct Sums {
    std::vector<Sum> columns;
    std::vector<Sum> around;
  };

  int values_;
  int channels_;
  int reach_;
  bool squares_;
  Sums<int32_t> difference_;
  Sums<uint32_t> counted_;
  Sums<int32_t> square_;
  Sums<int32_t> variance_;
};

}  // namespace silhouette
