// The shared map of silhouette-server: on the same machine, the states of all configurations under
// the server's default policy, looked up in memory that the server keeps up to date.
//
//   absl::StatusOr<silhouette::SharedSpace> space =
//       silhouette::SharedSpace::Open("/dev/shm/silhouette-cell", absl::Milliseconds(200));
//   if (!space.ok()) ...
//   if (space->Check({0.1, 0.2}).free()) ...
//
// Nobody asks the server: how old the scene is decides. A server that hangs or was killed publishes
// nothing, and all is unknown as soon as its last scene is too old, kSceneStale. A server that was
// stopped, or serves another database, says so in the map: kMapClosed. A SharedSpace never goes
// over to another file by itself, for numbers and joint values would mean something else there:
// Reopen() it.
//
// Only the file's owner can write to it, who is trusted. By cutting it off while it is in use he
// ends this program with SIGBUS; the server never does.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "silhouette/answers.h"
#include "silhouette/configuration_grid.h"
#include "silhouette/configuration_space.h"
#include "silhouette/database.h"
#include "silhouette/verdict.h"

namespace silhouette::client {

// Any number of threads may use one at once. Copies share the memory.
class SharedSpace {
 public:
  // `max_age`: oldest image that an answer may rest on, not negative; the server's own max_age
  // counts besides. `owner`: the number of the user who the file must belong to; nothing: any. Say
  // it where others may make files in the folder, as in /dev/shm: while no server runs, anybody can
  // put a file there.
  // NotFound: there is no such file, so no server publishes. PermissionDenied: this user may not
  // read it, it belongs to somebody else than `owner`, or somebody else than its owner may write
  // to it. FailedPrecondition: it is of another version of the format, or by another machine's
  // clock. InvalidArgument: it is not a shared map, or damaged. Each in one sentence.
  static absl::StatusOr<SharedSpace> Open(const std::string& path,
                                          absl::Duration max_age = absl::InfiniteDuration(),
                                          std::optional<uint32_t> owner = std::nullopt);

  // Opens what is at the path now: after a start of the server, or with another database. As Open,
  // with the same max_age; the file must belong to the same user as this one.
  absl::StatusOr<SharedSpace> Reopen() const;

  // What the server serves; the states are of default_policy.
  const Database& database() const;
  const ConfigurationGrid& grid() const { return database().grid; }

  // The state of a configuration of the grid, by its number. Unknown also for a number that no
  // configuration has.
  State StateAt(ConfigurationNumber number) const;
  bool IsFree(ConfigurationNumber number) const { return StateAt(number) == State::kFree; }

  // The verdict on any configuration, without evidence and hidden_possible: never free or occupied
  // where the server would not say the same. Off the grid the map may not be enough
  // (kBetweenGridPoints; docs/concepts.md tells where it is). `basis`: if not null, gets what the
  // verdict rests on.
  Verdict Check(std::span<const double> q, Basis* basis = nullptr) const;
  Verdict Check(std::initializer_list<double> q, Basis* basis = nullptr) const {
    return Check(std::span(q.begin(), q.size()), basis);
  }

  // Many at once, all by the same scene.
  ConfigurationChecks CheckConfigurations(std::span<const Configuration> configurations) const;
  NumberChecks CheckNumbers(std::span<const uint32_t> numbers) const;

  // What an answer would rest on now.
  Basis basis() const;
  absl::Duration Age() const { return basis().Age(); }
  // Why all is unknown now; kUnspecified if it is not.
  Reason unknown_reason() const;

  // The states as they are now, to be kept. All are unknown if there is an unknown_reason.
  ConfigurationSpace Copy() const;

 private:
  class Map;
  explicit SharedSpace(std::shared_ptr<const Map> map) : map_(std::move(map)) {}

  std::shared_ptr<const Map> map_;
};

}  // namespace silhouette::client

namespace silhouette {
using SharedSpace = client::SharedSpace;
}  // namespace silhouette
