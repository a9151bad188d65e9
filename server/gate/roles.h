// SPDX-License-Identifier: Apache-2.0
// Who may call what: roles, the role that each call needs, and the clients that have it.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"

namespace silhouette {

enum class Role : uint8_t {
  kPlanner,        // checks, watches
  kPublisher,      // scenes
  kOperator,       // allowed regions, variants
  kAdministrator,  // everything
};
inline constexpr Role kRoles[] = {Role::kPlanner, Role::kPublisher, Role::kOperator,
                                  Role::kAdministrator};

// "planner"; the key in cell.yaml.
const char* NameOf(Role role);

// What a call needs. kNothing has no caller: it is what calls need that the table does not name.
enum class Access : uint8_t {
  kNothing,
  kCertificate,  // any that the server's client_ca signed; any user that has a role
  kAnyRole,
  kPlanner,
  kPublisher,
  kOperator,
};

// `call`: as HTTP/2 names it, "/silhouette.v1.CollisionService/CheckPath". An administrator may do
// all but kNothing.
Access AccessOf(std::string_view call);

// Whether who has this role, and no other, may call `call`.
bool MayCall(Role role, std::string_view call);

// Longest name of a client, bytes.
inline constexpr size_t kMostNameBytes = 256;

// The names of clients by role. Immutable.
class Roles {
 public:
  Roles() = default;
  // The names in certificates, common names or alternative names; or users. Throws
  // std::invalid_argument for an empty or too long name, and if there is none at all.
  explicit Roles(std::map<Role, std::vector<std::string>> names);

  bool empty() const { return names_.empty(); }

  // All names that have a role.
  std::vector<std::string> names() const;

  // Whether a client that has these names (NamesOf) may call `call`. PermissionDenied names the
  // client, the call, the role that it needs, and the mend. Unimplemented: the server has no such
  // call.
  absl::Status Permit(std::span<const std::string> names, std::string_view call) const;

 private:
  std::set<Role> Of(std::span<const std::string> names) const;

  std::map<std::string, std::set<Role>, std::less<>> names_;
};

// A name that somebody sent, for messages and logs: Printable(), of at most kMostNameBytes.
std::string PrintableName(std::string_view name);

}  // namespace silhouette
