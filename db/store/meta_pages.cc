// SPDX-License-Identifier: Apache-2.0
// Whether the two meta pages of an LMDB data file make sense. LMDB believes them when it opens the
// file: one flipped bit of a page size or a page number can end the process.
//
// LMDB (0.9, data version 1) writes them in turn, page 0 by transactions with an even id, page 1 by
// those with an odd one. Thus their ids differ by one; both are 0 before the first transaction.
#include <array>
#include <string>

#include "absl/strings/str_cat.h"
#include "db/store/environment.h"
#include "db/store/read_at.h"

namespace silhouette {
namespace {

constexpr size_t kMetaEnd = 16 + 136;  // the page header and MDB_meta
constexpr uint32_t kLmdbMagic = 0xBEEFC0DE;
constexpr uint32_t kDataVersion = 1;
constexpr uint16_t kMetaFlag = 0x08;
// md_flags that the tree of free pages has; the main tree has none.
constexpr uint16_t kIntegerKey = 0x08;
constexpr uint64_t kNoRoot = ~uint64_t{0};
// No machine maps more.
constexpr uint64_t kMostMapBytes = uint64_t{1} << 46;

// A meta page's values by their place in it (MDB_page, MDB_meta).
struct MetaPage {
  explicit MetaPage(const char* page)
      : number(Load<uint64_t>(page)),
        flags(Load<uint16_t>(page + 10)),
        magic(Load<uint32_t>(page + 16)),
        version(Load<uint32_t>(page + 20)),
        map_bytes(Load<uint64_t>(page + 32)),
        page_size(Load<uint32_t>(page + 40)),
        free_flags(Load<uint16_t>(page + 44)),
        free_root(Load<uint64_t>(page + 80)),
        main_pad(Load<uint32_t>(page + 88)),
        main_flags(Load<uint16_t>(page + 92)),
        main_root(Load<uint64_t>(page + 128)),
        last_page(Load<uint64_t>(page + 136)),
        transaction(Load<uint64_t>(page + 144)) {}

  uint64_t number;
  uint16_t flags;
  uint32_t magic;
  uint32_t version;
  uint64_t map_bytes;
  uint32_t page_size;
  uint16_t free_flags;
  uint64_t free_root;
  uint32_t main_pad;
  uint16_t main_flags;
  uint64_t main_root;
  uint64_t last_page;
  uint64_t transaction;
};

// What is wrong with the meta page that should be page `number` of a file whose pages have
// `page_size` bytes; empty: nothing.
std::string FaultOf(const MetaPage& meta, uint64_t number, uint32_t page_size) {
  if (meta.number != number) return absl::StrCat("its page number is ", meta.number);
  if (meta.flags != kMetaFlag) return absl::StrCat("its page flags are ", meta.flags);
  if (meta.magic != kLmdbMagic) return "it does not begin as a meta page of LMDB does";
  if (meta.version != kDataVersion) {
    return absl::StrCat("its data version is ", meta.version, " instead of ", kDataVersion);
  }
  if (meta.page_size != page_size) {
    return absl::StrCat("its page size is ", meta.page_size, " instead of ", page_size);
  }
  if (meta.free_flags != kIntegerKey || meta.main_flags != 0 || meta.main_pad != 0) {
    return "the flags of its trees make no sense";
  }
  if (meta.map_bytes > kMostMapBytes) {
    return absl::StrCat("its map has ", meta.map_bytes, " bytes");
  }
  if (meta.last_page < 1 || meta.last_page >= meta.map_bytes / page_size) {
    return absl::StrCat("its last page is ", meta.last_page, ", beyond its map");
  }
  if (meta.transaction != 0 && meta.transaction % 2 != number) {
    return absl::StrCat("transaction ", meta.transaction, " does not write it");
  }
  return "";
}

// The same of where the trees begin. Only the newer page says that: where LMDB could not write a
// meta page, as on a full disk, it leaves the new trees there beside the transaction before.
std::string FaultOfTrees(const MetaPage& newer) {
  for (const uint64_t root : {newer.free_root, newer.main_root}) {
    if (root != kNoRoot && (root < 2 || root > newer.last_page)) {
      return absl::StrCat("a tree begins at page ", root, ", which it does not have");
    }
  }
  return "";
}

absl::Status Damaged(const std::string& name, const std::string& fault) {
  return absl::DataLossError(
      absl::StrCat("'", name, "' is damaged: ", fault, "; restore it from a copy"));
}

// The bytes of both meta pages.
using MetaBytes = std::array<std::array<char, kMetaEnd>, 2>;

// Checks what the file has now, and leaves it in `read`.
absl::Status CheckOnce(int file, const std::string& name, MetaBytes& read) {
  read = {};
  const bool whole = ReadAt(file, 0, read[0]);
  const MetaPage first(read[0].data());
  if (first.magic != kLmdbMagic) {
    return absl::FailedPreconditionError(absl::StrCat(
        "'", name, "' is not a database: it does not begin as an LMDB data file does"));
  }
  if (!whole) return Damaged(name, "meta page 0 cannot be read; the file is truncated");
  const uint32_t size = first.page_size;
  if (size < 512 || size > 32768 || (size & (size - 1)) != 0) {
    return Damaged(name, absl::StrCat("its page size is ", size));
  }
  if (!ReadAt(file, size, read[1])) {
    return Damaged(name, "meta page 1 cannot be read; the file is truncated");
  }
  const MetaPage second(read[1].data());
  for (uint64_t i = 0; i < 2; ++i) {
    const MetaPage& meta = i == 0 ? first : second;
    const MetaPage& other = i == 0 ? second : first;
    std::string fault = FaultOf(meta, i, size);
    if (fault.empty() && meta.transaction >= other.transaction) fault = FaultOfTrees(meta);
    if (!fault.empty()) return Damaged(name, absl::StrCat("meta page ", i, ": ", fault));
  }
  const uint64_t distance = first.transaction > second.transaction
                                ? first.transaction - second.transaction
                                : second.transaction - first.transaction;
  if (distance > 1) {
    return Damaged(name, absl::StrCat("its meta pages are of transactions ", first.transaction,
                                      " and ", second.transaction));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckMetaPages(int file, const std::string& name) {
  // A writer may be at work: what stays as it is, is a fault.
  constexpr int kAttempts = 1000;
  MetaBytes before{};
  MetaBytes read{};
  absl::Status status = CheckOnce(file, name, read);
  for (int attempt = 0; attempt < kAttempts && !status.ok() && read != before; ++attempt) {
    before = read;
    status = CheckOnce(file, name, read);
  }
  return status;
}

}  // namespace silhouette
