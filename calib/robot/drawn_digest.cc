// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawn_digest.h"

#include <xxhash.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>

#include "absl/strings/str_format.h"

namespace silhouette {
namespace {

// The numbers as bytes, little-endian.
class DigestBytes {
 public:
  void Add(int64_t number) {
    for (int shift = 0; shift < 64; shift += 8) {
      bytes_.push_back(static_cast<char>(static_cast<uint64_t>(number) >> shift));
    }
  }
  void Add(size_t number) { Add(static_cast<int64_t>(number)); }
  void Add(int number) { Add(static_cast<int64_t>(number)); }
  void Add(bool is) { Add(static_cast<int64_t>(is ? 1 : 0)); }
  void Add(double number) {
    const double rounded = std::round(number * 1e9) + 0.0;  // one zero: not a negative one
    int64_t bits = 0;
    std::memcpy(&bits, &rounded, sizeof(bits));
    Add(bits);
  }
  void Add(const std::string& text) {
    Add(text.size());
    bytes_ += text;
  }
  template <typename Derived>
  void Add(const Eigen::MatrixBase<Derived>& matrix) {
    Add(static_cast<int64_t>(matrix.cols()));
    for (Eigen::Index column = 0; column < matrix.cols(); ++column) {
      for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
        Add(static_cast<double>(matrix(row, column)));
      }
    }
  }

  std::string Digest() const {
    const XXH128_hash_t hash = XXH3_128bits(bytes_.data(), bytes_.size());
    return absl::StrFormat("%016x%016x", hash.high64, hash.low64);
  }

 private:
  std::string bytes_;
};

void AddChain(const KinematicChain& chain, DigestBytes& bytes) {
  bytes.Add(chain.joints().size());
  for (const ChainJoint& joint : chain.joints()) {
    bytes.Add(joint.name);
    bytes.Add(joint.continuous);
    bytes.Add(joint.lower);
    bytes.Add(joint.upper);
  }
  bytes.Add(chain.links().size());
  for (const ChainLink& link : chain.links()) {
    bytes.Add(link.parent);
    bytes.Add(link.joint);
    bytes.Add(link.slides);
    bytes.Add(link.factor);
    bytes.Add(link.offset);
    bytes.Add(link.parent_from_link.matrix());
    bytes.Add(link.axis);
  }
}

void AddView(const PartDrawer& view, DigestBytes& bytes) {
  const CameraIntrinsics& in = view.camera().intrinsics();
  bytes.Add(view.size().width);
  bytes.Add(view.size().height);
  bytes.Add(view.margin());
  bytes.Add(in.width);
  bytes.Add(in.height);
  for (const double number : {in.fx, in.fy, in.cx, in.cy}) bytes.Add(number);
  for (const double number : in.distortion) bytes.Add(number);
  bytes.Add(view.camera().camera_from_world().matrix());
}

}  // namespace

std::string DigestOf(const DrawnRobot& robot) {
  DigestBytes bytes;
  AddChain(robot.chain(), bytes);
  bytes.Add(robot.parts().size());
  for (const RobotPart& part : robot.parts()) {
    bytes.Add(part.link);
    bytes.Add(part.moves_with);
    bytes.Add(part.radius);
    bytes.Add(part.points);
    bytes.Add(part.inner);
  }
  bytes.Add(robot.views().size());
  for (const PartDrawer& view : robot.views()) AddView(view, bytes);
  return bytes.Digest();
}

}  // namespace silhouette
