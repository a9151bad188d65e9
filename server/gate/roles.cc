// SPDX-License-Identifier: Apache-2.0
#include "server/gate/roles.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/log/log_lines.h"

namespace silhouette {
namespace {

// The one table of who may call what; docs/security.md has the same.
constexpr std::pair<std::string_view, Access> kCalls[] = {
    // Publishers stamp images by the server's clock, which its answer states.
    {"/silhouette.v1.CollisionService/CheckConfigurations", Access::kAnyRole},
    {"/silhouette.v1.CollisionService/CheckPath", Access::kPlanner},
    {"/silhouette.v1.CollisionService/GetConfigurationSpace", Access::kPlanner},
    {"/silhouette.v1.CollisionService/WatchConfigurationSpace", Access::kPlanner},
    {"/silhouette.v1.CollisionService/WatchPath", Access::kPlanner},
    {"/silhouette.v1.CollisionService/StreamChecks", Access::kPlanner},
    {"/silhouette.v1.CollisionService/Explain", Access::kPlanner},
    {"/silhouette.v1.SceneService/PublishScene", Access::kPublisher},
    {"/silhouette.v1.SceneService/ChangeVariant", Access::kOperator},
    {"/silhouette.v1.SceneService/AllowRegion", Access::kOperator},
    {"/silhouette.v1.SceneService/RevokeRegion", Access::kOperator},
    // What other clients ask, and camera images.
    {"/silhouette.v1.SceneService/WatchScenes", Access::kOperator},
    {"/silhouette.v1.SceneService/GetScene", Access::kAnyRole},
    {"/silhouette.v1.SceneService/GetAcquisition", Access::kAnyRole},
    {"/silhouette.v1.SceneService/ListAllowedRegions", Access::kAnyRole},
    {"/silhouette.v1.DatabaseService/GetDatabase", Access::kAnyRole},
    {"/grpc.health.v1.Health/Check", Access::kCertificate},
    {"/grpc.health.v1.Health/Watch", Access::kCertificate},
    {"/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", Access::kCertificate},
};

bool Suffices(const std::set<Role>& roles, Access access) {
  switch (access) {
    case Access::kNothing:
      return false;
    case Access::kCertificate:
      return true;
    case Access::kAnyRole:
      return !roles.empty();
    case Access::kPlanner:
      return roles.contains(Role::kPlanner) || roles.contains(Role::kAdministrator);
    case Access::kPublisher:
      return roles.contains(Role::kPublisher) || roles.contains(Role::kAdministrator);
    case Access::kOperator:
      return roles.contains(Role::kOperator) || roles.contains(Role::kAdministrator);
  }
  return false;
}

const char* RoleNeeded(Access access) {
  switch (access) {
    case Access::kPlanner:
      return NameOf(Role::kPlanner);
    case Access::kPublisher:
      return NameOf(Role::kPublisher);
    case Access::kOperator:
      return NameOf(Role::kOperator);
    default:
      return "any";
  }
}

}  // namespace

const char* NameOf(Role role) {
  switch (role) {
    case Role::kPlanner:
      return "planner";
    case Role::kPublisher:
      return "publisher";
    case Role::kOperator:
      return "operator";
    case Role::kAdministrator:
      return "administrator";
  }
  return "";
}

Access AccessOf(std::string_view call) {
  const auto* const row =
      std::ranges::find_if(kCalls, [call](const auto& known) { return known.first == call; });
  return row == std::end(kCalls) ? Access::kNothing : row->second;
}

bool MayCall(Role role, std::string_view call) { return Suffices({role}, AccessOf(call)); }

Roles::Roles(std::map<Role, std::vector<std::string>> names) {
  for (const auto& [role, clients] : names) {
    for (const std::string& client : clients) {
      if (client.empty() || client.size() > kMostNameBytes) {
        throw std::invalid_argument(absl::StrCat("a client of the role '", NameOf(role),
                                                 "' has a name of 1 to ", kMostNameBytes,
                                                 " bytes"));
      }
      names_[client].insert(role);
    }
  }
  if (names_.empty()) throw std::invalid_argument("no client has a role");
}

std::vector<std::string> Roles::names() const {
  std::vector<std::string> names;
  for (const auto& [name, roles] : names_) names.push_back(name);
  return names;
}

std::set<Role> Roles::Of(std::span<const std::string> names) const {
  std::set<Role> roles;
  for (const std::string& name : names) {
    const auto found = names_.find(name);
    if (found != names_.end()) roles.insert(found->second.begin(), found->second.end());
  }
  return roles;
}

absl::Status Roles::Permit(std::span<const std::string> names, std::string_view call) const {
  const Access access = AccessOf(call);
  const std::set<Role> roles = Of(names);
  if (!names.empty() && Suffices(roles, access)) return absl::OkStatus();
  const std::string client =
      names.empty() ? "an unnamed client (no name in its certificate, or a user without a role)"
                    : "'" + PrintableName(names[0]) + "'";
  if (access == Access::kNothing) {
    return absl::UnimplementedError(absl::StrCat(client, " may not call '", PrintableName(call),
                                                 "': the server has no such call"));
  }
  const std::string has =
      roles.empty()
          ? "no role"
          : absl::StrCat("the role ", absl::StrJoin(roles, ", ", [](auto* out, Role role) {
                           absl::StrAppend(out, NameOf(role));
                         }));
  return absl::PermissionDeniedError(
      absl::StrCat(client, " may not call ", std::string(call.substr(call.rfind('/') + 1)),
                   ", which needs ", access == Access::kAnyRole ? "a role" : "the role ",
                   access == Access::kAnyRole ? "" : RoleNeeded(access), ": it has ", has,
                   "; name it under 'server: roles' in the cell file"));
}

std::string PrintableName(std::string_view name) {
  return Printable(name.substr(0, kMostNameBytes)) + (name.size() > kMostNameBytes ? "..." : "");
}

}  // namespace silhouette
