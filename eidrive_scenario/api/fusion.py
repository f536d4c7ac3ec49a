"""Fusion methods: own detections and received reports to one object list.

Stable: all names except `IntermediateFusion` and its settings, which may change with a minor version.
"""

from eidrive_scenario.base.detections import Detections as Detections
from eidrive_scenario.fusion.average import AverageFusion as AverageFusion
from eidrive_scenario.fusion.covariance_intersection import CovarianceIntersectionFusion as CovarianceIntersectionFusion
from eidrive_scenario.fusion.intermediate import IntermediateFusion as IntermediateFusion
from eidrive_scenario.fusion.intermediate import IntermediateFusionSettings as IntermediateFusionSettings
from eidrive_scenario.fusion.method import FusionMethod as FusionMethod
from eidrive_scenario.fusion.method import Report as Report
from eidrive_scenario.fusion.pose_alignment import PoseAlignment as PoseAlignment
from eidrive_scenario.fusion.pose_alignment import align_pose as align_pose
