// SPDX-License-Identifier: Apache-2.0
// The client of silhouette-server.
//
//   absl::StatusOr<silhouette::Client> client = silhouette::Client::Connect("127.0.0.1:50051");
//   if (!client.ok()) ...
//   const auto checks = client->CheckConfigurations({{0.1, 0.2}});
//   if (checks.ok() && checks->verdicts[0].free()) ...
//
// Errors are one sentence each that names the server and the mend:
//   Unavailable       no server answers there, or it, or a proxy, ended the call too early
//   DeadlineExceeded  it did not answer in time
//   ResourceExhausted   too many calls for the server, or too much in this one; its own words
//   InvalidArgument, NotFound, FailedPrecondition   the server refuses; its own words
//   Aborted           the database was replaced meanwhile: publish or allow again
//   PermissionDenied  the server does not allow this client the call (its roles)
//   Unimplemented     the server is older than this library: it does not know a call, or reports no
//                     clearances
//   Internal          the answer is malformed
// No error is ever a verdict, and a part of an answer is never handed out.
// An answer that expired on its way (Basis::valid_until) is unknown, Reason::kAnswerLate.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "silhouette/answers.h"
#include "silhouette/check_stream.h"
#include "silhouette/configuration_space.h"
#include "silhouette/path_watch.h"
#include "silhouette/policy.h"
#include "silhouette/running_clock.h"
#include "silhouette/scene_watch.h"
#include "silhouette/verdict.h"

// What the server reports beside verdicts are the API's own messages: who uses one includes
// silhouette/messages.h.
namespace silhouette::v1 {
class Acquisition;
class AllowedRegion;
class AllowRegionRequest;
class ChangeVariantResponse;
class GetDatabaseResponse;
class ListAllowedRegionsResponse;
class PublishSceneRequest;
class Scene;
}  // namespace silhouette::v1

namespace silhouette::client {

inline constexpr char kDefaultAddress[] = "127.0.0.1:50051";

// PEM files of an encrypted connection: the authority that signed the server's certificate, and the
// client's own certificate and private key. All or none; none: plain text.
struct ClientTls {
  std::string ca;
  std::string certificate;
  std::string key;
};

class Connection;
class PublishingClock;

// Any number of threads may use a client at once. Copies share the connection. In a process that
// was forked from one that had a client, every call is a FailedPrecondition: it would disturb the
// parent's. From the first answer on a client is of one cell: if the server of another one (by
// name, grid, fixed joints or views) has the address later, checks, watched paths, GetDatabase and
// what changes the cell end as FailedPrecondition, and nothing of a LocalSpace is known; connect
// again. GetScene, WatchScenes, GetAcquisition, ListAllowedRegions and RevokeRegion do not check
// this: they are for the cell that is served now, whichever it is.
class Client {
 public:
  // `address`: "host:port" or "unix:path". `timeout`: of each round trip to the server; watches and
  // streams have no end. Most calls take one round trip; a check takes up to two more if its answer
  // comes late; BeginVariantChange, ChangeVariant and AllowRegion take two, PublishScene up to six.
  // Only checks the form of the address (InvalidArgument) and reads the files of `tls` (NotFound).
  // The first call connects; later calls reconnect if the connection was lost, with the files as
  // they are some seconds before. With `tls` the server's certificate must name the host of
  // `address`.
  static absl::StatusOr<Client> Connect(const std::string& address,
                                        absl::Duration timeout = absl::Seconds(10),
                                        const ClientTls& tls = {});

  // The same connection with another timeout: positive, else every call is an InvalidArgument.
  Client WithTimeout(absl::Duration timeout) const;

  // The same connection for one variant of the robot: a tool, a part. Configurations, paths and a
  // LocalSpace are checked with it, whatever the scene's variant. Empty: checks use the scene's
  // variant. InvalidArgument of the calls: the database has no such variant; Unimplemented: the
  // server knows no variants.
  Client WithVariant(std::string variant) const;

  const std::string& address() const;

  // Verdicts for configurations, in the order asked.
  absl::StatusOr<ConfigurationChecks> CheckConfigurations(
      std::span<const Configuration> configurations, const Policy& policy = {},
      Evidence evidence = Evidence::kPerView, Clearance clearance = Clearance::kOmit) const;
  absl::StatusOr<ConfigurationChecks> CheckConfigurations(
      std::initializer_list<Configuration> configurations, const Policy& policy = {},
      Evidence evidence = Evidence::kPerView, Clearance clearance = Clearance::kOmit) const {
    return CheckConfigurations(std::span(configurations.begin(), configurations.size()), policy,
                               evidence, clearance);
  }

  // The same for configurations of the grid by their numbers (ConfigurationGrid), up to eight
  // million at once: much faster, without evidence.
  absl::StatusOr<NumberChecks> CheckNumbers(std::span<const uint32_t> numbers,
                                            const Policy& policy = {}) const;

  // The first place on a path that is not free. Between waypoints (at least one) joint values are
  // interpolated linearly, without wrapping. `resolution`: of a robot whose images are drawn,
  // metres, 0.0005 to 0.1: parts of the path on which no point of the robot moves farther are
  // sampled where they cannot be proven free; unset: 0.005. `separation`: if set, the answer tells
  // how fast the robot may follow the path; FailedPrecondition: the server knows no distances.
  absl::StatusOr<PathCheck> CheckPath(
      std::span<const Configuration> waypoints, const Policy& policy = {},
      Clearance clearance = Clearance::kOmit, std::optional<double> resolution = {},
      const std::optional<SeparationPolicy>& separation = std::nullopt) const;

  // The same, answered again with every scene; needs a server that can.
  absl::StatusOr<PathWatch> WatchPath(
      std::span<const Configuration> waypoints, const Policy& policy = {},
      Clearance clearance = Clearance::kOmit, std::optional<double> resolution = {},
      const std::optional<SeparationPolicy>& separation = std::nullopt) const;

  // Checks over one call, without waiting for each answer; needs a server that can.
  CheckStream StreamChecks() const;

  // The verdicts of all configurations, or of the given tiles only. `max_time`: how long the server
  // may work on them, not negative; tiles that are not finished by then are left out, and unknown.
  // `clearance_levels`: up to 16, in pixels of the masks, ascending, finite, 0 or more; the result
  // then has which of them each configuration's clearance exceeds. This may take long.
  absl::StatusOr<ConfigurationSpace> GetConfigurationSpace(
      const Policy& policy = {}, std::span<const uint64_t> tiles = {},
      std::optional<absl::Duration> max_time = std::nullopt,
      std::span<const double> clearance_levels = {}) const;

  // One verdict with its pictures.
  absl::StatusOr<Explanation> Explain(const Configuration& configuration,
                                      const Policy& policy = {}) const;

  // Publishes one simultaneous set of images, with the robot's joint values at that time: all
  // joints of the grid and all fixed joints. `scene.variant` names the variant that the images
  // show, whatever WithVariant says; empty: the default one, or InvalidArgument if WithVariant
  // named one. The returned scene may have defects. `taken`: an instant not later than the capture
  // of the images that state no time, for example that before the cameras were triggered. They get
  // it as server_clock, by round trips: however long the request is under way, the server knows how
  // old they are. Images with a capture_time or server_clock keep it.
  // InvalidArgument: an image has no time and `taken` is unset, or `taken` lies in the future.
  // FailedPrecondition: the server takes images itself, serves a newer scene, or has no reference
  // images to subtract from camera images. Aborted: the database was replaced meanwhile; publish
  // again.
  absl::StatusOr<v1::Scene> PublishScene(
      v1::PublishSceneRequest scene,
      std::optional<RunningClock::time_point> taken = std::nullopt) const;

  // A scene by its id, 0 for the newest; `with_planes`: also its masks.
  absl::StatusOr<v1::Scene> GetScene(uint64_t id = 0, bool with_planes = false) const;

  // All scenes from now on, and the answers to watched paths; `images`: camera images, too, where
  // the server has them. Needs the role operator.
  SceneWatch WatchScenes(bool images = false) const;

  // State of the server's own acquisition. FailedPrecondition: the server does not acquire images
  // itself.
  absl::StatusOr<v1::Acquisition> GetAcquisition() const;

  // Report to a server that takes images itself which variant shows the robot: before the gripper
  // closes, or a part or tool is taken or left, that the variant is changing; afterwards which it
  // is. From then on no verdict from older images is free, and none while it is changing. May
  // be called again. InvalidArgument: the database has no such variant. FailedPrecondition: the
  // server does not acquire images itself; publish scenes that name their variant. After any other
  // error the server may not know the change: call again.
  absl::StatusOr<v1::ChangeVariantResponse> BeginVariantChange() const;
  absl::StatusOr<v1::ChangeVariantResponse> ChangeVariant(const std::string& variant) const;

  // Puts an allowed region into force, in place of the one of its name: in its views obstacle
  // pixels are unknown for its duration, ten minutes at most. Aborted: the database was replaced
  // meanwhile; allow it again.
  absl::StatusOr<v1::AllowedRegion> AllowRegion(const v1::AllowRegionRequest& region) const;
  // Ends a region at once; whether one of this name was in force.
  absl::StatusOr<bool> RevokeRegion(const std::string& name) const;
  // The regions in force, by name.
  absl::StatusOr<v1::ListAllowedRegionsResponse> ListAllowedRegions() const;

  absl::StatusOr<v1::GetDatabaseResponse> GetDatabase() const;

 private:
  friend class LocalSpace;
  Client(std::shared_ptr<const Connection> connection,
         std::shared_ptr<PublishingClock> publishing_clock, absl::Duration timeout,
         std::string variant);

  std::shared_ptr<const Connection> connection_;
  std::shared_ptr<PublishingClock> publishing_clock_;
  absl::Duration timeout_;
  std::string variant_;
};

}  // namespace silhouette::client

namespace silhouette {
using Client = client::Client;
}  // namespace silhouette
