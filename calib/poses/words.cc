#include "calib/poses/words.h"

#include <algorithm>
#include <limits>

#include "absl/strings/str_cat.h"

namespace silhouette {

std::string FewOf(const std::vector<std::string>& names) {
  constexpr size_t kFew = 5;
  std::string few;
  for (size_t i = 0; i < names.size() && i < kFew; ++i) {
    absl::StrAppend(&few, i == 0 ? "" : ", ", names[i]);
  }
  if (names.size() > kFew) absl::StrAppend(&few, " and ", names.size() - kFew, " more");
  return few;
}

double MedianOf(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::infinity();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace silhouette
