// SPDX-License-Identifier: Apache-2.0
// silhouette-sim contact
#include <iostream>
#include <memory>

#include "db/status/status_macros.h"
#include "tools/program/program.h"
#include "tools/silhouette-sim/commands.h"
#include "tools/silhouette-sim/workplace.h"

namespace silhouette {
namespace {

struct ContactArguments {
  WorkplaceArguments workplace;
  std::vector<std::string> configurations;
};

absl::StatusOr<ExitCode> RunContact(const ContactArguments& arguments) {
  ASSIGN_OR_RETURN(const Workplace workplace, LoadWorkplace(arguments.workplace));
  std::vector<std::vector<double>> configurations;
  for (const std::string& text : arguments.configurations) {
    configurations.push_back(workplace.Parse(text));
  }
  const ContactChecker checker(workplace.robot, workplace.obstacles);
  nlohmann::ordered_json results = nlohmann::ordered_json::array();
  int contacts = 0;
  for (const std::vector<double>& configuration : configurations) {
    ASSIGN_OR_RETURN(const auto positions, workplace.Positions(configuration));
    const Contact contact =
        checker.Check(workplace.robot.LinkPoses(positions), workplace.obstacle_poses);
    contacts += contact.touching ? 1 : 0;
    nlohmann::ordered_json result{{"configuration", configuration}};
    result.update(JsonOf(contact));
    results.push_back(result);
    if (!arguments.workplace.json()) {
      std::cout << Spoken(configuration) << ": " << Spoken(contact) << '\n';
    }
  }
  if (arguments.workplace.json()) {
    std::cout << nlohmann::ordered_json{{"contacts", contacts}, {"configurations", results}}.dump(2)
              << '\n';
  }
  return contacts > 0 ? kNo : kDone;
}

}  // namespace

void AddContactCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "contact", "Check whether the robot touches an obstacle in given configurations");
  auto arguments = std::make_shared<ContactArguments>();
  AddWorkplaceOptions(*command, arguments->workplace, true);
  command
      ->add_option("--configuration", arguments->configurations,
                   "Values of the grid's joints, e.g. 0.5,-30deg; may be given several times")
      ->required()
      ->allow_extra_args(false);
  command->callback([arguments, &run] { run = [arguments] { return RunContact(*arguments); }; });
}

}  // namespace silhouette
