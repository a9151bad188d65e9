// SPDX-License-Identifier: Apache-2.0
// BoardDetector: the marks of boards of all kinds in an image.
//
// Tags are TagDetector's, circles DetectCircles'. A chessboard must be seen whole (OpenCV's
// sector-based detector); of a
// ChArUco board each inner corner beside a marker that is seen. One whose rows and columns are
// exchanged in its description gives marks of the board that it is, with another family. Their
// corners lie where the fitted edges of their squares meet; where squares are too small, the
// detector's or a corner of the grey values' gradients is kept, with a larger sigma.
#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/boards/board.h"
#include "calib/detection/tag_detector.h"

namespace silhouette {

class BoardDetector {
 public:
  // Throws std::invalid_argument for boards that CheckBoards refuses, or none.
  explicit BoardDetector(std::vector<Board> boards);

  const std::vector<Board>& boards() const { return boards_; }

  // Marks of the boards, and tags of their families that are on none. `image`: CV_8UC1. Not
  // thread-safe. Throws std::invalid_argument for another type of image.
  std::vector<DetectedTag> Detect(const cv::Mat& image,
                                  const std::optional<CameraModel>& lens = std::nullopt);

 private:
  std::vector<Board> boards_;
  std::optional<TagDetector> tags_;  // nothing: no board has any
};

// The families of the boards' tags, each once.
std::vector<std::string> FamiliesOf(std::span<const Board> boards);

// The size of the chessboard in an image that shows one; columns are not fewer than rows.
std::optional<GridSize> ChessboardIn(const cv::Mat& image);

// The ArUco dictionary, the smallest, whose markers an image shows several of; empty: none.
std::string DictionaryIn(const cv::Mat& image);

// The marks of one chessboard or ChArUco board; none if it is not seen. Arguments as of Detect.

std::vector<DetectedTag> DetectChessboard(const Board& board, const cv::Mat& image,
                                          const std::optional<CameraModel>& lens);
std::vector<DetectedTag> DetectCharuco(const Board& board, const cv::Mat& image,
                                       const std::optional<CameraModel>& lens);

}  // namespace silhouette
