// SPDX-License-Identifier: Apache-2.0
// TagFamily: the tags of one of the AprilTag library's families, or the markers of one of OpenCV's
// ArUco dictionaries, as modules, its black and white squares.
#pragma once

#include <memory>
#include <string>
#include <vector>

struct apriltag_family;

namespace silhouette {

// The modules of a tag, row by row from the top left of its print, seen from the front.
struct TagModules {
  int width = 0;            // modules per row, and rows
  std::vector<bool> white;  // width * width of them
  bool White(int column, int row) const { return white[static_cast<size_t>(row) * width + column]; }
};

// The library's own object. Not thread-safe, and good for one detector at a time.
using AprilTagFamily = std::unique_ptr<apriltag_family, void (*)(apriltag_family*)>;

// tag36h11 with a black border of two modules, as Kalibr prints AprilGrids.
inline constexpr char kKalibrFamily[] = "tag36h11b2";

class TagFamily {
 public:
  // Throws std::invalid_argument, with the families there are and the nearest, for any other name.
  explicit TagFamily(const std::string& name);

  // The library's: tagStandard41h12, tag36h11, ...; the default first.
  static const std::vector<std::string>& Names();

  const std::string& name() const { return name_; }
  // Whether it is a dictionary, such as DICT_4X4_50. The rim of its prints may overlap.
  bool is_dictionary() const { return !family_; }
  // The ids are 0 to tags() - 1.
  int tags() const;
  // Modules along a side of the print.
  int total_width() const;
  // Modules between the corners that are detected; they lie in the middle of the print.
  int width_at_border() const;
  // Modules from the square's edge between the corners to the first that differ from tag to tag.
  int border() const { return name_ == kKalibrFamily ? 2 : 1; }
  // Whether the square between the corners is white at its rim and black around it, instead of
  // black in white.
  bool reversed_border() const;

  // Throws std::out_of_range if there is no such id.
  TagModules Modules(int id) const;

  // A new one of the library's, of this family. Throws std::invalid_argument for a dictionary.
  AprilTagFamily Library() const;

 private:
  std::string name_;
  std::shared_ptr<apriltag_family> family_;  // of a dictionary: null
};

}  // namespace silhouette
