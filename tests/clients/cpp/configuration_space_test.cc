// SPDX-License-Identifier: Apache-2.0
// The configuration space as it comes over the wire: what was not received is unknown.
#include "silhouette/configuration_space.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <stdexcept>

#include "silhouette/client.h"
#include "tests/clients/cpp/watched_space.h"
#include "tests/random.h"

namespace silhouette::client {
namespace {

using ::testing::HasSubstr;

using Part = v1::GetConfigurationSpaceResponse;

// 100 x 100 configurations in tiles of 64 x 64: 4 tiles, three of them with absent places.
const ConfigurationGrid& ConfigurationSpaceGrid() {
  static const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 1, .steps = 100},
                                       {.name = "b", .lower = 0, .upper = 2, .steps = 100}},
                                      {64, 64});
  return grid;
}

Part FirstPart() {
  Part part;
  part.mutable_basis()->set_scene_id(5);
  part.mutable_basis()->mutable_valid_for()->set_seconds(60);
  Set(ConfigurationSpaceGrid(), part.mutable_grid());
  return part;
}

absl::StatusOr<ConfigurationSpace> Fetch(const std::vector<Part>& parts,
                                         const grpc::Status& end = grpc::Status::OK,
                                         const std::vector<double>& levels = {}) {
  FakeServer server;
  server.configuration_space = [&](auto&, auto&, grpc::ServerWriter<Part>& writer) {
    for (const Part& part : parts) writer.Write(part);
    return end;
  };
  return ClientOfHere(server).GetConfigurationSpace({}, {}, std::nullopt, levels);
}

TEST(ConfigurationSpace, IsReadAsItWasSent) {
  Random random;
  std::vector<Part> parts = {FirstPart()};
  std::vector<State> states(ConfigurationSpaceGrid().number_limit(), State::kUnknown);
  StateCounts expected;
  for (uint64_t t = 0; t < ConfigurationSpaceGrid().tiles(); ++t) {
    v1::ConfigurationSpaceTile tile;
    tile.set_tile(t);
    tile.set_free(std::string(512, '\0'));
    tile.set_occupied(std::string(512, '\0'));
    for (uint64_t place = 0; place < kTileSize; ++place) {
      const ConfigurationNumber number = t * kTileSize + place;
      if (!ConfigurationSpaceGrid().Contains(number)) continue;
      states[number] = static_cast<State>(random() % 3);
      const char bit = static_cast<char>(1 << (place % 8));
      if (states[number] == State::kFree) (*tile.mutable_free())[place / 8] |= bit;
      if (states[number] == State::kOccupied) (*tile.mutable_occupied())[place / 8] |= bit;
      expected.free += states[number] == State::kFree ? 1 : 0;
      expected.occupied += states[number] == State::kOccupied ? 1 : 0;
      expected.unknown += states[number] == State::kUnknown ? 1 : 0;
    }
    parts.emplace_back();
    *parts.back().add_tiles() = tile;
  }
  const auto space = Fetch(parts);
  ASSERT_TRUE(space.ok()) << space.status();
  EXPECT_EQ(space->grid(), ConfigurationSpaceGrid());
  EXPECT_EQ(space->basis().scene_id, 5u);
  for (ConfigurationNumber n = 0; n < states.size(); ++n) {
    ASSERT_EQ(space->StateAt(n), states[n]) << n;
    ASSERT_EQ(space->IsFree(n), states[n] == State::kFree);
  }
  EXPECT_EQ(space->Count().free, expected.free);
  EXPECT_EQ(space->Count().occupied, expected.occupied);
  EXPECT_EQ(space->Count().unknown, expected.unknown);
}

TEST(ConfigurationSpace, TileThatDidNotComeIsUnknown) {
  Part part = FirstPart();
  AddTile(part, 0, true);
  part.set_tiles_left_out(ConfigurationSpaceGrid().tiles() - 1);
  const auto space = Fetch({part});
  ASSERT_TRUE(space.ok()) << space.status();
  EXPECT_EQ(space->tiles_left_out(), ConfigurationSpaceGrid().tiles() - 1);
  EXPECT_TRUE(space->IsFree(0));
  EXPECT_EQ(space->StateAt(kTileSize), State::kUnknown);
  EXPECT_EQ(space->Count().free, kTileSize);
  EXPECT_EQ(space->Count().unknown, ConfigurationSpaceGrid().size() - kTileSize);
}

TEST(ConfigurationSpace, AbsentPlaceIsNeverFree) {
  Part part = FirstPart();
  for (uint64_t tile = 0; tile < ConfigurationSpaceGrid().tiles(); ++tile)
    AddTile(part, tile, true);
  const auto space = Fetch({part});
  ASSERT_TRUE(space.ok()) << space.status();
  for (ConfigurationNumber n = 0; n < ConfigurationSpaceGrid().number_limit(); ++n) {
    ASSERT_EQ(space->IsFree(n), ConfigurationSpaceGrid().Contains(n)) << n;
  }
  EXPECT_EQ(space->Count().free, ConfigurationSpaceGrid().size());
  EXPECT_FALSE(space->IsFree(ConfigurationSpaceGrid().number_limit()));
}

TEST(ConfigurationSpace, FreeAndOccupiedAtOnceIsUnknown) {
  Part part = FirstPart();
  AddTile(part, 0, true);
  part.mutable_tiles(0)->mutable_occupied()->at(0) = 1;
  const auto space = Fetch({part});
  ASSERT_TRUE(space.ok());
  EXPECT_EQ(space->StateAt(0), State::kUnknown);
  EXPECT_EQ(space->StateAt(1), State::kFree);
}

TEST(ConfigurationSpace, WithoutASceneNothingIsFree) {
  Part part = FirstPart();
  part.clear_basis();
  AddTile(part, 0, true);
  const auto space = Fetch({part});
  ASSERT_TRUE(space.ok());
  EXPECT_EQ(space->Count().free, 0u);
  EXPECT_EQ(space->Count().unknown, ConfigurationSpaceGrid().size());
  EXPECT_EQ(space->unknown_reason(), Reason::kNoScene);
}

TEST(ConfigurationSpace, WithAReasonOfTheServerNothingIsFreeWhateverTilesCome) {
  Part part = FirstPart();
  AddTile(part, 0, true);
  EXPECT_EQ(Fetch({part})->unknown_reason(), std::nullopt);
  // 99: what a newer server may say.
  for (const auto& [sent, read] : {std::pair(2, Reason::kSceneStale), {99, Reason::kUnspecified}}) {
    part.set_unknown_reason(static_cast<v1::Verdict::Reason>(sent));
    const auto space = Fetch({part});
    ASSERT_TRUE(space.ok()) << space.status();
    EXPECT_EQ(space->unknown_reason(), read);
    EXPECT_EQ(space->Count().unknown, ConfigurationSpaceGrid().size());
  }
}

TEST(ConfigurationSpace, BrokenStreamIsAnErrorAndNoSpace) {
  Part part = FirstPart();
  AddTile(part, 0, true);
  for (grpc::StatusCode code : {grpc::StatusCode::UNAVAILABLE, grpc::StatusCode::INTERNAL,
                                grpc::StatusCode::CANCELLED, grpc::StatusCode::DATA_LOSS}) {
    const auto space = Fetch({part}, grpc::Status(code, "broke off"));
    const bool cancelled = code == grpc::StatusCode::CANCELLED;  // not by this client
    EXPECT_EQ(space.status().code(),
              cancelled ? absl::StatusCode::kUnavailable : static_cast<absl::StatusCode>(code));
    EXPECT_THAT(std::string(space.status().message()), HasSubstr("127.0.0.1:"));
  }
}

TEST(ConfigurationSpace, MalformedAnswerIsAnError) {
  const auto fails = [](const std::vector<Part>& parts, const std::string& what) {
    const absl::Status status = Fetch(parts).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInternal);
    EXPECT_THAT(std::string(status.message()), HasSubstr(what));
  };
  fails({}, "no grid");
  Part no_grid;
  AddTile(no_grid, 0, true);
  fails({no_grid}, "no grid");
  Part bad_grid = FirstPart();
  bad_grid.mutable_grid()->mutable_joints(0)->set_steps(0);
  fails({bad_grid}, "joint 'a'");
  Part edges = FirstPart();
  edges.mutable_grid()->clear_tile_edges();
  fails({edges}, "tile edges");
  Part beyond = FirstPart();
  AddTile(beyond, 4, true);
  fails({beyond}, "tile 4 is beyond");
  Part twice = FirstPart();
  AddTile(twice, 1, true);
  fails({twice, twice}, "tile 1 comes twice");
  Part short_bits = FirstPart();
  AddTile(short_bits, 2, true);
  short_bits.mutable_tiles(0)->mutable_free()->pop_back();
  fails({short_bits}, "tile 2 has 511 bytes");
}

TEST(ConfigurationSpace, AsksForTheTilesThatAreWanted) {
  FakeServer server;
  v1::GetConfigurationSpaceRequest seen;
  server.configuration_space = [&](auto&, const v1::GetConfigurationSpaceRequest& request,
                                   grpc::ServerWriter<Part>& writer) {
    seen = request;
    writer.Write(FirstPart());
    return grpc::Status::OK;
  };
  const std::vector<uint64_t> tiles = {1, 3};
  ASSERT_TRUE(ClientOfHere(server).GetConfigurationSpace({.preset = "paper"}, tiles).ok());
  EXPECT_THAT(seen.tiles(), testing::ElementsAre(1, 3));
  EXPECT_EQ(seen.policy().preset(), "paper");
}

// Sets of bytes whose first byte is the given one, the others none.
std::string Bits(unsigned first) {
  std::string bytes(512, '\0');
  bytes[0] = static_cast<char>(first);
  return bytes;
}

// Places 0 to 3 are free, 4 is occupied; the levels are said to have these places above them.
Part PartWithLevels(const std::vector<unsigned>& above) {
  Part part = FirstPart();
  v1::ConfigurationSpaceTile& tile = *part.add_tiles();
  tile.set_free(Bits(0b01111));
  tile.set_occupied(Bits(0b10000));
  for (const unsigned places : above) tile.add_clearances(Bits(places));
  return part;
}

TEST(ClearanceLevels, TellTheGreatestThatIsExceeded) {
  const auto space =
      Fetch({PartWithLevels({0b1110, 0b1100, 0b1000})}, grpc::Status::OK, {1, 2.5, 8});
  ASSERT_TRUE(space.ok()) << space.status();
  EXPECT_THAT(space->clearance_levels(), testing::ElementsAre(1, 2.5, 8));
  const ClearanceBound none{.state = State::kFree, .exceeds = std::nullopt};
  EXPECT_EQ(space->ClearanceAt(0), none);
  EXPECT_EQ(space->ClearanceAt(1), (ClearanceBound{State::kFree, 1}));
  EXPECT_EQ(space->ClearanceAt(2), (ClearanceBound{State::kFree, 2.5}));
  EXPECT_EQ(space->ClearanceAt(3), (ClearanceBound{State::kFree, 8}));
  EXPECT_EQ(space->ClearanceAt(4), (ClearanceBound{State::kOccupied, std::nullopt}));
  for (const ConfigurationNumber unknown : {ConfigurationNumber{5}, kTileSize, 1000 * kTileSize}) {
    EXPECT_EQ(space->ClearanceAt(unknown), (ClearanceBound{State::kUnknown, std::nullopt}));
  }
  EXPECT_THAT(space->CountAbove(), testing::ElementsAre(3, 2, 1));
}

TEST(ClearanceLevels, OnlyWhatIsFreeAndAboveAllLowerOnesIsAbove) {
  const auto space = Fetch({PartWithLevels({0b110011, 0b101})}, grpc::Status::OK, {1, 2});
  ASSERT_TRUE(space.ok()) << space.status();
  EXPECT_EQ(space->ClearanceAt(0).exceeds, 2);
  EXPECT_EQ(space->ClearanceAt(1).exceeds, 1);
  EXPECT_EQ(space->ClearanceAt(2), (ClearanceBound{State::kFree, std::nullopt}));
  EXPECT_EQ(space->ClearanceAt(4), (ClearanceBound{State::kOccupied, std::nullopt}));
  EXPECT_EQ(space->ClearanceAt(5), (ClearanceBound{State::kUnknown, std::nullopt}));
  EXPECT_THAT(space->CountAbove(), testing::ElementsAre(2, 1));
}

TEST(ClearanceLevels, WithoutASceneThereAreNone) {
  Part part = PartWithLevels({0b1111});
  part.clear_basis();
  const auto space = Fetch({part}, grpc::Status::OK, {1});
  ASSERT_TRUE(space.ok()) << space.status();
  EXPECT_EQ(space->ClearanceAt(0), (ClearanceBound{State::kUnknown, std::nullopt}));
  EXPECT_THAT(space->CountAbove(), testing::ElementsAre(0));
}

TEST(ClearanceLevels, OfAServerThatDoesNotTellThemAreAnError) {
  const absl::Status status = Fetch({PartWithLevels({})}, grpc::Status::OK, {1, 2}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kUnimplemented);
  EXPECT_THAT(std::string(status.message()), HasSubstr("reports no clearances"));
}

TEST(ClearanceLevels, MalformedAnswerIsAnError) {
  const auto fails = [](const Part& part, const std::string& what) {
    const absl::Status status = Fetch({part}, grpc::Status::OK, {1, 2}).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInternal);
    EXPECT_THAT(std::string(status.message()), HasSubstr(what));
  };
  fails(PartWithLevels({1}), "tile 0 has 1 clearance levels instead of 2");
  fails(PartWithLevels({7, 3, 1}), "tile 0 has 3 clearance levels instead of 2");
  Part short_bits = PartWithLevels({3, 1});
  short_bits.mutable_tiles(0)->mutable_clearances(1)->pop_back();
  fails(short_bits, "tile 0 has 511 bytes");
  EXPECT_EQ(Fetch({PartWithLevels({1})}).status().code(), absl::StatusCode::kInternal)
      << "nobody asked";
}

TEST(ClearanceLevels, ThatDoNotAscendAreNoConfigurationSpace) {
  EXPECT_THROW(ConfigurationSpace(ConfigurationSpaceGrid(), {.scene_id = 1}, {}, 0, {2, 1}),
               std::invalid_argument);
  EXPECT_THROW(ConfigurationSpace(ConfigurationSpaceGrid(), {.scene_id = 1}, {}, 0, {1, 1}),
               std::invalid_argument);
}

}  // namespace
}  // namespace silhouette::client
