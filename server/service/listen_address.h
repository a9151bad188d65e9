// Where a server listens.
#pragma once

#include <string>

#include "absl/status/status.h"

namespace silhouette {

// Whether a server can listen on `address`: "host:port", "[::1]:port" or "unix:path"; port 0 stands
// for any free one. InvalidArgument: it is not an address. FailedPrecondition: it is taken, or is
// none of this machine's. The messages say what to do.
absl::Status CheckListenAddress(const std::string& address);

}  // namespace silhouette
