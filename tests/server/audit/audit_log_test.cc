// SPDX-License-Identifier: Apache-2.0
// The audit file: what it proves, and what it survives.
#include "server/audit/audit_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <nlohmann/json.hpp>
#include <thread>
#include <vector>

#include "absl/strings/str_split.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;

AuditEntry Entry(const std::string& detail, absl::Duration running = absl::Seconds(5)) {
  return {.time = absl::FromUnixSeconds(1'700'000'000),
          .running = running,
          .who = "'operator-1' at ipv4:127.0.0.1:4000",
          .what = "region.allow",
          .detail = detail};
}

struct AuditLogTest : testing::Test {
  const std::string path = FreshFolder() / "audit.jsonl";

  // Notes the entries and waits until they are written.
  void Write(const std::vector<std::string>& details) {
    auto log = AuditLog::Open(path);
    ASSERT_TRUE(log.ok()) << log.status();
    for (const std::string& detail : details) (*log)->Note(Entry(detail));
  }
  std::vector<std::string> Lines() const {
    return absl::StrSplit(ContentOf(path), '\n', absl::SkipEmpty());
  }
  std::string Fault() const { return std::string(ReadAudit(path).status().message()); }
};

TEST_F(AuditLogTest, LinesSayWhoDidWhatWhenByBothClocks) {
  Write({"region 'part'"});
  const auto line = nlohmann::json::parse(Lines().at(0));
  EXPECT_EQ(line["line"], 1);
  EXPECT_EQ(line["time"], "2023-11-14T22:13:20.000000Z");
  EXPECT_EQ(line["running_ns"], 5'000'000'000);
  EXPECT_EQ(line["who"], "'operator-1' at ipv4:127.0.0.1:4000");
  EXPECT_EQ(line["what"], "region.allow");
  EXPECT_EQ(line["detail"], "region 'part'");
}

TEST_F(AuditLogTest, ChainGoesOnAfterARestart) {
  Write({"a", "b"});
  Write({"c"});
  const auto audit = ReadAudit(path);
  ASSERT_TRUE(audit.ok()) << audit.status();
  EXPECT_EQ(audit->end.lines, 3u);
}

TEST_F(AuditLogTest, ChangedRemovedAndInsertedLinesAreNamed) {
  Write({"a", "b", "c", "d"});
  const std::vector<std::string> lines = Lines();
  const auto rewrite = [&](const std::vector<std::string>& now) {
    std::string text;
    for (const std::string& line : now) text += line + "\n";
    WriteFile(path, text);
  };
  std::vector<std::string> changed = lines;
  changed[1].replace(changed[1].find("\"b\""), 3, "\"x\"");
  rewrite(changed);
  EXPECT_THAT(Fault(), HasSubstr("line 3 does not hold the digest of the line before"));
  rewrite({lines[0], lines[2], lines[3]});
  EXPECT_THAT(Fault(), HasSubstr("line 2 says that it is line 3"));
  rewrite({lines[0], "not JSON", lines[1]});
  EXPECT_THAT(Fault(), HasSubstr("line 2 is not a JSON object"));
  rewrite({lines[1], lines[2]});
  EXPECT_THAT(Fault(), HasSubstr("line 1 says that it is line 2"));
  EXPECT_TRUE(absl::IsFailedPrecondition(AuditLog::Open(path).status()));
}

TEST_F(AuditLogTest, TornLastLineIsCutOffAndSaid) {
  Write({"a", "b"});
  const std::string whole = ContentOf(path);
  const std::string first = whole.substr(0, whole.find('\n') + 1);
  for (const std::string& left :
       {whole.substr(0, whole.size() - 1), whole.substr(0, whole.size() - 30), first + "{",
        first + "{\"line\":2" + std::string(20, '\0'), first + std::string(20, '\0')}) {
    WriteFile(path, left);
    Write({"c"});
    const auto audit = ReadAudit(path);
    ASSERT_TRUE(audit.ok()) << audit.status();
    ASSERT_THAT(Lines(), SizeIs(3));
    EXPECT_THAT(Lines()[1], HasSubstr("\"what\":\"audit.mended\""));
    EXPECT_THAT(Lines()[2], HasSubstr("\"detail\":\"c\""));
  }
}

TEST_F(AuditLogTest, TextsAreBoundedAndCannotForgeALine) {
  Write({"x\"}\n{\"line\":2}\r\x1b[2J\xff", std::string(1 << 20, 'a')});
  ASSERT_THAT(Lines(), SizeIs(2));
  for (const std::string& line : Lines()) {
    EXPECT_LT(line.size(), 2000u);
    for (const char c : line) EXPECT_TRUE(c >= ' ' && c <= '~');
  }
}

TEST_F(AuditLogTest, IsOfOneProcessAndNoOtherKindOfFile) {
  const auto first = AuditLog::Open(path);
  ASSERT_TRUE(first.ok());
  EXPECT_THAT(std::string(AuditLog::Open(path).status().message()),
              HasSubstr("another process writes"));
  const std::string other = path + "2";
  WriteFile(other, "name: cell\n");
  EXPECT_THAT(std::string(AuditLog::Open(other).status().message()),
              HasSubstr("line 1 is not a JSON object"));
  EXPECT_EQ(ContentOf(other), "name: cell\n");
}

TEST_F(AuditLogTest, OtherFileWithoutANewlineKeepsItsBytes) {
  for (const std::string text : {"{\"my\":\"data\"}", "{\"line\":7,\"my\":1}", "{ }", "x"}) {
    WriteFile(path, text);
    EXPECT_THAT(std::string(AuditLog::Open(path).status().message()),
                HasSubstr("line 1 has no end and is not of an audit file"));
    EXPECT_EQ(ContentOf(path), text);
  }
}

TEST_F(AuditLogTest, RepeatsAreNotedAgainOnlyAfterAMinuteWithoutThem) {
  {
    const auto log = AuditLog::Open(path);
    ASSERT_TRUE(log.ok());
    for (const int second : {0, 30, 80, 141}) {
      (*log)->NoteFirst(Entry("a", absl::Seconds(second)));
    }
    (*log)->NoteFirst(Entry("b", absl::Seconds(141)));
  }
  EXPECT_THAT(Lines(), SizeIs(3));  // a at 0 and at 141, b
}

TEST_F(AuditLogTest, FullDiskHoldsNobodyUpAndLosesNothing) {
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  auto log = AuditLog::Open(path);
  ASSERT_TRUE(log.ok());
  (*log)->Note(Entry("a"));
  while (!ReadAudit(path).ok() || ReadAudit(path)->end.lines < 1) std::this_thread::yield();
  const rlimit full{.rlim_cur = 300, .rlim_max = before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &full), 0);
  (*log)->Note(Entry("b"));
  (*log)->Note(Entry("c"));
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  (*log).reset();
  const auto audit = ReadAudit(path);
  ASSERT_TRUE(audit.ok()) << audit.status();
  EXPECT_EQ(audit->end.lines, 3u);
}

}  // namespace
}  // namespace silhouette
