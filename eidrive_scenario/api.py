"""The surface that extensions may import: behaviors, criteria, and third-party packages. The engine never does."""

from __future__ import annotations

from eidrive_scenario.geometry import box_distance
from eidrive_scenario.recording.criterion import Criterion, CriterionSettings, Verdict, judge, never_appeared
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.settings import Settings
from eidrive_scenario.world.view import Contact, WorldView

__all__ = [
    "Contact",
    "Criterion",
    "CriterionSettings",
    "Frame",
    "Settings",
    "Verdict",
    "WorldView",
    "box_distance",
    "judge",
    "never_appeared",
]
