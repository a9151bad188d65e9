// SPDX-License-Identifier: Apache-2.0
#include "db/index/place_set.h"

#include <algorithm>

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

[[gnu::no_sanitize_address]] void AddBaseline(const uint64_t* sets,
                                              std::span<const uint32_t> chosen, PlaceSet& result) {
  AddUnionInVectors<16>(sets, chosen, result);
}
#if defined(__x86_64__)
[[gnu::target("avx2"), gnu::no_sanitize_address]] void AddAvx2(const uint64_t* sets,
                                                               std::span<const uint32_t> chosen,
                                                               PlaceSet& result) {
  AddUnionInVectors<32>(sets, chosen, result);
}
[[gnu::target("avx512f"), gnu::no_sanitize_address]] void AddAvx512(
    const uint64_t* sets, std::span<const uint32_t> chosen, PlaceSet& result) {
  AddUnionInVectors<64>(sets, chosen, result);
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

std::vector<InstructionSet> InstructionSets() {
  std::vector<InstructionSet> sets = {InstructionSet::kBaseline};
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) sets.push_back(InstructionSet::kAvx2);
  if (__builtin_cpu_supports("avx512f")) sets.push_back(InstructionSet::kAvx512);
#endif
  return sets;
}

AddUnion UnionWith(InstructionSet set) {
#if defined(__x86_64__)
  if (set == InstructionSet::kAvx512) return AddAvx512;
  if (set == InstructionSet::kAvx2) return AddAvx2;
#endif
  static_cast<void>(set);
  return AddBaseline;
}

AddUnion BestUnion() {
  static const AddUnion best = UnionWith(InstructionSets().back());
  return best;
}

}  // namespace silhouette
