#include "tests/benchmark/synthetic_database.h"

#include <stdexcept>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/clock.h"
#include "db/store.h"

namespace silhouette::benchmarks {
namespace {

void Require(const absl::Status& status) {
  if (!status.ok()) throw std::runtime_error(std::string(status.message()));
}

RobotImage ImageOf(const SyntheticCell& cell, const TileMasks& tile, uint64_t place) {
  RobotImage image;
  image.number = tile.tile() * kTileSize + place;
  for (int view = 0; view < kViews; ++view) {
    const MaskWords words = tile.mask(view, place);
    image.masks.push_back(Mask::FromWords(cell.mask_size(), {words.begin(), words.end()}));
  }
  image.captured = absl::Now();
  image.commanded = cell.grid().At(image.number);
  image.measured = image.commanded;
  return image;
}

}  // namespace

storage::v1::CellDescription DescriptionOf(const SyntheticCell& cell) {
  storage::v1::CellDescription description;
  description.set_name("synthesised");
  for (const GridJoint& joint : cell.grid().joints()) {
    storage::v1::GridJoint& added = *description.add_grid_joints();
    added.set_name(joint.name);
    added.set_lower(joint.lower);
    added.set_upper(joint.upper);
    added.set_steps(joint.steps);
  }
  for (const int edge : cell.grid().tile_edges()) description.add_tile_edges(edge);
  for (int view = 1; view <= kViews; ++view) {
    storage::v1::View& added = *description.add_views();
    added.set_name("view_" + std::to_string(view));
    added.set_mask_width(cell.mask_size().width);
    added.set_mask_height(cell.mask_size().height);
  }
  return description;
}

void WriteDatabase(const SyntheticCell& cell, const std::string& path) {
  const auto database = Database::Create(path, DescriptionOf(cell));
  Require(database.status());
  auto writer = (*database)->Write("silhouette-bench", absl::InfiniteDuration());
  Require(writer.status());
  cell.ForEachTile([&](const TileMasks& tile) {
    for (uint64_t place = 0; place < kTileSize; ++place) {
      if (tile.present(place)) Require(writer->Put(ImageOf(cell, tile, place)));
    }
  });
  Require(writer->Commit());
}

}  // namespace silhouette::benchmarks
