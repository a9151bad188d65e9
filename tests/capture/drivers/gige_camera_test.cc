// SPDX-License-Identifier: Apache-2.0
// GigE Vision cameras: genuine devices of the protocol on loopback addresses, with rendered images.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <arv.h>

#include <cmath>
#include <fstream>
#include <functional>

#include "absl/time/clock.h"
#include "capture/devices/camera_set.h"
#include "capture/drivers/aravis/aravis_camera.h"
#include "capture/sim/served/network_cameras.h"
#include "tests/capture/drivers/own_network.h"
#include "tests/capture/drivers/served_cell.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::HasSubstr;

GenicamSource WithSerial(const std::string& serial) {
  GenicamSource source;
  source.serial = serial;
  source.timeout = absl::Seconds(10);
  return source;
}

// Before there are any threads.
const bool kOwnNetwork = EnterOwnNetwork(4);

class GigeCamera : public ServedCell {
 protected:
  explicit GigeCamera(bool colour = false) : ServedCell(colour) {}

  void SetUp() override {
    if (!kOwnNetwork) GTEST_SKIP() << "the system lets a test have no network of its own";
    Serve();
  }

  void Serve(const std::string& genicam = "") {
    cameras_.reset();
    auto cameras = ServeGigeCameras(*views_, genicam);
    ASSERT_TRUE(cameras.ok()) << cameras.status();
    cameras_ = *std::move(cameras);
  }

  // The cameras of `views`; `change` may change what they are told.
  static std::unique_ptr<CameraSet> Open(
      const std::vector<std::string>& views,
      const std::function<void(GenicamSource&)>& change = [](GenicamSource&) {}) {
    std::vector<std::unique_ptr<CameraSource>> sources;
    for (const std::string& name : views) {
      GenicamSource source = WithSerial(name);
      change(source);
      auto opened = OpenGenicamCamera(name, kWidth, kHeight, source);
      EXPECT_TRUE(opened.ok()) << opened.status();
      if (opened.ok()) sources.push_back(*std::move(opened));
    }
    return std::make_unique<CameraSet>(views, std::move(sources));
  }

  static absl::Status OpenStatus(const GenicamSource& source, int width = kWidth,
                                 int height = kHeight) {
    return OpenGenicamCamera("top", width, height, source).status();
  }

  std::unique_ptr<NetworkCameras> cameras_;
};

TEST_F(GigeCamera, AreFoundBySerialNumber) {
  const std::vector<FoundCamera> found = FindGenicamCameras();
  ASSERT_EQ(found.size(), 4u);
  EXPECT_EQ(found[0].serial, "back");
  EXPECT_EQ(found[0].protocol, "GigEVision");
  EXPECT_EQ(found[0].address, "127.0.0.4");
  EXPECT_EQ(found[0].vendor, "Aravis");
}

TEST_F(GigeCamera, TriggeredTogetherShowTheCellAsItIsThen) {
  const auto set = Open(names_);
  for (int i = 0; i < 12; ++i) {
    Turn(0.2 * i);
    const absl::Time before = absl::Now();
    const auto images = set->Grab();
    const absl::Time after = absl::Now();
    ASSERT_TRUE(images.ok()) << images.status();
    ASSERT_EQ(Pixels(*images), Truth()) << "set " << i;
    for (const CameraImage& image : *images) {
      EXPECT_EQ(image.channels, 1);
      EXPECT_GE(image.captured, before);
      EXPECT_LE(image.captured, after);
    }
  }
  for (const ViewCounts& counts : set->counts()) {
    EXPECT_EQ(counts.taken, 12u);
    EXPECT_EQ(counts.lost + counts.incomplete, 0u);
  }
}

TEST_F(GigeCamera, RunningFreeNeverShowsTheTimeBefore) {
  const auto set = Open(names_, [](GenicamSource& source) {
    source.trigger = CameraTrigger::kFree;
    source.latency = absl::Seconds(1);
  });
  for (int i = 0; i < 3; ++i) {
    Turn(0.5 * i);
    const absl::Time before = absl::Now();
    const auto images = set->Grab();
    ASSERT_TRUE(images.ok()) << images.status();
    EXPECT_EQ(Pixels(*images), Truth()) << "set " << i;
    for (const CameraImage& image : *images) EXPECT_GE(image.captured, before);
  }
}

TEST_F(GigeCamera, LostPacketsAreToldAndNoImageComesLate) {
  const auto set = Open({"top"}, [](GenicamSource& source) { source.timeout = absl::Seconds(2); });
  cameras_->LosePackets(0.1);
  for (int i = 0; i < 50 && set->counts()[0].incomplete == 0; ++i) {
    Turn(0.1 * i);
    const auto images = set->Grab();
    if (images.ok()) {
      EXPECT_EQ(images->front().pixels, Truth()[0]);
      continue;
    }
    EXPECT_TRUE(absl::IsUnavailable(images.status()) || absl::IsDeadlineExceeded(images.status()))
        << images.status();
  }
  EXPECT_EQ(set->counts()[0].incomplete, 1u);
  cameras_->LosePackets(1);
  const absl::Status status = set->Grab().status();
  EXPECT_TRUE(absl::IsDeadlineExceeded(status));
  EXPECT_THAT(status.message(), HasSubstr("the camera of the view 'top': no image within 2 s"));
  EXPECT_GE(set->counts()[0].lost, 1u);
  cameras_->LosePackets(0);
  Turn(2);
  absl::StatusOr<std::vector<CameraImage>> images;
  for (int i = 0; i < 10 && !images.ok(); ++i) images = set->Grab();
  ASSERT_TRUE(images.ok()) << images.status();
  EXPECT_EQ(images->front().pixels, Truth()[0]);
}

TEST_F(GigeCamera, ThatGoesAwayIsToldByItsViewAndComesBack) {
  const auto set = Open({"top"});
  ASSERT_TRUE(set->Grab().ok());
  cameras_.reset();
  const absl::Status status = set->Grab().status();
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_EQ(
      status.message(),
      "the camera of the view 'top': the connection to it was lost; check its power and cable");
  Serve();
  Turn(1);
  absl::StatusOr<std::vector<CameraImage>> images;
  for (int i = 0; i < 20 && !images.ok(); ++i) images = set->Grab();
  ASSERT_TRUE(images.ok()) << images.status();
  EXPECT_EQ(images->front().pixels, Truth()[0]);
}

TEST_F(GigeCamera, SeveralThatWentAwayComeBackTogether) {
  const auto set = Open(names_);
  ASSERT_TRUE(set->Grab().ok());
  cameras_.reset();
  for (int i = 0; i < 2; ++i) {
    for (const auto& image : set->GrabEach()) EXPECT_FALSE(image.ok());
  }
  Serve();
  Turn(0.4);
  absl::StatusOr<std::vector<CameraImage>> images;
  for (int i = 0; i < 10 && !images.ok(); ++i) images = set->Grab();
  ASSERT_TRUE(images.ok()) << images.status();
  EXPECT_EQ(Pixels(*images), Truth());
}

TEST_F(GigeCamera, WhoseAddressAnotherOneHasNowIsFoundAgainByItsSerialNumber) {
  const auto set = Open({"top"});
  ASSERT_TRUE(set->Grab().ok());
  cameras_.reset();
  EXPECT_FALSE(set->Grab().ok());
  const std::vector<SimulatedView> views = views_->views();
  views_ = *ServedViews::Create(cell_, {views.rbegin(), views.rend()});
  Serve();
  absl::StatusOr<std::vector<CameraImage>> images = set->Grab();
  EXPECT_THAT(images.status().message(),
              HasSubstr("the camera with the serial number 'back', not 'top'"));
  for (int i = 0; i < 20 && !images.ok(); ++i) images = set->Grab();
  ASSERT_TRUE(images.ok()) << images.status();
  EXPECT_EQ(images->front().pixels, Truth().back());
}

struct ColourGigeCamera : GigeCamera {
  ColourGigeCamera() : GigeCamera(/*colour=*/true) {}

  // Aravis' description of its simulated camera, without pixel formats but `format`.
  static std::string GenicamWith(const std::string& format) {
    ArvFakeCamera* camera = arv_fake_camera_new("any");
    size_t size = 0;
    const char* xml = arv_fake_camera_get_genicam_xml(camera, &size);
    std::string text(xml, size);
    g_object_unref(camera);
    for (const std::string other :
         {"Mono8", "Mono16", "RGB8", "BayerRG8", "BayerGR8", "BayerGB8", "BayerBG8"}) {
      if (other == format) continue;
      const size_t begin = text.find("<EnumEntry Name=\"" + other + "\"");
      EXPECT_NE(begin, std::string::npos) << other;
      const std::string end = "</EnumEntry>";
      text.erase(begin, text.find(end, begin) + end.size() - begin);
    }
    const std::string file = (FreshFolder() / "camera.xml").string();
    std::ofstream(file) << text;
    return file;
  }

  static std::unique_ptr<CameraSet> OpenInColour() {
    return Open({"front"}, [](GenicamSource& source) { source.colour = true; });
  }
};

TEST_F(ColourGigeCamera, ColoursAreThoseOfTheCell) {
  const auto set = OpenInColour();
  const auto images = set->Grab();
  ASSERT_TRUE(images.ok()) << images.status();
  EXPECT_EQ(images->front().channels, 3);
  EXPECT_EQ(images->front().pixels, Truth()[1]);
}

TEST_F(ColourGigeCamera, WithoutColourAskedForIsGrey) {
  const auto images = Open({"front"})->Grab();
  ASSERT_TRUE(images.ok()) << images.status();
  EXPECT_EQ(images->front().channels, 1);
  EXPECT_EQ(images->front().pixels, GreyPixels(views_->TakeAll()[1]));
}

TEST_F(ColourGigeCamera, EveryBayerMosaicGivesTheColoursOfTheCell) {
  for (const std::string format : {"BayerRG8", "BayerGR8", "BayerGB8", "BayerBG8"}) {
    SCOPED_TRACE(format);
    Serve(GenicamWith(format));
    const auto images = OpenInColour()->Grab();
    ASSERT_TRUE(images.ok()) << images.status();
    ASSERT_EQ(images->front().channels, 3);
    const std::vector<uint8_t> truth = Truth()[1];
    const std::vector<uint8_t>& seen = images->front().pixels;
    ASSERT_EQ(seen.size(), truth.size());
    // What lies between a channel's own pixels is interpolated: right in the mean, and nearly right
    // almost everywhere.
    size_t wrong = 0;
    for (size_t channel = 0; channel < 3; ++channel) {
      double difference = 0;
      for (size_t i = channel; i < truth.size(); i += 3) {
        difference += seen[i] - truth[i];
        wrong += std::abs(seen[i] - truth[i]) > 25;
      }
      EXPECT_LT(std::abs(difference) / static_cast<double>(truth.size() / 3), 1.5) << channel;
    }
    EXPECT_LT(wrong, truth.size() / 20);
  }
}

TEST_F(GigeCamera, ThatIsNotThereIsToldWithThoseThatAre) {
  EXPECT_THAT(
      OpenStatus(WithSerial("side")).message(),
      AllOf(HasSubstr("no GigEVision camera with the serial number 'side'"), HasSubstr("top")));
  GenicamSource source;
  source.address = "127.0.0.2";
  EXPECT_TRUE(OpenStatus(source).ok());
}

TEST_F(GigeCamera, SettingsThatItDoesNotTakeAreToldWithItsBounds) {
  EXPECT_THAT(OpenStatus(WithSerial("top"), 320, 240).message(),
              HasSubstr("its sensor has 160 x 120 pixels; the cell says 320 x 240"));
  GenicamSource source = WithSerial("top");
  source.exposure = absl::Hours(1);
  EXPECT_THAT(OpenStatus(source).message(),
              AllOf(HasSubstr("the exposure"), HasSubstr("is not possible; it takes ")));
  source.exposure = absl::Milliseconds(4);
  source.gain = 2;
  EXPECT_TRUE(OpenStatus(source).ok());
}

TEST_F(GigeCamera, RegionIsThatOfTheCellWhateverItWasBefore) {
  struct Region {
    gint x = 0, y = 0, width = 0, height = 0;
    bool operator==(const Region&) const = default;
  };
  const auto open = [] { return arv_camera_new("127.0.0.1", nullptr); };
  for (const Region wanted : {Region{0, 0, 80, 60}, Region{40, 30, 80, 60}}) {
    for (const Region before : {Region{40, 30, 80, 60}, Region{0, 30, 80, 60},
                                Region{40, 30, 20, 20}, Region{0, 0, kWidth, kHeight}}) {
      ArvCamera* camera = open();
      ASSERT_NE(camera, nullptr);
      arv_camera_set_region(camera, before.x, before.y, before.width, before.height, nullptr);
      g_object_unref(camera);
      GenicamSource source;
      source.address = "127.0.0.1";
      source.offset_x = wanted.x;
      source.offset_y = wanted.y;
      const absl::Status status = OpenStatus(source, wanted.width, wanted.height);
      EXPECT_TRUE(status.ok()) << status;
      camera = open();
      ASSERT_NE(camera, nullptr);
      Region after;
      arv_camera_get_region(camera, &after.x, &after.y, &after.width, &after.height, nullptr);
      g_object_unref(camera);
      EXPECT_EQ(after, wanted) << after.x << ", " << after.y;
    }
  }
}

TEST_F(GigeCamera, ThatAnotherProgramControlsIsTold) {
  const auto first = OpenGenicamCamera("top", kWidth, kHeight, WithSerial("top"));
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_THAT(OpenStatus(WithSerial("top")).message(),
              HasSubstr("another program controls the camera"));
}

}  // namespace
}  // namespace silhouette
