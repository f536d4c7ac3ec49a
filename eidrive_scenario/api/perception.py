"""Detectors, the sensor readings that they get, and the detections that they return.

Stable: all names except `lift` and `MapContext`, which may change with a minor version.
"""

from eidrive_scenario.detections import CLASSES, Detections
from eidrive_scenario.perception.detector import Detector, DetectorContext
from eidrive_scenario.perception.geometry.map_context import MapContext
from eidrive_scenario.perception.lifting.lifting import lift
from eidrive_scenario.sensing.readings import CameraReading, EgoState, LidarReading, Readings, SignalReading

__all__ = [
    "CLASSES",
    "CameraReading",
    "Detections",
    "Detector",
    "DetectorContext",
    "EgoState",
    "LidarReading",
    "MapContext",
    "Readings",
    "SignalReading",
    "lift",
]
