// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/people/study.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <set>
#include <sstream>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/parallel/parallel.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"

namespace silhouette::people_experiment {
namespace {

std::string HeaderOf(const Study& study) {
  return nlohmann::ordered_json({{"seconds", study.episode.seconds},
                                 {"seed", study.episode.seed},
                                 {"people_stop", study.episode.people_stop},
                                 {"rendered", study.episode.rendered},
                                 {"basis", study.basis}})
      .dump();
}

// The results that the file holds already. A line that was cut short is left out, and overwritten.
absl::StatusOr<std::vector<EpisodeResult>> ReadResults(const Study& study) {
  std::vector<EpisodeResult> results;
  std::string kept = HeaderOf(study) + "\n";
  if (std::filesystem::exists(study.file)) {
    ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(study.file));
    std::istringstream lines(text);
    std::string line;
    std::getline(lines, line);
    if (line != HeaderOf(study)) {
      return absl::FailedPreconditionError(
          absl::StrCat("'", study.file, "' has results of other settings or of another build (",
                       line, "); name another folder with --out, or remove the file"));
    }
    while (std::getline(lines, line)) {
      const auto json = nlohmann::json::parse(line, nullptr, /*allow_exceptions=*/false);
      if (json.is_discarded()) continue;
      try {
        results.push_back({json.at("episode").get<int>(), json.at("method").get<std::string>(),
                           Counts::From(json)});
      } catch (const nlohmann::json::exception&) {
        continue;
      }
      absl::StrAppend(&kept, line, "\n");
    }
  }
  RETURN_IF_ERROR(WriteWholeFile(study.file, kept));
  return results;
}

// Keeps other studies out of the folder of the results, until it is destroyed.
class FolderLock {
 public:
  FolderLock() = default;
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;
  ~FolderLock() {
    if (folder_ >= 0) close(folder_);
  }

  // FailedPrecondition: another study has it.
  absl::Status Take(const std::filesystem::path& folder) {
    folder_ = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder_ < 0 || flock(folder_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) {
      return absl::OkStatus();  // what is wrong with the folder is said when the file is written
    }
    return absl::FailedPreconditionError(
        absl::StrCat("another process writes its results to '", folder.string(),
                     "'; wait for its end, or name another folder with --out"));
  }

 private:
  int folder_ = -1;
};

// Appends results to the file, whichever thread has them.
class Keeper {
 public:
  Keeper(const Study& study, std::vector<EpisodeResult> results)
      : results_(std::move(results)), done_(results_.size()) {
    if (!study.file.empty()) file_.open(study.file, std::ios::app);
  }

  // How many are done, or the error.
  absl::StatusOr<size_t> Keep(EpisodeResult result) {
    nlohmann::ordered_json json = {{"episode", result.episode}, {"method", result.method}};
    json.update(result.counts.ToJson());
    const std::lock_guard lock(mutex_);
    if (file_.is_open() && !(file_ << json.dump() << "\n" << std::flush)) {
      return absl::ResourceExhaustedError("a result could not be written; is the disk full?");
    }
    results_.push_back(std::move(result));
    return ++done_;
  }

  std::vector<EpisodeResult> Take() { return std::move(results_); }

 private:
  std::mutex mutex_;
  std::vector<EpisodeResult> results_;
  size_t done_;
  std::ofstream file_;
};

}  // namespace

absl::StatusOr<std::vector<EpisodeResult>> RunStudy(const Stage& stage, const Study& study,
                                                    const StudyProgress& progress,
                                                    const std::function<bool()>& stop) {
  std::vector<EpisodeResult> before;
  FolderLock folder;
  if (!study.file.empty()) {
    RETURN_IF_ERROR(folder.Take(std::filesystem::path(study.file).parent_path()));
    ASSIGN_OR_RETURN(before, ReadResults(study));
  }
  std::erase_if(before, [&](const EpisodeResult& result) {
    return result.episode >= study.episodes ||
           std::ranges::count(study.methods, result.method) == 0;
  });
  std::set<std::pair<int, std::string>> done;
  for (const EpisodeResult& result : before) done.insert({result.episode, result.method});
  std::vector<std::pair<int, std::string>> left;
  for (int episode = 0; episode < study.episodes; ++episode) {
    for (const std::string& method : study.methods) {
      if (!done.contains({episode, method})) left.emplace_back(episode, method);
    }
  }
  const size_t kept_before = done.size();
  Keeper keeper(study, std::move(before));
  std::mutex mutex;
  absl::Status status;
  ParallelWhile(left.size(), [&](size_t i) {
    const auto& [episode, method] = left[i];
    auto counts = RunEpisode(stage, study.episode, episode, method, stop);
    const absl::StatusOr<size_t> kept =
        counts.ok() ? keeper.Keep({episode, method, *std::move(counts)}) : counts.status();
    const std::lock_guard lock(mutex);
    status.Update(kept.status());
    if (kept.ok()) progress(*kept, kept_before);
    return status.ok();
  });
  RETURN_IF_ERROR(status);
  std::vector<EpisodeResult> results = keeper.Take();
  const auto rank = [&](const EpisodeResult& result) {
    return std::pair(result.episode, std::ranges::find(study.methods, result.method));
  };
  std::ranges::sort(
      results, [&](const EpisodeResult& a, const EpisodeResult& b) { return rank(a) < rank(b); });
  return results;
}

}  // namespace silhouette::people_experiment
