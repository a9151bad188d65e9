// SPDX-License-Identifier: Apache-2.0
#include "silhouette/local_space.h"

#include <pybind11/stl.h>

#include <algorithm>
#include <array>

#include "clients/python/bindings.h"

namespace silhouette::python {
namespace {

using client::Client;
using client::LocalSpace;
using client::SpaceSnapshot;
using Shared = std::shared_ptr<const SpaceSnapshot>;

// The joint values of one configuration, without an allocation: a C-contiguous float64 array of one
// dimension in place, the items of any other sequence copied.
class JointValues {
 public:
  explicit JointValues(const py::handle& q) {
    if (py::isinstance<py::array_t<double, py::array::c_style>>(q)) {
      const auto array = py::reinterpret_borrow<py::array_t<double>>(q);
      if (array.ndim() == 1) {
        values_ = {array.data(), static_cast<size_t>(array.shape(0))};
        return;
      }
    }
    const auto items = py::reinterpret_steal<py::object>(
        PySequence_Fast(q.ptr(),
                        "q takes one configuration: a float64 array of the shape (d,), "
                        "or a sequence of d numbers"));
    if (!items) throw py::error_already_set();
    const auto size = static_cast<size_t>(PySequence_Fast_GET_SIZE(items.ptr()));
    if (size > copied_.size()) {
      throw std::invalid_argument("q has " + std::to_string(size) + " joint values; a robot has " +
                                  std::to_string(kMaxJoints) + " at most");
    }
    for (size_t i = 0; i < size; ++i) {
      copied_[i] = PyFloat_AsDouble(PySequence_Fast_GET_ITEM(items.ptr(), i));
      if (copied_[i] == -1 && PyErr_Occurred() != nullptr) throw py::error_already_set();
    }
    values_ = {copied_.data(), size};
  }
  JointValues(const JointValues&) = delete;
  JointValues& operator=(const JointValues&) = delete;

  std::span<const double> get() const { return values_; }

 private:
  std::array<double, kMaxJoints> copied_;
  std::span<const double> values_;
};

// `joints`: the number of values. Unknown outside the grid is true of others, too, but not what the
// caller must mend.
void RequireJoints(const SpaceSnapshot& snapshot, size_t joints, const std::string& name) {
  const ConfigurationGrid* grid = snapshot.grid();
  if (grid == nullptr || joints == static_cast<size_t>(grid->dimensions())) return;
  throw std::invalid_argument(name + " has " + std::to_string(joints) +
                              " joint values; the grid has " + std::to_string(grid->dimensions()) +
                              " joints");
}

client::Verdict CheckOne(const SpaceSnapshot& snapshot, const py::object& q) {
  const JointValues values(q);
  RequireJoints(snapshot, values.get().size(), "q");
  return snapshot.Check(values.get());
}

Checks CheckMany(const SpaceSnapshot& snapshot, const Doubles& configurations) {
  RequireRows(configurations, "configurations");
  const auto joints = static_cast<size_t>(configurations.shape(1));
  RequireJoints(snapshot, joints, "a row of configurations");
  Checks checks(snapshot.basis(), configurations.shape(0));
  uint8_t* states = checks.states.mutable_data();
  uint8_t* reasons = checks.reasons.mutable_data();
  const double* q = configurations.data();
  WithoutLock([&, size = configurations.shape(0)] {
    for (py::ssize_t i = 0; i < size; ++i, q += joints) {
      const client::Verdict verdict = snapshot.Check({q, joints});
      states[i] = static_cast<uint8_t>(verdict.state);
      reasons[i] = static_cast<uint8_t>(verdict.reason);
    }
  });
  return checks;
}

Checks CheckNumbers(const SpaceSnapshot& snapshot, const Numbers& numbers) {
  const std::span<const uint32_t> asked(numbers.data(), static_cast<size_t>(numbers.size()));
  return ChecksOf(WithoutLock([&] { return snapshot.CheckNumbers(asked); }));
}

struct Motion {
  client::MotionVerdict verdict;
  size_t joints = 0;
};

Motion CheckMotion(const SpaceSnapshot& snapshot, const py::handle& from, const py::handle& to,
                   double path_resolution) {
  const JointValues begin(from);
  const JointValues end(to);
  RequireJoints(snapshot, begin.get().size(), "start");
  RequireJoints(snapshot, end.get().size(), "goal");
  return {
      WithoutLock([&] { return snapshot.CheckMotion(begin.get(), end.get(), path_resolution); }),
      begin.get().size()};
}

void BindMotion(py::module_& module) {
  py::class_<Motion>(module, "MotionVerdict",
                     "The verdict on a straight motion. True only if all of it is free.")
      .def_property_readonly("state", [](const Motion& at) { return ToPython(at.verdict.state); })
      .def_property_readonly("reason", [](const Motion& at) { return ToPython(at.verdict.reason); })
      .def_property_readonly("free", [](const Motion& at) { return at.verdict.free(); })
      .def("__bool__", [](const Motion& at) { return at.verdict.free(); })
      .def_property_readonly(
          "fraction", [](const Motion& at) { return at.verdict.fraction; },
          "Of the way to the first place that is not free, 0 to 1. Only if not free.")
      .def_property_readonly(
          "configuration",
          [](const Motion& at) {
            const double* place = at.verdict.place.data();
            return ArrayOf(Configuration(place, place + std::min<size_t>(at.joints, kMaxJoints)));
          },
          "(d,) float64: that place, radians or metres.")
      .def_property_readonly(
          "last_free", [](const Motion& at) { return at.verdict.last_free; },
          "All of the motion up to this fraction is free; 0 also if the start is not.")
      .def_property_readonly("checked", [](const Motion& at) { return at.verdict.checked; })
      .def_property_readonly("proof", [](const Motion& at) { return ToPython(at.verdict.proof); })
      .def_property_readonly("sampled_step",
                             [](const Motion& at) { return at.verdict.sampled_step; })
      .def("__repr__", [](const Motion& at) {
        const std::string text = TextOf({.state = at.verdict.state, .reason = at.verdict.reason});
        return "<MotionVerdict " + text +
               (at.verdict.free() ? "" : ", at fraction " + std::to_string(at.verdict.fraction)) +
               ">";
      });
}

py::object UnknownReason(const SpaceSnapshot& snapshot) {
  const auto reason = snapshot.unknown_reason();
  return reason ? ToPython(*reason) : py::none();
}

// What LocalSpace and SpaceSnapshot both have; `snapshot(at)`: the snapshot that answers.
template <typename T, typename Class, typename F>
void BindChecks(Class& type, F snapshot) {
  type.def(
          "check_many",
          [snapshot](const T& at, const Doubles& configurations) {
            return CheckMany(*snapshot(at), configurations);
          },
          py::arg("configurations"),
          "Many verdicts, all from one scene, without the interpreter's lock.\n\n"
          "configurations: (n, d) float64, radians or metres.")
      .def(
          "check_numbers",
          [snapshot](const T& at, const py::object& numbers) {
            return CheckNumbers(*snapshot(at), NumbersIn(numbers));
          },
          py::arg("numbers"),
          "The same for grid points. numbers: (n,) whole numbers, as Grid.numbers of this grid has "
          "them; "
          "another database may have another grid.")
      .def(
          "check_motion",
          [snapshot](const T& at, const py::object& from, const py::object& to, double step) {
            return CheckMotion(*snapshot(at), from, to, step);
          },
          py::arg("start"), py::arg("goal"), py::arg("path_resolution") = 0.005,
          "The straight motion between two configurations.\n\n"
          "start, goal: (d,) float64, radians or metres.\n"
          "path_resolution: metres that a point of the robot may move between samples, 0.0005 to "
          "0.1.\nUnknown (BETWEEN_GRID_POINTS) where only the server can tell: use "
          "Client.check_path.")
      .def_property_readonly("basis", [snapshot](const T& at) { return snapshot(at)->basis(); })
      .def_property_readonly(
          "unknown_reason", [snapshot](const T& at) { return UnknownReason(*snapshot(at)); },
          "Why everything is unknown at this moment; None if verdicts are valid.");
}

void BindSnapshot(py::module_& module) {
  py::class_<SpaceSnapshot, std::shared_ptr<SpaceSnapshot>> type(
      module, "SpaceSnapshot",
      "The verdicts of one scene. They do not change, and are all unknown once they expire.");
  type.def(
      "check",
      [](const SpaceSnapshot& at, const py::object& q) { return ToPython(CheckOne(at, q)); },
      py::arg("q"), "The verdict for one configuration: (d,) float64, radians or metres.");
  BindChecks<SpaceSnapshot>(type, [](const SpaceSnapshot& at) { return &at; });
  type.def_property_readonly("grid", &SpaceSnapshot::grid,
                             py::return_value_policy::reference_internal,
                             "None before the first update.")
      .def_property_readonly(
          "states",
          [](const SpaceSnapshot& at) -> py::object {
            if (at.grid() == nullptr) return py::none();
            const py::array_t<uint32_t> numbers = NumbersOf(*at.grid());
            const Checks checks = CheckNumbers(at, numbers);
            return checks.states.attr("reshape")(numbers.attr("shape"));
          },
          "A new uint8 array in the shape of the grid, values of State; None before the first "
          "update.")
      .def_property_readonly("number", &SpaceSnapshot::number,
                             "Counts up with every update and every loss of the connection.")
      .def_property_readonly("skipped_scenes", &SpaceSnapshot::skipped_scenes);
}

std::shared_ptr<SpaceSnapshot> Unconst(Shared snapshot) {
  return std::const_pointer_cast<SpaceSnapshot>(std::move(snapshot));  // immutable all the same
}

// A LocalSpace that a context manager can end; it lives on while a thread still waits for it.
class PythonSpace {
 public:
  PythonSpace(const Client& client, client::LocalSpaceOptions options)
      : space_(std::make_shared<const LocalSpace>(client, std::move(options))) {}

  // To be called with the interpreter's lock.
  std::shared_ptr<const LocalSpace> get() const {
    if (space_ == nullptr) throw std::invalid_argument("this LocalSpace was closed");
    return space_;
  }
  void Close() { space_.reset(); }

 private:
  std::shared_ptr<const LocalSpace> space_;
};

py::dict StatusOf(const PythonSpace& at) {
  const client::LocalSpaceStatus status = at.get()->status();
  py::dict fields;
  fields["connected"] = status.connected;
  fields["problem"] = std::string(status.problem.message());
  fields["attempts"] = status.attempts;
  fields["updates"] = status.updates;
  fields["skipped_scenes"] = status.skipped_scenes;
  return fields;
}

std::shared_ptr<SpaceSnapshot> WaitForUpdate(const PythonSpace& at, uint64_t after,
                                             double timeout) {
  Shared newest;
  WaitInSlices(timeout, [&](absl::Duration slice) {
    const auto space = at.get();
    newest = WithoutLock([&] { return space->WaitForUpdate(after, slice); });
    return newest->number() > after;
  });
  return Unconst(std::move(newest));
}

}  // namespace

void BindLocalSpace(py::module_& module) {
  BindMotion(module);
  BindSnapshot(module);
  py::class_<PythonSpace> type(
      module, "LocalSpace",
      "The configuration space, kept up to date in this process: checks make no call.\n\n"
      "Everything is unknown before the first update, while the connection is lost, and once the "
      "scene expires.");
  type.def(py::init([](const Client& client, const client::Policy& policy, double max_age,
                       std::vector<uint64_t> tiles, bool obstacles) {
             return std::make_unique<PythonSpace>(
                 client, client::LocalSpaceOptions{.policy = policy,
                                                   .tiles = std::move(tiles),
                                                   .max_age = SecondsOf(max_age, "max_age"),
                                                   .obstacles = obstacles});
           }),
           py::arg("client"), py::kw_only(), py::arg("policy") = client::Policy(),
           py::arg("max_age") = 1.0, py::arg("tiles") = std::vector<uint64_t>(),
           py::arg("obstacles") = true,
           "Subscribes and returns at once.\n\n"
           "max_age: greatest age of a usable scene, seconds; inf: the server's own max_age, which "
           "always applies, alone.\n"
           "tiles: only these tiles of the grid; empty: all.\n"
           "obstacles: of a robot whose images are drawn, hold the scene's obstacles.")
      .def("__enter__", [](py::object self) { return self; })
      .def("__exit__", [](PythonSpace& at, const py::args&) { at.Close(); })
      .def("close", &PythonSpace::Close, "Ends the subscription; waits for no server.")
      .def(
          "check",
          [](const PythonSpace& at, const py::object& q) {
            return ToPython(CheckOne(*at.get()->Snapshot(), q));
          },
          py::arg("q"), "The verdict for one configuration: (d,) float64, radians or metres.");
  BindChecks<PythonSpace>(type, [](const PythonSpace& at) { return at.get()->Snapshot(); });
  type.def(
          "snapshot", [](const PythonSpace& at) { return Unconst(at.get()->Snapshot()); },
          "The newest snapshot: for many checks from one scene.")
      .def("wait_for_update", WaitForUpdate, py::arg("after"), py::arg("timeout"),
           "Waits for a snapshot whose number is above `after`, and returns the newest in any "
           "case.\n\nafter: SpaceSnapshot.number, 0 for the first.\ntimeout: seconds at most.")
      .def_property_readonly("status", StatusOf,
                             "State of the subscription: connected, problem, attempts, updates, "
                             "skipped_scenes.");
}

}  // namespace silhouette::python
