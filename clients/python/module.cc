// SPDX-License-Identifier: Apache-2.0
#include <string>

#include "clients/python/bindings.h"

namespace silhouette::python {
namespace {

py::object ClassFor(absl::StatusCode code) {
  std::string name;
  bool capital = true;
  for (const char c : absl::StatusCodeToString(code)) {  // INVALID_ARGUMENT
    if (c == '_') {
      capital = true;
      continue;
    }
    name += capital ? c : static_cast<char>(c - 'A' + 'a');
    capital = false;
  }
  const py::module_ errors = py::module_::import("silhouette._errors");
  return py::getattr(errors, name.c_str(), errors.attr("Error"));
}

void Translate(std::exception_ptr thrown) {
  try {
    if (thrown) std::rethrow_exception(thrown);
  } catch (const StatusError& error) {
    PyErr_SetString(ClassFor(error.status.code()).ptr(),
                    std::string(error.status.message()).c_str());
  }
}

}  // namespace

PYBIND11_MODULE(_silhouette, module) {
  module.doc() = "The C++ client of silhouette-server; see the package silhouette.";
  py::register_exception_translator(Translate);
  BindAnswers(module);
  BindSpaces(module);
  BindClient(module);
  BindLocalSpace(module);
}

}  // namespace silhouette::python
