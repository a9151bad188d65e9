// SPDX-License-Identifier: Apache-2.0
#include <pybind11/stl.h>

#include <limits>

#include "clients/python/bindings.h"
#include "silhouette/configuration_space.h"

namespace silhouette::python {
namespace {

using client::ConfigurationSpace;
using client::State;

std::vector<py::ssize_t> ShapeOf(const ConfigurationGrid& grid) {
  std::vector<py::ssize_t> shape;
  for (const GridJoint& joint : grid.joints()) shape.push_back(joint.steps);
  return shape;
}

// Calls `visit(place, number)` for each grid point, in the row-major order of ShapeOf.
template <typename F>
void ForEachPoint(const ConfigurationGrid& grid, F visit) {
  const int last = grid.dimensions() - 1;
  GridIndex index{};
  for (uint64_t place = 0; place < grid.size(); ++place) {
    visit(place, grid.NumberOf(index));
    for (int j = last; j >= 0; --j) {
      const auto at = static_cast<size_t>(j);
      if (++index[at] < grid.joints()[at].steps) break;
      index[at] = 0;
    }
  }
}

py::array_t<uint8_t> StatesOf(const ConfigurationSpace& space) {
  py::array_t<uint8_t> states(ShapeOf(space.grid()));
  uint8_t* out = states.mutable_data();
  WithoutLock([&] {
    ForEachPoint(space.grid(), [&](uint64_t place, ConfigurationNumber number) {
      out[place] = static_cast<uint8_t>(space.StateAt(number));
    });
  });
  return states;
}

py::array_t<double> ClearancesOf(const ConfigurationSpace& space) {
  py::array_t<double> levels(ShapeOf(space.grid()));
  double* out = levels.mutable_data();
  WithoutLock([&] {
    ForEachPoint(space.grid(), [&](uint64_t place, ConfigurationNumber number) {
      out[place] =
          space.ClearanceAt(number).exceeds.value_or(std::numeric_limits<double>::quiet_NaN());
    });
  });
  return levels;
}

py::list AxesOf(const ConfigurationGrid& grid) {
  py::list axes;
  for (size_t j = 0; j < grid.joints().size(); ++j) {
    Configuration values;
    for (GridIndex index{}; index[j] < grid.joints()[j].steps; ++index[j]) {
      values.push_back(grid.At(index)[j]);
    }
    axes.append(ArrayOf(values));
  }
  return axes;
}

void BindGrid(py::module_& module) {
  py::class_<GridJoint>(module, "GridJoint", "A joint of the grid; radians, or metres.")
      .def_readonly("name", &GridJoint::name)
      .def_readonly("lower", &GridJoint::lower)
      .def_readonly("upper", &GridJoint::upper)
      .def_readonly("steps", &GridJoint::steps, "Number of grid values.")
      .def_readonly("continuous", &GridJoint::continuous, "It turns without end.");
  py::class_<ConfigurationGrid>(module, "Grid", "The discretised configurations of a robot.")
      .def_property_readonly("joints",
                             [](const ConfigurationGrid& at) {
                               return std::vector(at.joints().begin(), at.joints().end());
                             })
      .def_property_readonly(
          "shape", [](const ConfigurationGrid& at) { return py::tuple(py::cast(ShapeOf(at))); },
          "Steps of each joint.")
      .def_property_readonly("axes", AxesOf,
                             "For each joint its grid values: (steps,) float64, radians or metres.")
      .def_property_readonly("size", &ConfigurationGrid::size, "Number of configurations.")
      .def_property_readonly("numbers", NumbersOf,
                             "uint32 in the shape of the grid: the number of each grid point, as "
                             "check_numbers takes it.")
      .def(
          "nearest",
          [](const ConfigurationGrid& at, const Doubles& q) -> std::optional<py::tuple> {
            if (q.ndim() != 1 || q.size() != at.dimensions()) {
              throw std::invalid_argument("q takes a value for each joint of the grid: (" +
                                          std::to_string(at.dimensions()) + ",)");
            }
            const auto number = at.Nearest({q.data(), static_cast<size_t>(q.size())});
            if (!number) return std::nullopt;
            const GridIndex index = at.IndexOf(*number).value();
            return py::tuple(py::cast(std::vector(index.begin(), index.begin() + at.dimensions())));
          },
          py::arg("q"),
          "The index of the grid point nearest to q, (d,) radians or metres; None outside the "
          "grid.")
      .def(
          "at",
          [](const ConfigurationGrid& at, const std::vector<int>& index) {
            if (index.size() != at.joints().size()) {
              throw std::invalid_argument("the index takes a value for each joint of the grid");
            }
            GridIndex steps{};
            std::ranges::copy(index, steps.begin());
            return ArrayOf(at.At(steps));
          },
          py::arg("index"), "The joint values at a grid index: (d,) float64, radians or metres.");
}

}  // namespace

py::array_t<uint32_t> NumbersOf(const ConfigurationGrid& grid) {
  if (grid.number_limit() > std::numeric_limits<uint32_t>::max()) {
    throw std::invalid_argument("the grid has too many configurations for an array of numbers");
  }
  py::array_t<uint32_t> numbers(ShapeOf(grid));
  uint32_t* out = numbers.mutable_data();
  ForEachPoint(grid, [out](uint64_t place, ConfigurationNumber number) {
    out[place] = static_cast<uint32_t>(number);
  });
  return numbers;
}

void BindSpaces(py::module_& module) {
  BindGrid(module);
  py::class_<ConfigurationSpace>(
      module, "ConfigurationSpace",
      "The verdicts of all configurations from one scene, which may be old: look at basis.age().")
      .def_property_readonly("grid", &ConfigurationSpace::grid,
                             py::return_value_policy::reference_internal)
      .def_property_readonly("basis", &ConfigurationSpace::basis,
                             py::return_value_policy::reference_internal)
      .def_property_readonly("states", StatesOf,
                             "A new uint8 array in the shape of the grid, values of State.")
      .def_property_readonly(
          "unknown_reason",
          [](const ConfigurationSpace& at) -> py::object {
            const auto reason = at.unknown_reason();
            return reason ? ToPython(*reason) : py::none();
          },
          "Why everything is unknown; None if verdicts were valid when they came.")
      .def_property_readonly("tiles_left_out", &ConfigurationSpace::tiles_left_out,
                             "Tiles that the server had no time for: their states are unknown.")
      .def_property_readonly("clearance_levels", &ConfigurationSpace::clearance_levels)
      .def_property_readonly("clearances", ClearancesOf,
                             "A new float64 array in the shape of the grid: the greatest requested "
                             "level, mask pixels, that the clearance exceeds; NaN: none.");
}

}  // namespace silhouette::python
