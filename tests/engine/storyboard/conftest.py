"""Runtime context without roads and with two cars; scripted conditions and actions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from py_trees.common import Status

from eidrive_scenario.openscenario import load_scenario, model
from eidrive_scenario.registry import Registry
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.context.behaviour import ActionBehaviour
from eidrive_scenario.storyboard.context.condition import Condition
from eidrive_scenario.storyboard.context.protocols import ConditionContext
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.state.domains import Domain
from eidrive_scenario.storyboard.storyboard import Storyboard
from eidrive_scenario.world.view import WorldView

CAR = """<ScenarioObject name="{name}"><Vehicle name="{name}" vehicleCategory="car">
  <BoundingBox><Center x="1.5" y="0" z="0.75"/><Dimensions width="2" length="5" height="1.5"/></BoundingBox>
  <Performance maxSpeed="70" maxAcceleration="10" maxDeceleration="10"/>
  <Axles><FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.8" positionX="3" positionZ="0.3"/>
  <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.8" positionX="0" positionZ="0.3"/></Axles>
  <Properties/></Vehicle></ScenarioObject>"""

SCENARIO = """<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="3" date="2024-01-01T00:00:00" description="two cars" author="test"/>
  <CatalogLocations/><RoadNetwork/>
  <Entities>{cars}</Entities>
  <Storyboard><Init><Actions/></Init><StopTrigger/></Storyboard></OpenSCENARIO>"""

ROAD = """<OpenDRIVE><header revMajor="1" revMinor="6"/>
  <road name="street" length="{length}" id="1" junction="-1"><link/>
    <planView><geometry s="0" x="0" y="0" hdg="0" length="{length}">{shape}</geometry></planView>
    <lanes><laneSection s="0">
      <left><lane id="1" type="driving" level="false"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></left>
      <center><lane id="0" type="none" level="false"/></center>
      <right>
        <lane id="-1" type="driving" level="false"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane>
        <lane id="-2" type="driving" level="false"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane>
      </right></laneSection></lanes></road></OpenDRIVE>"""


def empty_view(time: float = 0.0, tick: int = 0) -> WorldView:
    """Return a view without actors."""
    none, points = np.empty(0), np.empty((0, 3))
    return WorldView(time, tick, (), (), points, none, none, none, points, points, none, none, points, points)


class Clock:
    """Clock that steps a runtime context without a world."""

    def __init__(self, context: RuntimeContext, dt: float) -> None:
        self.context, self.dt, self.tick = context, dt, -1

    def step(self) -> RuntimeContext:
        """Start the next tick."""
        self.tick += 1
        self.context.begin_tick(replace(self.context.view, time=self.tick * self.dt, tick=self.tick), self.dt)
        return self.context


class Script(Condition):
    """Condition with a list of values, one per evaluation; the last value is repeated."""

    def __init__(self, values: Sequence[bool]) -> None:
        super().__init__(model.SimulationTimeCondition(rule=model.Rule.EQUAL_TO, value=0.0))
        self.values, self.asked = list(values), 0

    def holds(self, context: ConditionContext) -> bool:
        value = self.values[min(self.asked, len(self.values) - 1)]
        self.asked += 1
        return value

    def explain(self, context: ConditionContext) -> str:
        return f"value {self.asked} at {context.time:g} s"


class Task(ActionBehaviour):
    """Action that takes a number of ticks."""

    def __init__(
        self, context: RuntimeContext, ticks: int, *, actor: str | None = None, domain: Domain = Domain.NONE
    ) -> None:
        super().__init__(model.VisibilityAction(graphics=True, sensors=True, traffic=True), context, actor=actor)
        self.ticks, self.starts, self._domain = ticks, 0, domain

    @property
    def controls(self) -> Domain:
        return self._domain

    @property
    def is_actor_missing(self) -> bool:
        """False, as elements are tested without placed actors."""
        return False

    def initialise(self) -> None:
        self.starts += 1
        self._left = self.ticks

    def update(self) -> Status:
        self._left -= 1
        return Status.SUCCESS if self._left <= 0 else Status.RUNNING


class Setting(Task):
    """Action that sets a value and ends at its start."""

    immediate = True


@pytest.fixture
def context() -> RuntimeContext:
    """Runtime context with cars A and B, without roads."""
    cars = "".join(CAR.format(name=name) for name in "AB")
    scenario = load_scenario(SCENARIO.format(cars=cars).encode())
    return RuntimeContext(scenario, None, dt=0.1, seed=0, empty_view=empty_view(tick=-1))


@pytest.fixture
def clock(context: RuntimeContext) -> Clock:
    """Clock with steps of 0.1 s."""
    return Clock(context, 0.1)


@pytest.fixture
def script() -> Callable[[Sequence[bool]], Script]:
    """Constructor of scripted conditions."""
    return Script


@pytest.fixture
def task(context: RuntimeContext) -> Callable[..., Task]:
    """Constructor of actions."""
    return lambda ticks, **more: Task(context, ticks, **more)


@pytest.fixture
def setting(context: RuntimeContext) -> Callable[[], Setting]:
    """Constructor of actions that take no time."""
    return lambda: Setting(context, 1)


@pytest.fixture
def fresh() -> Callable[[], tuple[RuntimeContext, Clock, type[Script], Callable[..., Task]]]:
    """Constructor of a context, its clock, conditions and actions, called for each example of a property."""
    scenario = load_scenario(SCENARIO.format(cars="".join(CAR.format(name=name) for name in "AB")).encode())

    def made() -> tuple[RuntimeContext, Clock, type[Script], Callable[..., Task]]:
        context = RuntimeContext(scenario, None, dt=0.1, seed=0, empty_view=empty_view(tick=-1))
        return context, Clock(context, 0.1), Script, lambda ticks, **more: Task(context, ticks, **more)

    return made


@pytest.fixture
def street() -> RoadNetwork:
    """Straight road along x, 200 m: lane 1 (y = 2, towards -x), lanes -1 (y = -2) and -2 (y = -6, towards +x)."""
    return RoadNetwork.parse(ROAD.format(length=200, shape="<line/>"))


@pytest.fixture
def bend() -> RoadNetwork:
    """Road with the same lanes in a left bend of radius 50 m, a quarter circle."""
    return RoadNetwork.parse(ROAD.format(length=78.5398163397, shape='<arc curvature="0.02"/>'))


ACT = """<Story name="story"><Act name="act"><ManeuverGroup name="group" maximumExecutionCount="1">
  <Actors selectTriggeringEntities="false"><EntityRef entityRef="A"/></Actors>
  <Maneuver name="maneuver">{events}</Maneuver></ManeuverGroup></Act></Story>"""


@pytest.fixture
def build() -> Callable[..., Storyboard]:
    """Constructor of a storyboard with cars A and B: Init actions and events of A, stop trigger, global actions."""

    def made(
        init: str,
        events: str = "",
        stop: str = "<StopTrigger/>",
        global_actions: str = "",
        registered: Registry | None = None,
        declared: str = "",
    ) -> Storyboard:
        text = SCENARIO.format(cars="".join(CAR.format(name=name) for name in "AB"))
        actions = f'<Actions>{global_actions}<Private entityRef="A">{init}</Private></Actions>'
        stories = ACT.format(events=events) if events else ""
        text = text.replace("<CatalogLocations/>", declared + "<CatalogLocations/>")
        text = text.replace("<Actions/>", actions).replace("<StopTrigger/>", stories + stop)
        return Storyboard(load_scenario(text.encode()), None, dt=0.1, actions=registered)

    return made
