# SPDX-License-Identifier: Apache-2.0
"""The client of silhouette-server: which configurations of a robot are free right now.

    import numpy as np
    import silhouette

    client = silhouette.Client("127.0.0.1:50051")
    if client.check(np.array([[0.1, 0.2]])).all_free: ...

    with silhouette.LocalSpace(client, max_age=0.3) as space:
        space.wait_for_update(after=0, timeout=1.0)
        if space.check([0.1, 0.2]): ...

Joint values are radians, of prismatic joints metres, in the order of the grid's joints. Times are
seconds. Only an explicit FREE is true: a verdict that is unknown or occupied, and a path of which
a part is, are false. Errors are exceptions (Error and its subclasses), never verdicts.
"""
from ._enums import PathProof, Reason, State
from ._errors import (
    Aborted,
    Cancelled,
    DeadlineExceeded,
    Error,
    FailedPrecondition,
    Internal,
    InvalidArgument,
    NotFound,
    OutOfRange,
    PermissionDenied,
    ResourceExhausted,
    Unavailable,
    Unimplemented,
)
from ._silhouette import (
    Basis,
    Checks,
    Client,
    ConfigurationSpace,
    Defect,
    Explanation,
    Grid,
    GridJoint,
    LocalSpace,
    MotionVerdict,
    PathCheck,
    PathPlace,
    PathUpdate,
    PathWatch,
    Policy,
    SpaceSnapshot,
    Verdict,
    ViewEvidence,
    ViewPictures,
)

__all__ = [
    "Aborted", "Basis", "Cancelled", "Checks", "Client", "ConfigurationSpace", "DeadlineExceeded", "Defect",
    "Error", "Explanation", "FailedPrecondition", "Grid", "GridJoint", "Internal",
    "InvalidArgument", "LocalSpace", "MotionVerdict", "NotFound", "OutOfRange", "PathCheck", "PathPlace",
    "PathProof", "PathUpdate", "PathWatch", "PermissionDenied", "Policy", "Reason", "ResourceExhausted",
    "SpaceSnapshot", "State", "Unavailable", "Unimplemented", "Verdict", "ViewEvidence",
    "ViewPictures",
]
