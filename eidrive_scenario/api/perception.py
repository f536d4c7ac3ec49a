"""Sensors and their readings, detectors and their detections, trackers.

Stable: all names except `lift` and `MapContext`, which may change with a minor version.
"""

from eidrive_scenario.base.detections import CLASSES, Detections
from eidrive_scenario.perception.detector import Detector, DetectorContext
from eidrive_scenario.perception.geometry.map_context import MapContext
from eidrive_scenario.perception.lifting.lifting import lift
from eidrive_scenario.perception.localization import PoseNoise
from eidrive_scenario.perception.tracking.method import TrackerKind, TrackingMethod
from eidrive_scenario.perception.tracking.uncertain_pose import PoseUncertainty
from eidrive_scenario.sensing.camera import ImageSensor
from eidrive_scenario.sensing.readings import CameraReading, EgoState, LidarReading, Readings, SignalReading
from eidrive_scenario.sensing.sensor import Scene, Sensor
from eidrive_scenario.sensing.settings import CameraSettings, SensorSettings
from eidrive_scenario.world.view import WorldView

__all__ = [
    "CLASSES",
    "CameraReading",
    "CameraSettings",
    "Detections",
    "Detector",
    "DetectorContext",
    "EgoState",
    "ImageSensor",
    "LidarReading",
    "MapContext",
    "PoseNoise",
    "PoseUncertainty",
    "Readings",
    "Scene",
    "Sensor",
    "SensorSettings",
    "SignalReading",
    "TrackerKind",
    "TrackingMethod",
    "WorldView",
    "lift",
]
