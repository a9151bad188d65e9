// SPDX-License-Identifier: Apache-2.0
// The ArUco markers in the white squares of a ChArUco board.
#pragma once

#include <opencv2/aruco/dictionary.hpp>
#include <string>
#include <vector>

#include "calib/boards/board.h"
#include "calib/boards/tag_family.h"

namespace silhouette {

// DICT_4X4_50, DICT_APRILTAG_36h11, ...: OpenCV's dictionaries.
std::vector<std::string> ArucoDictionaryNames();

// Throws std::invalid_argument, with the dictionaries there are and the nearest, for another name.
cv::Ptr<cv::aruco::Dictionary> ArucoDictionary(const std::string& name);

// A marker with its border of one black module. Throws std::out_of_range if there is no such id.
TagModules ArucoModules(const cv::aruco::Dictionary& dictionary, int id);

// One marker of a board, and the square in whose middle it is.
struct CharucoMarker {
  int id = 0;
  int row = 0;  // from the print's top left square
  int column = 0;
};

// Row by row. The board's square in that corner is black, but for a legacy board of an even number
// of rows.
std::vector<CharucoMarker> MarkersOf(const BoardDescription& charuco);

// Whether the square of a chessboard or ChArUco board is black. The one at the print's top left is,
// but for legacy boards as above.
bool IsBlackSquare(const BoardDescription& board, int row, int column);

}  // namespace silhouette
