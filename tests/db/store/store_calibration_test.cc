// SPDX-License-Identifier: Apache-2.0
// The calibration in the database.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <functional>
#include <limits>
#include <thread>

#include "db/store/store.h"
#include "tests/db/store/test_database.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

// Camera models for TestCell(), told apart by `value`.
storage::v1::Calibration Cameras(double value = 1) {
  storage::v1::Calibration calibration;
  const storage::v1::CellDescription cell = TestCell();
  for (const storage::v1::View& view : cell.views()) {
    storage::v1::CameraModel& camera = *calibration.add_cameras();
    camera.set_image_width(view.image_width() > 0 ? view.image_width() : 33);
    camera.set_image_height(view.image_height() > 0 ? view.image_height() : 20);
    camera.set_fx(500);
    camera.set_fy(500);
    camera.set_cx(value);
    for (int i = 0; i < 5; ++i) camera.add_distortion(0.01 * i);
    for (int i = 0; i < 3; ++i) camera.add_rotation(0.1 * i);
    for (int i = 0; i < 3; ++i) camera.add_translation(i);
  }
  return calibration;
}

storage::v1::Calibration Matrices() {
  storage::v1::Calibration calibration;
  storage::v1::FundamentalMatrix& matrix = *calibration.add_fundamental_matrices();
  matrix.set_view_a(1);
  matrix.set_view_b(0);
  for (int i = 0; i < 9; ++i) matrix.add_f(i);
  return calibration;
}

std::optional<storage::v1::Calibration> CalibrationOf(const Database& database) {
  const auto snapshot = database.Read();
  EXPECT_TRUE(snapshot.ok()) << snapshot.status();
  const auto calibration = snapshot->Calibration();
  EXPECT_TRUE(calibration.ok()) << calibration.status();
  return *calibration;
}

TEST(Calibration, IsKeptReplacedAndRemovedEachAsAChange) {
  auto database = MakeDatabase();
  const std::string path = database->path();
  EXPECT_FALSE(CalibrationOf(*database).has_value());
  uint64_t generation = database->Read()->generation();
  EXPECT_EQ(database->RemoveCalibration("nothing").code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(database->Read()->generation(), generation);
  for (const storage::v1::Calibration& calibration : {Cameras(), Matrices(), Cameras(2)}) {
    ASSERT_TRUE(database->SetCalibration(calibration, "import").ok());
    EXPECT_EQ(CalibrationOf(*database)->SerializeAsString(), calibration.SerializeAsString());
    EXPECT_GT(database->Read()->generation(), generation);
    generation = database->Read()->generation();
  }
  database.reset();
  database = *Database::Open(path, Access::kWrite);
  EXPECT_EQ(CalibrationOf(*database)->SerializeAsString(), Cameras(2).SerializeAsString());
  ASSERT_TRUE(database->RemoveCalibration("remove").ok());
  EXPECT_FALSE(CalibrationOf(*database).has_value());
  EXPECT_GT(database->Read()->generation(), generation);
  const auto log = database->Read()->Provenance();
  ASSERT_EQ(log->entries_size(), 4);
  EXPECT_EQ(log->entries(0).program(), "import");
  EXPECT_EQ(log->entries(3).program(), "remove");
}

TEST(Calibration, IsTheSameInACompactedCopy) {
  const std::string copied = FreshFolder() / "copy";
  const auto database = MakeDatabase();
  ASSERT_TRUE(database->SetCalibration(Cameras(3), "import").ok());
  ASSERT_TRUE(database->Compact(copied).ok());
  const auto copy = *Database::Open(copied, Access::kRead);
  EXPECT_EQ(CalibrationOf(*copy)->SerializeAsString(), Cameras(3).SerializeAsString());
  EXPECT_EQ(copy->SetCalibration(Cameras(), "").code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(copy->RemoveCalibration("").code(), absl::StatusCode::kFailedPrecondition);
}

TEST(Calibration, ThatDoesNotFitTheViewsIsRefused) {
  const auto database = MakeDatabase();
  const uint64_t generation = database->Read()->generation();
  using Spoil = std::function<void(storage::v1::Calibration&)>;
  const auto refusal = [&](storage::v1::Calibration calibration, const Spoil& spoil) {
    spoil(calibration);
    const absl::Status status = database->SetCalibration(calibration, "import");
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
    return std::string(status.message());
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(refusal({}, [](auto&) {}), HasSubstr("either camera models or"));
  EXPECT_THAT(refusal(Cameras(), [](auto& c) { c.MergeFrom(Matrices()); }), HasSubstr("either"));
  EXPECT_THAT(refusal(Cameras(), [](auto& c) { c.mutable_cameras()->RemoveLast(); }),
              HasSubstr("there are 1 camera models for 2 views"));
  EXPECT_THAT(refusal(Cameras(), [](auto& c) { c.mutable_cameras(0)->set_image_width(320); }),
              HasSubstr("view 'left': the camera model is for images of 320x480, the view's "
                        "images are 640x480"));
  EXPECT_THAT(refusal(Cameras(), [](auto& c) { c.mutable_cameras(1)->set_image_width(0); }),
              HasSubstr("view 'top': the camera model's image has no pixels"));
  EXPECT_THAT(refusal(Cameras(), [](auto& c) { c.mutable_cameras(1)->set_fy(-1); }),
              HasSubstr("view 'top': a focal length is not positive"));
  EXPECT_THAT(refusal(Cameras(), [](auto& c) { c.mutable_cameras(0)->set_cx(kNan); }),
              HasSubstr("not finite"));
  EXPECT_THAT(refusal(Cameras(), [](auto& c) { c.mutable_cameras(0)->add_distortion(0); }),
              HasSubstr("6 distortion parameters"));
  EXPECT_THAT(refusal(Cameras(), [](auto& c) { c.mutable_cameras(0)->add_rotation(0); }),
              HasSubstr("rotation"));
  EXPECT_THAT(refusal(Cameras(), [](auto& c) { c.mutable_cameras(0)->clear_translation(); }),
              HasSubstr("translation"));
  const auto matrix = [](storage::v1::Calibration& c) { return c.mutable_fundamental_matrices(0); };
  EXPECT_THAT(refusal(Matrices(), [&](auto& c) { matrix(c)->set_view_a(2); }),
              HasSubstr("for view 2, which is not there"));
  EXPECT_THAT(refusal(Matrices(), [&](auto& c) { matrix(c)->set_view_b(-1); }),
              HasSubstr("for view -1, which is not there"));
  EXPECT_THAT(refusal(Matrices(), [&](auto& c) { matrix(c)->set_view_a(0); }),
              HasSubstr("two different views"));
  EXPECT_THAT(refusal(Matrices(), [&](auto& c) { matrix(c)->set_f(4, kNan); }),
              HasSubstr("9 finite values"));
  EXPECT_THAT(refusal(Matrices(), [&](auto& c) { matrix(c)->add_f(1); }),
              HasSubstr("9 finite values"));
  EXPECT_THAT(refusal(Matrices(),
                      [&](auto& c) {
                        storage::v1::FundamentalMatrix turned = *matrix(c);
                        turned.set_view_a(0);
                        turned.set_view_b(1);
                        *c.add_fundamental_matrices() = turned;
                      }),
              HasSubstr("views 'left' and 'top' have two fundamental matrices"));
  EXPECT_EQ(database->Read()->generation(), generation);
}

TEST(Calibration, WithFlippedBitsIsTakenForNoneAndTheRestCanBeRead) {
  const std::filesystem::path folder = FreshFolder();
  {
    const auto database = *Database::Create(folder / "db", TestCell());
    auto writer = database->Write("test");
    ASSERT_TRUE(writer->Put(TestImage(*database, 1)).ok());
    ASSERT_TRUE(writer->Commit().ok());
    ASSERT_TRUE(database->SetCalibration(Cameras(), "import").ok());
  }
  const std::string path = folder / "db/data.mdb";
  std::ifstream in(path, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  const std::string payload = Cameras().SerializeAsString();
  const size_t place = bytes.find(payload);
  ASSERT_NE(place, std::string::npos);
  for (size_t i = 0; i < payload.size(); i += 7) {
    bytes[place + i] = static_cast<char>(bytes[place + i] ^ 16);
    std::ofstream(path, std::ios::binary) << bytes;
    bytes[place + i] = static_cast<char>(bytes[place + i] ^ 16);
    const auto database = Database::Open(folder / "db", Access::kWrite);
    ASSERT_TRUE(database.ok()) << database.status();
    const auto snapshot = (*database)->Read();
    EXPECT_EQ(snapshot->Calibration().status().code(), absl::StatusCode::kDataLoss);
    EXPECT_EQ(**snapshot->Find(1), TestImage(**database, 1));
  }
  const auto database = Database::Open(folder / "db", Access::kWrite);
  ASSERT_TRUE((*database)->RemoveCalibration("remove").ok());
  EXPECT_FALSE(CalibrationOf(**database).has_value());
}

// In a child process: sets one calibration after another.
[[noreturn]] void SetUntilKilled(const std::string& path) {
  const auto database = Database::Open(path, Access::kWrite);
  if (!database.ok()) _exit(10);
  for (int i = 0;; ++i) {
    if (!(*database)->SetCalibration(Cameras(i), "killed").ok()) _exit(11);
    if (i % 5 == 4 && !(*database)->RemoveCalibration("killed").ok()) _exit(12);
  }
}

TEST(Calibration, IsNeverHalfWrittenByAProcessThatIsKilled) {
  const std::filesystem::path folder = FreshFolder();
  ASSERT_TRUE(Database::Create(folder / "db", TestCell()).ok());
  Random random;
  uint64_t generation = 1;
  // On a busy machine most processes are killed before they have written.
  for (int round = 0; round < 12 || generation <= 12; ++round) {
    ASSERT_LT(round, 1000);
    const pid_t child = fork();
    if (child == 0) SetUntilKilled(folder / "db");
    std::this_thread::sleep_for(std::chrono::microseconds(10'000 + random() % 40'000));
    kill(child, SIGKILL);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status)) << WEXITSTATUS(status);
    const auto database = Database::Open(folder / "db", Access::kRead);
    ASSERT_TRUE(database.ok()) << database.status();
    const auto calibration = CalibrationOf(**database);
    if (calibration) {
      EXPECT_EQ(calibration->SerializeAsString(),
                Cameras(calibration->cameras(0).cx()).SerializeAsString());
    }
    // Every change is in the log and in the generation, or in neither.
    const auto snapshot = (*database)->Read();
    EXPECT_GE(snapshot->generation(), generation);
    generation = snapshot->generation();
    EXPECT_EQ(static_cast<uint64_t>(snapshot->Provenance()->entries_size()), generation - 1);
  }
}

}  // namespace
}  // namespace silhouette
