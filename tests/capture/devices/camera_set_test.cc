// SPDX-License-Identifier: Apache-2.0
#include "capture/devices/camera_set.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <utility>

#include "absl/time/clock.h"

namespace silhouette {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

CameraImage ImageOf(uint8_t level, absl::Time captured = absl::UnixEpoch()) {
  return {.width = 1, .height = 1, .channels = 1, .pixels = {level}, .captured = captured};
}

// What happened to all sources, in its order.
using Log = std::vector<std::string>;

// Its images are 10 * (number of the trigger) + (number of the view).
class FakeSource : public CameraSource {
 public:
  FakeSource(std::vector<std::string> views, Log& log) : views_(std::move(views)), log_(&log) {}

  const std::vector<std::string>& views() const override { return views_; }
  absl::Duration timeout() const override { return absl::Seconds(2); }

  bool ready() const override { return there; }
  absl::Status Open() override {
    const absl::Status status = on_open ? on_open() : absl::OkStatus();
    there = status.ok();
    return status;
  }

  absl::Status Trigger() override {
    log_->push_back("trigger " + views_.front());
    ++triggers;
    return on_trigger;
  }

  absl::StatusOr<EachImage> Wait(absl::Duration deadline) override {
    log_->push_back("wait " + views_.front());
    deadlines.push_back(deadline);
    if (!on_wait.ok()) return on_wait;
    EachImage images;
    for (size_t v = 0; v < views_.size(); ++v) {
      images.emplace_back(ImageOf(static_cast<uint8_t>(10 * triggers + static_cast<int>(v))));
    }
    if (!on_last.ok()) images.back() = on_last;
    if (short_of_one) images.pop_back();
    return images;
  }

  bool there = true;
  std::function<absl::Status()> on_open;  // called by any thread
  int triggers = 0;
  bool short_of_one = false;
  absl::Status on_trigger;
  absl::Status on_wait;
  absl::Status on_last;  // of the last image alone
  std::vector<absl::Duration> deadlines;

 private:
  std::vector<std::string> views_;
  Log* log_;
};

class CameraSetTest : public testing::Test {
 protected:
  CameraSetTest() {
    auto pair = std::make_unique<FakeSource>(std::vector<std::string>{"left", "top"}, log_);
    auto front = std::make_unique<FakeSource>(std::vector<std::string>{"front"}, log_);
    pair_ = pair.get();
    front_ = front.get();
    std::vector<std::unique_ptr<CameraSource>> sources;
    sources.push_back(std::move(pair));
    sources.push_back(std::move(front));
    set_ = std::make_unique<CameraSet>(std::vector<std::string>{"top", "front", "left"},
                                       std::move(sources));
  }

  Log log_;
  FakeSource* pair_;
  FakeSource* front_;
  std::unique_ptr<CameraSet> set_;
};

TEST_F(CameraSetTest, AllAreTriggeredBeforeAnyIsWaitedFor) {
  ASSERT_TRUE(set_->Grab().ok());
  EXPECT_THAT(log_, ElementsAre("trigger left", "trigger front", "wait left", "wait front"));
  EXPECT_EQ(pair_->deadlines[0], front_->deadlines[0]) << "they are waited for side by side";
}

TEST_F(CameraSetTest, ImagesComeInTheOrderOfTheViews) {
  const auto images = set_->Grab();
  ASSERT_TRUE(images.ok()) << images.status();
  ASSERT_EQ(images->size(), 3u);
  EXPECT_EQ((*images)[0].pixels[0], 11);  // top, the pair's second
  EXPECT_EQ((*images)[1].pixels[0], 10);
  EXPECT_EQ((*images)[2].pixels[0], 10);
}

TEST_F(CameraSetTest, LostImageFailsTheSetAndNamesItsView) {
  front_->on_wait = absl::DeadlineExceededError("no image within 2s");
  const absl::Status status = set_->Grab().status();
  EXPECT_TRUE(absl::IsDeadlineExceeded(status));
  EXPECT_EQ(status.message(), "the camera of the view 'front': no image within 2s");
  EXPECT_EQ(set_->counts()[1].lost, 1u);
  EXPECT_EQ(set_->counts()[1].taken, 0u);
  EXPECT_EQ(set_->counts()[0].taken, 1u);
}

TEST_F(CameraSetTest, ImageThatFailsAloneLeavesTheOthersOfItsSource) {
  pair_->on_last = absl::DataLossError("camera 'top': not whole");
  const auto images = set_->GrabEach();
  EXPECT_TRUE(absl::IsUnavailable(images[0].status())) << "top";
  EXPECT_EQ(images[0].status().message(), "camera 'top': not whole");
  EXPECT_TRUE(images[1].ok() && images[2].ok());
  EXPECT_EQ(set_->counts()[0].incomplete, 1u);
  EXPECT_EQ(set_->counts()[0].taken, 0u);
  EXPECT_EQ(set_->counts()[2].taken, 1u);
}

TEST_F(CameraSetTest, IncompleteImageIsCountedAndMayBeAskedForAgain) {
  front_->on_wait = absl::DataLossError("3 of 40 packets are missing");
  EXPECT_TRUE(absl::IsUnavailable(set_->Grab().status()));
  EXPECT_EQ(set_->counts()[1].incomplete, 1u);
  EXPECT_EQ(set_->counts()[1].lost, 0u);
  front_->on_wait = absl::OkStatus();
  const auto images = set_->Grab();
  ASSERT_TRUE(images.ok()) << images.status();
  EXPECT_EQ((*images)[0].pixels[0], 21) << "no image of a set that failed is left over";
}

TEST_F(CameraSetTest, AllThatWereTriggeredAreWaitedForEvenIfOneFails) {
  pair_->on_trigger = absl::UnavailableError("the pair is not there any more");
  const absl::Status status = set_->Grab().status();
  EXPECT_TRUE(absl::IsUnavailable(status));
  EXPECT_EQ(status.message(), "the pair is not there any more");
  EXPECT_THAT(log_, ElementsAre("trigger left", "trigger front", "wait front"));
  EXPECT_EQ(set_->counts()[0].lost, 1u);
  EXPECT_EQ(set_->counts()[2].lost, 1u);
}

TEST_F(CameraSetTest, EachViewHasItsImageOrWhyThereIsNone) {
  front_->on_wait = absl::DeadlineExceededError("no image within 2s");
  const auto images = set_->GrabEach();
  ASSERT_EQ(images.size(), 3u);
  EXPECT_EQ(images[0]->pixels[0], 11);
  EXPECT_TRUE(absl::IsDeadlineExceeded(images[1].status()));
  EXPECT_EQ(images[2]->pixels[0], 10);
}

TEST_F(CameraSetTest, LostSourcesAreOpenedAtTheSameTimeBeforeAnyIsTriggered) {
  std::mutex mutex;
  std::condition_variable came;
  int inside = 0;
  const auto meet = [&] {
    std::unique_lock lock(mutex);
    ++inside;
    came.notify_all();
    return came.wait_for(lock, std::chrono::minutes(1), [&] { return inside == 2; })
               ? absl::OkStatus()
               : absl::UnavailableError("the other was not opened meanwhile");
  };
  for (FakeSource* source : {pair_, front_}) {
    source->there = false;
    source->on_open = [this, meet] {
      EXPECT_THAT(log_, IsEmpty());
      return meet();
    };
  }
  const auto images = set_->Grab();
  ASSERT_TRUE(images.ok()) << images.status();
  EXPECT_THAT(log_, ElementsAre("trigger left", "trigger front", "wait left", "wait front"));
}

TEST_F(CameraSetTest, SourceThatIsLookedForDelaysNoOther) {
  std::promise<absl::Status> end;
  int opened = 0;
  front_->there = false;
  front_->on_open = [&] {
    ++opened;
    return end.get_future().get();
  };
  for (int i = 0; i < 3; ++i) {
    const auto images = set_->GrabEach();
    EXPECT_TRUE(images[0].ok() && images[2].ok());
    EXPECT_TRUE(absl::IsUnavailable(images[1].status()));
    EXPECT_THAT(images[1].status().message(), HasSubstr("'front': the connection to it was lost"));
  }
  end.set_value(absl::OkStatus());
  EXPECT_TRUE(set_->Grab().ok()) << "who needs all waits for all";
  EXPECT_EQ(opened, 1);
}

TEST_F(CameraSetTest, SourceThatIsLookedForAgainStaysLostForTheSameReason) {
  std::promise<void> end;
  const std::shared_future<void> ended = end.get_future().share();
  int opened = 0;
  front_->there = false;
  front_->on_open = [&opened, ended] {
    if (++opened > 1) ended.wait();
    return absl::UnavailableError("it does not answer");
  };
  EXPECT_FALSE(set_->Grab().ok());
  for (int i = 0; i < 3; ++i) {
    EXPECT_THAT(set_->GrabEach()[1].status().message(), HasSubstr("it does not answer"));
  }
  end.set_value();
  EXPECT_FALSE(set_->Grab().ok());
}

TEST_F(CameraSetTest, SourceIsNotDestroyedWhileItIsLookedFor) {
  bool opened = false;
  front_->there = false;
  front_->on_open = [&opened] {
    absl::SleepFor(absl::Milliseconds(50));
    opened = true;
    return absl::OkStatus();
  };
  set_->GrabEach();
  set_.reset();
  EXPECT_TRUE(opened);
}

TEST_F(CameraSetTest, IfAllAreLostTheyAreWaitedFor) {
  pair_->there = front_->there = false;
  for (const auto& image : set_->GrabEach()) EXPECT_TRUE(image.ok()) << image.status();
}

TEST_F(CameraSetTest, SourceThatStaysAwayIsNotTriggered) {
  front_->there = false;
  front_->on_open = [] { return absl::UnavailableError("it does not answer"); };
  EXPECT_EQ(set_->Grab().status().message(), "the camera of the view 'front': it does not answer");
  EXPECT_THAT(log_, ElementsAre("trigger left", "wait left"));
  EXPECT_EQ(set_->counts()[1].lost, 1u);
}

TEST_F(CameraSetTest, SourceThatGivesTooFewImagesIsAnError) {
  pair_->short_of_one = true;
  EXPECT_THAT(set_->Grab().status().message(), HasSubstr("1 images instead of 2"));
}

TEST(CameraSet, EveryViewHasExactlyOneSource) {
  Log log;
  const auto set_of = [&](std::vector<std::string> views, std::vector<std::string> sources) {
    std::vector<std::unique_ptr<CameraSource>> made;
    for (const std::string& view : sources) {
      made.push_back(std::make_unique<FakeSource>(std::vector<std::string>{view}, log));
    }
    CameraSet(std::move(views), std::move(made));
  };
  EXPECT_NO_THROW(set_of({"top", "front"}, {"front", "top"}));
  EXPECT_THROW(set_of({"top", "front"}, {"top"}), std::invalid_argument);
  EXPECT_THROW(set_of({"top"}, {"top", "top"}), std::invalid_argument);
  EXPECT_THROW(set_of({"top"}, {"side"}), std::invalid_argument);
}

TEST(CameraSet, SkewIsTheTimeBetweenOldestAndNewest) {
  const absl::Time noon = absl::UnixEpoch() + absl::Hours(12);
  EXPECT_EQ(SkewOf({ImageOf(0, noon + absl::Milliseconds(3)), ImageOf(0, noon),
                    ImageOf(0, noon + absl::Milliseconds(1))}),
            absl::Milliseconds(3));
  EXPECT_EQ(SkewOf({}), absl::ZeroDuration());
}

}  // namespace
}  // namespace silhouette
