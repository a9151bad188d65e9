// The operator at the terminal that the program runs in.
#pragma once

#include "capture/drivers/robots/manual_robot.h"

namespace silhouette {

// Lines and questions go to stderr, answers come from stdin. FailedPrecondition: nobody is there,
// as stdin has ended; Cancelled: a signal came, such as that of Ctrl-C where the program catches
// it.
Operator OperatorAtTerminal();

}  // namespace silhouette
