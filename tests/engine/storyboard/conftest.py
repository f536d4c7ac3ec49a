"""Runtime context without roads and with two cars; scripted conditions and actions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import pytest
from msgspec.structs import replace
from opendrive_xml import lanes_xml, map_xml, road_xml
from openscenario_xml import round_car_xml, scenario_xml
from py_trees.common import Status
from storyboard_xml import act_xml, acts_xml, group_xml, init_xml, maneuver_xml

from eidrive_scenario.extensions.registry import Registry
from eidrive_scenario.openscenario import load_scenario, model
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.context.behaviour import ActionBehaviour
from eidrive_scenario.storyboard.context.condition import Condition
from eidrive_scenario.storyboard.context.contexts import ConditionContext
from eidrive_scenario.storyboard.context.runtime_context import RuntimeContext
from eidrive_scenario.storyboard.state.element_states import Domain
from eidrive_scenario.storyboard.storyboard import Storyboard

CARS = round_car_xml("A") + round_car_xml("B")


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
    scenario = load_scenario(scenario_xml(entities=CARS))
    return RuntimeContext(scenario, None, dt=0.1, seed=0)


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
    scenario = load_scenario(scenario_xml(entities=CARS))

    def made() -> tuple[RuntimeContext, Clock, type[Script], Callable[..., Task]]:
        context = RuntimeContext(scenario, None, dt=0.1, seed=0)
        return context, Clock(context, 0.1), Script, lambda ticks, **more: Task(context, ticks, **more)

    return made


@pytest.fixture
def street() -> RoadNetwork:
    """Straight road along x, 200 m: lane 1 (y = 2, towards -x), lanes -1 (y = -2) and -2 (y = -6, towards +x)."""
    return RoadNetwork.parse(map_xml(road_xml(length=200.0, lanes=lanes_xml(1, 2, 4))))


@pytest.fixture
def bend() -> RoadNetwork:
    """Road with the same lanes in a left bend of radius 50 m, a quarter circle."""
    return RoadNetwork.parse(map_xml(road_xml(length=25 * math.pi, curvature=0.02, lanes=lanes_xml(1, 2, 4))))


@pytest.fixture
def build() -> Callable[..., Storyboard]:
    """Constructor of a storyboard with cars A and B: Init actions and events of A, or a story; the condition groups of
    the stop trigger.
    """

    def made(
        init: str,
        events: str = "",
        stop: str = "",
        global_actions: str = "",
        registered: Registry | None = None,
        declared: str = "",
        story: str = "",
    ) -> Storyboard:
        text = scenario_xml(
            declarations=declared,
            entities=CARS,
            init=global_actions + init_xml("A", init),
            story=acts_xml(act_xml(group_xml(maneuver_xml(events), "A"))) if events else story,
            stop=stop,
        )
        return Storyboard(load_scenario(text), None, dt=0.1, actions=registered)

    return made
