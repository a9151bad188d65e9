# SPDX-License-Identifier: Apache-2.0
"""Enumerations of the API. Their values are those of the arrays `states` and `reasons`."""
import enum


class State(enum.IntEnum):
    """Only FREE is true."""

    UNKNOWN = 0
    """Whatever is not free or occupied; treat it as occupied."""
    FREE = 1
    OCCUPIED = 2

    def __bool__(self) -> bool:
        return self is State.FREE


class Reason(enum.IntEnum):
    """Why a verdict is unknown. Values from 200 are found by this library."""

    UNSPECIFIED = 0
    NO_SCENE = 1
    SCENE_STALE = 2
    SCENE_SKEWED = 3
    VIEW_MISSING = 4
    ROBOT_POSITION_UNKNOWN = 5
    FIXED_JOINT_MOVED = 6
    ROBOT_IMAGE_OF_SCENE_MISSING = 7
    ERROR_AREA = 8
    OUTSIDE_GRID = 9
    ROBOT_IMAGE_MISSING = 10
    EXCLUDED = 11
    ROBOT_IMAGE_CORRUPT = 12
    GENERATION_MISMATCH = 13
    INTERNAL = 14
    MARGIN_UNKNOWN = 15
    REGION_ENDED = 16
    CALIBRATION_DOUBTFUL = 17
    VARIANT_UNKNOWN = 18
    DATABASE_DAMAGED = 19
    LIGHT_CHANGED = 20
    VIEW_COVERED = 21
    VIEWS_SWAPPED = 22
    CAMERA_MOVED = 23
    ROBOT_ELSEWHERE = 24
    MOTION_NOT_PROVEN = 25
    DEPENDS_ON_WRIST = 26
    OUTSIDE_WORKSPACE = 27
    ROBOT_IMAGE_SUSPECT = 28
    NOT_IN_MAP = 200
    BETWEEN_GRID_POINTS = 201
    NO_UPDATE = 203
    CONNECTION_LOST = 204
    UPDATE_TOO_OLD = 205
    UPDATE_EXPIRED = 206
    UPDATE_MALFORMED = 207
    AGE_UNKNOWN = 208
    NOT_CHECKED_HERE = 209
    REFUSED = 210
    ANSWER_LATE = 211

    @property
    def description(self) -> str:
        """What it means, as a sentence that follows "unknown: "."""
        from . import _silhouette

        return _silhouette.describe(int(self))


class PathProof(enum.IntEnum):
    """What a free path is known to be free by."""

    NONE = 0
    """The path is not free, or the server does not say."""
    GRID = 1
    """Every grid cell on it is free."""
    CONTINUOUS = 2
    """The robot is free at all places of it."""
    SAMPLED = 3
    """The same, but for parts that are free at places PathCheck.sampled_step apart."""
