// SPDX-License-Identifier: Apache-2.0
#include "db/store/robot_image_format.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <xxhash.h>

#include <random>

#include "db/store/schema.h"
#include "tests/db/store/test_cell.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

const std::vector<MaskSize> kSizes = {{64, 64}, {33, 20}};

RobotImage SomeImage(std::mt19937_64& random, bool noisy) {
  RobotImage image;
  image.number = random();
  image.captured = absl::FromUnixNanos(1'700'000'000'123'456'789);
  for (MaskSize size : kSizes) image.masks.push_back(RandomMask(size, random, noisy));
  image.commanded = {0.1, -2};
  image.measured = {0.1000001, -2, 7};
  return image;
}

TEST(RobotImageFormat, RoundTripsWithAndWithoutCompression) {
  std::mt19937_64 random(1);
  for (bool noisy : {false, true}) {
    for (int i = 0; i < 100; ++i) {
      const RobotImage image = SomeImage(random, noisy);
      const std::string value = EncodeRobotImage(image);
      EXPECT_EQ(value[9], noisy ? 0 : 1);
      const absl::StatusOr<RobotImage> decoded = DecodeRobotImage(image.number, value, kSizes);
      ASSERT_TRUE(decoded.ok()) << decoded.status();
      EXPECT_EQ(*decoded, image);
    }
  }
}

// DecodeMasks agrees with DecodeRobotImage on a value, whatever it is.
void ExpectSameMasks(ConfigurationNumber number, const std::string& value,
                     const std::vector<MaskSize>& sizes) {
  const absl::StatusOr<RobotImage> image = DecodeRobotImage(number, value, sizes);
  size_t room = 0;
  for (const MaskSize size : sizes) room += size.words();
  std::vector<uint64_t> words(room, ~uint64_t{0});
  const StoredMasks masks = DecodeMasks(number, value, sizes, words);
  if (!image.ok()) {
    EXPECT_EQ(masks, StoredMasks::kDamaged);
    return;
  }
  ASSERT_EQ(masks, image->excluded ? StoredMasks::kExcluded : StoredMasks::kPresent);
  if (image->excluded) return;
  std::vector<uint64_t> expected;
  for (const Mask& mask : image->masks) {
    expected.insert(expected.end(), mask.words().begin(), mask.words().end());
  }
  EXPECT_EQ(words, expected);
}

// `value` with the checksum that it needs.
std::string Sealed(ConfigurationNumber number, std::string value) {
  schema::Seal(value, number);
  return value;
}

TEST(RobotImageFormat, MasksAloneAreThoseOfTheWholeRecord) {
  Random random;
  for (int i = 0; i < 500; ++i) {
    RobotImage image = SomeImage(random, i % 2 == 0);
    if (i % 10 == 0) {
      image.excluded = true;
      image.masks.clear();
    }
    const std::string value = EncodeRobotImage(image);
    ExpectSameMasks(image.number, value, kSizes);
    ExpectSameMasks(image.number + 1, value, kSizes);
    ExpectSameMasks(image.number, value, {{64, 64}, {33, 21}});
    ExpectSameMasks(image.number, value, {{64, 64}, {33, 20}, {1, 1}});
    ExpectSameMasks(image.number, value.substr(0, random() % value.size()), kSizes);
    // Content that makes no sense, under a checksum that holds.
    std::string changed = value;
    changed[8 + random() % (changed.size() - 8)] ^= static_cast<char>(1 << random() % 8);
    ExpectSameMasks(image.number, Sealed(image.number, changed), kSizes);
    if (!image.excluded) changed.back() = '\x80';  // beyond the last pixel, if not compressed
    ExpectSameMasks(image.number, Sealed(image.number, changed), kSizes);
  }
}

TEST(RobotImageFormat, HasTheDocumentedBytes) {
  RobotImage image;
  image.number = 5;
  image.captured = absl::FromUnixNanos(0x0102030405060708);
  image.commanded = {1.0};
  image.masks = {Mask::FromPredicate({3, 2}, [](int x, int y) { return x == 2 && y == 0; })};
  const std::string value = EncodeRobotImage(image);
  const std::string after_checksum = {0,    0, 1, 0, 0, 0, 0,      0,       // flags to reserved
                                      8,    7, 6, 5, 4, 3, 2,      1,       // time
                                      0,    0, 0, 0, 0, 0, '\xf0', '\x3f',  // 1.0
                                      0b100};                               // the mask
  EXPECT_EQ(value.substr(8), after_checksum);
  EXPECT_EQ(schema::ReadU64(value.data()),
            XXH3_64bits_withSeed(after_checksum.data(), after_checksum.size(), 5));
}

TEST(RobotImageFormat, NoticesEveryFlippedBit) {
  std::mt19937_64 random(2);
  const RobotImage image = SomeImage(random, false);
  std::string value = EncodeRobotImage(image);
  for (size_t bit = 0; bit < 8 * value.size(); ++bit) {
    value[bit / 8] = static_cast<char>(value[bit / 8] ^ (1 << bit % 8));
    const absl::Status status = DecodeRobotImage(image.number, value, kSizes).status();
    ASSERT_EQ(status.code(), absl::StatusCode::kDataLoss) << "bit " << bit;
    value[bit / 8] = static_cast<char>(value[bit / 8] ^ (1 << bit % 8));
  }
}

TEST(RobotImageFormat, NoticesEveryTruncationAndAValueUnderAnotherKey) {
  std::mt19937_64 random(3);
  const RobotImage image = SomeImage(random, false);
  const std::string value = EncodeRobotImage(image);
  for (size_t length = 0; length < value.size(); ++length) {
    const absl::Status status =
        DecodeRobotImage(image.number, value.substr(0, length), kSizes).status();
    ASSERT_EQ(status.code(), absl::StatusCode::kDataLoss) << "length " << length;
  }
  const absl::Status moved = DecodeRobotImage(image.number + 1, value, kSizes).status();
  EXPECT_EQ(moved.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(moved.message(), HasSubstr("checksum"));
}

TEST(RobotImageFormat, RefusesMasksOfOtherViewsUnderAValidChecksum) {
  std::mt19937_64 random(4);
  for (bool noisy : {false, true}) {
    const RobotImage image = SomeImage(random, noisy);
    const std::vector<MaskSize> other = {{64, 64}, {33, 21}};
    const absl::Status status =
        DecodeRobotImage(image.number, EncodeRobotImage(image), other).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
    EXPECT_THAT(status.message(), HasSubstr("do not fit the views"));
  }
}

TEST(RobotImageFormat, KeysSortAsTheirNumbersDo) {
  std::mt19937_64 random(5);
  for (int i = 0; i < 1000; ++i) {
    const uint64_t a = random() >> (random() % 64);
    const uint64_t b = random() >> (random() % 64);
    const schema::NumberKey a_key = schema::EncodeKey(a);
    const schema::NumberKey b_key = schema::EncodeKey(b);
    const std::string_view a_bytes(a_key.data(), a_key.size());
    const std::string_view b_bytes(b_key.data(), b_key.size());
    EXPECT_EQ(a < b, a_bytes < b_bytes);
    EXPECT_EQ(schema::DecodeKey(a_bytes), a);
  }
  EXPECT_EQ(schema::DecodeKey("short"), std::nullopt);
}

}  // namespace
}  // namespace silhouette
