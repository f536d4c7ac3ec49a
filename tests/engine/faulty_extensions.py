"""A package of faulty extensions in a temporary folder, as a third party would install it."""

from __future__ import annotations

from pathlib import Path

CODE = '''
import ctypes
import itertools
import math
import os
import sys
import time

import numpy as np
from py_trees.common import Status

from eidrive_scenario.api import (
    ActionBehaviour, Condition, Criterion, CriterionSettings, Detections, Detector, FusionMethod, LinkChannel,
    ChannelProfile, Plan, Problem, RoutePlanner, SettingError, Verdict,
)

AFTER = 0.5  # [s]: the faults begin later than the run


class Hangs(Detector):
    def detect(self, readings):
        while readings.time >= AFTER:
            pass
        return Detections(readings.time)


class Swallows(Detector):
    """Catches what interrupts it once, as careless code does."""

    def detect(self, readings):
        try:
            while readings.time >= AFTER:
                pass
        except BaseException:
            pass
        while readings.time >= AFTER:
            pass
        return Detections(readings.time)


class Sleeps(Detector):
    def detect(self, readings):
        time.sleep(3600.0)


class HangsInC(Detector):
    """Never returns to the interpreter, and holds its lock."""

    def detect(self, readings):
        if readings.time >= AFTER:
            sum(itertools.repeat(0))
        return Detections(readings.time)


class Deadlocks(Detector):
    """Waits in native code for a lock that it holds, without the lock of the interpreter; signals do not end that."""

    def detect(self, readings):
        if readings.time >= AFTER:
            library, mutex = ctypes.CDLL(None), ctypes.create_string_buffer(64)
            for _ in range(2):
                library.pthread_mutex_lock(mutex)
        return Detections(readings.time)


class EndsProcess(Detector):
    def detect(self, readings):
        os._exit(0)


class HangsWhenBuilt(Detector):
    def __init__(self):
        while True:
            pass

    def detect(self, readings):
        return Detections(readings.time)


class Exits(Detector):
    def detect(self, readings):
        if readings.time >= AFTER:
            sys.exit(0)
        return Detections(readings.time)


class ExitsWhenBuilt(Detector):
    def __init__(self):
        sys.exit(0)

    def detect(self, readings):
        return Detections(readings.time)


class WrongSettings(Detector):
    def __init__(self):
        raise SettingError(Problem("no weights", "give weights"))

    def detect(self, readings):
        return Detections(readings.time)


class Raises(Detector):
    def detect(self, readings):
        return self.helper(readings)

    def helper(self, readings):
        raise KeyError("no such camera")


class RaisesInNumpy(Detector):
    def detect(self, readings):
        np.linalg.inv(np.zeros((2, 2)))


class ReturnsNaN(Detector):
    def detect(self, readings):
        boxes = np.array([[30.0, 0.0, 0.75, math.nan, 1.8, 1.5, 0.0]])
        return Detections(readings.time, boxes, np.ones(1), ("car",), np.zeros((1, 2)), np.zeros((1, 2, 2)))


class ReturnsNone(Detector):
    def detect(self, readings):
        return None


class WrongShape(Detector):
    def detect(self, readings):
        return Detections(readings.time, np.zeros((1, 6)), np.ones(1), ("car",))


class ListOfBoxes(Detector):
    def detect(self, readings):
        return [[30.0, 0.0, 0.75, 4.5, 1.8, 1.5, 0.0]]


class Yields(Detector):
    def detect(self, readings):
        yield Detections(readings.time)


class FewArguments(Detector):
    def detect(self):
        return Detections(0.0)


class Lacks(Detector):
    pass


class NoDetector:
    def detect(self, readings):
        return Detections(readings.time)


def a_function(readings):
    return Detections(readings.time)


class NoSignals(Detector):
    sees_signals = frozenset({"light"})

    def detect(self, readings):
        return Detections(readings.time)

    def signals(self):
        return None


class FusionNaN(FusionMethod):
    def fuse(self, reports, now):
        return Detections(now, np.full((1, 7), math.inf), np.ones(1), ("car",), np.zeros((1, 2)), np.zeros((1, 2, 2)))


class FusionNone(FusionMethod):
    def fuse(self, reports, now):
        pass


class FusionHearRaises(FusionMethod):
    def hear(self, report):
        raise ZeroDivisionError("division by zero")

    def fuse(self, reports, now):
        return Detections(now)


class PlannerNone(RoutePlanner):
    def plan(self, ego, objects, goal, now):
        return None


class PlannerNaN(RoutePlanner):
    def plan(self, ego, objects, goal, now):
        plan = super().plan(ego, objects, goal, now)
        return Plan(plan.points, plan.speeds * math.nan, "undefined")


class PlannerOnePoint(RoutePlanner):
    def plan(self, ego, objects, goal, now):
        plan = super().plan(ego, objects, goal, now)
        return Plan(plan.points[:1], plan.speeds[:1], "short")


class PlannerStands(RoutePlanner):
    def plan(self, ego, objects, goal, now):
        plan = super().plan(ego, objects, goal, now)
        return Plan(np.repeat(plan.points[:1], 5, axis=0), plan.speeds[:5], "the same point")


class PlannerStaticRaises(RoutePlanner):
    @staticmethod
    def plan(ego, objects, goal, now):
        raise RuntimeError("from a static method")


class PlannerArguments(RoutePlanner):
    def __init__(self, settings):
        pass


class FaultyProfile(ChannelProfile):
    fault: str = "none"


class FaultyChannel(LinkChannel):
    settings = FaultyProfile

    def __init__(self, profile, seed):
        super().__init__()
        self.profile = profile

    def fate(self, message, receiver, now):
        match self.profile.fault:
            case "nan":
                return math.nan
            case "inf":
                return math.inf
            case "none":
                return None
            case "raises":
                raise OSError("no radio")
        return 0.1

    def interval(self, station):
        return math.nan if self.profile.fault == "interval" else 0.0

    def deliver(self, receiver, now):
        return None if self.profile.fault == "deliver" else super().deliver(receiver, now)


class FaultySettings(CriterionSettings):
    fault: str


class FaultyCriterion(Criterion):
    settings_type = FaultySettings
    name = "faulty"

    def __init__(self, settings):
        super().__init__(settings)
        self.fault = settings.fault
        if self.fault == "built":
            raise RuntimeError("not built")

    def observe(self, frame):
        if self.fault == "observe" and frame.view.time >= AFTER:
            raise RuntimeError("this criterion fails to observe")

    def verdict(self):
        match self.fault:
            case "none":
                return None
            case "nan":
                return Verdict(self.name, math.nan, None, None, "", None, "undefined")
            case "value":
                return Verdict(self.name, True, math.nan, None, "", None, "undefined")
            case "verdict":
                raise ValueError("no verdict")
        return Verdict(self.name, True, None, None, "", None, "fine")

    def metrics(self):
        return None if self.fault == "metrics" else {}


class FaultyAction(ActionBehaviour):
    def update(self):
        match self.action.content:
            case "none":
                return None
            case "nan":
                self.stage.actors[next(iter(self.stage.actors))].motion.speed = math.nan
            case "raises":
                raise LookupError("no such action")
            case "fails below 5" if self.stage.actors["Ego"].motion.speed < 4.9:
                raise ValueError("too slow")
        return Status.SUCCESS


class FaultyCondition(Condition):
    def holds(self, stage):
        match self.element.value:
            case "none":
                return None
            case "nan":
                return math.nan
            case "raises":
                raise ArithmeticError("undefined")
        return False

    def explain(self, stage):
        return "faulty"
'''

POINTS = {
    "detectors": {
        "hangs": "Hangs",
        "swallows": "Swallows",
        "sleeps": "Sleeps",
        "hangs_in_c": "HangsInC",
        "deadlocks": "Deadlocks",
        "ends_process": "EndsProcess",
        "hangs_when_built": "HangsWhenBuilt",
        "exits": "Exits",
        "exits_when_built": "ExitsWhenBuilt",
        "wrong_settings": "WrongSettings",
        "raises": "Raises",
        "raises_in_numpy": "RaisesInNumpy",
        "returns_nan": "ReturnsNaN",
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
    "fusion": {
        "fusion_nan": "FusionNaN",
        "fusion_none": "FusionNone",
        "fusion_hear_raises": "FusionHearRaises",
    },
    "planners": {
        "planner_none": "PlannerNone",
        "planner_nan": "PlannerNaN",
        "planner_one_point": "PlannerOnePoint",
        "planner_stands": "PlannerStands",
        "planner_static_raises": "PlannerStaticRaises",
        "planner_arguments": "PlannerArguments",
    },
    "channels": {"faulty": "FaultyChannel"},
    "criteria": {"faulty": "FaultyCriterion"},
    "actions": {"faulty.action": "FaultyAction"},
    "conditions": {"faulty.condition": "FaultyCondition"},
}

BROKEN_MODULES = {
    "faulty_exits": "import sys\nsys.exit(0)\n",
    "faulty_syntax": "def (\n",
    "faulty_raises": "import math\nVALUE = 1 / 0\n",
    "faulty_import": "import no_such_module\n",
}
"""Modules that cannot be imported; each is registered as a detector of its own name."""


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


SCENARIO = """<?xml version="1.0"?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="2" date="2026-01-01T00:00:00" description="two stations on a plane" author=""/>
  <CatalogLocations/>
  <RoadNetwork/>
  <Entities>
    <ScenarioObject name="Ego">{vehicle}
      <ObjectController><Controller name="EgoStation"><Properties>
        <Property name="module" value="eidrive"/>
        <Property name="detector" value="{detector}"/>
        <Property name="fusion" value="{fusion}"/>
        <Property name="planner" value="{planner}"/>
        <Property name="obey_signals" value="{signals}"/>
      </Properties></Controller></ObjectController>
    </ScenarioObject>
    <ScenarioObject name="Other">{vehicle}
      <ObjectController><Controller name="OtherStation"><Properties>
        <Property name="module" value="eidrive"/>
        <Property name="detector" value="oracle"/>
      </Properties></Controller></ObjectController>
    </ScenarioObject>
  </Entities>
  <Storyboard>
    <Init><Actions>
      <UserDefinedAction>
        <CustomCommandAction type="eidrive.criterion">{criterion}</CustomCommandAction></UserDefinedAction>
      <Private entityRef="Ego">{start_0}</Private>
      <Private entityRef="Other">{start_20}</Private>
    </Actions></Init>
    <Story name="story"><Act name="act">
      <ManeuverGroup name="group" maximumExecutionCount="1"><Actors selectTriggeringEntities="false">
        <EntityRef entityRef="Ego"/></Actors>
        <Maneuver name="maneuver"><Event name="event" priority="parallel">
          <Action name="action"><UserDefinedAction>
            <CustomCommandAction type="faulty.action">{action}</CustomCommandAction></UserDefinedAction></Action>
          <StartTrigger><ConditionGroup><Condition name="later" delay="0" conditionEdge="none"><ByValueCondition>
            <SimulationTimeCondition value="0.5" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup>
          </StartTrigger></Event></Maneuver>
      </ManeuverGroup>
      <StartTrigger><ConditionGroup><Condition name="at once" delay="0" conditionEdge="none"><ByValueCondition>
        <SimulationTimeCondition value="0" rule="greaterOrEqual"/></ByValueCondition></Condition></ConditionGroup>
      </StartTrigger></Act></Story>
    <StopTrigger>
      <ConditionGroup><Condition name="faulty" delay="0" conditionEdge="none"><ByValueCondition>
        <UserDefinedValueCondition name="faulty.condition" value="{condition}" rule="equalTo"/></ByValueCondition>
      </Condition></ConditionGroup>
      <ConditionGroup><Condition name="end" delay="0" conditionEdge="none"><ByValueCondition>
        <SimulationTimeCondition value="1" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup>
    </StopTrigger>
  </Storyboard>
</OpenSCENARIO>
"""
_VEHICLE = """<Vehicle name="car" vehicleCategory="car"><BoundingBox>
      <Center x="1.4" y="0" z="0.75"/><Dimensions width="1.8" length="4.5" height="1.5"/></BoundingBox>
      <Performance maxSpeed="60" maxAcceleration="5" maxDeceleration="9"/><Axles>
      <FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.6" positionX="2.8" positionZ="0.3"/>
      <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.6" positionX="0" positionZ="0.3"/></Axles>
      <Properties/></Vehicle>"""
_START = """<PrivateAction><TeleportAction><Position><WorldPosition x="{0}" y="{0}" h="0"/></Position></TeleportAction>
      </PrivateAction><PrivateAction><LongitudinalAction><SpeedAction>
      <SpeedActionDynamics dynamicsShape="step" value="0" dynamicsDimension="time"/>
      <SpeedActionTarget><AbsoluteTargetSpeed value="5"/></SpeedActionTarget></SpeedAction></LongitudinalAction>
      </PrivateAction><PrivateAction><ControllerAction><ActivateControllerAction lateral="true" longitudinal="true"/>
      </ControllerAction></PrivateAction>"""


def write_scenario(
    path: Path,
    *,
    detector: str = "oracle",
    fusion: str = "average",
    planner: str = "route",
    criterion: str = "collision: {of: Ego}",
    action: str = "sound",
    condition: str = "sound",
    signals: bool = False,
) -> Path:
    """Write a scenario of 1 s with the extensions of the ego, a criterion and an event after 0.5 s."""
    blocks = {
        "vehicle": _VEHICLE,
        "start_0": _START.format(0),
        "start_20": _START.format(20),
        "detector": detector,
        "fusion": fusion,
        "planner": planner,
        "criterion": criterion,
        "action": action,
        "condition": condition,
        "signals": str(signals).lower(),
    }
    text = SCENARIO
    for name, block in blocks.items():
        text = text.replace(f"{{{name}}}", block)
    path.write_text(text)
    return path
