// SPDX-License-Identifier: Apache-2.0
#include "calib/boards/charuco.h"

#include <array>
#include <stdexcept>

#include "common/yaml/strict_yaml.h"

namespace silhouette {
namespace {

// In the order of OpenCV's numbers.
constexpr std::array kNames = {
    "DICT_4X4_50",         "DICT_4X4_100",       "DICT_4X4_250",       "DICT_4X4_1000",
    "DICT_5X5_50",         "DICT_5X5_100",       "DICT_5X5_250",       "DICT_5X5_1000",
    "DICT_6X6_50",         "DICT_6X6_100",       "DICT_6X6_250",       "DICT_6X6_1000",
    "DICT_7X7_50",         "DICT_7X7_100",       "DICT_7X7_250",       "DICT_7X7_1000",
    "DICT_ARUCO_ORIGINAL", "DICT_APRILTAG_16h5", "DICT_APRILTAG_25h9", "DICT_APRILTAG_36h10",
    "DICT_APRILTAG_36h11",
};
static_assert(kNames.size() == cv::aruco::DICT_APRILTAG_36h11 + 1);

}  // namespace

std::vector<std::string> ArucoDictionaryNames() { return {kNames.begin(), kNames.end()}; }

cv::Ptr<cv::aruco::Dictionary> ArucoDictionary(const std::string& name) {
  for (size_t i = 0; i < kNames.size(); ++i) {
    if (name == kNames[i]) return cv::aruco::Dictionary::get(static_cast<int>(i));
  }
  const std::string near = NearestWord(name, ArucoDictionaryNames());
  throw std::invalid_argument("there is no dictionary '" + name + "'" +
                              (near.empty() ? "" : ", did you mean '" + near + "'?") +
                              " The dictionaries are " + ListOfWords(ArucoDictionaryNames()));
}

TagModules ArucoModules(const cv::aruco::Dictionary& dictionary, int id) {
  if (id < 0 || id >= dictionary.bytesList.rows) {
    throw std::out_of_range("the dictionary has no marker " + std::to_string(id));
  }
  const cv::Mat bits = cv::aruco::Dictionary::getBitsFromByteList(
      dictionary.bytesList.rowRange(id, id + 1), dictionary.markerSize);
  TagModules modules{.width = dictionary.markerSize + 2, .white = {}};
  for (int row = -1; row <= bits.rows; ++row) {
    for (int column = -1; column <= bits.cols; ++column) {
      const bool inside = row >= 0 && row < bits.rows && column >= 0 && column < bits.cols;
      modules.white.push_back(inside && bits.at<uchar>(row, column) != 0);
    }
  }
  return modules;
}

std::vector<CharucoMarker> MarkersOf(const BoardDescription& charuco) {
  std::vector<CharucoMarker> markers;
  for (int row = 0; row < charuco.rows; ++row) {
    for (int column = 0; column < charuco.columns; ++column) {
      if (IsBlackSquare(charuco, row, column)) continue;
      markers.push_back({.id = charuco.first_id + static_cast<int>(markers.size()),
                         .row = row,
                         .column = column});
    }
  }
  return markers;
}

bool IsBlackSquare(const BoardDescription& board, int row, int column) {
  const bool white_first = board.legacy && board.rows % 2 == 0;
  return (row + column) % 2 == (white_first ? 1 : 0);
}

}  // namespace silhouette
