// SPDX-License-Identifier: Apache-2.0
// The colours of all pictures, after Okabe & Ito. Colour-blind people can distinguish them, too;
// in grey print they differ by lightness.
#pragma once

#include <cstdint>

namespace silhouette {

struct Colour {
  uint8_t red = 0;
  uint8_t green = 0;
  uint8_t blue = 0;
  bool operator==(const Colour&) const = default;
};

namespace palette {

inline constexpr Colour kPaper{255, 255, 255};
inline constexpr Colour kInk{34, 34, 34};
inline constexpr Colour kFaint{190, 190, 190};  // frames and ticks

// The planes of an obstacle image, and the robot in a view.
inline constexpr Colour kBackground{236, 236, 236};
inline constexpr Colour kObstacle{213, 94, 0};
inline constexpr Colour kUnknown{86, 180, 233};
inline constexpr Colour kError{240, 228, 66};
inline constexpr Colour kRobot{0, 114, 178};
// Unknown pixels: of an allowed region, and such as never prove anything.
inline constexpr Colour kAllowed{204, 121, 167};
inline constexpr Colour kIgnored{130, 130, 130};

// The configuration space.
inline constexpr Colour kFree{247, 247, 247};
inline constexpr Colour kOccupied{140, 140, 140};
inline constexpr Colour kTight{230, 159, 0};  // free with the least clearance; more fades to kFree
inline constexpr Colour kTruth{213, 94, 0};
inline constexpr Colour kPath{0, 114, 178};
inline constexpr Colour kStart{0, 158, 115};
inline constexpr Colour kGoal{204, 121, 167};

// Records of a database.
inline constexpr Colour kCaptured{0, 158, 115};
inline constexpr Colour kExcluded{204, 121, 167};
inline constexpr Colour kMissing{236, 236, 236};
inline constexpr Colour kDamaged{213, 94, 0};

}  // namespace palette
}  // namespace silhouette
