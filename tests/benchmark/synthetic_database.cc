// SPDX-License-Identifier: Apache-2.0
#include "tests/benchmark/synthetic_database.h"

#include <random>
#include <stdexcept>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/clock.h"
#include "capture/segmentation/reference.h"
#include "db/store/store.h"
#include "server/scene/make_scene.h"
#include "tests/capture/segmentation/images.h"

namespace silhouette::benchmarks {
namespace {

void Require(const absl::Status& status) {
  if (!status.ok()) throw std::runtime_error(std::string(status.message()));
}

template <typename T>
T Required(absl::StatusOr<T> value) {
  Require(value.status());
  return *std::move(value);
}

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
  for (int view = 0; view < kViews; ++view) {
    storage::v1::View& added = *description.add_views();
    added.set_name(ViewName(view));
    added.set_image_width(EmptyCellPicture().cols);
    added.set_image_height(EmptyCellPicture().rows);
    added.set_mask_width(cell.mask_size().width);
    added.set_mask_height(cell.mask_size().height);
  }
  return description;
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

storage::v1::References References() {
  std::mt19937_64 random(1);
  const Reference reference =
      Reference::FromImages(ExposeSeries(EmptyCellPicture(), 20, 1.5, random));
  storage::v1::References references;
  for (int view = 0; view < kViews; ++view) {
    storage::v1::Reference& added = *references.add_views();
    added.set_mean_png(reference.MeanPng());
    added.set_noise_png(reference.NoisePng());
    added.set_images(20);
  }
  return references;
}

}  // namespace

std::string ViewName(int view) { return "view_" + std::to_string(view + 1); }

cv::Mat EmptyCellPicture() {
  static const cv::Mat picture = EmptyCell({640, 480});
  return picture;
}

void WriteDatabase(const SyntheticCell& cell, const std::string& path) {
  const auto database = Required(Database::Create(path, DescriptionOf(cell)));
  auto writer = Required(database->Write("silhouette-bench", absl::InfiniteDuration()));
  cell.ForEachTile([&](const TileMasks& tile) {
    for (uint64_t place = 0; place < kTileSize; ++place) {
      if (tile.present(place)) Require(writer.Put(ImageOf(cell, tile, place)));
    }
  });
  Require(writer.Commit());
  Require(database->SetReferences(References(), "silhouette-bench"));
}

TimedBuild BuildIndex(const std::string& path) {
  const auto database = Required(Database::Open(path, Database::Access::kWrite));
  const absl::Time begin = absl::Now();
  TimedBuild build{.report = Required(BuildCollisionIndex(*database))};
  build.time = absl::ToDoubleNanoseconds(absl::Now() - begin);
  return build;
}

uint64_t BytesInUse(const std::string& path) {
  const auto database = Required(Database::Open(path, Database::Access::kRead));
  return Required(database->GetUsage()).used_bytes;
}

std::shared_ptr<const ServedDatabase> LoadDatabase(const std::string& path,
                                                   const LoadSettings& settings) {
  const auto database = Required(Database::Open(path, Database::Access::kRead));
  return Required(ServedDatabase::Load(*database, {}, {}, std::nullopt, settings));
}

Served ServedScene(const std::shared_ptr<const ServedDatabase>& database,
                   const BenchmarkScene& scene) {
  SceneInput input;
  for (size_t joint = 0; joint < scene.robot.size(); ++joint) {
    input.joints.push_back({database->grid().joints()[joint].name, scene.robot[joint]});
  }
  for (int view = 0; view < kViews; ++view) {
    const ObstacleImage& image = *scene.images[static_cast<size_t>(view)];
    input.views.push_back(
        {ViewName(view), std::nullopt, SceneMask{image.obstacle() | image.unknown()}});
  }
  Scene made = Required(silhouette::MakeScene(*database, input, {}, {}, SystemClock()));
  made.id = 1;
  return {.database = database,
          .scene = std::make_shared<const Scene>(std::move(made)),
          .without_scene = Reason::kNone};
}

}  // namespace silhouette::benchmarks
