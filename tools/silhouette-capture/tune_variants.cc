#include "tools/silhouette-capture/tune_variants.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "tools/cell/segmentation_text.h"

namespace silhouette {
namespace {

std::vector<std::string> Sweep(const SegmentationSettings& now) {
  std::vector<std::string> tries;
  const auto both = [&](const char* key, double value, double factor) {
    tries.push_back(absl::StrCat(key, ": ", value / factor));
    tries.push_back(absl::StrCat(key, ": ", value * factor));
  };
  const auto limit = [&](const char* key, double value, double usual) {
    if (value > 0) return both(key, value, 2);
    tries.push_back(absl::StrCat(key, ": ", usual));
  };
  both("noise_factor", now.noise_factor > 0 ? now.noise_factor : 6, 1.5);
  limit("min_difference", now.min_difference, SegmentationSettings{}.min_difference);
  limit("faint_difference", now.faint_difference, SegmentationSettings{}.faint_difference);
  limit("texture_difference", now.texture_difference, SegmentationSettings{}.texture_difference);
  if (now.faint_side > 3) {
    tries.push_back(absl::StrCat("faint_side: ", std::max(3, now.faint_side - 4)));
  }
  if (now.faint_side < SegmentationSettings::kMostFaintSide) {
    tries.push_back(absl::StrCat(
        "faint_side: ", std::min(SegmentationSettings::kMostFaintSide, now.faint_side + 4)));
  }
  tries.push_back(absl::StrCat("min_blob_pixels: ", now.min_blob_pixels / 3));
  tries.push_back(absl::StrCat("min_blob_pixels: ", 3 * std::max(now.min_blob_pixels, 4)));
  tries.push_back(now.shadows == Shadows::kIgnore ? "shadows: foreground" : "shadows: ignore");
  return tries;
}

}  // namespace

absl::StatusOr<std::vector<TuneVariant>> TuneVariants(const storage::v1::CellDescription& database,
                                                      const SegmentationSettings& of_cell_file,
                                                      const std::vector<std::string>& tries) {
  std::vector<TuneVariant> variants;
  const auto stored = SegmentationOf(database);
  if (stored.ok()) variants.push_back({"the database's", *stored});
  if (!stored.ok() || Describe(*stored) != Describe(of_cell_file)) {
    variants.push_back({"the cell file's", of_cell_file});
  }
  for (const std::string& text : tries.empty() ? Sweep(of_cell_file) : tries) {
    ASSIGN_OR_RETURN(const auto settings,
                     SegmentationIn(text, absl::StrCat("--try '", text, "'"), of_cell_file));
    if (settings != of_cell_file) {
      variants.push_back({text, settings});
    } else if (!tries.empty()) {
      return absl::InvalidArgumentError(
          absl::StrCat("--try '", text, "' changes nothing: the cell file says the same"));
    }
  }
  return variants;
}

}  // namespace silhouette
