// SPDX-License-Identifier: Apache-2.0
#include "common/picture/files.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <vector>

#include "tests/test_folder.h"

namespace {

std::vector<bool> synced;  // whether each was a folder

}  // namespace

// In place of the C library's.
extern "C" int fsync(int file) {
  struct stat status {};
  fstat(file, &status);
  synced.push_back(S_ISDIR(status.st_mode));
  return 0;
}

namespace silhouette {
namespace {

TEST(Files, AFileThatOutlastsAPowerFailureIsOnTheDiskAndThenItsName) {
  synced.clear();
  const std::string path = FreshFolder() / "joints.csv";
  ASSERT_TRUE(WriteWholeFile(path, "of the process").ok());
  EXPECT_TRUE(synced.empty());
  ASSERT_TRUE(WriteWholeFile(path, "for ever", Outlasts::kPowerFailure).ok());
  EXPECT_EQ(synced, (std::vector<bool>{false, true}));
  EXPECT_EQ(*ReadWholeFile(path), "for ever");
}

}  // namespace
}  // namespace silhouette
