// SPDX-License-Identifier: Apache-2.0
#include "silhouette/client.h"

#include <pybind11/stl.h>

#include <chrono>
#include <map>

#include "absl/strings/str_cat.h"
#include "clients/python/bindings.h"
#include "silhouette/messages.h"

namespace silhouette::python {
namespace {

using client::Client;
using client::PathUpdate;
using client::PathWatch;
using client::Policy;
using Clock = client::RunningClock;
using Joints = std::map<std::string, double>;

// `seconds`: of Python's time.monotonic(), which stands still while the computer sleeps. Throws
// std::invalid_argument for an instant that lies in the future, or that no such clock has shown.
Clock::time_point MonotonicTime(double seconds) {
  const Clock::time_point now = Clock::now();  // first: a pause makes the image older, no younger
  const absl::Duration monotonic =
      absl::FromChrono(std::chrono::steady_clock::now().time_since_epoch());
  const absl::Duration age = monotonic - SecondsOf(seconds, "taken");
  if (age < absl::ZeroDuration() || age > absl::Hours(24 * 3650)) {
    throw std::invalid_argument(absl::StrCat(
        "taken is ", seconds, ", and time.monotonic() is ", absl::ToDoubleSeconds(monotonic),
        ": state one of it not later than the capture, not one of time.time()"));
  }
  return now - absl::ToChronoNanoseconds(age);
}

// The time for a call, which nothing else ends. Throws std::invalid_argument for one without end.
absl::Duration TimeoutOf(double seconds) {
  const absl::Duration timeout = SecondsOf(seconds, "timeout");
  if (timeout <= absl::ZeroDuration() || timeout == absl::InfiniteDuration()) {
    throw std::invalid_argument(
        absl::StrCat("timeout is ", seconds, "; it takes a finite number of seconds above 0"));
  }
  return timeout;
}

// The key of a dict. Throws std::invalid_argument if it is no name.
std::string ViewNameOf(const py::handle& key) {
  try {
    return py::cast<std::string>(key);
  } catch (const py::cast_error&) {
    throw std::invalid_argument("a view is named by a str, not by " +
                                py::cast<std::string>(py::repr(key)));
  }
}

client::Clearance Measured(bool clearance) {
  return clearance ? client::Clearance::kMeasure : client::Clearance::kOmit;
}

v1::Mask MaskMessage(const py::handle& pixels, const std::string& view) {
  if (!py::isinstance<py::array_t<bool>>(pixels)) {
    throw std::invalid_argument("the mask of view '" + view +
                                "' takes an array of bool of the shape (height, width)");
  }
  const auto mask = py::array_t<bool, py::array::c_style>::ensure(pixels);
  if (mask.ndim() != 2) {
    throw std::invalid_argument("the mask of view '" + view + "' has " +
                                std::to_string(mask.ndim()) +
                                " dimensions; it takes the shape (height, width)");
  }
  const MaskSize size{static_cast<int>(mask.shape(1)), static_cast<int>(mask.shape(0))};
  return client::ToMessage(
      Mask::FromPredicate(size, [&mask](int x, int y) { return *mask.data(y, x); }));
}

std::vector<std::pair<double, double>> CornersOf(const py::handle& polygon,
                                                 const std::string& view) {
  try {
    return py::cast<std::vector<std::pair<double, double>>>(polygon);
  } catch (const py::cast_error&) {
    throw std::invalid_argument("the region of view '" + view +
                                "' takes an array of bool of the shape (height, width), or the "
                                "corners (x, y) of a polygon");
  }
}

// An image of a view: masks by a dict of bool arrays, camera images as the bytes of a PNG or JPEG.
py::object PublishScene(const Client& client, const Joints& joints, const py::dict& views,
                        const py::dict& obstacles, const std::string& variant, double taken) {
  const Clock::time_point time = MonotonicTime(taken);
  v1::PublishSceneRequest request;
  request.set_variant(variant);
  for (const auto& [name, position] : joints) {
    v1::JointPosition& joint = *request.add_joints();
    joint.set_name(name);
    joint.set_position(position);
  }
  for (const auto& [name, image] : views) {
    v1::ViewImage& view = *request.add_views();
    view.set_view(ViewNameOf(name));
    if (py::isinstance<py::bytes>(image)) {
      view.set_camera_image(py::cast<std::string>(image));
    } else {
      *view.mutable_scene_mask() = MaskMessage(image, view.view());
    }
  }
  for (const auto& [name, mask] : obstacles) {
    v1::ViewImage& view = *request.add_views();
    view.set_view(ViewNameOf(name));
    *view.mutable_obstacle_mask() = MaskMessage(mask, view.view());
  }
  return ToPython(Ask([&] { return client.PublishScene(std::move(request), time); }));
}

py::object AllowRegion(const Client& client, const std::string& name, const py::dict& views,
                       double duration) {
  v1::AllowRegionRequest request;
  request.set_name(name);
  *request.mutable_duration() = client::ToMessage(SecondsOf(duration, "duration"));
  for (const auto& [view, pixels] : views) {
    v1::RegionPixels& region = *request.add_views();
    region.set_view(ViewNameOf(view));
    if (py::isinstance<py::array_t<bool>>(pixels)) {
      *region.mutable_mask() = MaskMessage(pixels, region.view());
      continue;
    }
    for (const auto& [x, y] : CornersOf(pixels, region.view())) {
      v1::Point& corner = *region.mutable_polygon()->add_corners();
      corner.set_x(x);
      corner.set_y(y);
    }
  }
  return ToPython(Ask([&] { return client.AllowRegion(request); }));
}

py::dict Database(const Client& client) {
  const v1::GetDatabaseResponse answer = Ask([&] { return client.GetDatabase(); });
  py::dict database = ToPython(static_cast<const google::protobuf::Message&>(answer));
  auto grid = client::FromMessage(answer.grid());
  if (!grid.ok()) throw StatusError(grid.status());
  database["grid"] = *std::move(grid);
  return database;
}

PathUpdate NextUpdate(PathWatch& watch, std::optional<double> timeout) {
  std::optional<PathUpdate> update;
  const bool came = WaitInSlices(timeout, [&](absl::Duration slice) {
    auto next = WithoutLock([&] { return watch.Next(slice); });
    if (absl::IsDeadlineExceeded(next.status())) return false;
    if (!next.ok()) throw StatusError(next.status());
    update = *std::move(next);
    return true;
  });
  if (!came) throw StatusError(absl::DeadlineExceededError("no update came within the timeout"));
  return *std::move(update);
}

void BindPictures(py::module_& module) {
  using client::Explanation;
  using client::ViewPictures;
  py::class_<ViewPictures> pictures(module, "ViewPictures",
                                    "Pictures of one view: (height, width, 3) uint8 RGB arrays.");
  pictures.def_readonly("view", &ViewPictures::view);
  const auto picture = [&pictures](const char* name, std::string ViewPictures::*png,
                                   const char* text) {
    pictures.def_property_readonly(
        name,
        [png](const ViewPictures& at) {
          return py::module_::import("silhouette._pictures").attr("decode")(py::bytes(at.*png));
        },
        text);
  };
  picture("scene", &ViewPictures::scene_png, "What differs from the empty cell.");
  picture("obstacle", &ViewPictures::obstacle_png, "The obstacles in it.");
  picture("intersection", &ViewPictures::intersection_png,
          "The obstacle image inside the robot image, with its unknown pixels.");
  picture("collision", &ViewPictures::collision_png, "The obstacle pixels inside the robot image.");
  py::class_<Explanation>(module, "Explanation", "One verdict with its pictures.")
      .def_readonly("basis", &Explanation::basis)
      .def_property_readonly(
          "verdict", [](const Explanation& at) { return ToPython(at.verdict); },
          "With the pixel counts of each view in verdict.views.")
      .def_readonly("views", &Explanation::views,
                    "In the order of the database's views; empty without a scene.");
}

void BindWatch(py::module_& module) {
  py::class_<PathUpdate>(module, "PathUpdate",
                         "True only while the path is free and the update valid.")
      .def_readonly("check", &PathUpdate::check)
      .def_property_readonly("free_now", &PathUpdate::FreeNow,
                             "Whether the path is free and the update still valid.")
      .def("__bool__", &PathUpdate::FreeNow)
      .def_readonly("skipped_scenes", &PathUpdate::skipped_scenes)
      .def("__repr__", [](const PathUpdate& at) {
        const bool expired = at.check.verdict.free() && !at.FreeNow();
        return "<PathUpdate " + (expired ? "expired" : TextOf(at.check.verdict)) + ">";
      });
  py::class_<PathWatch>(module, "PathWatch",
                        "A path, watched: iterate over it for a new verdict with every scene, and "
                        "for the last one once more, false, if it expires. Only cancel() ends the "
                        "iteration; a lost watch raises, as next does. A context manager.")
      .def("__enter__", [](py::object self) { return self; })
      .def("__exit__", [](PathWatch& at, const py::args&) { at.Cancel(); })
      .def("__iter__", [](py::object self) { return self; })
      .def("__next__",
           [](PathWatch& at) {
             try {
               return NextUpdate(at, std::nullopt);
             } catch (const StatusError& error) {
               if (absl::IsCancelled(error.status)) throw py::stop_iteration();
               throw;
             }
           })
      .def("next", NextUpdate, py::arg("timeout") = py::none(),
           "The newest update that was not returned yet, or the last one once more, false, if it "
           "expires before that.\n\ntimeout: seconds; None: no limit. DeadlineExceeded: none "
           "came, the watch continues. Any other error ends it: the path is not free.")
      .def("cancel", &PathWatch::Cancel, "Ends the watch; any thread may call it.");
}

void BindPolicy(py::module_& module) {
  py::class_<Policy>(module, "Policy",
                     "How verdicts follow from images; what is not set is the server's default. A "
                     "str stands for the policy with this preset.")
      .def(py::init([](std::string preset, std::optional<int> min_views,
                       std::optional<int> max_occluded_views, std::optional<std::string> off_grid) {
             Policy policy{std::move(preset), min_views, max_occluded_views, std::nullopt};
             if (off_grid == "cell") policy.off_grid = client::OffGrid::kCell;
             if (off_grid == "nearest") policy.off_grid = client::OffGrid::kNearest;
             if (off_grid && !policy.off_grid) {
               throw std::invalid_argument("off_grid is '" + *off_grid +
                                           "'; known are cell and nearest");
             }
             return policy;
           }),
           py::arg("preset") = "", py::kw_only(), py::arg("min_views") = py::none(),
           py::arg("max_occluded_views") = py::none(), py::arg("off_grid") = py::none(),
           "preset: one of get_database()['presets'], such as \"uncalibrated\".\n"
           "min_views: occupied if at least this many views show an obstacle inside the robot.\n"
           "max_occluded_views: in how many views the robot may occlude an obstacle.\n"
           "off_grid: \"cell\" or \"nearest\": what stands for a configuration off the grid.")
      .def_readonly("preset", &Policy::preset)
      .def_readonly("min_views", &Policy::min_views)
      .def_readonly("max_occluded_views", &Policy::max_occluded_views);
  py::implicitly_convertible<py::str, Policy>();
}

void BindChecksOf(py::class_<Client>& type) {
  type.def(
          "check",
          [](const Client& at, const Doubles& configurations, const Policy& policy, bool evidence,
             bool clearance) {
            const auto rows = RowsOf(configurations, "configurations");
            auto checks = Ask([&] {
              return at.CheckConfigurations(
                  rows, policy, evidence ? client::Evidence::kPerView : client::Evidence::kOmit,
                  Measured(clearance));
            });
            Checks arrays = ChecksOf(std::move(checks), clearance);
            if (!evidence) arrays.verdicts.clear();
            return arrays;
          },
          py::arg("configurations"), py::kw_only(), py::arg("policy") = Policy(),
          py::arg("evidence") = false, py::arg("clearance") = false,
          "Verdicts for configurations, in the order asked.\n\n"
          "configurations: (n, d) float64, radians (prismatic joints: metres).\n"
          "evidence: fill Checks.verdicts.\nclearance: fill Checks.clearances; takes time.")
      .def(
          "check_numbers",
          [](const Client& at, const py::object& of, const Policy& policy) {
            const Numbers numbers = NumbersIn(of);
            const std::span asked(numbers.data(), static_cast<size_t>(numbers.size()));
            return ChecksOf(Ask([&] { return at.CheckNumbers(asked, policy); }));
          },
          py::arg("numbers"), py::kw_only(), py::arg("policy") = Policy(),
          "The same for grid points: faster.\n\nnumbers: (n,) whole numbers, as Grid.numbers has "
          "them; "
          "8 million at most.")
      .def(
          "check_path",
          [](const Client& at, const Doubles& waypoints, const Policy& policy, bool clearance,
             std::optional<double> resolution) {
            const auto rows = RowsOf(waypoints, "waypoints");
            return Ask([&] { return at.CheckPath(rows, policy, Measured(clearance), resolution); });
          },
          py::arg("waypoints"), py::kw_only(), py::arg("policy") = Policy(),
          py::arg("clearance") = false, py::arg("resolution") = py::none(),
          "The first place on a path that is not free.\n\n"
          "waypoints: (n, d) float64, n >= 1, radians or metres; linear between them, without "
          "wrapping.\nresolution: metres that a point of a drawn robot may move between samples, "
          "0.0005 to 0.1; None: 0.005.")
      .def(
          "watch_path",
          [](const Client& at, const Doubles& waypoints, const Policy& policy, bool clearance,
             std::optional<double> resolution) {
            const auto rows = RowsOf(waypoints, "waypoints");
            return Ask([&] { return at.WatchPath(rows, policy, Measured(clearance), resolution); });
          },
          py::arg("waypoints"), py::kw_only(), py::arg("policy") = Policy(),
          py::arg("clearance") = false, py::arg("resolution") = py::none(),
          "The same, answered again with every scene.\n\nwaypoints, resolution: as of check_path.")
      .def(
          "configuration_space",
          [](const Client& at, const Policy& policy, const std::vector<uint64_t>& tiles,
             std::optional<double> max_time, const std::vector<double>& levels) {
            std::optional<absl::Duration> limit;
            if (max_time) limit = SecondsOf(*max_time, "max_time");
            return Ask([&] { return at.GetConfigurationSpace(policy, tiles, limit, levels); });
          },
          py::kw_only(), py::arg("policy") = Policy(), py::arg("tiles") = std::vector<uint64_t>(),
          py::arg("max_time") = py::none(), py::arg("clearance_levels") = std::vector<double>(),
          "The verdicts of all configurations of the grid.\n\n"
          "tiles: only these; empty: all.\nmax_time: seconds that the server may work; tiles that "
          "are not finished are unknown.\nclearance_levels: mask pixels, ascending, 16 at most.")
      .def(
          "explain",
          [](const Client& at, const Doubles& q, const Policy& policy) {
            if (q.ndim() != 1) throw std::invalid_argument("q takes an array of the shape (d,)");
            const Configuration configuration(q.data(), q.data() + q.size());
            return Ask([&] { return at.Explain(configuration, policy); });
          },
          py::arg("q"), py::kw_only(), py::arg("policy") = Policy(),
          "One verdict with its pictures.\n\nq: (d,) float64, radians or metres.");
}

void BindReports(py::class_<Client>& type) {
  type.def(
          "publish_scene", PublishScene, py::kw_only(), py::arg("joints"),
          py::arg("views") = py::dict(), py::arg("obstacles") = py::dict(), py::arg("variant") = "",
          py::arg("taken"),
          "Publishes one simultaneous set of images; returns the scene, which may have defects.\n\n"
          "joints: name to radians or metres, at that time: all grid joints and fixed joints.\n"
          "views: view to the bytes of a PNG or JPEG camera image, or to a (height, width) bool "
          "mask of all that differs from the empty cell.\n"
          "obstacles: view to a (height, width) bool mask of the obstacles without the robot.\n"
          "variant: the one that the images show, whatever the client's is; empty: the default "
          "one, or InvalidArgument if the client has one.\n"
          "taken: a time.monotonic() not later than the capture, seconds, such as that before the "
          "cameras are triggered; required. The computer must not have slept since, as that clock "
          "stands still then.")
      .def(
          "get_scene",
          [](const Client& at, uint64_t id, bool with_planes) {
            return ToPython(Ask([&] { return at.GetScene(id, with_planes); }));
          },
          py::arg("id") = 0, py::kw_only(), py::arg("with_planes") = false,
          "A scene.\n\nid: 0 for the newest.\nwith_planes: also its masks.")
      .def("get_database", Database, "What the server serves.")
      .def(
          "get_acquisition",
          [](const Client& at) { return ToPython(Ask([&] { return at.GetAcquisition(); })); },
          "State of the server's own acquisition. FailedPrecondition: it does not acquire.")
      .def(
          "begin_variant_change",
          [](const Client& at) { return ToPython(Ask([&] { return at.BeginVariantChange(); })); },
          "Reports that tool or part is changing: until change_variant() nothing is free.")
      .def(
          "change_variant",
          [](const Client& at, const std::string& variant) {
            return ToPython(Ask([&] { return at.ChangeVariant(variant); }));
          },
          py::arg("variant"), "Reports which variant shows the robot from now on.")
      .def("allow_region", AllowRegion, py::arg("name"), py::kw_only(), py::arg("views"),
           py::arg("duration"),
           "Allows obstacles in image regions for a while, in place of the region of this name.\n\n"
           "views: view to a (height, width) bool mask, or to the corners (x, y) of a polygon, "
           "mask pixels.\nduration: seconds, 600 at most.")
      .def(
          "revoke_region",
          [](const Client& at, const std::string& name) {
            return Ask([&] { return at.RevokeRegion(name); });
          },
          py::arg("name"), "Ends a region; whether one of this name was in force.")
      .def(
          "list_regions",
          [](const Client& at) {
            return ToPython(Ask([&] { return at.ListAllowedRegions(); }))["regions"];
          },
          "The allowed regions in force, by name.");
}

}  // namespace

void BindClient(py::module_& module) {
  BindPolicy(module);
  BindPictures(module);
  BindWatch(module);
  py::class_<Client> type(module, "Client",
                          "The client of silhouette-server. Any number of threads may use one.");
  type.def(py::init([](const std::string& address, double timeout, const std::string& variant,
                       const std::string& tls_ca, const std::string& tls_certificate,
                       const std::string& tls_key) {
             auto client =
                 Client::Connect(address, TimeoutOf(timeout),
                                 {.ca = tls_ca, .certificate = tls_certificate, .key = tls_key});
             if (!client.ok()) throw StatusError(client.status());
             return client->WithVariant(variant);
           }),
           py::arg("address") = client::kDefaultAddress, py::kw_only(), py::arg("timeout") = 10.0,
           py::arg("variant") = "", py::arg("tls_ca") = "", py::arg("tls_certificate") = "",
           py::arg("tls_key") = "",
           "Connects with the first call, and again after a lost connection.\n\n"
           "address: \"host:port\" or \"unix:path\".\ntimeout: seconds, of each round trip: "
           "most calls take one, publish_scene up to six; Ctrl-C ends none earlier.\n"
           "variant: of the robot, which checks use; empty: the scene's.\n"
           "tls_ca, tls_certificate, tls_key: PEM files of an encrypted connection, all or none.")
      .def_property_readonly("address", &Client::address)
      .def(
          "with_timeout",
          [](const Client& at, double timeout) { return at.WithTimeout(TimeoutOf(timeout)); },
          py::arg("timeout"), "The same connection. timeout: seconds.")
      .def("with_variant", &Client::WithVariant, py::arg("variant"),
           "The same connection for another variant of the robot.");
  BindChecksOf(type);
  BindReports(type);
}

}  // namespace silhouette::python
