// SPDX-License-Identifier: Apache-2.0
#include "proto/tls/channel_credentials.h"

#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_credentials_options.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace silhouette {
namespace {

constexpr unsigned kSecondsBetweenLooks = 10;

absl::Status RequirePem(const std::string& path, const std::string& what) {
  std::ifstream file(path);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  if (!file.is_open() || file.bad()) {
    return absl::NotFoundError(absl::StrCat("cannot read '", path, "': ", strerror(errno)));
  }
  if (text.find(what + "-----") != std::string::npos) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("'", path, "' holds no ", what, " in PEM format"));
}

}  // namespace

absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> ChannelCredentialsFor(
    const std::string& address, const ClientTlsFiles& files) {
  const int given = !files.ca.empty() + !files.certificate.empty() + !files.key.empty();
  if (given == 0) return grpc::InsecureChannelCredentials();
  if (given != 3) {
    return absl::InvalidArgumentError(
        "an encrypted connection needs three files: ca, certificate and key");
  }
  if (address.starts_with("unix:")) {
    return absl::InvalidArgumentError(
        absl::StrCat("a Unix socket is not encrypted; give no certificates for '", address, "'"));
  }
  for (const auto& [path, what] :
       {std::pair(files.ca, "CERTIFICATE"), std::pair(files.certificate, "CERTIFICATE"),
        std::pair(files.key, "PRIVATE KEY")}) {
    if (absl::Status status = RequirePem(path, what); !status.ok()) return status;
  }
  grpc::experimental::TlsChannelCredentialsOptions options;
  options.set_certificate_provider(
      std::make_shared<grpc::experimental::FileWatcherCertificateProvider>(
          files.key, files.certificate, files.ca, kSecondsBetweenLooks));
  options.watch_root_certs();
  options.watch_identity_key_cert_pairs();
  options.set_certificate_verifier(
      std::make_shared<grpc::experimental::HostNameCertificateVerifier>());
  return grpc::experimental::TlsCredentials(options);
}

}  // namespace silhouette
