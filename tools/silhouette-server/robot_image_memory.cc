#include "tools/silhouette-server/robot_image_memory.h"

#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "db/store/schema.h"
#include "db/store/writer_lock.h"

namespace silhouette {
namespace {

constexpr absl::Duration kBetweenReports = absl::Seconds(5);

std::string Gigabytes(uint64_t bytes) {
  return absl::StrFormat("%.2f GB", static_cast<double>(bytes) * 1e-9);
}

// The least memory.max of this process's control group and those it is in; `most` if none says any.
uint64_t MemoryOfGroup(uint64_t most) {
  std::ifstream groups("/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    if (!line.starts_with("0::/")) continue;  // those of version 1
    const std::filesystem::path root = "/sys/fs/cgroup";
    std::filesystem::path group = root / line.substr(4);
    while (true) {
      uint64_t bytes = 0;
      if (std::ifstream(group / "memory.max") >> bytes) most = std::min(most, bytes);
      if (group == root || !group.has_relative_path()) break;
      group = group.parent_path();
    }
  }
  return most;
}

}  // namespace

uint64_t AvailableMemory() {
  uint64_t bytes =
      static_cast<uint64_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
  bytes = MemoryOfGroup(bytes);
  for (const auto resource : {RLIMIT_AS, RLIMIT_DATA}) {
    rlimit limit{};
    if (getrlimit(resource, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY) {
      bytes = std::min<uint64_t>(bytes, limit.rlim_cur);
    }
  }
  return bytes;
}

LoadSettings LoadSettingsOf(const Cell& cell) {
  return {.robot_image_memory = cell.server.robot_image_memory.value_or(AvailableMemory() / 5 * 2),
          .variants_in_memory = cell.server.variants_in_memory,
          .progress =
              [last = absl::Now()](uint64_t done, uint64_t records) mutable {
                const absl::Time now = absl::Now();
                if (now - last < kBetweenReports) return;
                last = now;
                spdlog::info("read {} of {} robot images", done, records);
              },
          .fixed_joint_tolerance = cell.server.scene.fixed_joint_tolerance};
}

void LogRobotImages(const ServedDatabase& database, const std::string& path,
                    const LoadSettings& settings) {
  const RobotImageTable& images = database.robot_images();
  const uint64_t bytes =
      images.Count(RobotImageState::kPresent) * images.words() * sizeof(uint64_t);
  if (images.in_memory()) {
    spdlog::info("robot images: {}, in memory", Gigabytes(bytes));
  } else {
    spdlog::info(
        "robot images: {}, of which memory may hold {} (robot_image_memory): read from '{}' where "
        "they are needed",
        Gigabytes(bytes), Gigabytes(settings.robot_image_memory), path);
  }
  const bool reads_on = std::ranges::any_of(database.variants(), [&](const std::string& name) {
    const ServedDatabase& variant = *database.Variant(name);
    return !variant.robot_images().in_memory() || variant.index() != nullptr;
  });
  if (!reads_on || !ReadersKeepWritersOut(path)) return;
  spdlog::warn(
      "without permission to write '{}/{}' nobody can write into the database while it is served: "
      "no capture, no index; give this process that permission, or stop it before",
      path, schema::kLockFile);
}

}  // namespace silhouette
