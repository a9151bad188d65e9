// SPDX-License-Identifier: Apache-2.0
// Files that are written, read, cut, damaged; tests/tools/silhouette-record reads them with the
// format's own library.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <deque>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/mcap/mcap_reader.h"
#include "common/mcap/mcap_rotation.h"
#include "common/mcap/mcap_writer.h"
#include "tests/test_folder.h"

namespace {
bool no_file_shrinks = false;
// Where a block of 4096 bytes begins that the disk does not give, of any file; below 0: there is
// none.
off_t bad_block = -1;
}  // namespace

// In place of that of the C library: as of a disk that fails.
extern "C" int ftruncate(int file, off_t size) noexcept {
  if (no_file_shrinks) errno = EIO;
  return no_file_shrinks ? -1 : static_cast<int>(syscall(SYS_ftruncate, file, size));
}

extern "C" ssize_t read(int file, void* bytes, size_t size) {
  const off_t at = bad_block < 0 ? -1 : lseek(file, 0, SEEK_CUR);
  if (at >= bad_block && at >= 0 && at < bad_block + 4096) {
    errno = EIO;
    return -1;
  }
  if (at >= 0 && at < bad_block) size = std::min(size, static_cast<size_t>(bad_block - at));
  return syscall(SYS_read, file, bytes, size);
}

namespace silhouette {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

const std::vector<McapChannel> kChannels = {
    {"/a", "protobuf", "some.Type", "protobuf", std::string("\0descriptor", 11)},
    {"/b", "json", "", "", ""}};
const absl::Time kStart = absl::FromUnixMillis(1'769'860'800'123);

McapMessage At(double seconds, const std::string& data, uint16_t channel = 0) {
  const absl::Time time = kStart + absl::Seconds(seconds);
  return {.channel = channel, .logged = time, .published = time - absl::Seconds(1), .data = data};
}

// Bytes that cannot be compressed.
std::string Noise(size_t size) {
  std::string noise(size, '\0');
  uint32_t state = 1;
  for (char& c : noise) c = static_cast<char>((state = state * 1664525 + 1013904223) >> 24);
  return noise;
}

struct Read {
  std::vector<std::string> data;
  std::vector<McapReader::Message> messages;
  absl::Status status;
  bool cut = false;
  std::string damage;
};

Read ReadFile(const std::string& path) {
  Read read;
  auto reader = McapReader::Open(path);
  read.status = reader.status();
  while (read.status.ok()) {
    auto message = (*reader)->Next();
    read.status = message.status();
    if (!message.ok() || !*message) break;
    read.data.push_back((*message)->data);
    read.messages.push_back(**std::move(message));
  }
  if (reader.ok()) {
    read.cut = (*reader)->cut();
    read.damage = (*reader)->Damage();
  }
  return read;
}

std::string BytesOf(const std::filesystem::path& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

class McapTest : public ::testing::Test {
 protected:
  // Three chunks: 1 and 2, 3, 4.
  std::string NewFile(bool whole = true) {
    const std::string path = folder_ / "file.mcap";
    McapWriter writer(path, kChannels);
    EXPECT_TRUE(writer.Write({At(0, "1"), At(1, "2", 1)}).ok());
    EXPECT_TRUE(writer.Write({At(2, "3")}).ok());
    EXPECT_TRUE(writer.Write({At(3, "4")}).ok());
    EXPECT_TRUE(!whole || writer.Close().ok());
    return path;
  }
  std::vector<std::string> Files() {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
      names.push_back(entry.path().filename());
    }
    std::ranges::sort(names);
    return names;
  }
  std::string Write(const std::string& bytes) {
    const std::string path = folder_ / "other.mcap";
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
  }

  const std::filesystem::path folder_ = FreshFolder();
};

TEST_F(McapTest, WhatWasWrittenIsRead) {
  const Read read = ReadFile(NewFile());
  EXPECT_TRUE(read.status.ok()) << read.status;
  EXPECT_FALSE(read.cut);
  EXPECT_THAT(read.data, ElementsAre("1", "2", "3", "4"));
  EXPECT_EQ(*read.messages[0].channel, kChannels[0]);
  EXPECT_EQ(*read.messages[1].channel, kChannels[1]);
  EXPECT_EQ(read.messages[3].logged, kStart + absl::Seconds(3));
  EXPECT_EQ(read.messages[3].published, kStart + absl::Seconds(2));
}

TEST_F(McapTest, LargeMessagesAreRead) {
  const std::string path = folder_ / "large.mcap";
  McapWriter writer(path, kChannels);
  const std::string noise = Noise(3 << 20);
  ASSERT_TRUE(writer.Write({At(0, noise), At(0, std::string(9 << 20, 'x'))}).ok());
  ASSERT_TRUE(writer.Close().ok());
  EXPECT_LT(std::filesystem::file_size(path), size_t{4} << 20);
  EXPECT_THAT(ReadFile(path).data, ElementsAre(noise, std::string(9 << 20, 'x')));
}

TEST_F(McapTest, CutFileIsReadUpToItsLastWholeChunk) {
  const std::string whole = BytesOf(NewFile());
  size_t last = 0;
  std::set<size_t> counts;
  for (size_t length = mcap::kMagic.size(); length < whole.size(); length += 3) {
    const Read read = ReadFile(Write(whole.substr(0, length)));
    ASSERT_TRUE(read.status.ok()) << length << ": " << read.status;
    ASSERT_GE(read.data.size(), last);
    last = read.data.size();
    counts.insert(last);
    ASSERT_TRUE(read.cut || last == 4) << length;
  }
  EXPECT_THAT(counts, ElementsAre(0u, 2u, 3u, 4u));
  // Within the third chunk, where the file that it was cut to shows it.
  const size_t third = whole.rfind("lz4", whole.rfind("lz4", whole.size() / 2));
  const Read read = ReadFile(Write(whole.substr(0, third + 9)));
  EXPECT_THAT(read.damage, HasSubstr("(a record goes beyond the file's end)"));
}

TEST_F(McapTest, FileThatIsStillWrittenIsRead) {
  const Read read = ReadFile(NewFile(/*whole=*/false));
  EXPECT_TRUE(read.status.ok() && read.cut);
  EXPECT_THAT(read.data, SizeIs(4));
}

TEST_F(McapTest, DamageIsNamedAndNeverReadAsAMessage) {
  const std::string whole = BytesOf(NewFile());
  const size_t chunk = whole.find("lz4");
  ASSERT_NE(chunk, std::string::npos);
  std::string damaged = whole;
  damaged[chunk - 8] ^= 1;  // the checksum of its records
  const Read read = ReadFile(Write(damaged));
  EXPECT_TRUE(read.status.ok()) << read.status;
  EXPECT_THAT(read.data, ElementsAre("3", "4")) << "after the chunk";
  EXPECT_TRUE(read.messages[0].after_damage);
  EXPECT_FALSE(read.messages[1].after_damage);
  EXPECT_EQ(read.damage,
            absl::StrCat("is damaged at byte ", chunk - 41, " (a chunk fails its checksum)"));
  // Any other byte, or several: no crash, nothing that was not written, and nothing lost unsaid.
  for (const size_t length : {1, 7, 40}) {
    for (size_t i = mcap::kMagic.size(); i + length <= whole.size(); ++i) {
      for (const char flip : {'\x41', '\x08', '\x80'}) {
        std::string other = whole;
        for (size_t at = i; at < i + length; ++at)
          other[at] = length == 1 ? other[at] ^ flip : '\0';
        const Read found = ReadFile(Write(other));
        ASSERT_TRUE(found.status.ok()) << found.status;
        ASSERT_TRUE(std::ranges::is_sorted(found.data)) << i;
        for (const std::string& data : found.data) {
          ASSERT_THAT(data, ::testing::AnyOf("1", "2", "3", "4")) << i;
        }
        ASSERT_TRUE(found.data.size() == 4 || !found.damage.empty()) << i << " " << length;
        ASSERT_GE(found.data.size(), 2u) << i << " " << length;
        for (const auto& message : found.messages) {
          ASSERT_EQ(message.channel->topic, message.data == "2" ? "/b" : "/a") << i;
        }
      }
    }
  }
  EXPECT_TRUE(absl::IsInvalidArgument(ReadFile(Write("no such file")).status));
  EXPECT_TRUE(absl::IsNotFound(ReadFile(folder_ / "none.mcap").status));
}

// As of a writer that was killed: nothing at its end says what there was.
TEST_F(McapTest, DamageInAFileWithoutEndIsReadBeforeAndAfter) {
  const std::string whole = BytesOf(NewFile(/*whole=*/false));
  const size_t second = whole.find("lz4", whole.find("lz4") + 1);
  std::string damaged = whole;
  damaged.replace(second - 41, 60, 60, '\0');
  const Read read = ReadFile(Write(damaged));
  EXPECT_TRUE(read.status.ok()) << read.status;
  EXPECT_THAT(read.data, ElementsAre("1", "2", "4"));
  EXPECT_TRUE(read.messages[2].after_damage);
  EXPECT_EQ(read.damage,
            absl::StrCat("is damaged at byte ", second - 41, " (a record is of no known kind)"));
}

TEST_F(McapTest, BlockThatTheDiskDoesNotGiveCostsItsChunk) {
  const std::string path = folder_ / "file.mcap";
  McapWriter writer(path, kChannels);
  for (int i = 1; i <= 3; ++i) {
    ASSERT_TRUE(writer.Write({At(i, std::to_string(i) + Noise(20'000))}).ok());
  }
  ASSERT_TRUE(writer.Close().ok());
  bad_block = 28'672;  // within the second chunk
  const Read read = ReadFile(path);
  bad_block = -1;
  EXPECT_TRUE(read.status.ok()) << read.status;
  ASSERT_THAT(read.data, SizeIs(2));
  EXPECT_EQ(read.data[0][0], '1');
  EXPECT_EQ(read.data[1][0], '3');
  EXPECT_TRUE(read.messages[1].after_damage);
  EXPECT_THAT(read.damage, HasSubstr("(the disk does not give all of a record)"));
}

TEST_F(McapTest, BytesThatAreMissingBeforeTheFirstChunkCostNoMessage) {
  for (const bool closed : {true, false}) {
    const std::string whole = BytesOf(NewFile(closed));
    std::filesystem::remove(folder_ / "file.mcap");
    const size_t chunk = whole.find("lz4") - 41;
    for (size_t i = mcap::kMagic.size(); i < chunk; ++i) {
      std::string other = whole;
      other.erase(i, std::min<size_t>(chunk - i, 5));
      const Read read = ReadFile(Write(other));
      ASSERT_THAT(read.data, ElementsAre("1", "2", "3", "4")) << i << ": " << read.damage;
      ASSERT_EQ(read.messages[1].channel->topic, "/b") << i;
    }
  }
}

TEST_F(McapTest, ExistingFileIsKept) {
  const std::string path = NewFile();
  EXPECT_TRUE(absl::IsAlreadyExists(McapWriter(path, kChannels).Write({At(0, "5")})));
  EXPECT_THAT(ReadFile(path).data, SizeIs(4));
}

// While it lives, no file can grow beyond the size, as on a full disk.
class FilesEndAt {
 public:
  explicit FilesEndAt(uint64_t size) {
    getrlimit(RLIMIT_FSIZE, &old_);
    const rlimit full{size, old_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &full);
  }
  ~FilesEndAt() {
    setrlimit(RLIMIT_FSIZE, &old_);
    std::signal(SIGXFSZ, handler_);
  }

 private:
  void (*handler_)(int) = std::signal(SIGXFSZ, SIG_IGN);
  rlimit old_{};
};

TEST_F(McapTest, FileThatMetAFullDiskIsByteForByteTheOneThatDidNot) {
  const auto write = [&](const std::string& path, bool full) {
    McapWriter writer(path, kChannels);
    for (const char* data : {"before", "meanwhile", "after"}) {
      for (const uint64_t room : {0, 20}) {
        if (!full) continue;
        const FilesEndAt end(writer.bytes() + room);
        const absl::Status status = writer.Write({At(0, data)});
        EXPECT_THAT(std::string(status.message()), HasSubstr(path));
        EXPECT_EQ(std::filesystem::exists(path), writer.bytes() > 0);
      }
      EXPECT_TRUE(writer.Write({At(0, data)}).ok());
    }
    EXPECT_TRUE(writer.Close().ok());
    return BytesOf(path);
  };
  const std::string whole = write(folder_ / "whole.mcap", false);
  EXPECT_TRUE(write(folder_ / "full.mcap", true) == whole);
  EXPECT_THAT(ReadFile(folder_ / "full.mcap").data, ElementsAre("before", "meanwhile", "after"));
}

TEST_F(McapTest, FileThatBeginsOnAFullDiskKeepsItsMessagesUntilThereIsRoom) {
  McapRotation files({folder_, "r", 100'000, 3}, kChannels,
                     [] { return std::vector<McapMessage>(); });
  {
    const FilesEndAt full(20);
    ASSERT_TRUE(files.Add(At(0, "meanwhile")).ok());
    EXPECT_FALSE(files.Flush().ok());
    EXPECT_THAT(Files(), IsEmpty());
    EXPECT_EQ(files.path(), "");
  }
  ASSERT_TRUE(files.Close().ok());
  EXPECT_EQ(files.lost(), 0u);
  EXPECT_THAT(ReadFile(files.path()).data, ElementsAre("meanwhile"));
}

TEST_F(McapTest, DiskThatCreatesNoFileLosesNothing) {
  const std::string missing = folder_ / "missing";
  EventExcerpts excerpts(McapRotation({missing, "stop", 100'000, 3}, kChannels,
                                      [] { return std::vector{At(0, "opening", 1)}; }),
                         absl::Seconds(30), absl::Seconds(30), /*standing=*/1);
  ASSERT_TRUE(excerpts.Add(At(0, "before"), absl::Seconds(0)).ok());
  ASSERT_TRUE(excerpts.Add(At(1, "the stop"), absl::Seconds(1)).ok());
  excerpts.Keep(absl::Seconds(1)).IgnoreError();
  const absl::Status status = excerpts.Flush();
  EXPECT_THAT(std::string(status.message()), HasSubstr("No such file"));
  EXPECT_EQ(excerpts.files().unwritten(), 2u);
  std::filesystem::create_directory(missing);
  ASSERT_TRUE(excerpts.Add(At(2, "after"), absl::Seconds(2)).ok());
  ASSERT_TRUE(excerpts.Close().ok());
  EXPECT_EQ(excerpts.files().lost(), 0u);
  EXPECT_THAT(ReadFile(excerpts.files().path()).data,
              ElementsAre("opening", "before", "the stop", "after"));
}

TEST_F(McapTest, FileOfWhichTheDiskTakesNothingRemovesNoOther) {
  const std::filesystem::path oldest = folder_ / "r-20200101T000000.000Z.mcap";
  std::ofstream(oldest) << "of an earlier run";
  McapRotation files({folder_, "r", 100'000, 1}, kChannels,
                     [] { return std::vector<McapMessage>(); });
  ASSERT_TRUE(files.Add(At(0, "meanwhile")).ok());
  {
    const FilesEndAt full(20);
    EXPECT_FALSE(files.Flush().ok());
  }
  EXPECT_THAT(Files(), ElementsAre(oldest.filename()));
  ASSERT_TRUE(files.Flush().ok());
  EXPECT_THAT(Files(), ElementsAre(std::filesystem::path(files.path()).filename()));
}

TEST_F(McapTest, FolderThatIsRemovedAndMadeAgainGetsANewFile) {
  const std::string folder = folder_ / "removed";
  std::filesystem::create_directory(folder);
  McapRotation files({folder, "r", 100'000, 3}, kChannels,
                     [] { return std::vector{At(0, "opening", 1)}; });
  ASSERT_TRUE(files.Add(At(0, "removed")).ok());
  ASSERT_TRUE(files.Flush().ok());
  ASSERT_TRUE(files.Add(At(0.5, "waiting")).ok());
  std::filesystem::remove_all(folder);
  ASSERT_TRUE(files.Add(At(1, "meanwhile")).ok());
  EXPECT_FALSE(files.Flush().ok());
  std::filesystem::create_directory(folder);
  ASSERT_TRUE(files.Add(At(2, "after")).ok());
  ASSERT_TRUE(files.Close().ok());
  EXPECT_THAT(ReadFile(files.path()).data, ElementsAre("opening", "waiting", "meanwhile", "after"));
}

TEST_F(McapTest, FileThatADiskDoesNotCutBackIsWholeOnceItIsWritten) {
  McapRotation files({folder_, "r", 100'000, 3}, kChannels,
                     [] { return std::vector<McapMessage>(); });
  ASSERT_TRUE(files.Add(At(0, "before")).ok());
  ASSERT_TRUE(files.Flush().ok());
  ASSERT_TRUE(files.Add(At(1, "meanwhile")).ok());
  {
    const FilesEndAt full(std::filesystem::file_size(files.path()) + 20);
    no_file_shrinks = true;
    EXPECT_FALSE(files.Flush().ok());
    no_file_shrinks = false;
  }
  ASSERT_TRUE(files.Close().ok());
  const Read read = ReadFile(files.path());
  EXPECT_THAT(read.data, ElementsAre("before", "meanwhile"));
  EXPECT_TRUE(!read.cut && read.damage.empty()) << read.damage;
}

TEST_F(McapTest, WhatWaitsForAFullDiskAtTheEndIsCounted) {
  McapRotation files({folder_, "r", 100'000, 3}, kChannels,
                     [] { return std::vector<McapMessage>(); });
  ASSERT_TRUE(files.Add(At(0, "before")).ok());
  EXPECT_EQ(files.unwritten(), 1u);
  ASSERT_TRUE(files.Flush().ok());
  EXPECT_EQ(files.unwritten(), 0u);
  ASSERT_TRUE(files.Add(At(1, "meanwhile")).ok());
  ASSERT_TRUE(files.Add(At(2, "meanwhile")).ok());
  {
    const FilesEndAt full(std::filesystem::file_size(files.path()) + 20);
    EXPECT_FALSE(files.Close().ok());
  }
  EXPECT_EQ(files.unwritten(), 2u);
  EXPECT_EQ(files.lost(), 0u);
  EXPECT_THAT(ReadFile(files.path()).data, ElementsAre("before"));
}

TEST_F(McapTest, FilesHaveABoundedSizeAndTheOldestMakeRoom) {
  std::ofstream(folder_ / "a-note.txt") << "of somebody else";
  std::ofstream(folder_ / "r-0-incident.mcap") << "not of this rotation";
  McapRotation files({folder_, "r", 3000, 3}, kChannels,
                     [] { return std::vector{At(-100, "opening", 1)}; });
  for (int i = 0; i < 40; ++i) {
    ASSERT_TRUE(files.Add(At(i, static_cast<char>('A' + i) + Noise(500))).ok());
    ASSERT_TRUE(files.Flush().ok());
  }
  ASSERT_TRUE(files.Close().ok());
  const std::vector<std::string> names = Files();
  ASSERT_THAT(names, SizeIs(5));
  EXPECT_EQ(names[0], "a-note.txt");
  EXPECT_EQ(names[1], "r-0-incident.mcap");
  std::vector<std::string> kept;
  for (size_t i = 2; i < names.size(); ++i) {
    const std::string path = folder_ / names[i];
    EXPECT_LT(std::filesystem::file_size(path), 5000u);
    const Read read = ReadFile(path);
    EXPECT_TRUE(read.status.ok() && !read.cut);
    ASSERT_GT(read.data.size(), 1u);
    EXPECT_EQ(read.data[0], "opening");
    EXPECT_EQ(read.messages[0].logged, read.messages[1].logged);
    kept.insert(kept.end(), read.data.begin() + 1, read.data.end());
  }
  ASSERT_GT(kept.size(), 5u);
  for (size_t i = 0; i < kept.size(); ++i) {
    EXPECT_EQ(kept[kept.size() - 1 - i][0], static_cast<char>('A' + 39 - i));
  }
}

TEST_F(McapTest, EventAfterMuchThatWaitedIsKept) {
  EventExcerpts excerpts(McapRotation({folder_, "stop", uint64_t{1} << 30, 10}, kChannels,
                                      [] { return std::vector<McapMessage>(); }),
                         absl::Seconds(30), absl::Seconds(30), /*standing=*/1);
  const std::string large(1 << 20, 'x');
  for (int i = 0; i < 80; ++i)
    ASSERT_TRUE(excerpts.Add(At(0.1 * i, large), absl::Seconds(0.1 * i)).ok());
  ASSERT_TRUE(excerpts.Add(At(8, "the stop"), absl::Seconds(8)).ok());
  ASSERT_TRUE(excerpts.Keep(absl::Seconds(8)).ok());
  ASSERT_TRUE(excerpts.Close().ok());
  EXPECT_EQ(excerpts.files().lost(), 0u);
  const std::vector<std::string> kept = ReadFile(excerpts.files().path()).data;
  ASSERT_THAT(kept, SizeIs(81));
  EXPECT_EQ(kept.back(), "the stop");
}

TEST_F(McapTest, OldestOfWhatWaitsIsLostNeverTheStop) {
  const std::string missing = folder_ / "missing";
  EventExcerpts excerpts(McapRotation({missing, "stop", uint64_t{1} << 30, 10, {1}}, kChannels,
                                      [] { return std::vector{At(0, "opening", 1)}; }),
                         absl::Seconds(30), absl::Seconds(30), /*standing=*/1);
  const std::string large(1 << 20, 'x');
  ASSERT_TRUE(excerpts.Add(At(0, "standing", 1), absl::Seconds(0)).ok());
  for (int i = 0; i < 80; ++i)
    ASSERT_TRUE(excerpts.Add(At(0.1 * i, large), absl::Seconds(0.1 * i)).ok());
  ASSERT_TRUE(excerpts.Add(At(8, "the stop"), absl::Seconds(8)).ok());
  excerpts.Keep(absl::Seconds(8)).IgnoreError();
  ASSERT_TRUE(excerpts.Add(At(9, large), absl::Seconds(9)).ok());
  std::filesystem::create_directory(missing);
  ASSERT_TRUE(excerpts.Close().ok());
  EXPECT_EQ(excerpts.files().lost(), 18u);
  const std::vector<std::string> kept = ReadFile(excerpts.files().path()).data;
  ASSERT_THAT(kept, SizeIs(66));
  EXPECT_EQ(kept[0], "opening");
  EXPECT_EQ(kept[1], "standing") << "of a channel whose messages hold until the next";
  EXPECT_EQ(kept[64], "the stop");
}

TEST_F(McapTest, MessagesAreReadAgainInAnyOrder) {
  McapWriter writer(folder_ / "f.mcap", kChannels);
  std::deque<McapMessage> chunk;
  for (int i = 0; i < 20; ++i) {
    chunk.push_back(At(i, absl::StrCat("message ", i)));
    if (i % 3 != 2 && i != 19) continue;
    ASSERT_TRUE(writer.Write(std::exchange(chunk, {})).ok());
  }
  ASSERT_TRUE(writer.Close().ok());
  auto reader = *McapReader::Open(folder_ / "f.mcap");
  std::vector<McapReader::Place> places;
  while (true) {
    const auto message = reader->Next();
    ASSERT_TRUE(message.ok());
    if (!*message) break;
    places.push_back((*message)->place);
  }
  ASSERT_THAT(places, SizeIs(20));
  for (const size_t i : {19, 0, 1, 2, 3, 18, 2}) {
    const auto message = reader->Read(places[i]);
    ASSERT_TRUE(message.ok()) << message.status();
    EXPECT_EQ(message->data, absl::StrCat("message ", i));
  }
}

TEST_F(McapTest, TwoFilesOfOneMillisecondAreBothKept) {
  McapRotation files({folder_, "r", 1 << 20, 10}, kChannels,
                     [] { return std::vector<McapMessage>(); });
  for (const char* data : {"a", "b"}) {
    ASSERT_TRUE(files.Add(At(0, data)).ok());
    ASSERT_TRUE(files.Close().ok());
  }
  const std::vector<std::string> names = Files();
  ASSERT_THAT(names, SizeIs(2));
  EXPECT_THAT(ReadFile(folder_ / names[0]).data, ElementsAre("a"));
  EXPECT_THAT(ReadFile(folder_ / names[1]).data, ElementsAre("b"));
}

TEST_F(McapTest, FileThatIsWrittenMakesNoRoomThoughOthersHaveLaterNames) {
  for (const char* later : {"20990101T000000.000Z", "20990101T000001.000Z"}) {
    std::ofstream(folder_ / (std::string("scenes-") + later + ".mcap"));
  }
  McapRotation files({folder_, "scenes", 1 << 20, 2}, kChannels,
                     [] { return std::vector<McapMessage>(); });
  ASSERT_TRUE(files.Add(At(0, "a")).ok());
  ASSERT_TRUE(files.Close().ok());
  EXPECT_THAT(ReadFile(files.path()).data, ElementsAre("a"));
}

TEST_F(McapTest, AClockThatIsSetBackMakesNoNewFileTheOldest) {
  std::ofstream(folder_ / "r-20990101T000000.000Z.mcap") << "of an earlier run";
  McapRotation files({folder_, "r", 1 << 20, 3}, kChannels,
                     [] { return std::vector<McapMessage>(); });
  for (const int hours : {40, 30, 20, 10}) {
    ASSERT_TRUE(files.Add(At(3600 * hours, std::to_string(hours))).ok());
  }
  ASSERT_TRUE(files.Close().ok());
  std::vector<std::string> kept;
  for (const std::string& name : Files()) {
    for (const std::string& data : ReadFile(folder_ / name).data) kept.push_back(data);
  }
  EXPECT_THAT(kept, ElementsAre("10", "20", "30"));
}

TEST_F(McapTest, TheTimeAroundEventsIsKeptAndNoOther) {
  EventExcerpts excerpts(McapRotation({folder_, "stop", 1 << 20, 10}, kChannels,
                                      [] { return std::vector<McapMessage>(); }),
                         absl::Seconds(30), absl::Seconds(30), /*standing=*/1);
  auto add_until = [&, next = 0](int end) mutable {
    for (; next <= end; ++next)
      ASSERT_TRUE(excerpts.Add(At(next, std::to_string(next)), absl::Seconds(next)).ok());
  };
  add_until(100);
  EXPECT_THAT(Files(), IsEmpty());
  ASSERT_TRUE(excerpts.Keep(absl::Seconds(100)).ok());
  add_until(120);
  ASSERT_TRUE(excerpts.Keep(absl::Seconds(120)).ok());  // within the time after the first
  add_until(300);
  ASSERT_TRUE(excerpts.Keep(absl::Seconds(300)).ok());
  add_until(310);
  ASSERT_TRUE(excerpts.Close().ok());
  const std::vector<std::string> names = Files();
  ASSERT_THAT(names, SizeIs(2));
  const std::vector<std::string> first = ReadFile(folder_ / names[0]).data;
  EXPECT_EQ(first.front(), "70");
  EXPECT_EQ(first.back(), "150");
  EXPECT_THAT(first, SizeIs(81));
  const std::vector<std::string> second = ReadFile(folder_ / names[1]).data;
  EXPECT_EQ(second.front(), "270");
  EXPECT_EQ(second.back(), "310");
}

}  // namespace
}  // namespace silhouette
