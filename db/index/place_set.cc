#include "db/index/place_set.h"

#include <algorithm>
#include <bit>

namespace silhouette {
namespace {

template <size_t kBytes>
struct VectorOf;
template <>
struct VectorOf<16> {
  using Type [[gnu::vector_size(16), gnu::aligned(8), gnu::may_alias]] = uint64_t;
};
template <>
struct VectorOf<32> {
  using Type [[gnu::vector_size(32), gnu::aligned(8), gnu::may_alias]] = uint64_t;
};
template <>
struct VectorOf<64> {
  using Type [[gnu::vector_size(64), gnu::aligned(8), gnu::may_alias]] = uint64_t;
};

// Eight vectors of the result at a time stay in registers. Not for the address sanitizer: its
// frames (detect_stack_use_after_return) do not keep the alignment of 64 bytes that GCC 12's moves
// count on.
template <size_t kBytes>
[[gnu::always_inline, gnu::no_sanitize_address]] inline void AddUnionInVectors(
    const uint64_t* sets, std::span<const uint32_t> chosen, PlaceSet& result) {
  using Vector = typename VectorOf<kBytes>::Type;
  constexpr size_t kRegisters = 8;
  constexpr size_t kVectors = PlaceSet::kWords * 8 / kBytes;
  static_assert(kVectors % kRegisters == 0);
  auto* out = reinterpret_cast<Vector*>(result.words.data());
  for (size_t first = 0; first < kVectors; first += kRegisters) {
    Vector sum[kRegisters];
#pragma GCC unroll 8
    for (size_t i = 0; i < kRegisters; ++i) sum[i] = out[first + i];
    for (const uint32_t set : chosen) {
      const auto* in = reinterpret_cast<const Vector*>(sets + PlaceSet::kWords * set) + first;
#pragma GCC unroll 8
      for (size_t i = 0; i < kRegisters; ++i) sum[i] |= in[i];
    }
#pragma GCC unroll 8
    for (size_t i = 0; i < kRegisters; ++i) out[first + i] = sum[i];
  }
}

alignas(64) constexpr std::array<uint64_t, kLineWords> kNoLine{};

// The same of sets that are told by differences. As many lines at a time as registers hold.
template <size_t kBytes>
[[gnu::always_inline, gnu::no_sanitize_address]] inline void AddDifferencesInVectors(
    std::span<const SetDifference> chosen, PlaceSet& result) {
  using Vector = typename VectorOf<kBytes>::Type;
  constexpr size_t kRegisters = 8;
  constexpr size_t kPerLine = kLineWords * 8 / kBytes;
  constexpr size_t kLines = kRegisters / kPerLine;
  auto* out = reinterpret_cast<Vector*>(result.words.data());
  for (size_t line = 0; line < PlaceSet::kWords / kLineWords; line += kLines) {
    Vector* here = out + line * kPerLine;
    Vector sum[kRegisters];
#pragma GCC unroll 8
    for (size_t i = 0; i < kRegisters; ++i) sum[i] = here[i];
    for (const SetDifference& set : chosen) {
      const uint64_t* base = set.base + kLineWords * line;
      const uint64_t before = set.differing & ((uint64_t{1} << line) - 1);
      const uint64_t* next = set.lines + kLineWords * static_cast<size_t>(std::popcount(before));
#pragma GCC unroll 8
      for (size_t i = 0; i < kLines; ++i) {
        const bool differs = (set.differing >> (line + i) & 1) != 0;
        const uint64_t* with = differs ? next : kNoLine.data();
        next += differs ? kLineWords : 0;
#pragma GCC unroll 4
        for (size_t v = 0; v < kPerLine; ++v) {
          const size_t at = i * kPerLine + v;
          // At whatever address.
          Vector words;
          Vector difference;
          __builtin_memcpy(&words, base + at * kBytes / 8, kBytes);
          __builtin_memcpy(&difference, with + v * kBytes / 8, kBytes);
          sum[at] |= words ^ difference;
        }
      }
    }
#pragma GCC unroll 8
    for (size_t i = 0; i < kRegisters; ++i) here[i] = sum[i];
  }
}

[[gnu::no_sanitize_address]] void AddBaseline(const uint64_t* sets,
                                              std::span<const uint32_t> chosen, PlaceSet& result) {
  AddUnionInVectors<16>(sets, chosen, result);
}
[[gnu::no_sanitize_address]] void AddDifferencesBaseline(std::span<const SetDifference> chosen,
                                                         PlaceSet& result) {
  AddDifferencesInVectors<16>(chosen, result);
}

#if defined(__x86_64__)
[[gnu::target("avx2"), gnu::no_sanitize_address]] void AddAvx2(const uint64_t* sets,
                                                               std::span<const uint32_t> chosen,
                                                               PlaceSet& result) {
  AddUnionInVectors<32>(sets, chosen, result);
}
[[gnu::target("avx2"), gnu::no_sanitize_address]] void AddDifferencesAvx2(
    std::span<const SetDifference> chosen, PlaceSet& result) {
  AddDifferencesInVectors<32>(chosen, result);
}

[[gnu::target("avx512f"), gnu::no_sanitize_address]] void AddAvx512(
    const uint64_t* sets, std::span<const uint32_t> chosen, PlaceSet& result) {
  AddUnionInVectors<64>(sets, chosen, result);
}
[[gnu::target("avx512f"), gnu::no_sanitize_address]] void AddDifferencesAvx512(
    std::span<const SetDifference> chosen, PlaceSet& result) {
  AddDifferencesInVectors<64>(chosen, result);
}
#endif

}  // namespace

bool PlaceSet::Empty() const {
  return std::all_of(words.begin(), words.end(), [](uint64_t word) { return word == 0; });
}

PlaceSet& PlaceSet::operator|=(const PlaceSet& other) {
  for (size_t i = 0; i < kWords; ++i) words[i] |= other.words[i];
  return *this;
}

PlaceSet& PlaceSet::operator&=(const PlaceSet& other) {
  for (size_t i = 0; i < kWords; ++i) words[i] &= other.words[i];
  return *this;
}

PlaceSet& PlaceSet::operator-=(const PlaceSet& other) {
  for (size_t i = 0; i < kWords; ++i) words[i] &= ~other.words[i];
  return *this;
}

uint64_t SetDifference::Word(size_t word) const {
  const uint64_t line = uint64_t{1} << (word / kLineWords);
  if ((differing & line) == 0) return base[word];
  const auto before = static_cast<size_t>(std::popcount(differing & (line - 1)));
  return base[word] ^ lines[kLineWords * before + word % kLineWords];
}

std::vector<InstructionSet> InstructionSets() {
  std::vector<InstructionSet> sets = {InstructionSet::kBaseline};
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) sets.push_back(InstructionSet::kAvx2);
  if (__builtin_cpu_supports("avx512f")) sets.push_back(InstructionSet::kAvx512);
#endif
  return sets;
}

Unions UnionsWith(InstructionSet set) {
#if defined(__x86_64__)
  if (set == InstructionSet::kAvx512) return {AddAvx512, AddDifferencesAvx512};
  if (set == InstructionSet::kAvx2) return {AddAvx2, AddDifferencesAvx2};
#endif
  static_cast<void>(set);
  return {AddBaseline, AddDifferencesBaseline};
}

const Unions& BestUnions() {
  static const Unions best = UnionsWith(InstructionSets().back());
  return best;
}

}  // namespace silhouette
