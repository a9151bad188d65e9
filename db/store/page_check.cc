// SPDX-License-Identifier: Apache-2.0
// Whether the pages of an LMDB data file make sense. LMDB trusts its pages: one damaged pointer can
// end the process, or let a write destroy what is sound. Thus every page of every tree is looked at
// before LMDB is.
//
// Checked are the trees of one state of the database: the page numbers, kinds and bounds of all
// branch and leaf pages, the bounds and order of their nodes, counts and depths, that no page is
// used twice or lies beyond the file's end. Values are not: they have checksums of their own. The
// format is that of LMDB 0.9 on 64-bit little-endian machines, data version 1.
#include "db/store/environment.h"

#include <sys/mman.h>
#include <sys/stat.h>

#include <array>
#include <cerrno>
#include <optional>
#include <string_view>
#include <vector>

#include "absl/strings/str_cat.h"
#include "db/store/read_at.h"

namespace silhouette {
namespace {

constexpr uint64_t kNoPage = ~uint64_t{0};
constexpr size_t kPageHeader = 16;
constexpr size_t kNodeHeader = 8;
constexpr size_t kTreeSize = 48;
constexpr size_t kMetaSize = 136;
constexpr int kMostLevels = 32;

// mp_flags
constexpr uint16_t kBranch = 0x01;
constexpr uint16_t kPageCheckLeaf = 0x02;
// md_flags
constexpr uint16_t kDuplicates = 0x04;
// mn_flags
constexpr uint16_t kBigData = 0x01;
constexpr uint16_t kSubData = 0x02;

// MDB_db: where a tree begins and what it should hold.
struct Tree {
  explicit Tree(const char* at)
      : flags(Load<uint16_t>(at + 4)),
        depth(Load<uint16_t>(at + 6)),
        branch_pages(Load<uint64_t>(at + 8)),
        leaf_pages(Load<uint64_t>(at + 16)),
        entries(Load<uint64_t>(at + 32)),
        root(Load<uint64_t>(at + 40)) {}

  uint16_t flags;
  uint16_t depth;
  uint64_t branch_pages;
  uint64_t leaf_pages;
  uint64_t entries;
  uint64_t root;
};

// Of an MDB_meta.
uint64_t TransactionOf(const char* meta) { return Load<uint64_t>(meta + 128); }

// MDB_node, within its page.
struct Node {
  std::string_view key;
  std::string_view data;    // leaf: the value, or the number of its first overflow page
  uint16_t flags = 0;       // leaf
  uint64_t value_size = 0;  // leaf
  uint64_t child = 0;       // branch
};

class PageCheck {
 public:
  PageCheck(const char* map, uint64_t bytes, uint64_t page_size)
      : map_(map), page_size_(page_size), file_pages_(bytes / page_size), used_(file_pages_) {
    used_[0] = used_[1] = true;  // the meta pages
  }

  // The first fault of the state that `meta`, an MDB_meta, describes; empty if there is none.
  std::string Check(const char* meta) {
    Walk(Tree(meta + 24), kFreeTree);
    if (fault_.empty()) Walk(Tree(meta + 24 + kTreeSize), kMainTree);
    for (size_t i = 0; i < sub_trees_.size() && fault_.empty(); ++i) {
      Walk(sub_trees_[i], kSubTree);
    }
    return fault_;
  }

 private:
  enum Kind { kFreeTree, kMainTree, kSubTree };

  struct Progress {
    const Tree tree;
    const Kind kind;
    uint64_t branch_pages = 0;
    uint64_t leaf_pages = 0;
    uint64_t entries = 0;
    std::optional<std::string_view> last_key;
  };

  bool Fail(uint64_t page, std::string_view what) {
    if (fault_.empty()) fault_ = absl::StrCat("page ", page, ": ", std::string(what));
    return false;
  }

  bool Use(uint64_t page, uint64_t count) {
    for (uint64_t n = 0; n < count; ++n) {
      const uint64_t i = page + n;
      if (i >= file_pages_) return Fail(i, "it lies beyond the file's end; the file is truncated");
      if (used_[i]) return Fail(i, "it is used twice");
      used_[i] = true;
    }
    return true;
  }

  void Walk(const Tree& tree, Kind kind) {
    if (tree.root == kNoPage) {
      if (tree.entries != 0) Fail(0, "a tree without pages has entries");
      return;
    }
    if (tree.depth < 1 || tree.depth > kMostLevels) {
      Fail(tree.root, "a tree's depth is out of bounds");
      return;
    }
    Progress progress{tree, kind, 0, 0, 0, std::nullopt};
    if (!WalkPage(tree.root, 1, progress)) return;
    if (progress.branch_pages != tree.branch_pages || progress.leaf_pages != tree.leaf_pages ||
        progress.entries != tree.entries) {
      Fail(tree.root, "its tree does not have as many pages and entries as it should");
    }
  }

  bool WalkPage(uint64_t number, int level, Progress& progress) {
    if (!Use(number, 1)) return false;
    const char* page = map_ + number * page_size_;
    const uint16_t kind = Load<uint16_t>(page + 10);
    const uint16_t lower = Load<uint16_t>(page + 12);
    const uint16_t upper = Load<uint16_t>(page + 14);
    const bool leaf = level == progress.tree.depth;
    if (Load<uint64_t>(page) != number || kind != (leaf ? kPageCheckLeaf : kBranch)) {
      return Fail(number, "it is not the page that its tree expects there");
    }
    if (lower < kPageHeader || lower % 2 != 0 || lower > upper || upper > page_size_) {
      return Fail(number, "its bounds make no sense");
    }
    ++(leaf ? progress.leaf_pages : progress.branch_pages);
    const size_t nodes = (lower - kPageHeader) / 2;
    if (nodes < (leaf ? 1 : 2)) return Fail(number, "it has too few entries");
    for (size_t i = 0; i < nodes; ++i) {
      const std::optional<Node> node = NodeAt(page, i, upper, leaf);
      if (!node) return Fail(number, "an entry makes no sense");
      const bool sound = leaf ? CheckLeafNode(number, *node, progress)
                              : CheckBranchNode(number, *node, i, level, progress);
      if (!sound) return false;
    }
    return true;
  }

  std::optional<Node> NodeAt(const char* page, size_t i, uint16_t upper, bool leaf) const {
    const uint64_t offset = Load<uint16_t>(page + kPageHeader + 2 * i);
    if (offset < upper || offset % 2 != 0 || offset + kNodeHeader > page_size_) return std::nullopt;
    const char* at = page + offset;
    const uint64_t low = Load<uint16_t>(at) | uint64_t{Load<uint16_t>(at + 2)} << 16;
    const uint64_t key_size = Load<uint16_t>(at + 6);
    Node node;
    node.flags = Load<uint16_t>(at + 4);
    node.value_size = low;
    node.child = low | uint64_t{node.flags} << 32;
    const uint64_t data_size = !leaf ? 0 : (node.flags & kBigData) != 0 ? 8 : low;
    if (offset + kNodeHeader + key_size + data_size > page_size_) return std::nullopt;
    node.key = {at + kNodeHeader, key_size};
    node.data = {at + kNodeHeader + key_size, data_size};
    return node;
  }

  // Whether `a` sorts before `b` in a tree of this kind.
  static bool Before(Kind kind, std::string_view a, std::string_view b) {
    if (kind != kFreeTree) return a < b;
    return a.size() == 8 && b.size() == 8 && Load<uint64_t>(a.data()) < Load<uint64_t>(b.data());
  }

  bool CheckBranchNode(uint64_t number, const Node& node, size_t i, int level, Progress& progress) {
    // The first key of a branch page stands for "all that is less" and is not read.
    if (i > 0 && progress.last_key && !Before(progress.kind, *progress.last_key, node.key)) {
      return Fail(number, "its keys are not in order");
    }
    if (i > 0) least_key_ = node.key;
    return WalkPage(node.child, level + 1, progress);
  }

  bool CheckLeafNode(uint64_t number, const Node& node, Progress& progress) {
    if (progress.last_key && !Before(progress.kind, *progress.last_key, node.key)) {
      return Fail(number, "its keys are not in order");
    }
    if (least_key_ && Before(progress.kind, node.key, *least_key_)) {
      return Fail(number, "its keys are not those that its tree expects there");
    }
    least_key_.reset();
    progress.last_key = node.key;
    ++progress.entries;
    if (node.flags == kSubData && progress.kind == kMainTree) {
      if (node.data.size() != kTreeSize) return Fail(number, "a sub-database makes no sense");
      // Silhouette has none with duplicates; whose it is will be asked later.
      const Tree tree(node.data.data());
      if ((tree.flags & kDuplicates) == 0) sub_trees_.push_back(tree);
      return true;
    }
    if ((node.flags & ~kBigData) != 0) return Fail(number, "an entry is of an unknown kind");
    std::string_view value = node.data;
    if ((node.flags & kBigData) != 0) {
      const uint64_t first = Load<uint64_t>(node.data.data());
      const uint64_t pages = (kPageHeader - 1 + node.value_size) / page_size_ + 1;
      if (!Use(first, pages)) return false;
      value = {map_ + first * page_size_ + kPageHeader, node.value_size};
    }
    return progress.kind != kFreeTree || CheckFreePages(number, value);
  }

  // A list of pages that the next writer will overwrite: their count, then their numbers.
  bool CheckFreePages(uint64_t number, std::string_view list) {
    const uint64_t count = list.size() < 8 ? kNoPage : Load<uint64_t>(list.data());
    if (count > list.size() / 8 - 1) return Fail(number, "a list of free pages makes no sense");
    for (uint64_t i = 1; i <= count; ++i) {
      const uint64_t page = Load<uint64_t>(list.data() + 8 * i);
      if (page < file_pages_ && !Use(page, 1)) return false;
    }
    return true;
  }

  const char* map_;
  const uint64_t page_size_;
  const uint64_t file_pages_;
  std::vector<bool> used_;
  std::vector<Tree> sub_trees_;
  std::optional<std::string_view> least_key_;  // of the next leaf, as the branch above says
  std::string fault_;
};

}  // namespace

absl::Status CheckPages(int file, const std::string& name, uint64_t transaction) {
  struct stat status {};
  if (fstat(file, &status) != 0)
    return LmdbError(errno, absl::StrCat("'", name, "' cannot be read"));
  const uint64_t bytes = static_cast<uint64_t>(status.st_size);
  void* map = bytes == 0 ? MAP_FAILED : mmap(nullptr, bytes, PROT_READ, MAP_SHARED, file, 0);
  if (map == MAP_FAILED) return LmdbError(errno, absl::StrCat("'", name, "' cannot be read"));
  const char* data = static_cast<const char*>(map);

  std::optional<std::string> fault;
  const uint64_t page_size = Load<uint32_t>(data + kPageHeader + 24);
  for (uint64_t place : {uint64_t{0}, page_size}) {
    if (place + kPageHeader + kMetaSize > bytes) continue;
    const char* live = data + place + kPageHeader;
    // A writer's next commit but one overwrites it.
    const auto meta = Load<std::array<char, kMetaSize>>(live);
    if (TransactionOf(meta.data()) != transaction) continue;
    fault = PageCheck(data, bytes, page_size).Check(meta.data());
    const bool half_newer = TransactionOf(live) != transaction;  // perhaps
    if (!fault->empty() && half_newer) fault.reset();
  }
  munmap(map, bytes);
  if (!fault) return absl::UnavailableError(absl::StrCat("'", name, "' changed meanwhile"));
  if (fault->empty()) return absl::OkStatus();
  return absl::DataLossError(
      absl::StrCat("'", name, "' is damaged: ", *fault, "; restore it from a copy"));
}

}  // namespace silhouette
