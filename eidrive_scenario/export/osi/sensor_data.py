"""SensorData messages from the detections of stations."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import rotation_matrix
from eidrive_scenario.export.geometry import angles
from eidrive_scenario.export.osi.moving_objects import VEHICLES, object_type, rear_axle
from eidrive_scenario.export.osi.schemas import Identifiers, Osi, set_orientation, set_time, set_vector
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation.recorded_outcome import AxleCenters


@dataclass(frozen=True)
class _Origin:
    """Vehicle frame of a station: position (3,) [m], rotation (3, 3), velocity (3,) [m/s], yaw rate [rad/s]."""

    position: Array
    turn: Array
    velocity: Array
    yaw_rate: float

    @property
    def along_ground(self) -> Array:
        """Matrix (3, 2) that adds the height to a horizontal vector so that it lies in the ground plane of the vehicle.

        Stations do not estimate vertical velocities; on a constant slope other vehicles move in this plane.
        """
        x, y, z = self.turn[:, 2]
        return np.array([[1.0, 0.0], [0.0, 1.0], [-x / z, -y / z]])


class SensorDataBuilder:
    """Builder of the messages of one station, in the frame of its vehicle.

    list_name  "detections" for own detections, "fused" for the objects after fusion
    axles      axles of the station; None for a mast, and if they are unknown
    """

    def __init__(
        self, osi: Osi, ids: Identifiers, station: str, list_name: str, axles: AxleCenters | None = None
    ) -> None:
        self._osi = osi
        self._station = station
        self._list = list_name
        self._sensor = ids.of("sensor", station, list_name)
        self._rear_axle = rear_axle(axles)

    def build(self, frame: Frame) -> Any | None:
        """Return the message of a frame, or None if the station is absent."""
        step = frame.steps.get(self._station)
        origin = _origin(frame, self._station)
        if step is None or origin is None:
            return None
        objects: Detections = getattr(step, self._list)
        message = self._osi.begin(self._osi.sensor_data(), frame.view.time)
        message.sensor_id.value = self._sensor
        # The sensor is a virtual one in the reference point; OSI measures its place from the rear axle
        set_vector(message.mounting_position.position, -self._rear_axle)
        set_orientation(message.mounting_position.orientation, 0.0)
        if math.isfinite(objects.time):
            set_time(message.last_measurement_time, objects.time)
            set_time(message.moving_object_header.measurement_time, objects.time)
        message.moving_object_header.cycle_counter = frame.view.tick
        qualifier = type(message.moving_object_header).DataQualifier
        message.moving_object_header.data_qualifier = qualifier.Value("DATA_QUALIFIER_AVAILABLE")
        for row in range(len(objects)):
            self._add(message, objects, row, origin)
        return message

    def _add(self, message: Any, objects: Detections, row: int, origin: _Origin) -> None:
        box = objects.boxes[row]
        detected = message.moving_object.add()
        header = detected.header
        if objects.tracks:
            header.tracking_id.value = max(objects.tracks[row], 0)
        header.existence_probability = float(objects.confidence[row])
        header.sensor_id.add().value = self._sensor
        state = type(header).MeasurementState
        header.measurement_state = state.Value("MEASUREMENT_STATE_MEASURED")
        base = detected.base
        base.dimension.length, base.dimension.width, base.dimension.height = box[3:6].tolist()
        position = origin.turn.T @ (box[:3] - origin.position)
        set_vector(base.position, position)
        set_orientation(base.orientation, *angles(origin.turn.T @ rotation_matrix(box[6])))
        arm = box[:3] - origin.position
        if np.isfinite(objects.velocity[row]).all():
            spin = origin.yaw_rate * np.array([-arm[1], arm[0], 0.0])
            moved = origin.along_ground @ objects.velocity[row]
            set_vector(base.velocity, origin.turn.T @ (moved - origin.velocity - spin))
        covariance = objects.covariance[row]
        if np.isfinite(covariance).all():
            plane = (origin.turn.T @ origin.along_ground)[:2]
            spread = np.sqrt(np.maximum(np.diag(plane @ covariance @ plane.T), 0.0))
            detected.base_rmse.position.x, detected.base_rmse.position.y = spread.tolist()
        reference = self._osi.detected.DetectedMovingObject.ReferencePoint
        detected.reference_point = reference.Value("REFERENCE_POINT_CENTER")
        self._add_candidate(detected, objects.classes[row])

    def _add_candidate(self, detected: Any, category: str) -> None:
        """Add the only class, whose probability is 1: OSI states it given that the object exists."""
        candidate = detected.candidate.add(probability=1.0)
        candidate.type = self._osi.moving_object.Type.Value(object_type(category))
        if category in VEHICLES:
            kind = self._osi.moving_object.VehicleClassification.Type
            candidate.vehicle_classification.type = kind.Value(VEHICLES[category])


def _origin(frame: Frame, station: str) -> _Origin | None:
    """Return the vehicle frame that the station estimates, or its true one if it estimates none."""
    step, view = frame.steps.get(station), frame.view
    estimate = step.estimate if step is not None else None
    if estimate is not None:
        turn = rotation_matrix(estimate.yaw, estimate.pitch, estimate.roll)
        velocity = turn @ np.array([estimate.speed, 0.0, 0.0])
        return _Origin(estimate.position, turn, velocity, estimate.yaw_rate)
    if station not in view:
        return None
    row = view.row(station)
    turn = rotation_matrix(view.yaw[row], view.pitch[row], view.roll[row])
    return _Origin(view.position[row], turn, view.velocity[row], float(view.yaw_rate[row]))
