// Joint values as people type them.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace silhouette {

// "0.5", "-30deg" or "-30 deg" in radians (metres for prismatic joints). Throws
// std::invalid_argument with one sentence for everything else.
double ParseJointValue(const std::string& text);

// "0.5,-30deg": values separated by commas. Throws as ParseJointValue does.
std::vector<double> ParseConfiguration(const std::string& text);

// "joint_1=0.5": a name and a value. Throws as ParseJointValue does.
std::pair<std::string, double> ParseJoint(const std::string& text);

}  // namespace silhouette
