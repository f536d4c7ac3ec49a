"""Fusion methods: own detections and received reports to one object list.

Stable: all names.
"""

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.fusion.average import AverageFusion
from eidrive_scenario.fusion.covariance_intersection import CovarianceIntersectionFusion
from eidrive_scenario.fusion.method import FusionMethod, Report

__all__ = [
    "AverageFusion",
    "CovarianceIntersectionFusion",
    "Detections",
    "FusionMethod",
    "Report",
]
