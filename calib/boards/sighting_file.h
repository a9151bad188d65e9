// SPDX-License-Identifier: Apache-2.0
// Sightings of boards' marks as a CSV file, one line per corner:
//
//   frame,view,family,tag,corner,x,y,sigma,width,height
//   0007,left,tagStandard41h12,12,0,311.0627,208.9413,0.013,640,480
//   0008,left,chessboard-9x6,12,0,305.1133,97.0284,0.021,640,480
//
// family: Board::family(); tag: the mark's id; corner: 0 to 3 of a tag, else 0, in the order of
// Board::CornersOf; x, y and sigma in pixels, integers at pixel centres; width and height of the
// image in pixels, 0 if not known. A file may lack these two columns. Numbers are written so that
// reading gives the same ones.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "calib/camera/pixel_size.h"

namespace silhouette {

// TagSighting: one mark of a board (a tag, or a corner of a chessboard) seen in one image. What all
// of calibration starts from.

struct TagSighting {
  std::string frame;   // images with the same frame were taken at once, of a cell that stood still
  std::string view;    // the camera
  std::string family;  // of the mark, as Board::family
  int tag = 0;         // its id
  // Pixels of the camera's image, integers at pixel centres; in the order of Board::CornersOf.
  std::vector<Eigen::Vector2d> corners = {};
  double sigma = 0;      // standard deviation of a corner per axis, pixels
  PixelSize image = {};  // of the camera's image; 0: not known
};

// What the sightings say of the size of a view's images; nothing: not known.
std::optional<PixelSize> ImageSizeOf(std::span<const TagSighting> sightings,
                                     const std::string& view);

// InvalidArgument if the corners of `view` are of images of another size than `stated`. `what`:
// what the message calls that size, e.g. "the image size of its camera model".
absl::Status CheckImageSize(std::span<const TagSighting> sightings, const std::string& view,
                            PixelSize stated, const std::string& what);

// Throws std::invalid_argument for what could not be read again: a frame, view or family with a
// line break or without a name, no corner or more than four, a number that is not finite, a sigma
// that is not positive.
std::string SightingFileText(std::span<const TagSighting> sightings);

// In the order of the file. `file`: what messages call it. InvalidArgument with file and line: not
// such a table, an empty name, a negative tag, a corner that is not 0 to 3 or is there twice, a
// mark whose corners are neither one nor four, not as many as others of its family have, or of
// different sigma, a number that is not finite, a sigma that is not positive, images of a view that
// differ in size.
absl::StatusOr<std::vector<TagSighting>> SightingsFromText(const std::string& text,
                                                           const std::string& file);

}  // namespace silhouette
