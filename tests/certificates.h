// SPDX-License-Identifier: Apache-2.0
// Certificates for tests of encrypted connections.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "proto/tls/client_tls_files.h"
#include "tests/folders.h"
#include "tests/test_folder.h"

namespace silhouette {

// Those of tools/certificates for a server at `host`, in a new folder.
inline std::filesystem::path MakeCertificates(const std::string& host = "127.0.0.1") {
  const std::filesystem::path folder = FreshFolder();
  const std::string command =
      SourceFolder() + "/tools/certificates '" + folder.string() + "' " + host + " > /dev/null";
  EXPECT_EQ(std::system(command.c_str()), 0);
  return folder;
}

// What the client `name` of `folder` connects with.
inline ClientTlsFiles TlsFilesOf(const std::string& name, const std::filesystem::path& folder) {
  return {.ca = folder / "ca.pem",
          .certificate = folder / (name + ".pem"),
          .key = folder / (name + ".key")};
}

}  // namespace silhouette
