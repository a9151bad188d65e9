#include "clients/cpp/shared_space_map.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "clients/cpp/messages.h"

namespace silhouette::client {
namespace {

using Outcome = shared_map::Reader::Outcome;

// A reason that is not known here is one all the same: `otherwise`.
Reason ReasonOf(uint64_t word, Reason otherwise) {
  if (word == 0 || word > static_cast<uint64_t>(v1::Verdict::Reason_MAX)) return otherwise;
  const Reason reason = client::FromMessage(static_cast<v1::Verdict::Reason>(word));
  return reason == Reason::kUnspecified ? otherwise : reason;
}

}  // namespace

SharedSpace::Map::Map(std::string path, std::unique_ptr<SharedMapFile> file, absl::Duration max_age)
    : path_(std::move(path)),
      file_(std::move(file)),
      reader_(file_->words()),
      given_max_age_(max_age),
      max_age_(absl::ToInt64Nanoseconds(max_age)) {}

absl::Status SharedSpace::Map::Describe() {
  if (!reader_.clock().SameAs(shared_map::ClockId::Ours())) {
    return absl::FailedPreconditionError(absl::StrCat(
        "nothing tells how old the shared map '", path_,
        "' is: it was written before this machine was last started, on another machine, in another "
        "time namespace, or where /proc/sys/kernel/random/boot_id cannot be read; start "
        "silhouette-server anew, beside this program"));
  }
  const auto damaged = [&] {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path_, "' is a damaged shared map: it does not tell what it is of"));
  };
  v1::GetDatabaseResponse message;
  const std::string_view bytes = reader_.description();
  if (!message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return damaged();
  absl::StatusOr<Database> database = FromMessage(message);
  if (!database.ok() || database->grid.tiles() != reader_.tiles()) return damaged();
  database_ = *std::move(database);
  rule_ = OffGridRuleOf(database_->default_policy, static_cast<int>(database_->views.size()));
  return absl::OkStatus();
}

Reason SharedSpace::Map::WhyUnknown(Outcome outcome, const Look& look) const {
  if (reader_.closed()) return Reason::kMapClosed;
  if (outcome == Outcome::kNone) return Reason::kNoScene;
  if (outcome == Outcome::kOvertaken) return Reason::kInternal;
  const shared_map::Stamp& stamp = look.stamp;
  if (stamp.reason != 0) return ReasonOf(stamp.reason, Reason::kInternal);
  if (stamp.scene == 0) return Reason::kNoScene;
  if (look.now > stamp.valid_until) return ReasonOf(stamp.reason_after, Reason::kSceneStale);
  // No scene comes from the future.
  if (stamp.taken > look.now || stamp.taken < look.now - max_age_) return Reason::kSceneStale;
  return Reason::kUnspecified;
}

KeptStates SharedSpace::Map::Copied(const Update& update) const {
  KeptStates states;
  states.words.resize(reader_.tiles() * shared_map::kWordsPerTile);
  states.told = update.cells();
  for (uint64_t i = 0; i < states.words.size() / shared_map::kWordsPerPlaces; ++i) {
    uint64_t* words = &states.words[shared_map::kWordsPerPlaces * i];
    words[0] = update.free(i);
    words[1] = update.occupied(i);
    words[2] = update.free_cells(i);
  }
  return states;
}

Basis SharedSpace::Map::BasisOf(const Look& look, const std::string& names) const {
  Basis basis{.database_generation = database().generation,
              .asked = std::chrono::steady_clock::time_point(std::chrono::nanoseconds(look.now))};
  if (look.stamp.scene == 0) return basis;
  basis.scene_id = look.stamp.scene;
  basis.scene_time = absl::FromUnixNanos(look.stamp.scene_time);
  basis.scene_age = absl::Nanoseconds(look.now) - absl::Nanoseconds(look.stamp.taken);
  basis.regions = RegionsIn(names);
  return basis;
}

std::vector<std::string> SharedSpace::Map::RegionsIn(const std::string& names) {
  return absl::StrSplit(names, '\n', absl::SkipEmpty());
}

}  // namespace silhouette::client
