// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/urdf_text.h"

#include <console_bridge/console.h>
#include <tinyxml.h>
#include <urdf_model/pose.h>
#include <urdf_parser/urdf_parser.h>

#include <cmath>
#include <exception>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <numbers>
#include <sstream>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/text/utf8.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

// Keeps what urdfdom complains about instead of printing it. Its message handler is one for the
// whole process, hence the lock.
class Complaints : public console_bridge::OutputHandler {
 public:
  Complaints() : lock_(mutex()) { console_bridge::useOutputHandler(this); }
  ~Complaints() override { console_bridge::restorePreviousOutputHandler(); }
  Complaints(const Complaints&) = delete;
  Complaints& operator=(const Complaints&) = delete;

  void log(const std::string& text, console_bridge::LogLevel level, const char* /*file*/,
           int /*line*/) override {
    if (level < console_bridge::CONSOLE_BRIDGE_LOG_ERROR || count_ == 2) return;
    absl::StrAppend(&first_, first_.empty() ? "" : "; ", text);
    ++count_;
  }
  // The first two: what is wrong, and often where. Empty: there is none.
  const std::string& first() const { return first_; }

 private:
  static std::mutex& mutex() {
    static std::mutex mutex;
    return mutex;
  }
  std::lock_guard<std::mutex> lock_;
  std::string first_;
  int count_ = 0;
};

absl::StatusOr<std::string> ReadText(const std::string& path) {
  std::ifstream in(path);
  if (!in || !fs::is_regular_file(path)) {
    return NotFound("the robot's file '", path, "' does not exist or cannot be read");
  }
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

// Whether anything in the element is for xacro to expand. Expanded files often declare its
// namespace still.
bool IsXacro(const TiXmlElement& element) {
  if (element.ValueStr() == "gazebo") return false;  // the simulator's own
  if (element.ValueStr().starts_with("xacro:")) return true;
  for (const TiXmlAttribute* at = element.FirstAttribute(); at != nullptr; at = at->Next()) {
    const std::string_view value = at->Value();
    if (value.find("${") != value.npos || value.find("$(") != value.npos) return true;
  }
  for (const TiXmlElement* child = element.FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    if (IsXacro(*child)) return true;
  }
  return false;
}

std::string ExpandedName(const std::string& path) {
  const fs::path name = fs::path(path).filename();
  if (name.extension() != ".xacro") return name.stem().string() + "_expanded.urdf";
  return name.stem().extension() == ".urdf" ? name.stem().string() : name.stem().string() + ".urdf";
}

// Takes away what urdfdom refuses a robot for if it is not complete, and nothing here needs.
void RemoveDynamics(TiXmlElement& robot) {
  for (TiXmlElement* of = robot.FirstChildElement(); of != nullptr; of = of->NextSiblingElement()) {
    for (const char* name : {"inertial", "dynamics", "safety_controller", "calibration"}) {
      while (TiXmlElement* child = of->FirstChildElement(name)) of->RemoveChild(child);
    }
  }
}

// Puts a sphere on either end of every capsule, and a cylinder between: urdfdom knows no capsules.
// It complains about those whose numbers cannot be read. A second shape is refused: urdfdom leaves
// it out.
absl::Status CompleteBodies(const std::string& path, TiXmlElement& link) {
  for (TiXmlElement* body = link.FirstChildElement(); body != nullptr;
       body = body->NextSiblingElement()) {
    TiXmlElement* const geometry = body->FirstChildElement("geometry");
    TiXmlElement* const shape = geometry == nullptr ? nullptr : geometry->FirstChildElement();
    if (shape == nullptr) continue;
    if (shape->NextSiblingElement() != nullptr ||
        geometry->NextSiblingElement("geometry") != nullptr) {
      const char* const name = link.Attribute("name");
      return InvalidArgument(path, ":", geometry->Row(), ": link '", name == nullptr ? "" : name,
                             "' has a <visual> or <collision> of more than one shape; give each "
                             "one of its own");
    }
    const char* const scale = shape->Attribute("scale");
    urdf::Vector3 factors;
    try {
      if (scale != nullptr) factors.init(scale);
    } catch (const std::exception&) {
      return InvalidArgument(path, ":", shape->Row(), ": scale=\"", scale,
                             "\" is not three numbers; write e.g. scale=\"0.001 0.001 0.001\"");
    }
    if (shape->ValueStr() != "capsule") continue;
    shape->SetValue("cylinder");
    if (body->FirstChildElement("origin") == nullptr) body->InsertEndChild(TiXmlElement("origin"));
    const TiXmlElement& origin = *body->FirstChildElement("origin");
    urdf::Pose pose;
    double length = 0;
    try {
      if (const char* xyz = origin.Attribute("xyz")) pose.position.init(xyz);
      if (const char* rpy = origin.Attribute("rpy")) pose.rotation.init(rpy);
    } catch (const std::exception&) {
      continue;
    }
    if (shape->QueryDoubleAttribute("length", &length) != TIXML_SUCCESS) continue;
    TiXmlElement end = *body;
    end.FirstChildElement("geometry")->FirstChildElement("cylinder")->SetValue("sphere");
    for (const double z : {-length / 2, length / 2}) {
      const urdf::Vector3 at = pose.position + pose.rotation * urdf::Vector3(0, 0, z);
      end.FirstChildElement("origin")->SetAttribute(
          "xyz", absl::StrFormat("%.17g %.17g %.17g", at.x, at.y, at.z));
      body = link.InsertAfterChild(body, end)->ToElement();
    }
  }
  return absl::OkStatus();
}

// Completes limits for urdfdom, which reads none without effort and velocity: nothing here needs
// them. A joint that mimics another needs no range of its own; any other is refused without one.
absl::Status CompleteLimits(const std::string& path, TiXmlElement& robot) {
  for (TiXmlElement* joint = robot.FirstChildElement("joint"); joint != nullptr;
       joint = joint->NextSiblingElement("joint")) {
    const auto text = [&](const char* attribute) {
      const char* const value = joint->Attribute(attribute);
      return std::string(value == nullptr ? "" : value);
    };
    const bool ranges = text("type") == "revolute" || text("type") == "prismatic";
    const bool mimics = joint->FirstChildElement("mimic") != nullptr;
    TiXmlElement* limit = joint->FirstChildElement("limit");
    const bool has_range = limit != nullptr && (limit->Attribute("lower") != nullptr ||
                                                limit->Attribute("upper") != nullptr);
    if (ranges && !mimics && !has_range) {
      return InvalidArgument(
          path, ":", joint->Row(), ": joint '", text("name"),
          "' has no limits; state <limit lower=\"...\" upper=\"...\"/>, or ",
          text("type") == "revolute" ? "type=\"continuous\" if it turns without end, or " : "",
          "type=\"fixed\" if it does not move");
    }
    if (limit == nullptr) {
      if (!ranges) continue;
      limit = joint->InsertEndChild(TiXmlElement("limit"))->ToElement();
    }
    for (const char* name : {"effort", "velocity"}) {
      if (limit->Attribute(name) == nullptr) limit->SetAttribute(name, "0");
    }
  }
  return absl::OkStatus();
}

// Refuses what can only be degrees: a rotation of more than two turns.
absl::Status CheckRotations(const std::string& path, const TiXmlElement& element) {
  if (element.ValueStr() == "gazebo") return absl::OkStatus();  // the simulator's own
  constexpr double kMost = 4 * std::numbers::pi;
  if (const char* const rpy = element.Attribute("rpy")) {
    std::istringstream numbers(rpy);
    for (double angle = 0; numbers >> angle;) {
      if (std::abs(angle) <= kMost) continue;
      return InvalidArgument(path, ":", element.Row(), ": rpy=\"", rpy,
                             "\" turns by more than two turns; rotations in URDF are radians: 90 "
                             "degrees are 1.5708");
    }
  }
  for (const TiXmlElement* child = element.FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    RETURN_IF_ERROR(CheckRotations(path, *child));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<urdf::ModelInterfaceSharedPtr> ParseUrdf(const std::string& path) {
  ASSIGN_OR_RETURN(const std::string text, ReadText(path));
  if (text.empty()) return InvalidArgument(path, ": the file is empty");
  if (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff")) {
    return InvalidArgument(
        path, ": its text is UTF-16; convert it, as in: iconv -f UTF-16 -t UTF-8 OLD > NEW");
  }
  if (!IsUtf8(text)) {
    return InvalidArgument(path,
                           ": its text is not UTF-8; convert it, as in: iconv -f ISO-8859-1 "
                           "-t UTF-8 OLD > NEW");
  }
  TiXmlDocument document;
  document.Parse(text.c_str());
  if (document.Error()) {
    // Row 0: where the text ends.
    const std::string row = document.ErrorRow() > 0 ? absl::StrCat(":", document.ErrorRow()) : "";
    return InvalidArgument(path, row, ": not well-formed XML: ", document.ErrorDesc(),
                           row.empty() ? "; is the file cut off?" : "");
  }
  if (TiXmlElement* const robot = document.RootElement(); robot != nullptr) {
    if (IsXacro(*robot)) {
      return InvalidArgument(path, ": this is xacro; expand it first: xacro ", path, " > ",
                             ExpandedName(path));
    }
    RemoveDynamics(*robot);
    for (TiXmlElement* link = robot->FirstChildElement("link"); link != nullptr;
         link = link->NextSiblingElement("link")) {
      RETURN_IF_ERROR(CompleteBodies(path, *link));
    }
    RETURN_IF_ERROR(CompleteLimits(path, *robot));
    RETURN_IF_ERROR(CheckRotations(path, *robot));
  }
  TiXmlPrinter printer;
  printer.SetStreamPrinting();
  document.Accept(&printer);
  Complaints complaints;
  urdf::ModelInterfaceSharedPtr model = urdf::parseURDF(printer.Str());
  // An element that it cannot read is left out: that robot would have no body there.
  if (model == nullptr || model->getRoot() == nullptr || !complaints.first().empty()) {
    return InvalidArgument(
        path, ": not a valid URDF: ",
        complaints.first().empty()
            ? "there is no robot in it"
            : absl::StrCat(complaints.first(), "; correct the element, or leave it out"));
  }
  return model;
}

}  // namespace silhouette
