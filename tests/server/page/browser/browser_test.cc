// SPDX-License-Identifier: Apache-2.0
// The page in a real browser.
#include "tests/server/page/browser/browser.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/server/page/recorded.h"

namespace silhouette {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;
using testing::StartsWith;

constexpr char kHostileName[] = "<img src=x onerror=document.title='run'>";

// The camera images of the view 'top' are wider than its masks.
std::shared_ptr<const ServedDatabase> HostileDatabase() {
  TestDatabase test{.index = true};
  test.cell.set_name(kHostileName);
  test.cell.mutable_views(2)->set_image_width(80);
  return NewDatabase(test);
}

// One browser for all: it takes seconds to start.
class BrowserTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { browser = new Browser(1280, 900); }
  static void TearDownTestSuite() {
    delete browser;
    browser = nullptr;
  }

  // The clock runs, as that of the browser does.
  BrowserTest()
      : test(HostileDatabase(), {}, [](const Clock&) { return Clock(SystemClock); }),
        page(StartPage(test)) {
    browser->Open("http://" + page->address() + "/");
  }
  ~BrowserTest() override { browser->Open("about:blank"); }

  bool Shows(const std::string& selector, const testing::Matcher<std::string>& text,
             milliseconds longest = std::chrono::seconds(10)) {
    const bool shown = Soon([&] { return text.Matches(browser->Text(selector)); }, longest);
    if (!shown) ADD_FAILURE() << selector << " shows: " << browser->Text(selector);
    return shown;
  }

  // Publishes ten scenes a second until the test ends.
  class Scenes {
   public:
    Scenes(TestServer& server, const SceneInput& input)
        : thread_([&server, input](const std::stop_token& stop) {
            while (!stop.stop_requested()) {
              server.Publish(input);
              std::this_thread::sleep_for(milliseconds(100));
            }
          }) {}

   private:
    std::jthread thread_;
  };

  // The colours of the map, one a cell, row by row from below: "f", "o" or "u".
  std::string Map() {
    return browser
        ->Run(R"(const map = document.getElementById('map');
          const ratio = map.width / map.clientWidth;
          const wide = map.clientWidth - 64 - 12, high = map.clientHeight - 10 - 46;
          const context = map.getContext('2d');
          let cells = '';
          for (let b = 0; b < 8; ++b) for (let a = 0; a < 5; ++a) {
            // Beside the middle, where the robot's ring is.
            const x = 64 + (a + 0.12) / 5 * wide, y = 10 + high - (b + 0.12) / 8 * high;
            const [red, , blue] = context.getImageData(x * ratio, y * ratio, 1, 1).data;
            cells += blue > red + 50 ? 'u' : red > 200 ? 'f' : 'o';
          }
          return cells;)")
        .get<std::string>();
  }

  static Browser* browser;
  TestServer test;
  std::unique_ptr<CellPage> page;
};

Browser* BrowserTest::browser = nullptr;

TEST_F(BrowserTest, WithoutASceneNothingIsFree) {
  ASSERT_TRUE(Shows("#status", std::string("Not serving: no scene")));
  EXPECT_EQ(Map(), std::string(40, 'u'));
  EXPECT_EQ(browser->Text("#free"), "–");
  EXPECT_THAT(browser->Text("#defects"), HasSubstr("scene"));
}

TEST_F(BrowserTest, ShowsWhatTheApiSays) {
  const Scenes scenes(test, SceneWithBlock(2));
  ASSERT_TRUE(Shows("#status", std::string("Serving")));
  std::string expected;
  for (int b = 0; b < 8; ++b) {
    for (int a = 0; a < 5; ++a) {
      expected += test.CheckOne(At(a, b)).state() == v1::Verdict::STATE_FREE ? 'f' : 'o';
    }
  }
  EXPECT_EQ(Map(), expected);
  const auto free = std::ranges::count(expected, 'f');
  EXPECT_THAT(browser->Text("#free"), StartsWith(absl::StrCat(free, " (")));
  EXPECT_THAT(browser->Text("#occupied"), StartsWith(absl::StrCat(40 - free, " (")));
  EXPECT_THAT(browser->Text("figure[data-view=left] figcaption"),
              HasSubstr(absl::StrCat("obstacle ", Block(0, 2).Count(), ", ")));
  EXPECT_THAT(browser->Text("#present"), HasSubstr(": free."));
  // Ages are those of the newest scene, a moment ago. On a busy machine it takes a few questions
  // for the server's clock until one is quick.
  EXPECT_TRUE(Shows("#age", testing::ContainsRegex("^[0-6]?[0-9]?[0-9] ms$")));
}

TEST_F(BrowserTest, AWatchedPathIsShownWithItsVerdict) {
  const Scenes scenes(test, SceneWithBlock(2));
  ASSERT_TRUE(Shows("#status", std::string("Serving")));
  v1::CheckPathRequest request;
  for (const int a : {0, 4}) Set(At(a, 4), request.add_waypoints());
  grpc::ClientContext context;
  const auto reader = test.collision->WatchPath(&context, request);
  std::jthread reading([&] {
    v1::WatchPathResponse told;
    while (reader->Read(&told)) continue;
  });
  EXPECT_TRUE(Shows("#paths .verdict", std::string("occupied")));
  EXPECT_THAT(browser->Text("#paths"), HasSubstr("left: 4 obstacle, right: 4 obstacle"));
  context.TryCancel();
  EXPECT_TRUE(Shows("#paths", HasSubstr("No client watches a path")));
}

TEST_F(BrowserTest, ContinuousJointsAreDrawnWithinTheirTurn) {
  const Scenes scenes(test, SceneWithBlock(2));
  ASSERT_TRUE(Shows("#status", std::string("Serving")));
  EXPECT_EQ(browser->Run(R"(
          const shown = structuredClone(snapshot);
          const joint = shown.database.grid.joints[0];
          joint.continuous = true;
          const turn = joint.upper - joint.lower;
          const map = document.getElementById('map');
          const drawn = (at, path) => {
            shown.present.configuration[0] = at;
            shown.paths = [{ waypoints: path.map((q) => [q, 0]), state: 'free' }];
            drawMap(shown, true);
            return map.toDataURL();
          };
          const within = drawn(joint.lower, [joint.lower + 0.7 * turn, joint.lower + 0.9 * turn]);
          const beyond = drawn(joint.lower - 3 * turn, [joint.lower - 0.3 * turn, joint.lower - 0.1 * turn]);
          const across = drawn(joint.lower, [joint.lower + 0.7 * turn, joint.lower + 1.2 * turn]);
          const back = drawn(joint.lower, [joint.lower - 0.3 * turn, joint.lower + 0.2 * turn]);
          return [beyond === within, across === back, across === within].join();)"),
            "true,true,false");
}

TEST_F(BrowserTest, APathOverVeryManyTurnsIsNotDrawn) {
  const Scenes scenes(test, SceneWithBlock(2));
  ASSERT_TRUE(Shows("#status", std::string("Serving")));
  EXPECT_EQ(browser->Run(R"(
          const shown = structuredClone(snapshot);
          shown.database.grid.joints[0].continuous = true;
          const map = document.getElementById('map');
          const drawn = (path) => {
            shown.paths = [{ waypoints: path.map((q) => [q, 0]), state: 'free' }];
            drawMap(shown, true);
            return map.toDataURL();
          };
          return [drawn([0, 1e12]) === drawn([]), drawn([0, 10]) === drawn([])].join();)"),
            "true,false");
}

TEST_F(BrowserTest, AMapOfTooManyConfigurationsIsUnknownAndDrawnAtOnce) {
  const Scenes scenes(test, SceneWithBlock(2));
  ASSERT_TRUE(Shows("#status", std::string("Serving")));
  EXPECT_EQ(browser->Run(R"(
          const shown = structuredClone(snapshot);
          shown.space.cells = null;
          for (const joint of shown.database.grid.joints) joint.steps = 4096;
          const own = ImageData;
          ImageData = class { constructor(wide, high) { throw new Error(`${wide} x ${high}`); } };
          try {
            drawMap(shown, true);
          } catch (fault) {
            return `made an image of ${fault.message}`;
          } finally {
            ImageData = own;
          }
          const map = document.getElementById('map');
          const ratio = map.width / map.clientWidth;
          const [x, y] = [(64 + 20) * ratio, (10 + 20) * ratio];
          const [red, green, blue] = map.getContext('2d').getImageData(x, y, 1, 1).data;
          return [red, green, blue].join();)"),
            "86,180,233");
}

TEST_F(BrowserTest, ALostCameraAppearsWithinASecond) {
  auto scenes = std::make_unique<Scenes>(test, SceneWithBlock(2));
  ASSERT_TRUE(Shows("#status", std::string("Serving")));
  EXPECT_EQ(browser->Text("figure[data-view=top] .veil"), "");
  scenes.reset();
  SceneInput lost = SceneWithBlock(2);
  lost.views.pop_back();
  const Scenes without(test, lost);
  EXPECT_TRUE(
      Shows("figure[data-view=top] .veil", HasSubstr("not in the scene"), milliseconds(1000)));
  EXPECT_TRUE(Shows("#defects", HasSubstr("top")));
}

TEST_F(BrowserTest, AStaleSceneIsGreyWithinASecondOfItsEnd) {
  test.Publish(SceneWithBlock(2));
  ASSERT_TRUE(Shows("#status", HasSubstr("scene stale"), milliseconds(2000)));
  EXPECT_EQ(Map(), std::string(40, 'u'));
  EXPECT_EQ(browser->Text("#free"), "–");
  EXPECT_TRUE(Shows("#stops", HasSubstr("scene stale"))) << "once the server has told of it";
}

TEST_F(BrowserTest, ALostConnectionSaysSo) {
  const Scenes scenes(test, SceneWithBlock(2));
  ASSERT_TRUE(Shows("#status", std::string("Serving")));
  page.reset();
  EXPECT_TRUE(Shows("#status", HasSubstr("Connection lost"), milliseconds(2000)));
  EXPECT_EQ(Map(), std::string(40, 'u'));
  EXPECT_EQ(browser->Text("#free"), "–");
  browser->Open("about:blank");
  page = StartPage(test);
}

TEST_F(BrowserTest, AFaultInADrawingLeavesNothingThatServes) {
  const Scenes scenes(test, SceneWithBlock(2));
  ASSERT_TRUE(Shows("#status", std::string("Serving")));
  browser->Run("drawMap = () => { throw new Error('no such cell'); };");
  EXPECT_TRUE(Shows("#status", std::string("This page has failed, load it again: no such cell")));
  EXPECT_EQ(browser->Run("return document.body.className;"), "unknown");
}

TEST_F(BrowserTest, TheTimeThatEventsAreUnderWayCountsAsAge) {
  const Scenes scenes(test, SceneWithBlock(2));
  ASSERT_TRUE(Shows("#status", std::string("Serving")));
  browser->Run(R"(
      const inTime = heard;
      heard = (event) => setTimeout(() => inTime(event), 3000);
      lose();
      connect();
      known = 0;
      new MutationObserver(() => { known += document.body.className === 'known'; })
        .observe(document.body, { attributes: true });)");
  EXPECT_TRUE(Shows("#status", HasSubstr("Updates are late")));
  EXPECT_EQ(Map(), std::string(40, 'u'));
  EXPECT_EQ(browser->Run("return known;"), 0) << "nothing was ever shown as current";
}

// No question for the server's clock is answered from then on.
constexpr char kNoClock[] = R"(
    ask = fetch;
    fetch = (url, ...rest) => url === 'clock' ? Promise.reject() : ask(url, ...rest);)";

TEST_F(BrowserTest, WithoutTheServersClockNothingIsFree) {
  const Scenes scenes(test, SceneWithBlock(2));
  ASSERT_TRUE(Shows("#status", std::string("Serving")));
  browser->Run(absl::StrCat(kNoClock, "lose(); connect();"));
  EXPECT_TRUE(Shows("#status", std::string("Connecting")));
  EXPECT_EQ(Map(), std::string(40, 'u'));
  EXPECT_EQ(browser->Text("#age"), "–");
}

TEST_F(BrowserTest, AfterTheBrowsersComputerSleptTheClockIsAskedForAgain) {
  const Scenes scenes(test, SceneWithBlock(2));
  ASSERT_TRUE(Shows("#status", std::string("Serving")));
  browser->Run(absl::StrCat(kNoClock, "const now = Date.now; Date.now = () => now() + 60000;"));
  EXPECT_TRUE(Shows("#status", std::string("Connecting")));
  browser->Run("fetch = ask;");
  EXPECT_TRUE(Shows("#status", std::string("Serving")));
}

TEST_F(BrowserTest, AClockThatJumpsIsAskedForAgain) {
  const Scenes scenes(test, SceneWithBlock(2));
  ASSERT_TRUE(Shows("#status", std::string("Serving")));
  EXPECT_EQ(browser->Run(R"(
          heard(JSON.stringify({ stops, role, now: { ...newest, clock: newest.clock + 100 } }));
          return judge(newest).status;)"),
            "Connecting");
  EXPECT_TRUE(Shows("#status", std::string("Serving")));
}

TEST_F(BrowserTest, ARegionEndsTooLateRatherThanTooEarly) {
  const Scenes scenes(test, SceneWithBlock(2));
  test.Allow("part", 2, absl::Seconds(60));
  ASSERT_TRUE(Shows("#region-list .left", StartsWith("ends in ")));
  // A slow connection: the snapshot may be 100 s old.
  EXPECT_THAT(browser
                  ->Run(R"(
                      bound = { ...bound, ahead: bound.ahead + 100 };
                      regions.draw(snapshot, false);
                      return document.querySelector('#region-list .left').textContent;)")
                  .get<std::string>(),
              StartsWith("ends in "));
}

TEST_F(BrowserTest, TheHeaderNamesARegionInForceThatHidesNothing) {
  const Scenes scenes(test, SceneWithBlock(2));
  test.Allow("part", 4, absl::Seconds(60));
  EXPECT_TRUE(Shows("#regions", std::string("part")));
}

TEST_F(BrowserTest, LatencyIsThatOfTheScenesOfTheLastMinute) {
  ASSERT_TRUE(Shows("#status", std::string("Not serving: no scene")));
  EXPECT_EQ(browser->Run(R"(
          const figures = (count) => ({ count, within: [0, count] });
          const bars = (...counts) => {
            const seen = counts.map(([scene, map]) => ({ to_scene: figures(scene), to_map: figures(map) }));
            samples.splice(0, samples.length, ...seen.map((latency) => ({ second: local() - 10, share: null, latency })));
            return latencyBars(seen.at(-1)).join();
          };
          const none = bars([7, 7], [7, 7]);
          const first_map = bars([90, 0], [95, 4]);
          const server_began_again = bars([9, 9], [2, 2]);
          return [none, first_map, server_began_again].join('; ');)"),
            "0,0,0; 0,4,0; 0,2,0");
}

TEST_F(BrowserTest, WhereTheWholeSpaceIsNeverCountedTheHistorySaysSo) {
  ASSERT_TRUE(Shows("#status", std::string("Not serving: no scene")));
  EXPECT_THAT(browser->Text("#history-note"), HasSubstr("Striped: unknown"));
  EXPECT_THAT(browser
                  ->Run(R"(
                      snapshot = { ...snapshot, space: { ...snapshot.space, counted: false } };
                      drawHistory();
                      return `${$('history').hidden}: ${$('history-note').textContent}`;)")
                  .get<std::string>(),
              StartsWith("true: Not measured: "));
}

TEST_F(BrowserTest, EventsThatPileUpAreDrawnOnce) {
  ASSERT_TRUE(Shows("#status", std::string("Not serving: no scene")));
  EXPECT_EQ(browser->Run(R"(
          const own = { heard, drawMap };
          heard = () => {};
          drawn = 0;
          drawMap = (...rest) => { ++drawn; own.drawMap(...rest); };
          for (let i = 0; i < 20; ++i) {
            const stops = [{ time: 0, reason: 'stop', message: `number ${i}` }];
            const now = { ...newest, database: { ...newest.database, cell_name: `cell ${i}` } };
            own.heard(JSON.stringify({ stops, role, now }));
          }
          return drawn;)"),
            0);
  EXPECT_TRUE(Shows("#cell", std::string("cell 19")));
  EXPECT_TRUE(Shows("#stops", HasSubstr("number 19")));
  EXPECT_LT(browser->Run("return drawn;").get<int>(), 20);
}

TEST_F(BrowserTest, WhereTheBrowserPaintsNothingTheDrawingIsJudgedAllTheSame) {
  const Scenes scenes(test, SceneWithBlock(2));
  ASSERT_TRUE(Shows("#status", std::string("Serving")));
  browser->Run("requestAnimationFrame = () => 0;");
  for (int i = 0; i < 2; ++i) {  // the first time, a painting may have been under way
    const nlohmann::json drawn = browser->Run("return snapshot.clock;");
    EXPECT_TRUE(Soon([&] { return browser->Run("return snapshot.clock;") > drawn; }))
        << "an old drawing goes";
  }
}

TEST_F(BrowserTest, ATabThatComesBackIsCurrent) {
  test.Publish(SceneWithBlock(2));
  ASSERT_TRUE(Soon([&] { return browser->Text("#scene") == "1"; }));
  const auto hide = [](const char* hidden) {
    return absl::StrCat("Object.defineProperty(document, 'hidden', {configurable: true, value: ",
                        hidden, "}); document.dispatchEvent(new Event('visibilitychange'));");
  };
  const std::string status = "return document.getElementById('status').textContent;";
  EXPECT_THAT(browser->Run(hide("true") + status).get<std::string>(), HasSubstr("Connection lost"));
  EXPECT_TRUE(browser->Run("return source;").is_null()) << "a hidden tab asks for nothing";
  Looker stopped(*page, "", [](const nlohmann::json& event) {
    return event["stops"][0]["reason"] == "scene stale";
  });
  stopped.Wait();
  test.Publish(SceneWithBlock(2));
  EXPECT_THAT(browser->Run(hide("false") + status).get<std::string>(),
              HasSubstr("Connection lost"));
  EXPECT_TRUE(Shows("#scene", std::string("2")));
  EXPECT_TRUE(Shows("#stops", HasSubstr("scene stale")));
}

TEST_F(BrowserTest, ImagesAreReleasedOnceTheyAreDrawn) {
  ASSERT_TRUE(Shows("#status", std::string("Not serving: no scene")));
  browser->Run(R"(
      made = [];
      decode = async () => {
        made.push(await createImageBitmap(new ImageData(2, 2)));
        return made.at(-1);
      };)");
  EXPECT_TRUE(Soon([&] {
    return browser->Run(
               "return made.length > 3 && made.slice(0, 3).every((m) => m.width === 0);") == true;
  }));
}

TEST_F(BrowserTest, AStopOfAnotherDayHasItsDate) {
  ASSERT_TRUE(Shows("#stops", HasSubstr("no scene")));
  EXPECT_THAT(browser->Text("#stops b"), testing::ContainsRegex("^[0-9:]+$"));
  EXPECT_EQ(browser->Run(R"(
          stops = [{ time: new Date(2020, 4, 3, 14, 15, 16).getTime(), reason: '', message: '' }];
          drawStops();
          return document.querySelector('#stops b').textContent;)"),
            "3 May 2020, 14:15:16");
}

TEST_F(BrowserTest, APageTooManySaysSo) {
  browser->Open("about:blank");
  std::vector<std::unique_ptr<Looker>> lookers;
  const auto look = [&] {
    auto looker = std::make_unique<Looker>(*page, "", [](const auto&) { return false; });
    Soon([&] { return looker->events > 0 || looker->status == 503; });
    if (looker->events == 0) return false;  // the browser's stream has not ended yet
    lookers.push_back(std::move(looker));
    return true;
  };
  for (int i = 0; i < CellPage::kMostStreams; ++i) ASSERT_TRUE(Soon(look));
  browser->Open("http://" + page->address() + "/");
  EXPECT_TRUE(Shows("#status", std::string("At most 4 pages show this cell: close one.")));
  lookers.clear();
  EXPECT_TRUE(Shows("#status", std::string("Not serving: no scene")));
}

// With a page that may allow regions.
class BrowserRegions : public BrowserTest {
 protected:
  BrowserRegions() {
    page = StartPage(test, Role::kOperator);
    browser->Open("http://" + page->address() + "/");
    EXPECT_TRUE(Shows("#status", std::string("Serving")));
    EXPECT_TRUE(Soon([&] { return !Hidden("#region-tools"); }));
    Click("#region-draw");
  }

  void Click(const std::string& selector) {
    browser->Run("document.querySelector(" + nlohmann::json(selector).dump() + ").click();");
  }
  bool Hidden(const std::string& selector) {
    return browser
        ->Run("return document.querySelector(" + nlohmann::json(selector).dump() + ").hidden;")
        .get<bool>();
  }
  // From one mask pixel to another, near their outer corners.
  void DragPixels(int view, MaskSize size, int left, int top, int right, int bottom) {
    const std::string& name = kViewNames[static_cast<size_t>(view)];
    browser->Drag("figure[data-view=" + name + "] canvas.region",
                  {(left + 0.2) / size.width, (top + 0.2) / size.height},
                  {(right + 0.8) / size.width, (bottom + 0.8) / size.height});
  }
  // The mask pixels whose middles have colour in a view's overlay.
  Mask Coloured(int view) {
    const auto i = static_cast<size_t>(view);
    const nlohmann::json alphas = browser->Run(
        absl::StrCat("const canvas = document.querySelector('figure[data-view=", kViewNames[i],
                     "] canvas.region'), context = canvas.getContext('2d'), found = [];"
                     "for (let y = 0; y < ",
                     kViewSizes[i].height, "; ++y) for (let x = 0; x < ", kViewSizes[i].width,
                     "; ++x) found.push(context.getImageData((x + 0.5) / ", kViewSizes[i].width,
                     " * canvas.width, (y + 0.5) / ", kViewSizes[i].height,
                     " * canvas.height, 1, 1).data[3]); return found;"));
    return Mask::FromPredicate(kViewSizes[i], [&](int x, int y) {
      return alphas[static_cast<size_t>(y * kViewSizes[i].width + x)] > 0;
    });
  }
  void AllowDrawn() {
    EXPECT_TRUE(Soon([&] { return browser->Run("return !$('region-next').disabled;") == true; }));
    Click("#region-next");
    said = browser->Text("#region-meaning");
    Click("#region-allow");
    EXPECT_TRUE(Shows("#region-list .left", StartsWith("ends in ")));
  }
  v1::ListAllowedRegionsResponse Listed() {
    return test.Ask(&v1::SceneService::Stub::ListAllowedRegions, v1::ListAllowedRegionsRequest());
  }

  const Scenes scenes{test, SceneWithBlock(2)};
  std::string said;  // what was confirmed
};

Mask Rectangle(MaskSize size, int left, int top, int right, int bottom) {
  return Mask::FromPredicate(
      size, [=](int x, int y) { return x >= left && x <= right && y >= top && y <= bottom; });
}

TEST_F(BrowserRegions, ADrawnRegionIsExactlyThatOfTheApi) {
  DragPixels(0, kViewSizes[0], 3, 2, 7, 6);
  DragPixels(2, kViewSizes[2], 8, 9, 4, 4);  // from its lower right corner, to the image's rim
  const Mask left = Rectangle(kViewSizes[0], 3, 2, 7, 6);
  const Mask top = Rectangle(kViewSizes[2], 4, 4, 8, 9);
  EXPECT_EQ(Coloured(0), left);
  EXPECT_EQ(Coloured(2), top);
  AllowDrawn();
  EXPECT_THAT(said, testing::AllOf(HasSubstr("not seen in: left (25 pixels), top (30 pixels)"),
                                   HasSubstr("for 30 s"), testing::ContainsRegex("Until [0-9:]+"),
                                   HasSubstr("A person inside is not seen")));
  const v1::ListAllowedRegionsResponse listed = Listed();
  ASSERT_EQ(listed.regions_size(), 1);
  EXPECT_EQ(listed.regions(0).name(), "region");
  ASSERT_EQ(listed.regions(0).views_size(), 2);
  EXPECT_EQ(listed.regions(0).views(0).view(), "left");
  EXPECT_EQ(listed.regions(0).views(0).mask().bits(), left.ToBytes());
  EXPECT_EQ(listed.regions(0).views(1).view(), "top");
  EXPECT_EQ(listed.regions(0).views(1).mask().bits(), top.ToBytes());
}

TEST_F(BrowserRegions, ARegionCountsDownAndIsRevoked) {
  DragPixels(0, kViewSizes[0], 3, 2, 3, 2);
  AllowDrawn();
  ASSERT_EQ(Listed().regions_size(), 1);
  EXPECT_TRUE(Shows("#region-list .left", testing::ContainsRegex("^ends in 0:2[0-8]$")));
  EXPECT_TRUE(Hidden("#region-form")) << "nothing more is drawn";
  Click("#region-list button");
  EXPECT_TRUE(Shows("#region-list", HasSubstr("None is in force")));
  EXPECT_EQ(Listed().regions_size(), 0);
}

TEST_F(BrowserRegions, TheKeyboardDrawsARegion) {
  EXPECT_EQ(browser->Run("return document.querySelectorAll('canvas.region[tabindex]').length;"), 3);
  const std::string right = "\uE014";
  const std::string down = "\uE015";
  browser->Run("document.querySelector('figure[data-view=top] canvas.region').focus();");
  browser->Press({right});  // in the middle
  browser->Press({right, right, down});
  browser->Press({right, down, down}, /*held=*/"\uE008");
  const Mask drawn = Rectangle(kViewSizes[2], 5, 4, 9, 9);
  EXPECT_EQ(Coloured(2), drawn);
  AllowDrawn();
  ASSERT_EQ(Listed().regions_size(), 1);
  EXPECT_EQ(Listed().regions(0).views(0).mask().bits(), drawn.ToBytes());
}

TEST_F(BrowserRegions, WhatTheServerRefusesIsSaid) {
  DragPixels(0, kViewSizes[0], 3, 2, 3, 2);
  for (int i = 0; i < 64; ++i) test.Allow(absl::StrCat("region ", i), 2, absl::Seconds(60));
  EXPECT_TRUE(Soon([&] { return browser->Run("return !$('region-next').disabled;") == true; }));
  Click("#region-next");
  Click("#region-allow");
  EXPECT_TRUE(Shows("#region-error", HasSubstr("there are 64 allowed regions; revoke one")));
}

TEST_F(BrowserTest, WithoutARoleNoRegionCanBeDrawn) {
  const Scenes scenes(test, SceneWithBlock(2));
  ASSERT_TRUE(Shows("#region-list", HasSubstr("read-only")));
  EXPECT_EQ(browser->Run("return $('region-tools').hidden;"), true);
  EXPECT_EQ(browser->Run("return document.querySelectorAll('canvas.region[tabindex]').length;"), 0);
  test.Allow("part", 2, absl::Seconds(10));
  EXPECT_TRUE(Shows("#region-list .left", StartsWith("ends in 0:")));
  EXPECT_EQ(browser->Run("return document.querySelectorAll('#region-list button').length;"), 0);
}

// A path is free, then blocked; ten seconds without a scene; then as it was when it was blocked.
class RecordingInBrowser : public BrowserTest {
 protected:
  RecordingInBrowser() {
    cell.Scene(EmptyCellScene());
    cell.Path();
    cell.Scene(SceneWithBlock(2));
    cell.Path();
    stop = cell.now();
    cell.test.clock.Advance(absl::Seconds(10));
    cell.Scene(SceneWithBlock(2));
    replay = cell.Open();
    recorded = *CellPage::Start("127.0.0.1:0", /*insecure=*/false, *replay);
    browser->Open("http://" + recorded->address() + "/");
  }
  ~RecordingInBrowser() override { browser->Open("about:blank"); }

  void MoveTo(const std::string& control, int64_t time, const std::string& event) {
    browser->Run(absl::StrCat("const control = document.getElementById('", control,
                              "'); control.value = '", time, "'; control.dispatchEvent(new Event('",
                              event, "'));"));
  }
  void Press(const std::string& key) {
    browser->Run("document.body.dispatchEvent(new KeyboardEvent('keydown', {key: '" + key +
                 "', bubbles: true, cancelable: true}));");
  }

  RecordedServer cell;
  int64_t stop = 0;
  std::unique_ptr<Replay> replay;
  std::unique_ptr<CellPage> recorded;
};

TEST_F(RecordingInBrowser, AStopShowsTheBlockedPathAndItsEvidence) {
  ASSERT_TRUE(Shows("#status", std::string("Was serving")));
  EXPECT_THAT(browser->Text("#banner"), HasSubstr("not the cell as it is now"));
  EXPECT_TRUE(Shows("#paths .verdict", std::string("free")));
  MoveTo("jump", stop, "change");
  EXPECT_TRUE(Shows("#paths .verdict", std::string("occupied")));
  EXPECT_THAT(browser->Text("#paths"), HasSubstr("left: 4 obstacle, right: 4 obstacle"));
  EXPECT_THAT(browser->Text("figure[data-view=left] figcaption"),
              HasSubstr(absl::StrCat("obstacle ", Block(0, 2).Count(), ", ")));
  std::string expected;
  for (int b = 0; b < 8; ++b) {
    for (int a = 0; a < 5; ++a) {
      expected += cell.test.CheckOne(At(a, b)).state() == v1::Verdict::STATE_FREE ? 'f' : 'o';
    }
  }
  EXPECT_EQ(Map(), expected);
}

TEST_F(RecordingInBrowser, AGapShowsNoSceneAndNothingFree) {
  ASSERT_TRUE(Shows("#status", std::string("Was serving")));
  MoveTo("position", stop + 5000, "input");
  ASSERT_TRUE(Shows("#status", std::string("No scene recorded at this time")));
  EXPECT_EQ(Map(), std::string(40, 'u'));
  EXPECT_EQ(browser->Text("#free"), "–");
  EXPECT_THAT(browser->Text("#paths .verdict"), std::string("unknown"));
  EXPECT_THAT(browser->Text("#defects"), HasSubstr("no scene is recorded at this time"));
}

TEST_F(RecordingInBrowser, ArrowKeysGoFromSceneToScene) {
  ASSERT_TRUE(Shows("#status", std::string("Was serving")));
  EXPECT_TRUE(Shows("#scene", std::string("1")));
  Press("ArrowRight");
  EXPECT_TRUE(Shows("#scene", std::string("2")));
  Press("ArrowRight");
  EXPECT_TRUE(Shows("#scene", std::string("3")));
  Press("ArrowLeft");
  EXPECT_TRUE(Shows("#scene", std::string("2")));
}

TEST_F(RecordingInBrowser, ArrowKeysPassAMomentThatCannotBeShown) {
  RecordedServer other;
  other.Scene(EmptyCellScene());
  other.Scene(EmptyCellScene(), [](v1::Scene& scene) {
    Set(Mask({8, 8}), scene.mutable_views(0)->mutable_scene());
  });
  other.Scene(EmptyCellScene());
  const auto broken = other.Open();
  const auto shown = *CellPage::Start("127.0.0.1:0", /*insecure=*/false, *broken);
  browser->Open("http://" + shown->address() + "/");
  ASSERT_TRUE(Shows("#scene", std::string("1")));
  Press("ArrowRight");
  ASSERT_TRUE(Shows("#status", StartsWith("Unknown: ")));
  EXPECT_EQ(Map(), std::string(40, 'u'));
  Press("ArrowRight");
  EXPECT_TRUE(Shows("#status", std::string("Was serving")));
  EXPECT_TRUE(Shows("#scene", std::string("3")));
  browser->Open("about:blank");
}

TEST_F(RecordingInBrowser, PlaysToItsEnd) {
  ASSERT_TRUE(Shows("#status", std::string("Was serving")));
  browser->Run("document.getElementById('speed').value = '20';");
  Press(" ");
  EXPECT_TRUE(Shows("#play", std::string("Pause")));
  EXPECT_TRUE(Shows("#scene", std::string("3")));
  EXPECT_TRUE(Shows("#play", std::string("Play")));
}

TEST_F(RecordingInBrowser, WithoutTheServerNothingIsShownAsThatMoment) {
  ASSERT_TRUE(Shows("#status", std::string("Was serving")));
  recorded.reset();
  Press("ArrowRight");
  EXPECT_TRUE(Shows("#status", HasSubstr("Connection lost")));
  EXPECT_EQ(Map(), std::string(40, 'u'));
}

TEST_F(BrowserTest, TextsAreNeverMarkup) {
  ASSERT_TRUE(Shows("#cell", std::string(kHostileName)));
  EXPECT_EQ(browser->Run("return document.images.length;"), 0);
  EXPECT_EQ(browser->Run("return document.title;"), "Silhouette");
}

}  // namespace
}  // namespace silhouette
