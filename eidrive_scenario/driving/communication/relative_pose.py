"""Pose errors of other stations relative to the assumed pose of a receiving station."""

from __future__ import annotations

import numpy as np
from msgspec.structs import replace

from eidrive_scenario.arrays import Array
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.v2x.messages.message import StationState


def relative_state(state: StationState | None, ego: EgoState, covariance: Array | None) -> StationState | None:
    """Return the reported state of another station with the covariance of its pose relative to that of the receiver.

    ego         assumed pose of the receiver
    covariance  (3, 3) of its x, y and yaw; None: the pose is exact

    The receiver steers relative to its assumed pose, of which its own detections are free of error. The two pose errors
    are independent, so that objects of the other station have both. An error of the yaw at the receiver moves a point
    at distance d by d times the error: about the place of the other station, the error of the receiver is T e with
    T = [[1, 0, -dy], [0, 1, dx], [0, 0, 1]].
    """
    if state is None or covariance is None:
        return state
    dx, dy = state.x - float(ego.position[0]), state.y - float(ego.position[1])
    about = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
    own = about @ covariance @ about.T
    return replace(state, pose_covariance=own if state.pose_covariance is None else state.pose_covariance + own)
