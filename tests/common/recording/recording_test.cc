// SPDX-License-Identifier: Apache-2.0
// What a Recorder writes, as a Recording finds it again.
#include "common/recording/recording.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/test_folder.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

const absl::Time kStart = absl::FromUnixSeconds(1'769'860'800);

absl::Time After(double seconds) { return kStart + absl::Seconds(seconds); }

// Both clocks after `seconds`, the wall clock set by `step` since the start.
RecorderTime Now(double seconds, double step = 0) {
  return {.wall = After(seconds + step), .running = absl::Hours(50) + absl::Seconds(seconds)};
}

class RecordingTest : public ::testing::Test {
 protected:
  static v1::GetDatabaseResponse Database() {
    v1::GetDatabaseResponse database;
    database.set_cell_name("cell");
    database.set_cell_digest(5);
    database.set_generation(3);
    database.add_views()->set_name("left");
    return database;
  }
  RecordingTest() : recorder({.folder = folder}, Database()) {}

  static v1::WatchScenesResponse Scene(uint64_t id) {
    v1::WatchScenesResponse news;
    news.mutable_scene()->set_id(id);
    return news;
  }
  static v1::WatchScenesResponse State(v1::Verdict::Reason unknown = {}) {
    v1::WatchScenesResponse news;
    news.mutable_state()->set_unknown_reason(unknown);
    return news;
  }
  static v1::WatchScenesResponse Path(uint64_t id, v1::Verdict::State state) {
    v1::WatchScenesResponse news;
    v1::WatchedPath& path = *news.add_paths();
    path.set_id(id);
    path.mutable_answer()->mutable_check()->mutable_verdict()->set_state(state);
    return news;
  }

  std::vector<std::string> Files(const std::string& prefix) const {
    return FilesIn(folder, prefix);
  }
  static std::vector<std::string> FilesIn(const std::string& folder, const std::string& prefix) {
    std::vector<std::string> files;
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.path().filename().string().starts_with(prefix)) files.push_back(entry.path());
    }
    std::ranges::sort(files);
    return files;
  }
  // What the only file of all has.
  std::unique_ptr<Recording> Read(const std::string& prefix = "recording-") {
    EXPECT_TRUE(recorder.Close().ok());
    const std::vector<std::string> files = Files(prefix);
    EXPECT_THAT(files, SizeIs(1));
    auto recording = Recording::Open(files.at(0));
    EXPECT_TRUE(recording.ok()) << recording.status();
    return *std::move(recording);
  }
  static uint64_t SceneAt(Recording& recording, double seconds) {
    const auto moment = recording.At(After(seconds), absl::Seconds(1));
    EXPECT_TRUE(moment.ok()) << moment.status();
    return moment.ok() && moment->scene ? moment->scene->id() : 0;
  }

  const std::string folder = FreshFolder();
  Recorder recorder;
};

TEST_F(RecordingTest, AMomentHasTheNewestSceneBeforeIt) {
  recorder.Take(State(), Now(0));
  for (int i = 0; i < 100; ++i) {
    recorder.Take(Scene(static_cast<uint64_t>(i + 1)), Now(0.1 * i));
    if (i % 7 != 0) continue;
    ASSERT_TRUE(recorder.Flush().ok());
  }
  const auto recording = Read();
  EXPECT_EQ(recording->summary().cell, "cell");
  EXPECT_EQ(recording->summary().cell_digest, 5u);
  EXPECT_THAT(recording->summary().scenes, SizeIs(100));
  // In any order.
  for (const int i : {50, 3, 98, 0, 51, 52}) {
    EXPECT_EQ(SceneAt(*recording, 0.1 * i + 0.05), static_cast<uint64_t>(i + 1));
  }
}

TEST_F(RecordingTest, ACheckOfTheCalibrationHoldsFromItsTimeOn) {
  recorder.Take(Scene(1), Now(0));
  v1::GetDatabaseResponse doubtful = Database();
  doubtful.mutable_calibration_check()->set_message("camera 'left' has moved");
  recorder.Update(doubtful, Now(1));
  recorder.Take(Scene(2), Now(1));
  recorder.Update(doubtful, Now(2));  // nothing new
  recorder.Take(Scene(3), Now(2));
  const auto recording = Read();
  EXPECT_FALSE(recording->At(After(0.5), absl::Seconds(1))->database.has_calibration_check());
  for (const double seconds : {1.0, 2.0}) {
    EXPECT_EQ(
        recording->At(After(seconds), absl::Seconds(1))->database.calibration_check().message(),
        "camera 'left' has moved");
  }
}

TEST_F(RecordingTest, AGapHasNoScene) {
  recorder.Take(State(), Now(0));
  recorder.Take(Scene(1), Now(0));
  recorder.Take(Scene(2), Now(10));
  const auto recording = Read();
  EXPECT_EQ(SceneAt(*recording, 1), 1u);
  EXPECT_EQ(SceneAt(*recording, 1.001), 0u);
  EXPECT_EQ(SceneAt(*recording, 9.999), 0u);
  EXPECT_EQ(SceneAt(*recording, 10), 2u);
}

TEST_F(RecordingTest, BeforeTheStartAndAfterTheEndThereIsNothing) {
  recorder.Take(State(), Now(0));
  recorder.Take(Scene(1), Now(1));
  const auto recording = Read();
  for (const double outside : {-0.001, 1.001}) {
    EXPECT_EQ(recording->At(After(outside), absl::Seconds(1)).status().code(),
              absl::StatusCode::kOutOfRange);
  }
  EXPECT_TRUE(recording->At(After(0), absl::Seconds(1)).ok());
  EXPECT_TRUE(recording->At(After(1), absl::Seconds(1)).ok());
}

TEST_F(RecordingTest, PathsAreThoseThatWereWatchedThenWithTheirNewestAnswer) {
  recorder.Take(Path(7, v1::Verdict::STATE_FREE), Now(0));
  recorder.Take(Path(7, v1::Verdict::STATE_OCCUPIED), Now(1));
  v1::WatchScenesResponse end;
  end.add_paths()->set_id(7);
  end.mutable_paths(0)->set_ended(true);
  recorder.Take(end, Now(2));
  const auto recording = Read();
  const auto states = [&](double seconds) {
    std::vector<int> found;
    const auto moment = recording->At(After(seconds), absl::Seconds(1));
    for (const RecordedPath& path : moment->paths) {
      found.push_back(path.path.answer().check().verdict().state());
    }
    return found;
  };
  EXPECT_THAT(states(0.5), ElementsAre(v1::Verdict::STATE_FREE));
  EXPECT_THAT(states(1), ElementsAre(v1::Verdict::STATE_OCCUPIED));
  EXPECT_THAT(states(2), IsEmpty());
  ASSERT_THAT(recording->summary().stops, SizeIs(1));
  EXPECT_EQ(recording->summary().stops[0].time, After(1));
}

TEST_F(RecordingTest, ALostServerIsUnknownAndItsPathsEnd) {
  recorder.Take(State(), Now(0));
  recorder.Take(Scene(1), Now(0));
  recorder.Take(Path(1, v1::Verdict::STATE_FREE), Now(0));
  recorder.Lose(Now(0.5));
  // It was restarted: its first path is another.
  recorder.Take(State(), Now(4));
  EXPECT_THAT(recorder.Take(Path(1, v1::Verdict::STATE_OCCUPIED), Now(4)), IsEmpty());
  const auto recording = Read();
  EXPECT_THAT(recording->summary().stops, IsEmpty());
  const auto lost = recording->At(After(0.6), absl::Seconds(1));
  EXPECT_EQ(lost->state->unknown_reason(), v1::Verdict::REASON_NO_SCENE);
  EXPECT_THAT(lost->paths, IsEmpty());
  EXPECT_THAT(recording->At(After(4), absl::Seconds(1))->paths, SizeIs(1));
}

TEST_F(RecordingTest, AnExcerptBeginsWithTheStateThatHeldThen) {
  recorder.Take(State(v1::Verdict::REASON_VARIANT_UNKNOWN), Now(0));
  recorder.Take(Path(1, v1::Verdict::STATE_FREE), Now(0));
  for (int i = 0; i < 340; ++i) recorder.Take(Scene(static_cast<uint64_t>(i + 1)), Now(0.1 * i));
  recorder.Take(Path(1, v1::Verdict::STATE_OCCUPIED), Now(34));
  const auto recording = Read("stop-");
  const absl::Time start = recording->summary().start;
  EXPECT_EQ(start, After(4));
  const auto moment = recording->At(start, absl::Seconds(1));
  ASSERT_TRUE(moment->state);
  EXPECT_EQ(moment->state->unknown_reason(), v1::Verdict::REASON_VARIANT_UNKNOWN);
}

TEST_F(RecordingTest, ScenesWhoseClockIsSlewedBackAreAllFound) {
  recorder.Take(State(), Now(0));
  recorder.Take(Scene(1), Now(0));
  for (uint64_t id = 2; id <= 4; ++id) {
    v1::WatchScenesResponse news = Scene(id);
    if (id == 2) news.MergeFrom(State(v1::Verdict::REASON_VARIANT_UNKNOWN));
    if (id == 3) news.MergeFrom(State());
    recorder.Take(news, Now(0.1 * static_cast<double>(id), -0.45));
  }
  recorder.Take(Scene(5), Now(1));
  const auto recording = Read();
  std::vector<uint64_t> found;
  std::vector<int> reasons;
  absl::Time before = absl::InfinitePast();
  for (const absl::Time time : recording->summary().scenes) {
    EXPECT_GE(time - before, absl::Milliseconds(1));
    before = time;
    const auto moment = recording->At(time, absl::Seconds(1));
    found.push_back(moment->scene->id());
    reasons.push_back(moment->state->unknown_reason());
  }
  EXPECT_THAT(found, ElementsAre(1, 2, 3, 4, 5));
  EXPECT_THAT(reasons, ElementsAre(0, v1::Verdict::REASON_VARIANT_UNKNOWN, 0, 0, 0));
}

TEST_F(RecordingTest, AClockThatIsSetBackBeginsAnotherFile) {
  recorder.Take(State(), Now(0, 100));
  recorder.Take(Scene(1), Now(0, 100));
  recorder.Take(Scene(2), Now(0, 50));
  recorder.Take(Scene(3), Now(1, 99));
  recorder.Take(Scene(4), Now(1, 48));
  ASSERT_TRUE(recorder.Close().ok());
  std::vector<std::vector<absl::Time>> times;
  for (const std::string& file : Files("recording-")) {
    const auto recording = Recording::Open(file);
    ASSERT_TRUE(recording.ok());
    times.push_back((*recording)->summary().scenes);
    EXPECT_TRUE((*recording)->At(times.back()[0], absl::Seconds(1))->state) << file;
  }
  EXPECT_THAT(times, ElementsAre(ElementsAre(After(49)), ElementsAre(After(50), After(100)),
                                 ElementsAre(After(100))));
}

// A scene each 0.1 s for 40 s, then a stop, and 10 s more. The wall clock is set by `step` 5.7 s
// before the stop.
TEST_F(RecordingTest, TheTimeAroundAStopIsKeptWhereverTheClockIsSet) {
  for (const double step : {3600.0, -3600.0}) {
    const std::string stops = FreshFolder();
    Recorder stop_recorder({.folder = stops, .only_stops = true}, Database());
    stop_recorder.Take(State(), Now(0));
    for (int i = 0; i <= 500; ++i) {
      const RecorderTime now = Now(0.1 * i, i < 343 ? 0 : step);
      stop_recorder.Take(Scene(static_cast<uint64_t>(i + 1)), now);
      const auto state = i < 400 ? v1::Verdict::STATE_FREE : v1::Verdict::STATE_OCCUPIED;
      EXPECT_THAT(stop_recorder.Take(Path(1, state), now), SizeIs(i == 400 ? 1 : 0));
      ASSERT_TRUE(stop_recorder.Flush().ok());
    }
    ASSERT_TRUE(stop_recorder.Close().ok());
    std::vector<absl::Time> scenes;
    std::vector<absl::Time> stopped;
    for (const std::string& file : FilesIn(stops, "stop-")) {
      const auto recording = Recording::Open(file);
      ASSERT_TRUE(recording.ok()) << recording.status();
      const RecordingSummary& summary = (*recording)->summary();
      EXPECT_TRUE((*recording)->At(summary.start, absl::Seconds(1))->state) << file;
      scenes.insert(scenes.end(), summary.scenes.begin(), summary.scenes.end());
      for (const auto& stop : summary.stops) stopped.push_back(stop.time);
    }
    std::ranges::sort(scenes);
    std::vector<absl::Time> all;
    for (int i = 100; i <= 500; ++i) all.push_back(Now(0.1 * i, i < 343 ? 0 : step).wall);
    std::ranges::sort(all);
    EXPECT_EQ(scenes, all) << step;
    EXPECT_THAT(stopped, ElementsAre(After(40 + step)));
  }
}

TEST_F(RecordingTest, PicturesAreThoseOfTheTimeOfTheScene) {
  v1::WatchScenesResponse picture;
  picture.add_images()->set_view("left");
  picture.mutable_images(0)->set_jpeg("jpeg");
  recorder.Take(picture, Now(0));
  recorder.Take(Scene(1), Now(0.2));
  recorder.Take(Scene(2), Now(0.9));
  const auto recording = Read();
  const auto pictures = [&](double seconds) {
    return recording->At(After(seconds), absl::Seconds(1))->pictures;
  };
  EXPECT_THAT(pictures(0.2), ElementsAre(::testing::Pair("left", "jpeg")));
  EXPECT_THAT(pictures(0.9), IsEmpty());
}

TEST_F(RecordingTest, DamageIsNamedAndACutIsRead) {
  for (int i = 0; i < 50; ++i) {
    recorder.Take(Scene(static_cast<uint64_t>(i + 1)), Now(0.1 * i));
    ASSERT_TRUE(recorder.Flush().ok());
  }
  ASSERT_TRUE(recorder.Close().ok());
  const std::string file = Files("recording-").at(0);
  const uint64_t size = fs::file_size(file);
  const std::string cut = folder + "/cut";
  fs::copy_file(file, cut);
  fs::resize_file(cut, size / 2);
  const auto recording = Recording::Open(cut);
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_TRUE((*recording)->summary().cut);
  const auto scenes = (*recording)->summary().scenes.size();
  EXPECT_GT(scenes, 0u);
  EXPECT_LT(scenes, 50u);
  // A changed byte loses no more than it must, and what is lost is named with the file.
  int losses = 0;
  const auto whole = Recording::Open(file);
  for (uint64_t at = 50; at < size; at += 97) {
    std::fstream bytes(file, std::ios::in | std::ios::out | std::ios::binary);
    bytes.seekg(static_cast<std::streamoff>(at));
    const auto byte = static_cast<char>(bytes.get());
    const auto put = [&](char value) {
      bytes.seekp(static_cast<std::streamoff>(at));
      bytes.put(value).flush();
    };
    put(static_cast<char>(byte ^ 0x55));
    const auto damaged = Recording::Open(file);
    ASSERT_TRUE(damaged.ok()) << damaged.status();
    const RecordingSummary& left = (*damaged)->summary();
    EXPECT_GE(left.scenes.size(), 49u) << "a scene is a chunk";
    if (left.scenes.size() < 50) {
      ++losses;
      EXPECT_THAT(left.damage, AllOf(HasSubstr(file + " is damaged "), HasSubstr("lost is what ")));
    }
    // Changed after it was opened: never another scene.
    const auto moment = (*whole)->At(After(2.05), absl::Seconds(1));
    EXPECT_TRUE(!moment.ok() || moment->scene->id() == 21u);
    // Nor after a moment that could not be read.
    const auto other = (*whole)->At(After(4.05), absl::Seconds(1));
    EXPECT_TRUE(!other.ok() || other->scene->id() == 41u);
    const auto again = (*whole)->At(After(2.05), absl::Seconds(1));
    EXPECT_TRUE(!again.ok() || again->scene->id() == 21u);
    put(byte);
  }
  EXPECT_GT(losses, 10);
}

// What was lost may have ended all that held before it.
TEST_F(RecordingTest, NothingFromBeforeDamageHoldsAfterIt) {
  const auto take = [&](const v1::WatchScenesResponse& news, double seconds) {
    recorder.Take(news, Now(seconds));
    ASSERT_TRUE(recorder.Flush().ok());
  };
  v1::WatchScenesResponse all = Scene(1);
  all.MergeFrom(State());
  all.MergeFrom(Path(7, v1::Verdict::STATE_FREE));
  take(all, 0);
  take(State(v1::Verdict::REASON_NO_SCENE), 0.4);
  take(Scene(2), 0.8);
  take(State(), 1.2);
  ASSERT_TRUE(recorder.Close().ok());
  const std::string file = Files("recording-").at(0);
  std::string bytes;
  {
    std::ifstream in(file, std::ios::binary);
    bytes.assign(std::istreambuf_iterator<char>(in), {});
  }
  const size_t second = bytes.find("lz4", bytes.find("lz4") + 1);
  bytes.replace(second + 10, 20, 20, '\0');
  std::ofstream(file, std::ios::binary) << bytes;

  const auto recording = Recording::Open(file);
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_THAT((*recording)->summary().damage,
              AllOf(HasSubstr(file + " is damaged at byte "),
                    HasSubstr("lost is what was between 2026-01-31T12:00:00.000Z and "
                              "2026-01-31T12:00:00.800Z")));
  const auto at = [&](double seconds) {
    return *(*recording)->At(After(seconds), absl::Seconds(1));
  };
  EXPECT_TRUE(at(0).scene && at(0).state && at(0).paths.size() == 1);
  EXPECT_FALSE(at(0.2).scene || at(0.2).state || !at(0.2).paths.empty());
  EXPECT_TRUE(at(0.8).scene);
  EXPECT_FALSE(at(0.8).state || !at(0.8).paths.empty());
  EXPECT_TRUE(at(1.2).scene && at(1.2).state);
}

TEST_F(RecordingTest, DamagedFirstChunkCostsNoMoreThanTheNextState) {
  recorder.Take(State(), Now(0));
  for (int i = 0; i <= 20; ++i) {
    recorder.Take(Scene(static_cast<uint64_t>(i + 1)), Now(0.5 * i));
    ASSERT_TRUE(recorder.Flush().ok());
  }
  ASSERT_TRUE(recorder.Close().ok());
  const std::string file = Files("recording-").at(0);
  {
    std::fstream bytes(file, std::ios::in | std::ios::out | std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(bytes), {}};
    bytes.seekp(static_cast<std::streamoff>(text.find("lz4") + 100));
    bytes << std::string(20, '\0');
  }
  const auto recording = Recording::Open(file);
  ASSERT_TRUE(recording.ok()) << recording.status();
  EXPECT_THAT((*recording)->summary().scenes, SizeIs(20));
  EXPECT_EQ((*recording)->summary().cell, "cell");
  EXPECT_FALSE((*recording)->At(After(4.5), absl::Seconds(1))->state);
  const auto moment = (*recording)->At(After(5), absl::Seconds(1));
  EXPECT_TRUE(moment->state);
  EXPECT_EQ(moment->database.cell_name(), "cell");
}

// What is lost may have been that the calibration does not hold any more.
TEST_F(RecordingTest, StateIsNeverKnownAfterDamageWithoutTheCheckOfTheCalibration) {
  const auto take = [&](const v1::WatchScenesResponse& news, double seconds) {
    recorder.Take(news, Now(seconds));
    ASSERT_TRUE(recorder.Flush().ok());
  };
  take(State(), 0);
  v1::GetDatabaseResponse doubtful = Database();
  doubtful.mutable_calibration_check()->set_message("camera 'left' has moved");
  recorder.Update(doubtful, Now(1));
  take(State(), 1);
  for (int i = 0; i <= 12; ++i) take(Scene(static_cast<uint64_t>(i + 1)), 1.5 + 0.5 * i);
  ASSERT_TRUE(recorder.Close().ok());
  const std::string file = Files("recording-").at(0);
  {
    std::fstream bytes(file, std::ios::in | std::ios::out | std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(bytes), {}};
    const size_t second = text.find("lz4", text.find("lz4") + 1);
    bytes.seekp(static_cast<std::streamoff>(second + 30));
    bytes << std::string(10, '\0');
  }
  const auto recording = Recording::Open(file);
  ASSERT_TRUE(recording.ok()) << recording.status();
  ASSERT_FALSE((*recording)->summary().damage.empty());
  bool known = false;
  for (double seconds = 1.1; seconds < 7.4; seconds += 0.1) {
    const auto moment = (*recording)->At(After(seconds), absl::Seconds(1));
    ASSERT_TRUE(moment.ok());
    known = known || moment->state;
    EXPECT_TRUE(!moment->state || moment->database.has_calibration_check()) << seconds;
  }
  EXPECT_TRUE(known);
}

TEST_F(RecordingTest, WhatIsNoRecordingOrAllLostIsNeverEmpty) {
  recorder.Take(Scene(1), Now(0));
  ASSERT_TRUE(recorder.Close().ok());
  const std::string file = Files("recording-").at(0);
  std::string bytes;
  {
    std::ifstream in(file, std::ios::binary);
    bytes.assign(std::istreambuf_iterator<char>(in), {});
  }
  const std::string other = folder + "/other.mcap";
  std::ofstream(other, std::ios::binary) << bytes.substr(0, bytes.find("lz4"));
  EXPECT_EQ(Recording::Open(other).status(),
            absl::DataLossError(
                absl::StrCat(other, " is damaged at byte ", bytes.find("lz4") - 41,
                             " (a record goes beyond the file's end): lost is all of it")));
  std::ofstream(other, std::ios::binary) << bytes.substr(0, bytes.find("lz4") - 41);
  EXPECT_EQ(Recording::Open(other).status(),
            absl::DataLossError(other + " is cut: it has no message and no end"));
  fs::remove(other);
  McapWriter writer(other, {{"/a", "json", "", "", ""}});
  ASSERT_TRUE(
      writer.Write({{.channel = 0, .logged = kStart, .published = kStart, .data = "{}"}}).ok());
  ASSERT_TRUE(writer.Close().ok());
  EXPECT_TRUE(absl::IsInvalidArgument(Recording::Open(other).status()));
}

}  // namespace
}  // namespace silhouette
