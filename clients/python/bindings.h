// SPDX-License-Identifier: Apache-2.0
// The Python package `silhouette`: what its sources share. Everything that calls the server or
// takes long releases the interpreter's lock.
#pragma once

#include <google/protobuf/message.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <exception>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "silhouette/answers.h"
#include "silhouette/configuration_grid.h"
#include "silhouette/space_snapshot.h"
#include "silhouette/verdict.h"

namespace silhouette::python {

namespace py = pybind11;

// A status that is not OK; Python sees the class of silhouette._errors that has its code's name.
struct StatusError : std::exception {
  explicit StatusError(absl::Status of) : status(std::move(of)) {}
  absl::Status status;
};

// Gives up the interpreter's lock while it lives. When the interpreter ends, it ends a thread that
// wants the lock back by an exception that passes through the destructor; that of
// py::gil_scoped_release would end the program.
class Unlocked {
 public:
  Unlocked() = default;
  ~Unlocked() noexcept(false) { PyEval_RestoreThread(state_); }
  Unlocked(const Unlocked&) = delete;
  Unlocked& operator=(const Unlocked&) = delete;

 private:
  PyThreadState* const state_ = PyEval_SaveThread();
};

template <typename F>
auto WithoutLock(F call) {
  const Unlocked unlocked;
  return call();
}

// The value of a call that returns absl::StatusOr, made without the lock.
template <typename F>
auto Ask(F call) {
  auto answer = WithoutLock(call);
  if (!answer.ok()) throw StatusError(answer.status());
  return *std::move(answer);
}

// Throws std::invalid_argument, naming `what`, for NaN: absl::Seconds() makes it an infinite time.
absl::Duration SecondsOf(double seconds, const std::string& what);

// Calls `wait(slice)` until it returns true or `timeout` seconds (none: for ever) are over. Between
// the slices Python may handle signals, so that Ctrl-C ends any wait.
template <typename F>
bool WaitInSlices(std::optional<double> timeout, F wait) {
  const absl::Duration slice = absl::Milliseconds(100);
  absl::Duration left = timeout ? SecondsOf(*timeout, "timeout") : absl::InfiniteDuration();
  while (true) {
    if (wait(std::min(left, slice))) return true;
    left -= slice;
    if (left <= absl::ZeroDuration()) return false;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  }
}

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;

// Throws std::invalid_argument, naming `what`, unless the shape is (n, d).
void RequireRows(const Doubles& array, const std::string& what);

// The n rows of such an array; throws as RequireRows.
std::vector<Configuration> RowsOf(const Doubles& array, const std::string& what);

// Numbers of configurations: a uint32 array as it is, one of other whole numbers as such. Throws
// std::invalid_argument if they are no whole numbers, or numbers that uint32 does not have.
using Numbers = py::array_t<uint32_t, py::array::c_style>;
Numbers NumbersIn(const py::object& numbers);

py::array_t<double> ArrayOf(const Configuration& configuration);

// Python's enum members.
py::object ToPython(client::State state);
py::object ToPython(client::Reason reason);
py::object ToPython(client::PathProof proof);

// A verdict; those without evidence, regions and clearance are shared objects.
py::object ToPython(client::Verdict verdict);

// "free", "unknown: no scene"
std::string TextOf(const client::Verdict& verdict);

// Many verdicts in arrays.
struct Checks {
  Checks(client::Basis of, py::ssize_t size);

  client::Basis basis;
  py::array_t<uint8_t> states;            // (n), State
  py::array_t<uint8_t> reasons;           // (n), Reason
  py::object clearances;                  // (n), pixels, NaN without one; None if not requested
  std::vector<client::Verdict> verdicts;  // of Client.check only
};
Checks ChecksOf(client::ConfigurationChecks checks, bool clearance);
Checks ChecksOf(const client::NumberChecks& checks);

// The number of each grid point, in the shape of the grid. Throws std::invalid_argument if numbers
// do not fit 32 bits.
py::array_t<uint32_t> NumbersOf(const ConfigurationGrid& grid);

// A message of the API as a dict of its fields: durations in seconds, times in seconds since 1970,
// masks as bool arrays (height, width), enums by name; None for a message or value that is not set.
py::object ToPython(const google::protobuf::Message& message);

void BindAnswers(py::module_& module);
void BindSpaces(py::module_& module);
void BindClient(py::module_& module);
void BindLocalSpace(py::module_& module);

}  // namespace silhouette::python
