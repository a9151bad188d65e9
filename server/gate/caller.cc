// SPDX-License-Identifier: Apache-2.0
#include "server/gate/caller.h"

#include <grpc/grpc_security.h>
#include <grpc/grpc_security_constants.h>
#include <pwd.h>
#include <sys/socket.h>

#include <array>
#include <memory>

#include "absl/status/status.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "server/gate/roles.h"

namespace silhouette {

std::vector<std::string> NamesOf(const grpc_auth_context* context) {
  std::vector<std::string> names;
  if (context == nullptr || grpc_auth_context_peer_is_authenticated(context) == 0) return names;
  for (const char* property :
       {GRPC_X509_CN_PROPERTY_NAME, GRPC_X509_SAN_PROPERTY_NAME, kUserProperty}) {
    grpc_auth_property_iterator values =
        grpc_auth_context_find_properties_by_name(context, property);
    while (const grpc_auth_property* value = grpc_auth_property_iterator_next(&values)) {
      if (value->value_length > 0) names.emplace_back(value->value, value->value_length);
    }
  }
  return names;
}

absl::StatusOr<uid_t> UserNamed(const std::string& name) {
  uid_t number = 0;
  if (name.starts_with("uid ") && absl::SimpleAtoi(name.substr(4), &number)) return number;
  passwd entry{};
  passwd* found = nullptr;
  std::array<char, 16384> text{};
  getpwnam_r(name.c_str(), &entry, text.data(), text.size(), &found);
  if (found != nullptr) return found->pw_uid;
  return absl::NotFoundError(absl::StrCat("server: roles: this machine has no user '",
                                          PrintableName(name),
                                          "'; correct the name, or say 'uid NUMBER'"));
}

std::optional<uid_t> UserAt(int connection) {
  ucred peer{};
  socklen_t size = sizeof(peer);
  if (getsockopt(connection, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) return std::nullopt;
  return peer.uid;
}

std::string QuotedNameOf(grpc::CallbackServerContext& context) {
  const std::unique_ptr<grpc_auth_context, decltype(&grpc_auth_context_release)> auth(
      grpc_call_auth_context(context.c_call()), grpc_auth_context_release);
  const std::vector<std::string> names = NamesOf(auth.get());
  return names.empty() ? "" : absl::StrCat("'", PrintableName(names[0]), "'");
}

std::string CallerOf(grpc::CallbackServerContext& context) {
  std::string address = PrintableName(context.peer());
  if (address.starts_with("ip")) address = address.substr(0, address.rfind(':'));
  const std::string name = QuotedNameOf(context);
  return name.empty() ? address : absl::StrCat(name, " at ", address);
}

}  // namespace silhouette
