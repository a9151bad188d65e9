// SPDX-License-Identifier: Apache-2.0
// silhouette explain
#include <memory>

#include "db/status/status_macros.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/formats/inputs.h"
#include "tools/silhouette/formats/output.h"
#include "tools/silhouette/formats/pictures.h"
#include "tools/silhouette/options.h"

namespace silhouette {
namespace {

struct ExplainArguments {
  std::string configuration;
  bool degrees = false;
  std::string out;
  PolicyOptions policy;
};

absl::StatusOr<ExitCode> Explain(const Session& session, const ExplainArguments& arguments) {
  const Configuration configuration =
      ParseConfiguration(arguments.configuration, UnitOf(arguments.degrees));
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  ASSIGN_OR_RETURN(const auto explanation,
                   client.Explain(configuration, arguments.policy.policy()));
  if (!arguments.out.empty()) {
    RETURN_IF_ERROR(WriteExplanation(explanation, arguments.out));
  }
  PrintResult(session.format, JsonOf(configuration, explanation),
              TextOf(configuration, explanation));
  return explanation.verdict.free() ? kDone : kNo;
}

}  // namespace

void AddExplainCommand(CLI::App& program, Session& session, Run& run) {
  CLI::App* command =
      program.add_subcommand("explain", "Report why a configuration is free or not, view by view");
  auto arguments = std::make_shared<ExplainArguments>();
  command
      ->add_option("configuration", arguments->configuration,
                   "Joint values with commas between them")
      ->required();
  AddDegreesFlag(*command, arguments->degrees);
  command->add_option("--out", arguments->out,
                      "Write the images of every view into this folder: VIEW_scene.png and so on, "
                      "and explanation.png with all of them");
  AddFormatOption(*command, session.format);
  AddPolicyOptions(*command, arguments->policy);
  AddVariantOption(*command, session);
  command->footer(
      "Exit code 0 if the configuration is free, 1 if not.\n\n"
      "Example:\n"
      "  silhouette explain 30deg,-10deg --out why");
  Runs(*command, session, run, arguments, Explain);
}

}  // namespace silhouette
