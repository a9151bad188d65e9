// SPDX-License-Identifier: Apache-2.0
#include <xxhash.h>

#include <cstring>

#include "db/index/tile_index.h"
#include "db/store/raw_image_format.h"
#include "db/store/robot_image_format.h"
#include "db/store/tile_value.h"
#include "tests/robustness/parsers/targets.h"
#include "tests/server/test_cell.h"

namespace silhouette {
namespace {

constexpr uint64_t kNumber = 5;

// The value with the checksum that it should have: what a checksum keeps out is not to be all that
// keeps damage out.
std::string WithChecksum(std::string_view bytes, uint64_t seed) {
  std::string value(bytes);
  if (value.size() < 8) return value;
  const uint64_t checksum = XXH3_64bits_withSeed(value.data() + 8, value.size() - 8, seed);
  std::memcpy(value.data(), &checksum, sizeof(checksum));
  return value;
}

RobotImage AnyRobotImage(int b) {
  RobotImage image = TestRobotImage(*GridOf(ServerTestCell()), 2, b);
  image.number = kNumber;
  image.commanded = image.measured = {2, 0.5, 0.5};
  return image;
}

void ParseRobotImage(std::string_view bytes) {
  static const std::string base = EncodeRobotImage(AnyRobotImage(1));
  const std::string value = WithChecksum(bytes, kNumber);
  std::vector<double> measured;
  if (DecodeRobotImage(kNumber, value, kViewSizes, base).ok()) ReadMeasured(value, measured);
  std::vector<uint64_t> words;
  for (const MaskSize& size : kViewSizes) words.resize(words.size() + Mask(size).words().size());
  DecodeMasks(kNumber, value, kViewSizes, words, base);
  SharedValue(kNumber, value, base, kViewSizes);
  OwnValue(kNumber, value, base, kViewSizes);
}

std::vector<std::string> RobotImageSeeds() {
  const std::string base = EncodeRobotImage(AnyRobotImage(1));
  const std::string value = EncodeRobotImage(AnyRobotImage(4));
  RobotImage excluded = AnyRobotImage(2);
  excluded.excluded = true;
  excluded.masks.clear();
  return {value, EncodeRobotImage(excluded),
          SharedValue(kNumber, value, base, kViewSizes).value_or(value)};
}

void ParseRawImage(std::string_view bytes) {
  DecodeRawImage(kNumber, 1, WithChecksum(bytes, kNumber ^ uint64_t{1} << 56)).IgnoreError();
  NumberInRawImageKey(bytes);
}

std::vector<std::string> RawImageSeeds() {
  return {
      EncodeRawImage(kNumber, 1, {.references = 7, .png = PngOf(CameraPicture(1, Block(1, 2)))}),
      EncodeRawImageKey(kNumber, 1)};
}

const std::vector<PixelTree>& Trees() {
  static const std::vector<PixelTree> trees(kViewSizes.begin(), kViewSizes.end());
  return trees;
}

void ParseTile(std::string_view bytes) {
  TileHeaderIn(bytes);
  TileValueHolds(3, bytes);
  std::vector<uint64_t> aligned((bytes.size() + 7) / 8);
  std::memcpy(aligned.data(), bytes.data(), bytes.size());
  try {
    const TileIndex index(std::as_bytes(std::span(aligned)).first(bytes.size()), Trees());
    for (int view = 0; view < index.views(); ++view) {
      const PixelTree& tree = Trees()[static_cast<size_t>(view)];
      const Nodes nodes = tree.Cover(Block(view, 2) | RobotMask(view, 1, 3));
      PlaceSet touching;
      index.AddTouching(view, nodes, touching);
      index.AnyTouches(view, nodes);
      for (uint64_t place = 0; place < 64; ++place) {
        if (index.present().Contains(place)) index.Image(view, place);
      }
    }
  } catch (const std::invalid_argument&) {
  }
}

std::vector<std::string> TileSeeds() {
  TileIndexBuilder builder(Trees());
  for (int b = 0; b < 8; ++b) {
    std::vector<Mask> masks;
    for (int view = 0; view < 3; ++view) masks.push_back(RobotMask(view, b % 5, b));
    std::vector<MaskWords> words;
    for (const Mask& mask : masks) words.push_back(mask.words());
    builder.Add(static_cast<uint64_t>(3 * b), words);
  }
  const std::vector<std::byte> bytes = builder.Finish();
  return {{reinterpret_cast<const char*>(bytes.data()), bytes.size()}};
}

// The file of a small database, with an index.
const std::string& SoundFile() {
  static const std::string file = [] {
    const std::string path = FreshFolder() / "db";
    MakeDatabase(path, {.references = true, .index = true, .calibration = TestCalibration()});
    std::ifstream in(path + "/data.mdb", std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
  }();
  return file;
}

// Edits of a sound file, five bytes each: page (1), place in it (2), how many bytes (1), what is
// added to each of them (1). Then everything is read.
void ParseDatabase(std::string_view bytes) {
  std::string file = SoundFile();
  for (; bytes.size() >= 5; bytes.remove_prefix(5)) {
    const auto byte = [&](size_t i) { return static_cast<size_t>(static_cast<uint8_t>(bytes[i])); };
    const size_t at = byte(0) * 4096 + byte(1) % 16 * 256 + byte(2);
    for (size_t i = at; i <= at + byte(3) % 16; ++i) {
      file[i % file.size()] = static_cast<char>(file[i % file.size()] + bytes[4]);
    }
  }
  static const std::string path = FreshFolder() / "db";
  std::filesystem::create_directories(path);
  std::ofstream(path + "/data.mdb", std::ios::binary) << file;
  const auto database = Database::Open(path, Database::Access::kRead);
  if (!database.ok()) return;
  ServedDatabase::Load(**database).IgnoreError();
  const auto snapshot = (*database)->Read();
  if (!snapshot.ok()) return;
  snapshot->RawImageNumbers().IgnoreError();
  snapshot->Provenance().IgnoreError();
  snapshot->CaptureHistory().IgnoreError();
  (*database)->GetUsage().IgnoreError();
}

std::vector<std::string> DatabaseSeeds() {
  std::vector<std::string> seeds;
  for (uint8_t page = 0; page < SoundFile().size() / 4096; ++page) {
    for (const uint8_t place : {0, 10, 12, 16, 40, 128, 144}) {
      seeds.push_back({static_cast<char>(page), 0, static_cast<char>(place), 0, 1});
    }
  }
  return seeds;
}

constexpr FuzzTarget kDatabaseTargets[] = {
    {"robot_image", ParseRobotImage, RobotImageSeeds},
    {"raw_image", ParseRawImage, RawImageSeeds},
    {"tile", ParseTile, TileSeeds},
    {"database", ParseDatabase, DatabaseSeeds},
};

}  // namespace

std::span<const FuzzTarget> DatabaseTargets() { return kDatabaseTargets; }

}  // namespace silhouette
