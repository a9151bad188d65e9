// The same without asking the server, on its machine: may_i_go_here FILE VALUE... (radians), where
// FILE is the server's shared map.
#include <silhouette/shared_space.h>

#include <cstdlib>
#include <iostream>

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  const auto space = silhouette::SharedSpace::Open(argv[1], absl::Milliseconds(200));
  if (!space.ok()) {
    std::cerr << space.status().message() << '\n';
    return 3;
  }
  silhouette::Configuration q;
  for (int i = 2; i < argc; ++i) q.push_back(std::atof(argv[i]));
  const silhouette::client::Verdict verdict = space->Check(q);
  std::cout << NameOf(verdict.state) << '\n';
  return verdict.free() ? 0 : 1;
}
