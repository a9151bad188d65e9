// SPDX-License-Identifier: Apache-2.0
// Mask and MaskSize for users of the client library. Where the library is installed, the header
// itself stands here.
#pragma once

#include "db/mask/mask.h"
