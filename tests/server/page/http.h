// SPDX-License-Identifier: Apache-2.0
// httplib.h without a macro of <resolv.h> that is a name in Eigen.
#pragma once

#include <httplib.h>
#undef _res
