// SPDX-License-Identifier: Apache-2.0
// tools/certificates.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "tests/folders.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

const std::string kCommand = SourceFolder() + "/tools/certificates made";

TEST(CertificatesScript, AuthorityWhoseMakingWasInterruptedIsMadeAgain) {
  const Shell shell;
  // An openssl that ends when the authority has its key, and no certificate yet.
  WriteFile(
      shell.folder() / "openssl",
      "#!/bin/sh\ncase \"$*\" in *x509*) exit 7 ;; esac\nPATH=${PATH#*:} exec openssl \"$@\"\n");
  EXPECT_EQ(shell.Run("chmod +x openssl && PATH=$PWD:$PATH " + kCommand).exit_code, 7);
  const Ended again = shell.Run(kCommand);
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(shell.Run("openssl verify -CAfile made/ca.pem made/server.pem").exit_code, 0);
}

TEST(CertificatesScript, AuthorityThatCannotSignIsNamed) {
  const Shell shell;
  ASSERT_EQ(shell.Run(kCommand).exit_code, 0);
  std::filesystem::remove(shell.folder() / "made/ca.pem");
  const Ended ended = shell.Run(kCommand);
  EXPECT_EQ(ended.exit_code, 1);
  EXPECT_THAT(ended.err, HasSubstr("ca.key and ca.pem in made cannot sign"));
}

}  // namespace
}  // namespace silhouette
