// SPDX-License-Identifier: Apache-2.0
#include "calib/boards/tag_family.h"

#include <apriltag/apriltag.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagCircle49h12.h>
#include <apriltag/tagCustom48h12.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>
extern "C" {
#include <apriltag/common/image_u8.h>
}

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "calib/boards/charuco.h"
#include "common/yaml/strict_yaml.h"

namespace silhouette {
namespace {

struct Maker {
  const char* name;
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t*);
};

apriltag_family_t* CreateKalibr() {
  apriltag_family_t* family = tag36h11_create();
  family->width_at_border += 2;
  family->total_width += 2;
  for (uint32_t i = 0; i < family->nbits; ++i) {
    ++family->bit_x[i];
    ++family->bit_y[i];
  }
  return family;
}

constexpr Maker kMakers[] = {
    {"tagStandard41h12", tagStandard41h12_create, tagStandard41h12_destroy},
    {"tagStandard52h13", tagStandard52h13_create, tagStandard52h13_destroy},
    {"tag36h11", tag36h11_create, tag36h11_destroy},
    {kKalibrFamily, CreateKalibr, tag36h11_destroy},
    {"tag36h10", tag36h10_create, tag36h10_destroy},
    {"tag25h9", tag25h9_create, tag25h9_destroy},
    {"tag16h5", tag16h5_create, tag16h5_destroy},
    {"tagCircle21h7", tagCircle21h7_create, tagCircle21h7_destroy},
    {"tagCircle49h12", tagCircle49h12_create, tagCircle49h12_destroy},
    {"tagCustom48h12", tagCustom48h12_create, tagCustom48h12_destroy},
};

AprilTagFamily Create(const std::string& name) {
  for (const Maker& maker : kMakers) {
    if (name == maker.name) return {maker.create(), maker.destroy};
  }
  const std::string near = NearestWord(name, TagFamily::Names());
  throw std::invalid_argument("there is no tag family '" + name + "'" +
                              (near.empty() ? "" : ", did you mean '" + near + "'?") +
                              " The families are " + ListOfWords(TagFamily::Names()) +
                              ", and OpenCV's dictionaries of ArUco markers, such as DICT_4X4_50");
}

// Which modules carry data or border. The others, around a round tag or in the hollow of a nested
// one, are left as paper: the library draws them black.
std::vector<bool> MeaningfulModules(const apriltag_family& family, int border) {
  const int width = family.total_width;
  const int start = (width - family.width_at_border) / 2;
  std::vector<bool> meaningful(static_cast<size_t>(width) * width);
  for (uint32_t i = 0; i < family.nbits; ++i) {
    const int column = static_cast<int>(family.bit_x[i]) + start;
    const int row = static_cast<int>(family.bit_y[i]) + start;
    meaningful[static_cast<size_t>(row) * width + column] = true;
  }
  const auto mark_ring = [&](int from) {
    const int to = width - 1 - from;
    for (int i = from; i <= to; ++i) {
      for (const auto& [column, row] : {std::pair{i, from}, {i, to}, {from, i}, {to, i}}) {
        meaningful[static_cast<size_t>(row) * width + column] = true;
      }
    }
  };
  for (int ring = -1; ring < border; ++ring) mark_ring(start + ring);
  return meaningful;
}

}  // namespace

TagFamily::TagFamily(const std::string& name) : name_(name) {
  if (name.starts_with("DICT_")) {
    ArucoDictionary(name);  // throws
  } else {
    family_ = Create(name);
  }
}

const std::vector<std::string>& TagFamily::Names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const Maker& maker : kMakers) all.push_back(maker.name);
    return all;
  }();
  return names;
}

int TagFamily::tags() const {
  return family_ ? static_cast<int>(family_->ncodes) : ArucoDictionary(name_)->bytesList.rows;
}
int TagFamily::total_width() const {
  return family_ ? family_->total_width : width_at_border() + 2;
}
int TagFamily::width_at_border() const {
  return family_ ? family_->width_at_border : ArucoDictionary(name_)->markerSize + 2;
}
bool TagFamily::reversed_border() const { return family_ && family_->reversed_border; }

TagModules TagFamily::Modules(int id) const {
  if (id < 0 || id >= tags()) {
    throw std::out_of_range(name_ + " has no tag " + std::to_string(id) + ", its ids are 0 to " +
                            std::to_string(tags() - 1));
  }
  if (!family_) {
    const TagModules marker = ArucoModules(*ArucoDictionary(name_), id);
    TagModules modules{.width = marker.width + 2, .white = {}};
    for (int row = -1; row <= marker.width; ++row) {
      for (int column = -1; column <= marker.width; ++column) {
        const bool rim = std::min(row, column) < 0 || std::max(row, column) == marker.width;
        modules.white.push_back(rim || marker.White(column, row));
      }
    }
    return modules;
  }
  const std::vector<bool> meaningful = MeaningfulModules(*family_, border());
  image_u8_t* image = apriltag_to_image(family_.get(), id);
  TagModules modules{.width = total_width(), .white = std::vector<bool>(meaningful.size())};
  for (int row = 0; row < modules.width; ++row) {
    for (int column = 0; column < modules.width; ++column) {
      const size_t i = static_cast<size_t>(row) * modules.width + column;
      modules.white[i] = !meaningful[i] || image->buf[row * image->stride + column] != 0;
    }
  }
  image_u8_destroy(image);
  return modules;
}

AprilTagFamily TagFamily::Library() const { return Create(name_); }

}  // namespace silhouette
