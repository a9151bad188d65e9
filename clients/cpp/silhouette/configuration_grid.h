// SPDX-License-Identifier: Apache-2.0
// ConfigurationGrid for users of the client library. Where the library is installed, the header
// itself stands here.
#pragma once

#include "db/mask/configuration_grid.h"
