// SPDX-License-Identifier: Apache-2.0
// Cameras behind a CameraDriverService: that of the simulated cell, and one that does wrong.
#include "capture/drivers/grpc/grpc_camera.h"
#include "capture/devices/running_clock.h"

#include <gmock/gmock.h>
#include <google/protobuf/util/time_util.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <opencv2/imgcodecs.hpp>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "capture/devices/camera_set.h"
#include "capture/sim/served/network_cameras.h"
#include "silhouette/v1/camera_driver.grpc.pb.h"
#include "tests/capture/drivers/served_cell.h"
#include "tests/certificates.h"
#include "tests/folders.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

absl::StatusOr<std::vector<CameraImage>> GrpcCameraTake(CameraSource& source) {
  if (absl::Status status = source.Trigger(); !status.ok()) return status;
  auto each = source.Wait(RunningNow() + source.timeout());
  if (!each.ok()) return each.status();
  std::vector<CameraImage> images;
  for (absl::StatusOr<CameraImage>& image : *each) {
    if (!image.ok()) return image.status();
    images.push_back(*std::move(image));
  }
  return images;
}

class GrpcCamera : public ServedCell {
 protected:
  void SetUp() override { Serve(0); }

  void Serve(int port) {
    cameras_.reset();
    auto cameras = ServeGrpcCameras(*views_, port);
    ASSERT_TRUE(cameras.ok()) << cameras.status();
    cameras_ = *std::move(cameras);
  }

  std::unique_ptr<NetworkCameras> cameras_;
};

TEST_F(GrpcCamera, GiveOneSetInTheOrderOfTheViews) {
  const auto opened = OpenGrpcCameras(
      cameras_->addresses()[0],
      {{"behind", "back", kWidth, kHeight}, {"above", "top", kWidth, kHeight}}, absl::Seconds(20));
  ASSERT_TRUE(opened.ok()) << opened.status();
  for (int i = 0; i < 3; ++i) {
    Turn(0.4 * i);
    const absl::Time before = absl::Now();
    const auto images = GrpcCameraTake(**opened);
    ASSERT_TRUE(images.ok()) << images.status();
    ASSERT_EQ(images->size(), 2u);
    EXPECT_EQ((*images)[0].pixels, Truth()[3]);
    EXPECT_EQ((*images)[1].pixels, Truth()[0]);
    EXPECT_EQ((*images)[0].captured, (*images)[1].captured);
    EXPECT_GE((*images)[0].captured, before);
  }
}

TEST_F(GrpcCamera, ThatAreNotThereOrOfAnotherSizeAreTold) {
  const auto status = [&](const std::string& camera, int width) {
    return OpenGrpcCameras(cameras_->addresses()[0], {{"above", camera, width, kHeight}},
                           absl::Seconds(20))
        .status();
  };
  EXPECT_TRUE(absl::IsNotFound(status("side", kWidth)));
  EXPECT_THAT(status("side", kWidth).message(),
              HasSubstr("no camera 'side'; it has top, front, left, back"));
  EXPECT_THAT(status("top", 320).message(), HasSubstr("160 x 120 pixels; the cell says 320 x 120"));
}

TEST_F(GrpcCamera, DriverThatGoesAwayIsToldAndComesBack) {
  const std::string address = cameras_->addresses()[0];
  const auto opened =
      OpenGrpcCameras(address, {{"above", "top", kWidth, kHeight}}, absl::Seconds(5));
  ASSERT_TRUE(opened.ok()) << opened.status();
  cameras_.reset();
  const absl::Status status = GrpcCameraTake(**opened).status();
  EXPECT_TRUE(absl::IsUnavailable(status) || absl::IsDeadlineExceeded(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr(address));
  Serve(std::stoi(address.substr(address.find(':') + 1)));
  absl::StatusOr<std::vector<CameraImage>> images;
  const absl::Time deadline = absl::Now() + absl::Seconds(60);
  while (!images.ok() && absl::Now() < deadline) {
    images = GrpcCameraTake(**opened);
    if (!images.ok()) absl::SleepFor(absl::Milliseconds(50));
  }
  ASSERT_TRUE(images.ok()) << images.status();
  EXPECT_EQ(images->front().pixels, Truth()[0]);
}

// A driver with one camera that answers as a test says.
class OddDriver : public v1::CameraDriverService::Service {
 public:
  using Answer = std::function<void(v1::GrabResponse&)>;

  explicit OddDriver(Answer answer, const std::shared_ptr<grpc::ServerCredentials>& credentials =
                                        grpc::InsecureServerCredentials())
      : answer_(std::move(answer)) {
    int port = 0;
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", credentials, &port);
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
    address_ = absl::StrCat("127.0.0.1:", port);
  }

  grpc::Status GetCameras(grpc::ServerContext*, const v1::GetCamerasRequest*,
                          v1::GetCamerasResponse* response) override {
    v1::DriverCamera* camera = response->add_cameras();
    camera->set_name("top");
    camera->set_width(4);
    camera->set_height(2);
    return grpc::Status::OK;
  }

  grpc::Status Grab(grpc::ServerContext*, const v1::GrabRequest*,
                    v1::GrabResponse* response) override {
    answer_(*response);
    return grpc::Status::OK;
  }

  absl::StatusOr<std::vector<CameraImage>> Grabbed(const ClientTlsFiles& tls = {}) {
    auto opened = OpenGrpcCameras(address_, {{"top", "top", 4, 2}}, absl::Seconds(20), tls);
    if (!opened.ok()) return opened.status();
    return GrpcCameraTake(**opened);
  }

  const std::string& address() const { return address_; }

  // For two views of its camera.
  absl::StatusOr<CameraSource::EachImage> GrabbedTwice() {
    auto opened = OpenGrpcCameras(address_, {{"left", "top", 4, 2}, {"right", "top", 4, 2}},
                                  absl::Seconds(20));
    if (!opened.ok()) return opened.status();
    if (absl::Status status = (*opened)->Trigger(); !status.ok()) return status;
    return (*opened)->Wait(RunningNow() + (*opened)->timeout());
  }

 private:
  const Answer answer_;
  std::unique_ptr<grpc::Server> server_;
  std::string address_;
};

// An image of 4 x 2 pixels.
v1::DriverImage& AddImage(v1::GrabResponse& response) {
  v1::DriverImage* image = response.add_images();
  image->mutable_raw()->set_width(4);
  image->mutable_raw()->set_height(2);
  image->mutable_raw()->set_channels(1);
  image->mutable_raw()->set_pixels("12345678");
  return *image;
}

void SetTime(v1::DriverImage& image, absl::Time time) {
  *image.mutable_capture_time() =
      google::protobuf::util::TimeUtil::NanosecondsToTimestamp(absl::ToUnixNanos(time));
}

TEST(CameraDriver, ImageThatIsOlderThanTheCallIsRefused) {
  OddDriver driver([](v1::GrabResponse& response) {
    SetTime(AddImage(response), absl::Now() - absl::Hours(1));
  });
  const absl::Status status = driver.Grabbed().status();
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr("before it was asked for; it is an old one"));
}

TEST(CameraDriver, ImageOfAnotherTimeCountsAsOneThatIsNotWholeAndIsAskedForAgain) {
  int grabs = 0;
  OddDriver driver([&](v1::GrabResponse& response) {
    v1::DriverImage& image = AddImage(response);
    if (++grabs == 1) SetTime(image, absl::Now() - absl::Seconds(1));
  });
  std::vector<std::unique_ptr<CameraSource>> sources;
  sources.push_back(
      OpenGrpcCameras(driver.address(), {{"top", "top", 4, 2}}, absl::Seconds(20)).value());
  CameraSet cameras({"top"}, std::move(sources));
  EXPECT_TRUE(absl::IsUnavailable(cameras.Grab().status()));
  EXPECT_EQ(cameras.Grab().status(), absl::OkStatus());
}

TEST(CameraDriver, ImageOfTheFutureIsRefused) {
  OddDriver driver([](v1::GrabResponse& response) {
    SetTime(AddImage(response), absl::Now() + absl::Hours(1));
  });
  const absl::Status status = driver.Grabbed().status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr("after it came"));
}

TEST(CameraDriver, ImageWithoutATimeIsAsOldAsItCanBe) {
  absl::Time called;
  OddDriver driver([&](v1::GrabResponse& response) {
    called = absl::Now();
    AddImage(response);
  });
  const auto images = driver.Grabbed();
  ASSERT_TRUE(images.ok()) << images.status();
  EXPECT_LE(images->front().captured, called);
  EXPECT_EQ(images->front().pixels[7], '8');
}

TEST(CameraDriver, EncodedImagesAreRead) {
  OddDriver driver([](v1::GrabResponse& response) {
    std::vector<uint8_t> png;
    cv::imencode(".png", cv::Mat(2, 4, CV_8UC3, cv::Scalar(1, 2, 3)), png);
    response.add_images()->set_encoded(png.data(), png.size());
  });
  const auto images = driver.Grabbed();
  ASSERT_TRUE(images.ok()) << images.status();
  EXPECT_EQ(images->front().channels, 3);
  EXPECT_EQ(images->front().pixels[2], 3);
}

TEST(CameraDriver, EncodedImageOfWhichOnlyTheLowerBitsAreUsedIsRefused) {
  OddDriver driver([](v1::GrabResponse& response) {
    std::vector<uint8_t> png;
    cv::imencode(".png", cv::Mat(2, 4, CV_16UC1, cv::Scalar(4095)), png);
    response.add_images()->set_encoded(png.data(), png.size());
  });
  EXPECT_THAT(driver.Grabbed().status().message(), HasSubstr("the lower 12 of its 16 bits"));
}

std::string TextIn(const std::filesystem::path& file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), {}};
}

TEST(CameraDriver, WithCertificatesServesOnlyWhoHasOne) {
  const std::filesystem::path folder = MakeCertificates();
  grpc::SslServerCredentialsOptions options(
      GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  options.pem_root_certs = TextIn(folder / "ca.pem");
  options.pem_key_cert_pairs.push_back(
      {TextIn(folder / "server.key"), TextIn(folder / "server.pem")});
  OddDriver driver([](v1::GrabResponse& response) { AddImage(response); },
                   grpc::SslServerCredentials(options));
  EXPECT_EQ(driver.Grabbed(TlsFilesOf("operator", folder)).status(), absl::OkStatus());
  EXPECT_TRUE(absl::IsUnavailable(driver.Grabbed().status()));
}

TEST(CameraDriver, WhatIsNoImageIsTold) {
  const std::vector<OddDriver::Answer> answers = {
      [](v1::GrabResponse&) {},
      [](v1::GrabResponse& response) { response.add_images(); },
      [](v1::GrabResponse& response) { response.add_images()->set_encoded("dear reader"); },
      [](v1::GrabResponse& response) { AddImage(response).mutable_raw()->set_width(5); },
      [](v1::GrabResponse& response) { AddImage(response).mutable_raw()->set_channels(-1); },
  };
  for (const OddDriver::Answer& answer : answers) {
    OddDriver driver(answer);
    EXPECT_TRUE(absl::IsDataLoss(driver.Grabbed().status()));
  }
}

TEST(CameraDriver, ImageThatFailsLeavesTheOthers) {
  const std::vector<OddDriver::Answer> answers = {
      [](v1::GrabResponse& response) {
        response.add_images()->set_encoded("dear reader");
        AddImage(response);
      },
      [](v1::GrabResponse& response) {
        SetTime(AddImage(response), absl::Now() + absl::Hours(1));
        AddImage(response);
      },
  };
  for (const OddDriver::Answer& answer : answers) {
    OddDriver driver(answer);
    const auto images = driver.GrabbedTwice();
    ASSERT_TRUE(images.ok()) << images.status();
    ASSERT_EQ(images->size(), 2u);
    EXPECT_THAT((*images)[0].status().message(), HasSubstr("camera 'top': "));
    ASSERT_TRUE((*images)[1].ok()) << (*images)[1].status();
    EXPECT_EQ((*images)[1]->pixels[7], '8');
  }
}

TEST(CameraDriver, ExampleInPythonIsOneBesideTheClientPackage) {
  const std::string folder = FreshFolder().string();
  WriteFile(folder + "/silhouette/__init__.py", "");
  const std::string source = SourceFolder();
  cv::imwrite(folder + "/top.png", cv::Mat(2, 4, CV_8UC1, cv::Scalar(7)));
  const std::string generate = absl::StrCat(
      "protoc -I ", source, "/proto/silhouette/v1 --python_out=", folder, " --grpc_out=", folder,
      " --plugin=protoc-gen-grpc=$(which grpc_python_plugin) camera_driver.proto");
  ASSERT_EQ(std::system(generate.c_str()), 0) << generate;
  for (const std::string& mistake : std::vector<std::string>{
           "top --size 4x2", "top=none.png --size 4x2", "top=" + folder + "/top.png --size 4"}) {
    const std::string errors = folder + "/errors.txt";
    const std::string wrong =
        absl::StrCat("PYTHONPATH=", folder, " /usr/bin/python3 ", source,
                     "/clients/drivers/python/file_cameras.py ", mistake, " 2> ", errors);
    EXPECT_EQ(WEXITSTATUS(std::system(wrong.c_str())), 2) << mistake;
    std::ifstream file(errors);
    const std::string said{std::istreambuf_iterator<char>(file), {}};
    EXPECT_THAT(said, HasSubstr("file_cameras.py: error: "));
    EXPECT_THAT(said, ::testing::Not(HasSubstr("Traceback")));
  }
  // The shell tells its process, which becomes Python's.
  const std::string serve = absl::StrCat("echo $$; PYTHONPATH=", folder, " exec /usr/bin/python3 ",
                                         source, "/clients/drivers/python/file_cameras.py ",
                                         "--size 4x2 --port 0 top=", folder, "/top.png");
  FILE* output = popen(serve.c_str(), "r");
  ASSERT_NE(output, nullptr);
  int process = 0;
  char address[64] = "";
  const int read = fscanf(output, "%d serving top at %63s", &process, address);
  EXPECT_EQ(read, 2);
  if (read == 2) {
    const auto opened = OpenGrpcCameras(address, {{"above", "top", 4, 2}}, absl::Seconds(20));
    EXPECT_TRUE(opened.ok()) << opened.status();
    const auto images = opened.ok() ? GrpcCameraTake(**opened) : opened.status();
    EXPECT_TRUE(images.ok()) << images.status();
    if (images.ok()) {
      EXPECT_EQ(images->front().pixels, std::vector<uint8_t>(8, 7));
    }
  }
  if (process > 0) kill(process, SIGTERM);
  pclose(output);
}

}  // namespace
}  // namespace silhouette
