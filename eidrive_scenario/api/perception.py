"""Sensors and their readings, detectors and their detections, trackers.

Stable: all names except `lift` and `MapContext`, which may change with a minor version.
"""

from eidrive_scenario.base.detections import CLASSES as CLASSES
from eidrive_scenario.base.detections import Detections as Detections
from eidrive_scenario.base.feature_map import FeatureMap as FeatureMap
from eidrive_scenario.perception.detector import Detector as Detector
from eidrive_scenario.perception.detector import DetectorContext as DetectorContext
from eidrive_scenario.perception.geometry.map_context import MapContext as MapContext
from eidrive_scenario.perception.lifting.lifting import lift as lift
from eidrive_scenario.perception.localization import PoseNoise as PoseNoise
from eidrive_scenario.perception.tracking.method import TrackerKind as TrackerKind
from eidrive_scenario.perception.tracking.method import TrackingMethod as TrackingMethod
from eidrive_scenario.perception.tracking.uncertain_pose import PoseUncertainty as PoseUncertainty
from eidrive_scenario.sensing.camera import ImageSensor as ImageSensor
from eidrive_scenario.sensing.readings import CameraReading as CameraReading
from eidrive_scenario.sensing.readings import EgoState as EgoState
from eidrive_scenario.sensing.readings import LidarReading as LidarReading
from eidrive_scenario.sensing.readings import Readings as Readings
from eidrive_scenario.sensing.readings import SignalReading as SignalReading
from eidrive_scenario.sensing.sensor import Scene as Scene
from eidrive_scenario.sensing.sensor import Sensor as Sensor
from eidrive_scenario.sensing.settings import CameraSettings as CameraSettings
from eidrive_scenario.sensing.settings import SensorSettings as SensorSettings
from eidrive_scenario.world.view import WorldView as WorldView
