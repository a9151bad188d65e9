// SPDX-License-Identifier: Apache-2.0
// A disk that can be made full.
#pragma once

#include <gtest/gtest.h>
#include <sys/mount.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/test_folder.h"

namespace silhouette {

// A file system of its own that holds 2 MiB; skips the test where that is not permitted.
class FullDisk : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(disk_);
    if (mount("tmpfs", disk_.c_str(), "tmpfs", 0, "size=2m") != 0) {
      GTEST_SKIP() << "a tmpfs cannot be mounted here: " << strerror(errno);
    }
    mounted_ = true;
  }
  void TearDown() override {
    if (mounted_) {
      EXPECT_EQ(umount2(disk_.c_str(), MNT_DETACH), 0);
    }
  }
  void Fill() const {
    std::ofstream file(disk_ + "/filler", std::ios::binary);
    const std::string block(4096, 'x');
    while (file.write(block.data(), static_cast<std::streamsize>(block.size())).flush()) continue;
  }
  void Empty() const { std::filesystem::remove(disk_ + "/filler"); }

  const std::string disk_ = FreshFolder() / "disk";

 private:
  bool mounted_ = false;
};

}  // namespace silhouette
