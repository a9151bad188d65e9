// SPDX-License-Identifier: Apache-2.0
#include "silhouette/answers.h"

#include <pybind11/stl.h>

#include <array>
#include <cmath>
#include <limits>

#include "clients/python/bindings.h"
#include "silhouette/path_watch.h"

namespace silhouette::python {
namespace {

using client::Basis;
using client::PathCheck;
using client::Reason;
using client::State;
using client::Verdict;

// The members of silhouette._enums by value; never freed, because the interpreter ends first.
struct Enums {
  std::array<PyObject*, 3> states;
  std::array<PyObject*, 256> reasons;
  std::array<PyObject*, 4> proofs;
  // Verdicts of nothing but a state and a reason, made when first used.
  std::array<std::array<PyObject*, 256>, 3> verdicts{};
};

Enums* MakeEnums() {
  const py::module_ module = py::module_::import("silhouette._enums");
  auto* enums = new Enums;
  const auto fill = [](auto& places, const py::object& type) {
    places.fill(type(0).inc_ref().ptr());
    for (const py::handle member : type) {
      const size_t value = member.cast<size_t>();
      if (value < places.size()) places[value] = member.inc_ref().ptr();
    }
  };
  fill(enums->states, module.attr("State"));
  fill(enums->reasons, module.attr("Reason"));
  fill(enums->proofs, module.attr("PathProof"));
  return enums;
}

Enums& TheEnums() {
  static Enums* const enums = MakeEnums();
  return *enums;
}

py::object Borrowed(PyObject* object) { return py::reinterpret_borrow<py::object>(object); }

std::optional<double> Seconds(absl::Duration duration) {
  if (duration == absl::InfiniteDuration()) return std::nullopt;
  return absl::ToDoubleSeconds(duration);
}

void BindBasis(py::module_& module) {
  py::class_<client::Defect>(module, "Defect", "Why no verdict from a scene is free.")
      .def_property_readonly("reason", [](const client::Defect& at) { return ToPython(at.reason); })
      .def_readonly("message", &client::Defect::message,
                    "One sentence that names the thing and the mend.")
      .def("__repr__", [](const client::Defect& at) { return "<Defect: " + at.message + ">"; });
  py::class_<Basis>(module, "Basis", "The scene and the database behind an answer.")
      .def_readonly("database_generation", &Basis::database_generation)
      .def_readonly("scene_id", &Basis::scene_id,
                    "0: there was no scene, and every verdict is unknown.")
      .def_property_readonly(
          "scene_time",
          [](const Basis& at) -> std::optional<double> {
            if (at.scene_time == absl::InfinitePast()) return std::nullopt;
            return absl::ToDoubleSeconds(at.scene_time - absl::UnixEpoch());
          },
          "Capture time of the oldest image, seconds since 1970, or None.")
      .def_property_readonly(
          "scene_age", [](const Basis& at) { return Seconds(at.scene_age); },
          "Age of that image when the answer was made, seconds; None without a scene.")
      .def(
          "age", [](const Basis& at) { return Seconds(at.Age()); },
          "Age of that image now, seconds, never too small; None without a scene.")
      .def_property_readonly(
          "valid_for",
          [](const Basis& at) {
            return absl::ToDoubleSeconds(
                absl::FromChrono(at.valid_until - client::RunningClock::now()));
          },
          "Seconds from now for which the answer is valid, if nothing new comes.")
      .def_readonly("regions", &Basis::regions,
                    "Names of the allowed regions that may have changed verdicts.")
      .def_readonly("variant", &Basis::variant)
      .def_readonly("scene_variant", &Basis::scene_variant)
      .def_readonly("defects", &Basis::defects)
      .def_readonly("unverified_model", &Basis::unverified_model)
      .def("__repr__", [](const Basis& at) {
        return "<Basis scene " + std::to_string(at.scene_id) + ", generation " +
               std::to_string(at.database_generation) + ">";
      });
}

void BindVerdict(py::module_& module) {
  using client::ViewEvidence;
  py::class_<ViewEvidence>(module, "ViewEvidence",
                           "Evidence of one view: the pixels inside the robot image.")
      .def_readonly("view", &ViewEvidence::view)
      .def_readonly("obstacle_pixels", &ViewEvidence::obstacle_pixels)
      .def_readonly("unknown_pixels", &ViewEvidence::unknown_pixels)
      .def_readonly("error_pixels", &ViewEvidence::error_pixels)
      .def_readonly("missing", &ViewEvidence::missing,
                    "The scene lacks this view: it counts as showing an obstacle.")
      .def_readonly("distance", &ViewEvidence::distance,
                    "Pixels from the robot image to the nearest obstacle pixel, infinite without "
                    "one; None if no clearance was requested.");
  py::class_<Verdict>(module, "Verdict", "The verdict on a configuration. True only if it is free.")
      .def_property_readonly("state", [](const Verdict& at) { return ToPython(at.state); })
      .def_property_readonly("reason", [](const Verdict& at) { return ToPython(at.reason); })
      .def_property_readonly("free", &Verdict::free)
      .def("__bool__", &Verdict::free)
      .def_readonly("views", &Verdict::views,
                    "Evidence in the order of the database's views; empty if not requested.")
      .def_readonly("hidden_possible", &Verdict::hidden_possible,
                    "An obstacle may be occluded in every view. Set for free verdicts, too.")
      .def_readonly("regions", &Verdict::regions,
                    "Names of the allowed regions that may have changed the verdict.")
      .def_readonly("clearance", &Verdict::clearance,
                    "Mask pixels by which the robot could grow; None if unknown or not requested.")
      .def("__str__", TextOf)
      .def("__repr__", [](const Verdict& at) { return "<Verdict " + TextOf(at) + ">"; });
}

// From now on.
py::array ReadOnly(py::array array) {
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

void BindChecks(py::module_& module) {
  py::class_<Checks>(module, "Checks",
                     "n verdicts as arrays. It has no truth of its own: use all_free or free.")
      .def_readonly("basis", &Checks::basis)
      .def_property_readonly(
          "states", [](const Checks& at) { return ReadOnly(at.states); },
          "(n,) uint8, values of State. Beware: OCCUPIED is not 0; use free. Cannot be changed.")
      .def_property_readonly(
          "reasons", [](const Checks& at) { return ReadOnly(at.reasons); },
          "(n,) uint8, values of Reason. Cannot be changed.")
      .def_readonly("clearances", &Checks::clearances,
                    "(n,) float64, mask pixels, NaN where unknown; None if not requested.")
      .def_readonly("verdicts", &Checks::verdicts,
                    "n verdicts with their evidence; empty unless evidence was requested.")
      .def_property_readonly(
          "free",
          [](const Checks& at) {
            py::array_t<bool> free(at.states.size());
            for (py::ssize_t i = 0; i < free.size(); ++i) {
              free.mutable_data()[i] = at.states.data()[i] == static_cast<uint8_t>(State::kFree);
            }
            return free;
          },
          "(n,) bool.")
      .def_property_readonly(
          "all_free",
          [](const Checks& at) {
            const uint8_t* begin = at.states.data();
            const uint8_t* end = begin + at.states.size();
            return begin != end &&
                   std::count(begin, end, static_cast<uint8_t>(State::kFree)) == at.states.size();
          },
          "False for an empty request.")
      .def("__len__", [](const Checks& at) { return at.states.size(); })
      .def("__repr__",
           [](const Checks& at) {
             const uint8_t* begin = at.states.data();
             const auto free =
                 std::count(begin, begin + at.states.size(), static_cast<uint8_t>(State::kFree));
             return "<Checks " + std::to_string(free) + " of " + std::to_string(at.states.size()) +
                    " free, scene " + std::to_string(at.basis.scene_id) + ">";
           })
      .def("__bool__", [](const Checks&) -> bool {
        throw py::type_error("many verdicts have no truth; use .all_free or .free");
      });
}

void BindPath(py::module_& module) {
  using client::PathPlace;
  py::class_<PathPlace>(module, "PathPlace", "A place on a path.")
      .def_readonly("segment", &PathPlace::segment, "Waypoint number, counted from 0.")
      .def_readonly("fraction", &PathPlace::fraction, "Of the way to the next waypoint, 0 to 1.")
      .def_property_readonly(
          "configuration", [](const PathPlace& at) { return ArrayOf(at.configuration); },
          "(d,) float64, radians or metres.");
  py::class_<PathCheck>(module, "PathCheck",
                        "The verdict on a path, and the first place that is not free. True only if "
                        "the whole path is free.")
      .def_readonly("basis", &PathCheck::basis)
      .def_property_readonly("verdict", [](const PathCheck& at) { return ToPython(at.verdict); })
      .def_property_readonly("free", [](const PathCheck& at) { return at.verdict.free(); })
      .def("__bool__", [](const PathCheck& at) { return at.verdict.free(); })
      .def_readonly("segment", &PathCheck::segment, "Waypoint number, counted from 0.")
      .def_readonly("fraction", &PathCheck::fraction, "Of the way to the next waypoint, 0 to 1.")
      .def_property_readonly(
          "configuration", [](const PathCheck& at) { return ArrayOf(at.configuration); },
          "(d,) float64: the place that is not free.")
      .def_readonly("checked", &PathCheck::checked, "Number of places checked, up to there.")
      .def_readonly("narrowest", &PathCheck::narrowest,
                    "The first place with the smallest clearance; only if requested and free.")
      .def_property_readonly("proof", [](const PathCheck& at) { return ToPython(at.proof); })
      .def_readonly("sampled_step", &PathCheck::sampled_step,
                    "With PathProof.SAMPLED: metres that a point of the robot moves at most "
                    "between two places.")
      .def("__repr__",
           [](const PathCheck& at) { return "<PathCheck " + TextOf(at.verdict) + ">"; });
}

}  // namespace

std::string TextOf(const Verdict& verdict) {
  std::string text = client::NameOf(verdict.state);
  if (verdict.state == State::kUnknown) text += ": " + client::Describe(verdict.reason);
  return text;
}

absl::Duration SecondsOf(double seconds, const std::string& what) {
  if (std::isnan(seconds)) throw std::invalid_argument(what + " is not a number of seconds");
  return absl::Seconds(seconds);
}

Numbers NumbersIn(const py::object& numbers) {
  if (py::isinstance<Numbers>(numbers)) return py::reinterpret_borrow<Numbers>(numbers);
  const py::array any = py::array::ensure(numbers);
  if (!any || (any.dtype().kind() != 'i' && any.dtype().kind() != 'u')) {
    PyErr_Clear();
    throw std::invalid_argument(
        "numbers takes an array of whole numbers, as Grid.numbers has them");
  }
  const auto wide = py::array_t<int64_t, py::array::c_style | py::array::forcecast>::ensure(any);
  Numbers narrow(wide.size());
  for (py::ssize_t i = 0; i < wide.size(); ++i) {
    const int64_t number = wide.data()[i];
    if (number < 0 || number > std::numeric_limits<uint32_t>::max()) {
      throw std::invalid_argument("numbers: there is no configuration " + std::to_string(number));
    }
    narrow.mutable_data()[i] = static_cast<uint32_t>(number);
  }
  return narrow;
}

void RequireRows(const Doubles& array, const std::string& what) {
  if (array.ndim() == 2) return;
  throw std::invalid_argument(what + " has " + std::to_string(array.ndim()) +
                              " dimensions; it takes an array of the shape (n, joints), a row "
                              "for each configuration");
}

std::vector<Configuration> RowsOf(const Doubles& array, const std::string& what) {
  RequireRows(array, what);
  std::vector<Configuration> rows;
  for (py::ssize_t i = 0; i < array.shape(0); ++i) {
    rows.emplace_back(array.data(i, 0), array.data(i, 0) + array.shape(1));
  }
  return rows;
}

py::array_t<double> ArrayOf(const Configuration& configuration) {
  return py::array_t<double>(static_cast<py::ssize_t>(configuration.size()), configuration.data());
}

py::object ToPython(State state) {
  return Borrowed(TheEnums().states[std::min<size_t>(static_cast<size_t>(state), 2)]);
}
py::object ToPython(Reason reason) {
  return Borrowed(TheEnums().reasons[static_cast<size_t>(reason)]);
}
py::object ToPython(client::PathProof proof) {
  return Borrowed(TheEnums().proofs[static_cast<size_t>(proof)]);
}

py::object ToPython(Verdict verdict) {
  const bool plain = verdict.views.empty() && verdict.regions.empty() && !verdict.clearance &&
                     !verdict.hidden_possible;
  if (!plain) return py::cast(std::move(verdict));
  PyObject*& shared = TheEnums().verdicts.at(
      static_cast<size_t>(verdict.state))[static_cast<size_t>(verdict.reason)];
  if (shared == nullptr) shared = py::cast(std::move(verdict)).release().ptr();
  return Borrowed(shared);
}

Checks::Checks(Basis of, py::ssize_t size)
    : basis(std::move(of)), states(size), reasons(size), clearances(py::none()) {}

Checks ChecksOf(client::ConfigurationChecks checks, bool clearance) {
  Checks arrays(std::move(checks.basis), static_cast<py::ssize_t>(checks.verdicts.size()));
  uint8_t* states = arrays.states.mutable_data();
  uint8_t* reasons = arrays.reasons.mutable_data();
  std::vector<double> pixels;
  for (const Verdict& verdict : checks.verdicts) {
    *states++ = static_cast<uint8_t>(verdict.state);
    *reasons++ = static_cast<uint8_t>(verdict.reason);
    pixels.push_back(verdict.clearance.value_or(std::numeric_limits<double>::quiet_NaN()));
  }
  if (clearance) arrays.clearances = ArrayOf(pixels);
  arrays.verdicts = std::move(checks.verdicts);
  return arrays;
}

Checks ChecksOf(const client::NumberChecks& checks) {
  Checks arrays(checks.basis, static_cast<py::ssize_t>(checks.size));
  for (size_t i = 0; i < checks.size; ++i) {
    const State state = checks.StateOf(i);
    const Reason reason = state == State::kUnknown ? checks.unknown_reason : Reason::kUnspecified;
    arrays.states.mutable_data()[i] = static_cast<uint8_t>(state);
    arrays.reasons.mutable_data()[i] = static_cast<uint8_t>(reason);
  }
  return arrays;
}

void BindAnswers(py::module_& module) {
  module.def(
      "describe", [](uint8_t reason) { return client::Describe(static_cast<Reason>(reason)); },
      py::arg("reason"), "What a reason means, as a sentence that follows \"unknown: \".");
  module.def(
      "name_of", [](uint8_t reason) { return client::NameOf(static_cast<Reason>(reason)); },
      py::arg("reason"), "Such as \"scene stale\".");
  // Now: later, two threads may be first, and the one that waits would hold the interpreter's lock.
  TheEnums();
  BindBasis(module);
  BindVerdict(module);
  BindChecks(module);
  BindPath(module);
}

}  // namespace silhouette::python
