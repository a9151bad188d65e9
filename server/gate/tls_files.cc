// SPDX-License-Identifier: Apache-2.0
// The files of TLS, read and checked.
#include <openssl/bio.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <memory>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "db/status/status_macros.h"
#include "server/gate/credentials.h"

namespace silhouette {
namespace {

using Bio = std::unique_ptr<BIO, decltype(&BIO_free)>;
using Certificate = std::unique_ptr<X509, decltype(&X509_free)>;
using Key = std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)>;

absl::StatusOr<std::string> ReadPem(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file) return NotFound("cannot read '", path, "': ", strerror(errno));
  return text.str();
}

// The first certificate of a text; null if it has none.
Certificate FirstCertificate(const std::string& text) {
  const Bio bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())), BIO_free);
  return {PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr), X509_free};
}

// Not of a key that a password protects: no person is there to type it.
Key PrivateKey(const std::string& text) {
  const Bio bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())), BIO_free);
  const auto no_password = [](char*, int, int, void*) { return -1; };
  return {PEM_read_bio_PrivateKey(bio.get(), nullptr, no_password, nullptr), EVP_PKEY_free};
}

absl::Time TimeOf(const ASN1_TIME* time) {
  tm parts{};
  if (ASN1_TIME_to_tm(time, &parts) != 1) return absl::InfinitePast();
  return absl::FromTM(parts, absl::UTCTimeZone());
}

}  // namespace

absl::StatusOr<TlsTexts> ReadTls(const TlsFiles& files) {
  TlsTexts texts;
  ASSIGN_OR_RETURN(texts.certificate, ReadPem(files.certificate));
  ASSIGN_OR_RETURN(texts.key, ReadPem(files.key));
  ASSIGN_OR_RETURN(texts.client_ca, ReadPem(files.client_ca));
  const Certificate certificate = FirstCertificate(texts.certificate);
  if (certificate == nullptr) {
    return FailedPrecondition("'", files.certificate, "' holds no certificate in PEM format");
  }
  const Key key = PrivateKey(texts.key);
  if (key == nullptr) {
    return FailedPrecondition("'", files.key,
                              "' holds no private key in PEM format without a password");
  }
  if (FirstCertificate(texts.client_ca) == nullptr) {
    return FailedPrecondition("'", files.client_ca, "' holds no certificate in PEM format");
  }
  if (X509_check_private_key(certificate.get(), key.get()) != 1) {
    return FailedPrecondition("the key '", files.key, "' is not that of the certificate '",
                              files.certificate, "'");
  }
  texts.valid_until = TimeOf(X509_get0_notAfter(certificate.get()));
  const absl::Time from = TimeOf(X509_get0_notBefore(certificate.get()));
  if (absl::Now() < from) {
    return FailedPrecondition("the certificate '", files.certificate, "' is not valid before ",
                              absl::FormatTime(from), ": wait, or set this machine's clock");
  }
  if (absl::Now() >= texts.valid_until) {
    return FailedPrecondition("the certificate '", files.certificate, "' is valid from ",
                              absl::FormatTime(from), " to ", absl::FormatTime(texts.valid_until),
                              ", and not now; renew it");
  }
  return texts;
}

}  // namespace silhouette
