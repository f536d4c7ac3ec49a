"""The package of faulty extensions: one module, its entry points, and modules that cannot be imported."""

from __future__ import annotations

from pathlib import Path

from faulty_extensions.detectors import DETECTORS
from faulty_extensions.stations import STATIONS
from faulty_extensions.storyboard import STORYBOARD

HEAD = """import ctypes
import math
import os
import signal
import sys
import time

import numpy as np
from py_trees.common import Status

from eidrive_scenario.api.actions import ActionBehaviour, Condition
from eidrive_scenario.api.common import Diagnostic, SettingError
from eidrive_scenario.api.criteria import Criterion, CriterionSettings, Verdict
from eidrive_scenario.api.driving import Control, Plan, RoutePlanner, VehicleController
from eidrive_scenario.api.fusion import FusionMethod
from eidrive_scenario.api.perception import Detections, Detector, Sensor, SensorSettings, TrackingMethod
from eidrive_scenario.api.v2x import LinkChannel, ChannelProfile

AFTER = 0.5  # [s]: the faults begin later than the run
HELD = ctypes.create_string_buffer(64)  # a mutex that is never released
NATIVE = ctypes.PyDLL(None)  # native code that keeps the lock of the interpreter
NATIVE.pthread_mutex_lock(HELD)
"""
CODE = "\n".join([HEAD, DETECTORS, STATIONS, STORYBOARD])
"""The module `faulty`."""

POINTS = {
    "detectors": {
        "hangs": "Hangs",
        "swallows": "Swallows",
        "sleeps": "Sleeps",
        "hangs_in_c": "HangsInC",
        "hangs_in_c_later": "HangsInCLater",
        "deadlocks": "Deadlocks",
        "ends_process": "EndsProcess",
        "kills_process": "KillsProcess",
        "kills_process_when_built": "KillsProcessWhenBuilt",
        "hangs_when_built": "HangsWhenBuilt",
        "hangs_in_c_when_built": "HangsInCWhenBuilt",
        "exits": "Exits",
        "exits_when_built": "ExitsWhenBuilt",
        "wrong_settings": "WrongSettings",
        "raises": "Raises",
        "raises_in_numpy": "RaisesInNumpy",
        "returns_nan": "ReturnsNaN",
        "negative_size": "NegativeSize",
        "returns_none": "ReturnsNone",
        "wrong_shape": "WrongShape",
        "list_of_boxes": "ListOfBoxes",
        "yields": "Yields",
        "few_arguments": "FewArguments",
        "lacks": "Lacks",
        "no_detector": "NoDetector",
        "a_function": "a_function",
        "no_signals": "NoSignals",
    },
    "trackers": {"tracker_none": "TrackerNone"},
    "sensors": {"faulty_sensor": "FaultySensor"},
    "fusion": {
        "fusion_nan": "FusionNaN",
        "fusion_none": "FusionNone",
        "fusion_no_age": "FusionNoAge",
        "fusion_short_batch": "FusionShortBatch",
        "fusion_merges_none": "FusionMergesNone",
        "fusion_hear_raises": "FusionHearRaises",
    },
    "planners": {
        "planner_none": "PlannerNone",
        "planner_nan": "PlannerNaN",
        "planner_absurd": "PlannerAbsurd",
        "planner_one_point": "PlannerOnePoint",
        "planner_stands": "PlannerStands",
        "planner_static_raises": "PlannerStaticRaises",
        "planner_arguments": "PlannerArguments",
    },
    "vehicle_controllers": {
        "controller_none": "ControllerNone",
        "controller_nan": "ControllerNaN",
        "controller_text": "ControllerText",
    },
    "channels": {"faulty": "FaultyChannel"},
    "criteria": {"faulty": "FaultyCriterion", "plain_settings": "PlainSettingsCriterion"},
    "actions": {"faulty.action": "FaultyAction"},
    "conditions": {"faulty.condition": "FaultyCondition"},
}

BROKEN_MODULES = {
    "faulty_exits": "import sys\nsys.exit(0)\n",
    "faulty_syntax": "def (\n",
    "faulty_raises": "import math\nVALUE = 1 / 0\n",
    "faulty_import": "import no_such_module\n",
}
"""Modules that cannot be imported; each is registered as a detector under its module name."""


def install(folder: Path) -> Path:
    """Write the package with its metadata into a folder, which is then put on the path of modules."""
    (folder / "faulty.py").write_text(CODE)
    metadata = folder / "faulty-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: faulty\nVersion: 1.0\n")
    points = {kind: {name: f"faulty:{value}" for name, value in names.items()} for kind, names in POINTS.items()}
    for module, text in BROKEN_MODULES.items():
        (folder / f"{module}.py").write_text(text)
        points["detectors"][module] = f"{module}:Detector"
    lines = []
    for kind, names in points.items():
        lines += [f"[eidrive_scenario.{kind}]", *(f"{name} = {value}" for name, value in names.items())]
    (metadata / "entry_points.txt").write_text("\n".join(lines) + "\n")
    return folder


def line_of(text: str) -> int:
    """Return the number of the first line of the package's module that contains a text."""
    lines = CODE.splitlines()
    return next(number for number, line in enumerate(lines, 1) if text in line)
