// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/cell/missing_picture.h"

#include <algorithm>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/picture/sheet.h"
#include "common/picture/text.h"
#include "server/collision/collision_checker.h"
#include "server/collision/possible_space.h"

namespace silhouette::cell_experiment {
namespace {

constexpr int kPicturesPerCause = 2;

// The scenes, those with the most missing configurations first.
std::vector<size_t> WorstFirst(const std::vector<SceneRecord>& records) {
  std::vector<size_t> order(records.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return records[a].missing.size() > records[b].missing.size();
  });
  return order;
}

// The first missing configuration of a scene with a cause.
std::optional<size_t> FirstWith(const SceneRecord& record, Cause cause) {
  for (size_t i = 0; i < record.missing.size(); ++i) {
    for (const Explanation& explanation : record.missing[i].explanations) {
      if (explanation.cause == cause) return i;
    }
  }
  return std::nullopt;
}

constexpr int kWidth = 320;    // of a view
constexpr int kFactor = 4;     // of enlargement of a mask
constexpr double kVeil = 0.8;  // opacity of what is laid over a mask
constexpr int kTextHeight = 16;
constexpr int kMargin = 16;
constexpr Colour kTestRobot = palette::kGoal;
constexpr Colour kContact = palette::kStart;

// `picture` in the size of a view, its pixels as squares.
Picture Stretched(const Picture& picture, cv::Size size) {
  Picture result;
  cv::resize(picture, result, size, 0, 0, cv::INTER_NEAREST);
  return result;
}

// The boundary of the mask's pixels as a line.
void Outline(Picture& picture, const Mask& mask, Colour colour) {
  const double across = double(picture.cols) / mask.width();
  const double down = double(picture.rows) / mask.height();
  const auto set = [&](int x, int y) {
    return x >= 0 && y >= 0 && x < mask.width() && y < mask.height() && mask.at(x, y);
  };
  const auto corner = [&](int x, int y) {
    return cv::Point(static_cast<int>(x * across), static_cast<int>(y * down));
  };
  for (int y = 0; y <= mask.height(); ++y) {
    for (int x = 0; x <= mask.width(); ++x) {
      if (set(x, y) != set(x - 1, y)) {
        cv::line(picture, corner(x, y), corner(x, y + 1), BgrOf(colour), 2);
      }
      if (set(x, y) != set(x, y - 1)) {
        cv::line(picture, corner(x, y), corner(x + 1, y), BgrOf(colour), 2);
      }
    }
  }
}

// `text` in lines of at most `width` pixels.
std::vector<std::string> Lines(const std::string& text, int width) {
  std::vector<std::string> lines(1);
  size_t at = 0;
  while (at < text.size()) {
    const size_t end = std::min(text.find(' ', at), text.size());
    const std::string word = text.substr(at, end - at);
    std::string& line = lines.back();
    const std::string longer = line.empty() ? word : absl::StrCat(line, " ", word);
    if (line.empty() || TextWidth(longer, kTextHeight) <= width) {
      line = longer;
    } else {
      lines.push_back(word);
    }
    at = end + 1;
  }
  return lines;
}

// What is said above the views: the sentences, each with the presets that it explains.
std::string TextOf(const TrialSetting& setting, const ExplainedConfiguration& missing) {
  std::vector<std::pair<std::string, std::vector<std::string>>> sentences;
  for (size_t i = 0; i < missing.explanations.size(); ++i) {
    const Policy& policy = setting.policies[missing.missed.policies[i]];
    const std::string name = absl::StrCat(NameOf(policy.preset), " (",
                                          MinViews(policy, setting.database.views()), " views)");
    const std::string& sentence = missing.explanations[i].sentence;
    const auto known = std::find_if(sentences.begin(), sentences.end(),
                                    [&](const auto& each) { return each.first == sentence; });
    if (known == sentences.end()) {
      sentences.push_back({sentence, {name}});
    } else {
      known->second.push_back(name);
    }
  }
  std::string text;
  for (const auto& [sentence, names] : sentences) {
    absl::StrAppend(&text, text.empty() ? "" : " ", "Free for ", absl::StrJoin(names, ", "), ". ",
                    sentence);
  }
  return text;
}

// The pixels of a view's mask that show the obstacles, if nothing were before them.
Mask PixelsOf(const CameraModel& camera, const std::vector<Obstacle>& obstacles) {
  const CameraIntrinsics& image = camera.intrinsics();
  std::vector<uint64_t> words(MaskSize{image.width, image.height}.words(), 0);
  for (const Obstacle& obstacle : obstacles) {
    for (const double share : {0.25, 0.5, 0.75, 1.0}) {
      for (const Eigen::Vector3d& vertex : obstacle.mesh.vertices) {
        const auto pixel = camera.Project(obstacle.world_from_obstacle * (share * vertex));
        if (!pixel || !camera.Contains(*pixel)) continue;
        const auto bit =
            static_cast<size_t>(std::lround(pixel->y()) * image.width + std::lround(pixel->x()));
        words[bit / 64] |= uint64_t{1} << (bit % 64);
      }
    }
  }
  return Mask::FromWords({image.width, image.height}, std::move(words));
}

}  // namespace

std::vector<Chosen> ChooseForPictures(const std::vector<SceneRecord>& records, size_t count) {
  const std::vector<size_t> order = WorstFirst(records);
  std::set<std::pair<size_t, size_t>> taken;
  std::vector<Chosen> chosen;
  const auto take = [&](size_t record, size_t missing) {
    if (chosen.size() == count || !taken.insert({record, missing}).second) return false;
    chosen.push_back({record, missing});
    return true;
  };
  for (size_t cause = 0; cause < kCauses; ++cause) {
    int pictures = 0;
    for (const size_t record : order) {
      if (pictures == kPicturesPerCause) break;
      const auto missing = FirstWith(records[record], static_cast<Cause>(cause));
      if (missing && take(record, *missing)) ++pictures;
    }
  }
  for (size_t round = 0; chosen.size() < count; ++round) {
    bool any = false;
    for (const size_t record : order) {
      if (round >= records[record].missing.size()) continue;
      any = true;
      take(record, round);
    }
    if (!any) break;
  }
  return chosen;
}

Picture DrawPossible(const TrialSetting& setting, const ViewedScene& viewed) {
  const ServedDatabase& database = setting.database;
  const std::vector<CameraModel> cameras = setting.workplace.TrueCalibration().cameras;
  const PossibleSpace& possible = viewed.scene.possible_space.Get(
      database.sound(), viewed.scene.obstacle_images, viewed.scene.joints, {},
      MaxOccludedViews({}, database.views()));
  std::vector<CaptionedPicture> above;
  std::vector<CaptionedPicture> below;
  for (int view = 0; view < database.views(); ++view) {
    const auto i = static_cast<size_t>(view);
    const ObstacleImage& image = *viewed.scene.obstacle_images[i];
    const Picture planes = PictureOfPlanes(image.obstacle(), image.unknown(), image.error());
    Mask may_hold(image.size());
    for (const PossibleSpace::Part& part : possible.parts()) {
      may_hold = may_hold | *part.planes[i];
    }
    const auto with = [&](const Mask& mask, Colour colour) {
      return Enlarged(WithVeil(planes, mask, colour, kVeil), kFactor);
    };
    const CameraModel camera = cameras[i].ScaledTo(image.size().width, image.size().height);
    above.push_back({with(PixelsOf(camera, viewed.truth.obstacles), palette::kObstacle),
                     database.view_name(view)});
    below.push_back({with(may_hold, palette::kGoal), database.view_name(view)});
  }
  above.insert(above.end(), below.begin(), below.end());
  return ContactSheet(above, {.title = "A hidden ball; where the sound presets say one may be",
                              .columns = database.views(),
                              .legend = {{palette::kUnknown, "unknown: the robot"},
                                         {palette::kObstacle, "the ball, in truth"},
                                         {palette::kGoal, "an obstacle may be here"}}});
}

Picture Draw(const TrialSetting& setting, const ViewedScene& viewed,
             const ExplainedConfiguration& missing) {
  const CollisionChecker test(setting.database.robot_images(), viewed.scene.obstacle_images, {});
  const std::vector<CameraModel> cameras = setting.workplace.TrueCalibration().cameras;
  const std::vector<Mask> robot_images = *test.TestRobotImages(missing.missed.configuration);
  std::vector<CaptionedPicture> rows[3];
  for (size_t view = 0; view < viewed.images.size(); ++view) {
    const CameraImage& image = viewed.images[view];
    const cv::Size size(kWidth, kWidth * image.height / image.width);
    const Mask& robot = robot_images[view];
    const ObstacleImage& planes = *viewed.scene.obstacle_images[view];
    const Picture pictures[3] = {
        PictureOfPixels(image.width, image.height, image.channels, image.pixels),
        PictureOf(viewed.scene.views[view]->foreground),
        PictureOfPlanes(planes.obstacle(), planes.unknown(), planes.error())};
    const char* names[3] = {"camera image", "scene image", "obstacle image"};
    for (size_t i = 0; i < 3; ++i) {
      Picture picture = Stretched(pictures[i], size);
      Outline(picture, robot, kTestRobot);
      for (const Explanation& explanation : missing.explanations) {
        const auto pixel =
            cameras[view].ScaledTo(size.width, size.height).Project(explanation.place);
        if (!pixel) continue;
        const cv::Point at(cvRound(pixel->x()), cvRound(pixel->y()));
        cv::circle(picture, at, 7, BgrOf(palette::kPaper), 4, cv::LINE_AA);
        cv::circle(picture, at, 7, BgrOf(kContact), 2, cv::LINE_AA);
      }
      rows[i].push_back(
          {picture, absl::StrCat(setting.workplace.cell().views[view].name, ": ", names[i])});
    }
  }
  std::vector<CaptionedPicture> all;
  for (const auto& row : rows) all.insert(all.end(), row.begin(), row.end());
  const Picture sheet = ContactSheet(all, {.title = "",
                                           .columns = static_cast<int>(viewed.images.size()),
                                           .legend = {{palette::kObstacle, "obstacle"},
                                                      {palette::kUnknown, "unknown"},
                                                      {palette::kError, "error"},
                                                      {palette::kBackground, "background"},
                                                      {palette::kInk, "foreground"},
                                                      {kTestRobot, "test robot image"},
                                                      {kContact, "place of contact"}}});
  const std::vector<std::string> lines = Lines(TextOf(setting, missing), sheet.cols - 2 * kMargin);
  const int head = static_cast<int>(lines.size()) * (kTextHeight + 6) + kMargin;
  Picture whole = BlankPicture(sheet.cols, sheet.rows + head);
  sheet.copyTo(whole(cv::Rect(0, head, sheet.cols, sheet.rows)));
  for (size_t i = 0; i < lines.size(); ++i) {
    DrawText(whole, lines[i],
             {kMargin, kMargin + static_cast<int>(i) * (kTextHeight + 6) + kTextHeight / 2},
             {.height = kTextHeight});
  }
  return whole;
}

}  // namespace silhouette::cell_experiment
