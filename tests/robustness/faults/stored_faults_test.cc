// SPDX-License-Identifier: Apache-2.0
// What writes databases, while every call to the system goes wrong once: after it nothing that was
// acknowledged is lost, the database is whole, and the same command run again ends the work.
//
// One call of every third kind; all of all kinds with ROBUSTNESS_ALL=1 (tools/robustness faults).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <map>
#include <sstream>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "calib/files/calibration_session_file.h"
#include "db/store/collision_index.h"
#include "db/store/shards.h"
#include "tests/capture/session/program_cell.h"
#include "tests/db/store/test_cell.h"
#include "tests/folders.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

constexpr long kMostOfAKind = 100;
const bool kAll = std::getenv("ROBUSTNESS_ALL") != nullptr;

std::string Program(const std::string& name) { return ProgramFolder() + "/" + name + " "; }

// Something that writes a database.
struct Operation {
  std::string name;
  // What it starts from, in an empty folder.
  std::function<void(const Shell&)> prepare;
  std::string command;
  // The database that it makes or changes, in the folder.
  std::string database = "db";
};

void RunOrFail(const Shell& shell, const std::string& command) {
  const Ended ended = shell.Run(command);
  ASSERT_EQ(ended.exit_code, 0) << command << ": " << ended.err;
}

void MakeTestDatabase(const Shell& shell, const std::string& name, bool drawn = false) {
  WriteFile(shell.folder() / "cell.yaml", kTestCellFile);
  const auto database = Database::Create(shell.folder() / name, TestCell(6, 5));
  ASSERT_TRUE(database.ok()) << database.status();
  if (drawn) {
    storage::v1::DrawnImages images;
    images.set_digest("00ff");
    images.set_shards(1);
    ASSERT_TRUE((*database)->SetDrawnImages(images, "test").ok());
  }
  auto writer = (*database)->Write("test");
  for (const ConfigurationNumber number : AllNumbers((*database)->grid())) {
    ASSERT_TRUE(writer->Put(TestImage(**database, number)).ok());
  }
  ASSERT_TRUE(writer->Commit().ok());
}

storage::v1::Calibration Matrices() {
  storage::v1::Calibration calibration;
  storage::v1::FundamentalMatrix& matrix = *calibration.add_fundamental_matrices();
  matrix.set_view_b(1);
  for (const double value : {0, 0, 0, 0, 0, -1, 0, 1, 0}) matrix.add_f(value);
  return calibration;
}

std::vector<Operation> Operations() {
  return {
      {"import",
       [](const Shell& shell) {
         MakeTestDatabase(shell, "exported");
         RunOrFail(shell, Program("silhouette-db") + "export exported masks");
       },
       Program("silhouette-db") + "import masks --cell cell.yaml --database db"},
      {"index", [](const Shell& shell) { MakeTestDatabase(shell, "db"); },
       Program("silhouette-db") + "index db"},
      {"compact", [](const Shell& shell) { MakeTestDatabase(shell, "wide"); },
       Program("silhouette-db") + "compact wide db"},
      {"merge",
       [](const Shell& shell) {
         MakeTestDatabase(shell, "shard", /*drawn=*/true);
         RunOrFail(shell, Program("silhouette-db") + "index shard");
       },
       Program("silhouette-db") + "merge shard --into db"},
      {"calibration",
       [](const Shell& shell) {
         MakeTestDatabase(shell, "db");
         WriteFile(shell.folder() / "f.yaml", MatrixFileText(Matrices(), TestCell(6, 5)));
       },
       Program("silhouette-db") + "calibration import --database db f.yaml --force"},
      {"capture",
       [](const Shell& shell) {
         ProgramCell cell;
         cell.WriteCell({{"{joint_1: 9, joint_3: 5}", "{joint_1: 3, joint_3: 2}"}});
         for (const char* file : {"cell.yaml", "simulation.yaml"}) {
           fs::copy(cell / file, shell.folder() / file);
         }
         RunOrFail(shell,
                   Program("silhouette-capture") + "reference --cell cell.yaml --database db");
       },
       Program("silhouette-capture") + "run --cell cell.yaml --database db", "db"},
  };
}

// A call that goes wrong, as FAULT of preload/faults.cc.
struct FaultKind {
  const char* call;
  std::string what;
};

std::vector<FaultKind> FaultKinds() {
  const std::string io = std::to_string(EIO);
  const std::string full = std::to_string(ENOSPC);
  return {{"write", full},
          {"write", io},
          {"write", "short"},
          {"write", "kill"},
          {"write", "cut"},
          {"sync", io},
          {"sync", "kill"},
          {"sync", "cut"},
          {"read", io},
          {"read", "short"},
          {"map", std::to_string(ENOMEM)},
          {"map", "kill"},
          {"truncate", full},
          {"truncate", "cut"},
          {"rename", io},
          {"rename", "kill"},
          {"rename", "cut"},
          {"open", std::to_string(EMFILE)},
          {"clock", "step"},
          {"clock", "back"}};
}

bool EndsItself(const FaultKind& kind) { return kind.what == "kill" || kind.what == "cut"; }

// All of a database but its times. Empty: there is none.
std::map<std::string, std::string> ContentsOf(const fs::path& path) {
  std::map<std::string, std::string> contents;
  const auto database = Database::Open(path, Database::Access::kRead);
  if (absl::IsNotFound(database.status())) return contents;
  EXPECT_TRUE(database.ok()) << database.status();
  if (!database.ok()) return contents;
  for (const auto& [number, image] : ContentWithoutTimes(**database)) {
    std::string& text = contents[absl::StrCat("record ", number)];
    text = image.excluded ? "excluded" : "";
    const auto hash = std::hash<std::string>();
    for (const Mask& mask : image.masks) absl::StrAppend(&text, hash(mask.ToBytes()), " ");
    for (const double value : image.measured) absl::StrAppend(&text, " ", value);
  }
  const auto snapshot = (*database)->Read();
  if (const auto calibration = snapshot->Calibration(); calibration.ok() && *calibration) {
    contents["calibration"] = (*calibration)->SerializeAsString();
  }
  const auto index = CollisionIndex::Open(*(*database)->Read());
  EXPECT_TRUE(index.ok()) << index.status();
  if (index.ok()) {
    EXPECT_EQ((*index)->Summary().damaged, 0u);
    for (const uint64_t tile : (*index)->Tiles()) {
      if ((*index)->State(tile) == TileState::kFresh) contents[absl::StrCat("tile ", tile)] = "";
    }
  }
  return contents;
}

class StoredFaults : public testing::TestWithParam<Operation> {
 protected:
  void SetUp() override {
    GetParam().prepare(start_);
    if (HasFatalFailure()) return;
    const Shell undisturbed = Copy();
    const Ended ended = undisturbed.Run(Faulty("") + GetParam().command);
    ASSERT_EQ(ended.exit_code, 0) << ended.err;
    std::istringstream counts(ContentOf(undisturbed.folder() / "counts"));
    for (std::pair<std::string, long> each; counts >> each.first >> each.second;) {
      counts_.insert(each);
    }
    expected_ = ContentsOf(undisturbed.folder() / GetParam().database);
    before_ = ContentsOf(start_.folder() / GetParam().database);
    ASSERT_FALSE(expected_.empty());
  }

  // What the operation starts from, in a new folder.
  Shell Copy() const {
    Shell shell;
    fs::copy(start_.folder(), shell.folder(), fs::copy_options::recursive);
    return shell;
  }

  static std::string Faulty(const std::string& fault) {
    return "FAULT=" + fault + " FAULT_UNDER=\"$PWD/" + GetParam().database +
           "\" FAULT_DONE=\"$PWD/done\" FAULT_COUNTS=\"$PWD/counts\" "
           "LD_PRELOAD=" +
           BuildFolder() + "/tests/libfaults.so ";
  }

  // Which of `count` calls of a kind go wrong.
  static std::vector<long> Chosen(size_t kind, long count) {
    std::vector<long> chosen;
    // Clock reads are many and all alike.
    const long step = std::max(1L, count / kMostOfAKind);
    for (long n = 1; n <= count && kAll; n += step) chosen.push_back(n);
    if (!kAll && count > 0 && (kind + GetParam().name.size()) % 3 == 0) {
      chosen.push_back((count + 1) / 2);
    }
    return chosen;
  }

  // What is there is what was there, or what belongs there.
  void ExpectNothingWrong(const std::map<std::string, std::string>& contents) const {
    for (const auto& [name, value] : contents) {
      const auto old = before_.find(name);
      const auto made = expected_.find(name);
      EXPECT_TRUE((old != before_.end() && old->second == value) ||
                  (made != expected_.end() && made->second == value))
          << name;
    }
    for (const auto& [name, value] : before_) EXPECT_TRUE(contents.contains(name)) << name;
  }

  // Whether the call went wrong.
  bool Try(const FaultKind& kind, long n) const {
    const std::string fault = absl::StrCat(kind.call, ":", n, ":", kind.what);
    SCOPED_TRACE(fault);
    const Shell shell = Copy();
    const fs::path database = shell.folder() / GetParam().database;
    const Ended faulty = shell.Run(Faulty(fault) + GetParam().command);
    SCOPED_TRACE(faulty.err);
    // Which calls there are differs a little from run to run where threads are at work.
    if (!fs::exists(shell.folder() / "done")) return false;
    if (EndsItself(kind)) {
      EXPECT_EQ(faulty.exit_code, 128 + SIGKILL);
    } else if (faulty.exit_code != 0) {
      EXPECT_THAT(faulty.exit_code, testing::AllOf(testing::Ge(1), testing::Le(3)));
      EXPECT_THAT(faulty.err, testing::HasSubstr("silhouette-"));
    }
    const auto contents = ContentsOf(database);
    ExpectNothingWrong(contents);
    if (faulty.exit_code == 0) {
      EXPECT_EQ(contents, expected_) << "it said that all is done";
    }
    if (kAll && !contents.empty()) {
      const Ended verified =
          shell.Run(Program("silhouette-db") + "verify --allow-missing " + GetParam().database);
      EXPECT_EQ(verified.exit_code, 0) << verified.err << verified.out;
    }
    if (faulty.exit_code == 0) return true;
    const Ended again = shell.Run(GetParam().command);
    if (contents == expected_ && again.exit_code != 0) {
      EXPECT_THAT(again.err, testing::HasSubstr("there is a database in")) << "it is there";
      return true;
    }
    EXPECT_EQ(again.exit_code, 0) << again.err;
    EXPECT_EQ(ContentsOf(database), expected_);
    return true;
  }

  const Shell start_;
  std::map<std::string, long> counts_;
  std::map<std::string, std::string> before_;
  std::map<std::string, std::string> expected_;
};

TEST_P(StoredFaults, LoseNothingDamageNothingAndLetTheSameCommandGoOn) {
  long tries = 0;
  const std::vector<FaultKind> kinds = FaultKinds();
  for (size_t kind = 0; kind < kinds.size(); ++kind) {
    for (const long n : Chosen(kind, counts_[kinds[kind].call])) {
      tries += Try(kinds[kind], n) ? 1 : 0;
    }
  }
  std::cout << GetParam().name << ": " << tries << " faults" << std::endl;
  EXPECT_GT(tries, 3);
}

INSTANTIATE_TEST_SUITE_P(Of, StoredFaults, testing::ValuesIn(Operations()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace silhouette
