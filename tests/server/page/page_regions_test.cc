// SPDX-License-Identifier: Apache-2.0
// Who may allow and revoke regions over the page, and what the page shows of them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <memory>
#include <sstream>
#include <string>

#include "server/audit/audit_log.h"
#include "tests/server/page/looking.h"
#include "tests/test_folder.h"

namespace silhouette {
namespace {

using nlohmann::json;
using testing::HasSubstr;

constexpr char kAllow[] = "/silhouette.v1.SceneService/AllowRegion";
constexpr char kRevoke[] = "/silhouette.v1.SceneService/RevokeRegion";
constexpr char kJson[] = "application/json";

class PageRegions : public testing::Test {
 protected:
  ServingSettings Audited() {
    ServingSettings settings;
    settings.audit = *AuditLog::Open((folder / "audit.jsonl").string());
    return settings;
  }
  PageRegions()
      : test(NewDatabase({.index = true}), Audited()), page(StartPage(test, Role::kOperator)) {
    test.Publish(SceneWithBlock(2));
  }

  // What the page's own script sends.
  httplib::Headers Own(const CellPage& to) { return {{"Origin", "http://" + to.address()}}; }
  int Post(const char* call, const std::string& body) { return Post(call, body, Own(*page)); }
  int Post(const char* call, const std::string& body, const httplib::Headers& headers,
           const char* type = kJson) {
    httplib::Client client("http://" + page->address());
    const auto answer = client.Post(call, headers, body, type);
    if (!answer) return -1;
    said = answer->body;
    return answer->status;
  }
  std::string Part(const std::string& duration = "10s") {
    json request = JsonText(RegionAt("part", 2, absl::Seconds(1)));
    request["duration"] = duration;
    return request.dump();
  }
  v1::ListAllowedRegionsResponse Listed() {
    return test.Ask(&v1::SceneService::Stub::ListAllowedRegions, v1::ListAllowedRegionsRequest());
  }
  std::string AuditText() {
    std::stringstream text;
    text << std::ifstream(folder / "audit.jsonl").rdbuf();
    return text.str();
  }

  const std::filesystem::path folder = FreshFolder();
  TestServer test;
  std::unique_ptr<CellPage> page;
  std::string said;
};

TEST_F(PageRegions, ARegionOfThePageIsOneOfTheApi) {
  ASSERT_EQ(test.CheckOne(At(2, 0)).state(), v1::Verdict::STATE_OCCUPIED);
  ASSERT_EQ(Post(kAllow, Part()), 204) << said;
  const v1::ListAllowedRegionsResponse listed = Listed();
  ASSERT_EQ(listed.regions_size(), 1);
  EXPECT_EQ(listed.regions(0).remaining().seconds(), 10);
  const v1::AllowRegionRequest asked = RegionAt("part", 2, absl::Seconds(10));
  for (int view = 0; view < 3; ++view) {
    EXPECT_EQ(listed.regions(0).views(view).mask().bits(), asked.views(view).mask().bits());
  }
  EXPECT_EQ(test.CheckOne(At(2, 0)).state(), v1::Verdict::STATE_FREE);

  const json now = SeenOn(*page);
  EXPECT_EQ(now["regions"][0]["name"], "part");
  EXPECT_EQ(now["regions"][0]["remaining"], 10);
  EXPECT_EQ(now["regions"][0]["pixels"]["left"], Block(0, 2).Count());
  EXPECT_EQ(now["views"]["left"]["region"], JsonText(listed.regions(0).views(0).mask()));

  ASSERT_EQ(Post(kRevoke, R"({"name": "part"})"), 204) << said;
  EXPECT_EQ(test.CheckOne(At(2, 0)).state(), v1::Verdict::STATE_OCCUPIED);
  EXPECT_TRUE(SeenOn(*page)["regions"].empty());
  EXPECT_TRUE(Soon([&] { return AuditText().find("region.revoke") != std::string::npos; }));
  EXPECT_THAT(AuditText(), testing::AllOf(HasSubstr("page 127.0.0.1"), HasSubstr("region.allow"),
                                          HasSubstr("'part' for 10 s")));
}

TEST_F(PageRegions, AnEndedRegionIsNotShown) {
  ASSERT_EQ(Post(kAllow, Part("1s")), 204) << said;
  test.clock.Advance(absl::Seconds(1));
  const json now = SeenOn(*page);
  EXPECT_TRUE(now["regions"].empty());
  EXPECT_TRUE(now["views"]["left"]["region"].is_null());
}

TEST_F(PageRegions, APageWithoutARoleIsReadOnly) {
  page = StartPage(test);
  EXPECT_EQ(Post(kAllow, Part()), 403);
  EXPECT_THAT(said, HasSubstr("--page-role operator"));
  EXPECT_EQ(Listed().regions_size(), 0);
  page = StartPage(test, Role::kPlanner);
  EXPECT_EQ(Post(kAllow, Part()), 403);
  EXPECT_EQ(Post(kRevoke, R"({"name": "part"})"), 403);
  EXPECT_EQ(Listed().regions_size(), 0);
  EXPECT_TRUE(Soon([&] { return AuditText().find("call.denied") != std::string::npos; }));
}

TEST_F(PageRegions, NothingThatAnotherSiteCanSendAllowsARegion) {
  const std::string own = "http://" + page->address();
  const auto refused = [&](const httplib::Headers& headers, const char* type = kJson) {
    return Post(kAllow, Part(), headers, type);
  };
  EXPECT_EQ(refused({}), 403) << "no origin";
  EXPECT_EQ(refused({{"Origin", "null"}}), 403);
  EXPECT_EQ(refused({{"Origin", "http://evil.example"}}), 403);
  EXPECT_EQ(refused({{"Origin", own + "0"}}), 403) << "another port of this machine";
  EXPECT_EQ(refused({{"Origin", own}, {"Origin", own}}), 403);
  EXPECT_EQ(refused({{"Origin", own}, {"Sec-Fetch-Site", "same-site"}}), 403);
  EXPECT_EQ(refused({{"Origin", own}, {"Sec-Fetch-Site", "cross-site"}}), 403);
  EXPECT_EQ(refused({{"Origin", "http://evil.example"}, {"Host", "evil.example"}}), 421);
  // What forms can send.
  for (const char* type : {"text/plain", "application/x-www-form-urlencoded"}) {
    EXPECT_EQ(refused({{"Origin", own}}, type), 403) << type;
  }
  httplib::Client client(own);
  EXPECT_EQ(client.Get(kAllow)->status, 404);
  EXPECT_EQ(client.Put(kAllow, Own(*page), Part(), kJson)->status, 404);
  EXPECT_EQ(client.Options(kAllow)->status, 404) << "no other site may send JSON";
  EXPECT_EQ(Listed().regions_size(), 0);
  EXPECT_EQ(refused({{"Origin", own}, {"Sec-Fetch-Site", "same-origin"}}), 204) << said;
}

TEST_F(PageRegions, LimitsAreThoseOfTheApi) {
  EXPECT_EQ(Post(kAllow, Part("601s")), 400);
  EXPECT_THAT(said, HasSubstr("10 min"));
  EXPECT_EQ(Post(kAllow, Part("0s")), 400);
  json request = json::parse(Part());
  request["views"][0]["view"] = "behind";
  EXPECT_EQ(Post(kAllow, request.dump()), 400);
  EXPECT_THAT(said, HasSubstr("the cell has no such view"));
  for (const char* text : {"", "{", "[]", R"({"name": 7})", R"({"names": "part"})"}) {
    EXPECT_EQ(Post(kAllow, text), 400) << text;
  }
  EXPECT_EQ(Listed().regions_size(), 0);
}

TEST_F(PageRegions, MasksOfSixViewsOfAMillionPixelsEachAreTaken) {
  const std::string masks(size_t{6} * (1 << 20) / 6, ' ');  // six bits a character
  EXPECT_EQ(Post(kAllow, masks + Part()), 204) << said;
}

// A refusal ends the connection, maybe before all is sent: then there is no answer.
TEST_F(PageRegions, BodiesAreBounded) {
  EXPECT_THAT(Post(kAllow, std::string(CellPage::kMostBody, ' ') + Part()),
              testing::AnyOf(413, -1));
  // The length of a chunked body is not known before it is read.
  httplib::Client client("http://" + page->address());
  const auto chunked = client.Post(
      kAllow, Own(*page),
      [&](size_t, httplib::DataSink& sink) {
        const std::string part = Part();
        sink.write(part.data(), part.size());
        sink.done();
        return true;
      },
      kJson);
  EXPECT_TRUE(!chunked || chunked->status == 411);
  EXPECT_EQ(Listed().regions_size(), 0);
}

TEST_F(PageRegions, ARoleIsNeverGivenToOtherMachines) {
  for (const bool insecure : {false, true}) {
    const auto refused =
        CellPage::Start("0.0.0.0:0", insecure, test.server->serving(), Role::kOperator).status();
    EXPECT_EQ(refused.code(), absl::StatusCode::kFailedPrecondition) << insecure;
  }
}

TEST_F(PageRegions, ClientsThatAskTooOftenAreRefused) {
  ServingSettings settings;
  settings.limits.calls_per_second = 0.01;
  TestServer strict(NewDatabase({.index = true}), settings);
  page = StartPage(strict, Role::kOperator);
  Post(kRevoke, R"({"name": "part"})");
  EXPECT_EQ(Post(kRevoke, R"({"name": "part"})"), 429);
}

}  // namespace
}  // namespace silhouette
