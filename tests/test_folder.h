// SPDX-License-Identifier: Apache-2.0
// Folders for the files of tests.
#pragma once

#include <stdlib.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

namespace silhouette {

// A folder of this process, which goes away with it.
inline const std::filesystem::path& TestFolder() {
  struct Folder {
    Folder() {
      std::string pattern = std::filesystem::temp_directory_path() / "silhouette-XXXXXX";
      if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no temporary folder");
      path = pattern;
      // Other users may enter it, as any folder.
      std::filesystem::permissions(path, std::filesystem::perms(0755));
    }
    ~Folder() {
      std::error_code ignored;
      std::filesystem::remove_all(path, ignored);
    }
    std::filesystem::path path;
  };
  static const Folder folder;
  return folder.path;
}

// A new empty folder within TestFolder(), another at every call. Its path is short, as that of a
// Unix socket has to be.
inline std::filesystem::path FreshFolder() {
  static std::atomic<int> count = 0;
  const std::filesystem::path folder = TestFolder() / std::to_string(++count);
  std::filesystem::create_directories(folder);
  return folder;
}

// Makes the folder of the file, too. Its path.
inline std::string WriteFile(const std::filesystem::path& file, const std::string& content) {
  if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path());
  std::ofstream(file, std::ios::binary) << content;
  return file.string();
}

}  // namespace silhouette
