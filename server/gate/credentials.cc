// SPDX-License-Identifier: Apache-2.0
#include "server/gate/credentials.h"

#include <grpc/grpc.h>
#include <grpc/grpc_security.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include <array>
#include <mutex>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "db/status/status_macros.h"
#include "server/gate/caller.h"

namespace silhouette {
namespace {

// What tells a file's contents from earlier ones.
struct FileState {
  dev_t device = 0;
  ino_t number = 0;
  off_t size = 0;
  timespec changed = {};

  bool operator==(const FileState& other) const {
    return device == other.device && number == other.number && size == other.size &&
           changed.tv_sec == other.changed.tv_sec && changed.tv_nsec == other.changed.tv_nsec;
  }
};
using FileStates = std::array<FileState, 3>;

FileStates StatesOf(const TlsFiles& files) {
  FileStates states;
  size_t place = 0;
  for (const std::string* path : {&files.certificate, &files.key, &files.client_ca}) {
    struct stat status {};
    if (stat(path->c_str(), &status) == 0) {
      states[place] = {status.st_dev, status.st_ino, status.st_size, status.st_mtim};
    }
    ++place;
  }
  return states;
}

// What gRPC asks: for certificates with each connection, for permission with each call.
// Thread-safe.
class Gate {
 public:
  Gate(GateSettings settings, std::vector<std::string> user, Denied denied)
      : files_(settings.tls.value_or(TlsFiles())),
        roles_(std::move(settings.roles)),
        user_(std::move(user)),
        denied_(std::move(denied)) {}

  grpc_ssl_certificate_config_reload_status Fetch(grpc_ssl_server_certificate_config** config) {
    const std::lock_guard lock(mutex_);
    const FileStates states = StatesOf(files_);
    if (states == used_) {
      fault_.clear();
      return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_UNCHANGED;
    }
    const absl::StatusOr<TlsTexts> texts = ReadTls(files_);
    const std::string fault(texts.status().message());
    const bool is_new = std::exchange(fault_, fault) != fault;
    if (!texts.ok()) {
      if (is_new) spdlog::error("certificates not renewed, still using the former ones: {}", fault);
      return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_FAIL;
    }
    used_ = states;
    spdlog::info("certificate '{}' is valid until {}", files_.certificate,
                 absl::FormatTime(texts->valid_until));
    const grpc_ssl_pem_key_cert_pair pair{texts->key.c_str(), texts->certificate.c_str()};
    *config = grpc_ssl_server_certificate_config_create(texts->client_ca.c_str(), &pair, 1);
    return *config == nullptr ? GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_FAIL
                              : GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_NEW;
  }

  absl::Status Permit(grpc_auth_context* context, std::string_view call) {
    NameUser(context);
    const std::vector<std::string> names = NamesOf(context);
    absl::Status permitted = roles_.Permit(names, call);
    if (!permitted.ok() && denied_) {
      denied_(names.empty() ? "" : "'" + PrintableName(names[0]) + "'",
              AccessOf(call) == Access::kNothing ? "unknown call" : std::string(call));
    }
    return permitted;
  }

 private:
  // All calls of a connection share its context: only the first one writes, before any reads.
  void NameUser(grpc_auth_context* context) {
    if (user_.empty()) return;
    const std::lock_guard lock(mutex_);
    if (!NamesOf(context).empty()) return;
    for (const std::string& name : user_) {
      grpc_auth_context_add_cstring_property(context, kUserProperty, name.c_str());
    }
  }

  const TlsFiles files_;
  const Roles roles_;
  const std::vector<std::string> user_;
  const Denied denied_;
  std::mutex mutex_;
  FileStates used_;    // the files in use
  std::string fault_;  // why later ones are not; empty: they are
};

std::string_view TextOf(const grpc_slice& slice) {
  return {reinterpret_cast<const char*>(GRPC_SLICE_START_PTR(slice)), GRPC_SLICE_LENGTH(slice)};
}

grpc_ssl_certificate_config_reload_status FetchFor(void* gate,
                                                   grpc_ssl_server_certificate_config** config) {
  return static_cast<Gate*>(gate)->Fetch(config);
}

void PermitFor(void* gate, grpc_auth_context* context, const grpc_metadata* metadata, size_t size,
               grpc_process_auth_metadata_done_cb done, void* user_data) {
  std::string_view call;
  for (size_t i = 0; i < size; ++i) {
    if (TextOf(metadata[i].key) == ":path") call = TextOf(metadata[i].value);
  }
  const absl::Status status = static_cast<Gate*>(gate)->Permit(context, call);
  done(user_data, nullptr, 0, nullptr, 0, static_cast<grpc_status_code>(status.code()),
       std::string(status.message()).c_str());
}

// gRPC's C++ interface cannot renew certificates and keep those in use when the new ones are bad;
// its C interface can.
class GateCredentials final : public grpc::ServerCredentials {
 public:
  GateCredentials(GateSettings settings, std::vector<std::string> user, Denied denied)
      : settings_(std::move(settings)), user_(std::move(user)), denied_(std::move(denied)) {}

  void SetAuthMetadataProcessor(const std::shared_ptr<grpc::AuthMetadataProcessor>&) override {
    spdlog::error("the server's gate already decides on calls");
  }

 private:
  int AddPortToServer(const std::string& address, grpc_server* server) override {
    // Belongs to the credentials, which the server keeps as long as it may ask.
    auto* const gate = new Gate(settings_, user_, denied_);
    grpc_server_credentials* const credentials =
        settings_.tls
            ? grpc_ssl_server_credentials_create_with_options(
                  grpc_ssl_server_credentials_create_options_using_config_fetcher(
                      GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY, FetchFor, gate))
            : grpc_local_server_credentials_create(UDS);
    if (credentials == nullptr) {
      delete gate;
      return 0;
    }
    grpc_server_credentials_set_auth_metadata_processor(
        credentials, {.process = PermitFor,
                      .destroy = [](void* state) { delete static_cast<Gate*>(state); },
                      .state = gate});
    const int port = grpc_server_add_http2_port(server, address.c_str(), credentials);
    grpc_server_credentials_release(credentials);
    return port;
  }

  const GateSettings settings_;
  const std::vector<std::string> user_;
  const Denied denied_;
};

}  // namespace

absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> CredentialsFor(
    const GateSettings& settings, const std::vector<std::string>& user, Denied denied) {
  if (!settings.tls && settings.roles.empty()) return grpc::InsecureServerCredentials();
  if (settings.tls) RETURN_IF_ERROR(ReadTls(*settings.tls).status());
  return std::make_shared<GateCredentials>(settings, user, std::move(denied));
}

}  // namespace silhouette
