// SPDX-License-Identifier: Apache-2.0
// Asks whether the robot may be at a configuration: may_i_go ADDRESS VALUE... (radians).
#include <silhouette/client.h>

#include <cstdlib>
#include <iostream>

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  const auto client = silhouette::Client::Connect(argv[1]);
  silhouette::Configuration q;
  for (int i = 2; i < argc; ++i) {
    char* end = nullptr;
    q.push_back(std::strtod(argv[i], &end));
    if (end == argv[i] || *end != '\0') {
      std::cerr << "'" << argv[i] << "' is no number of radians\n";
      return 2;
    }
  }
  const auto checks = client.ok() ? client->CheckConfigurations({q}) : client.status();
  if (!checks.ok()) {
    std::cerr << checks.status().message() << '\n';
    return 3;
  }
  const silhouette::client::Verdict& verdict = checks->verdicts[0];
  std::cout << NameOf(verdict.state) << '\n';
  return verdict.free() ? 0 : 1;
}
