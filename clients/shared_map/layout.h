// The shared map: the file in which a server publishes the states of all configurations, for
// clients on the same machine that map it into their memory. All that both sides agree on.
//
// The file is a sequence of words: 64 bits, little-endian; integers are unsigned unless said
// otherwise, times are signed nanoseconds. Its first page, 4096 bytes, is the head:
//
//   word 0      "silhmap" and a zero byte
//   word 1      format version, 2
//   word 2      size of the file in bytes
//   word 3      number of tiles of the grid
//   word 4, 5   offset in bytes and size in bytes of the description
//   word 6, 7   offset in bytes of buffer 0, and from it to buffer 1
//   word 8, 9   the machine's boot: the 16 bytes of /proc/sys/kernel/random/boot_id in their order;
//               all zero: it is not known, and no reader can tell how old the states are
//   word 10     the time namespace: the number of the file /proc/self/ns/time; 0: there is none
//   word 16     0, or the map is closed: 1: the server stopped; 2: another file takes its place
//   word 17     number of the newest update, 0: none yet. Buffer number % 2 has it.
//
// The description is a serialised silhouette.v1.GetDatabaseResponse: the grid, the views, the
// generation of the database, and as default_policy the policy that the states are of. Words 0 to
// 10 and the description never change: a database in place of another gets a file of its own.
//
// A buffer begins on a page:
//
//   word 0      2 u: it has update u, whole; odd: an update is being written
//   word 1      why all states are unknown, silhouette.v1.Verdict.Reason; 0: they are not
//   word 2      the scene's id; 0: there is none
//   word 3      when the scene's oldest image was taken, by CLOCK_MONOTONIC
//   word 4      until when the states may be relied on, that instant included, likewise
//   word 5      why they are unknown after that
//   word 6      when the oldest image was taken, by the clock of whoever took it, since 1970
//   word 7      size in bytes of the names of the allowed regions behind the states
//   word 8 ..   those names, one a line, no more than 4160 bytes
//   word 528    what is told of grid cells. 0: nothing; 1: some that are free; 2: just those that
//               are, and a configuration that takes all corners of another one, all of which are
//               free or occupied, is occupied
//   byte 8192   the states: three words for every 64 places, in the order of their numbers. Bit
//               i % 64 of word 3 (i / 64) is set if the configuration i is free, of the word after
//               that if it is occupied; neither: unknown, or absent from the grid. Of the third
//               word it is set if the grid cell that begins at i is free: the box from there to the
//               next value along every joint, round the turn on a continuous joint, and without
//               extent along another joint that has its last value there. Then every configuration
//               in the cell is free, its rim included.
//
// The server stores an update in the buffer that the newest one is not in: word 0 becomes odd, the
// rest is written, word 0 becomes 2 u, then the head names u. A reader takes the newest buffer,
// reads what it wants between two looks at word 0, and begins anew if that was not 2 u both times.
// Every word from word 16 of the head on is accessed atomically: the server stores with release
// order, a reader loads with acquire order. Who sees a word of an update therefore sees that its
// writing had begun.
//
// A part of the pure core.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>

namespace silhouette::shared_map {

static_assert(std::endian::native == std::endian::little,
              "the words of the file are little-endian");

// "silhmap" and a zero byte.
inline constexpr uint64_t kMagic = 0x0070616d686c6973;
inline constexpr uint64_t kFormatVersion = 2;
inline constexpr size_t kPage = 4096;
inline constexpr size_t kBuffers = 2;
inline constexpr size_t kPlacesPerTile = 4096;

// Words of the head.
enum : size_t {
  kHeadMagic = 0,
  kHeadVersion = 1,
  kHeadFileBytes = 2,
  kHeadTiles = 3,
  kHeadDescriptionOffset = 4,
  kHeadDescriptionBytes = 5,
  kHeadBufferOffset = 6,
  kHeadBufferDistance = 7,
  kHeadBoot = 8,
  kHeadTimeNamespace = 10,
  kHeadClosed = 16,
  kHeadNewest = 17,
};

// Words of a buffer.
enum : size_t {
  kBufferSequence = 0,
  kBufferReason = 1,
  kBufferScene = 2,
  kBufferTaken = 3,
  kBufferValidUntil = 4,
  kBufferReasonAfter = 5,
  kBufferSceneTime = 6,
  kBufferNamesBytes = 7,
  kBufferNames = 8,
  kBufferCells = 528,
};
inline constexpr size_t kMostNamesBytes = 4160;
inline constexpr size_t kStatesOffset = 8192;
inline constexpr size_t kWordsPerPlaces = 3;  // for 64 of them
inline constexpr size_t kWordsPerTile = kWordsPerPlaces * kPlacesPerTile / 64;
static_assert(kBufferNames * sizeof(uint64_t) + kMostNamesBytes == kBufferCells * sizeof(uint64_t));

// What is told of grid cells.
enum class Cells : uint64_t { kNothing = 0, kSomeFree = 1, kExact = 2 };

enum class Closed : uint64_t { kNo = 0, kStopped = 1, kReplaced = 2 };

// Where the parts of a file lie, in bytes.
struct Layout {
  uint64_t tiles = 0;
  uint64_t description_bytes = 0;

  // Whether all of it can be counted in bytes.
  bool Possible() const;

  uint64_t DescriptionOffset() const { return kPage; }
  uint64_t BufferOffset() const;
  uint64_t BufferDistance() const;
  uint64_t FileBytes() const;

  bool operator==(const Layout&) const = default;
};

// Whose instants CLOCK_MONOTONIC counts.
struct ClockId {
  uint64_t boot[2] = {0, 0};
  uint64_t time_namespace = 0;

  // Of this process. The boot is zero where the kernel does not tell.
  static ClockId Ours();

  // Whether instants of the two can be compared: they are equal, and of a boot that is known.
  bool SameAs(const ClockId& other) const {
    return *this == other && (boot[0] != 0 || boot[1] != 0);
  }

  bool operator==(const ClockId&) const = default;
};

// What an update says besides the states; the words of a buffer of these names.
struct Stamp {
  uint64_t reason = 0;
  uint64_t scene = 0;
  int64_t taken = 0;
  int64_t valid_until = 0;
  uint64_t reason_after = 0;
  int64_t scene_time = 0;
  Cells cells = Cells::kNothing;

  bool operator==(const Stamp&) const = default;
};

}  // namespace silhouette::shared_map
