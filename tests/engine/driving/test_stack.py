"""Runs with a driving stack other than that of this project."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from scenario_1 import ONE, FrameCollector

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.requests import Overrides
from eidrive_scenario.driving.stack import DrivingStack, EmptyStack, StackContext, StackInputs, StackSettings
from eidrive_scenario.driving.step import AgentStep
from eidrive_scenario.errors import InputError
from eidrive_scenario.simulation import RunSettings, run_file
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Control
from eidrive_scenario.world.view import WorldView


class ThrottleStack(DrivingStack):
    """Applies full throttle to the vehicles with a controller, and reports one lost message per tick."""

    def __init__(self, context: StackContext) -> None:
        self.context = context
        self.present: dict[str, ActorSpec] = {}
        self.inputs: list[StackInputs] = []

    def add(self, spec: ActorSpec) -> None:
        if spec.name in self.possible_drivers:
            self.present[spec.name] = spec

    def remove(self, name: str) -> None:
        self.present.pop(name, None)

    @property
    def possible_drivers(self) -> Sequence[str]:
        return [name for name, assigned in self.context.scenario.controllers.items() if assigned and name != "RSU"]

    @property
    def drivers(self) -> frozenset[str]:
        return frozenset(self.present)

    def act(self, world: World, view: WorldView, inputs: StackInputs) -> dict[str, AgentStep]:
        self.inputs.append(inputs)
        none = Detections(view.time)
        return {name: AgentStep(none, (), none, None, Control(1.0, 0.0, 0.0), ()) for name in self.present}

    def controls(
        self, steps: Mapping[str, AgentStep], overrides: Mapping[str, Overrides] | None = None
    ) -> dict[str, Control]:
        return {name: step.control for name, step in steps.items() if step.control is not None}

    def send(self, steps: Mapping[str, AgentStep], now: float) -> Sequence[LinkEvent]:
        return (LinkEvent("Ego", "RSU", 0, now, "lost", None, "loss", 100),)

    def metrics(self, now: float) -> dict[str, float]:
        return {"throttle.seconds": now}

    def resolved_settings(self) -> StackSettings:
        return StackSettings(stations={name: {"stack": "throttle"} for name in self.possible_drivers})


def test_other_stack_drives_the_vehicles_of_a_library_scenario() -> None:
    """Full throttle from rest: after t the speed is a t, less rolling resistance and drag."""
    kept, stacks = FrameCollector(), []

    def build(context: StackContext) -> ThrottleStack:
        stacks.append(ThrottleStack(context))
        return stacks[-1]

    result = run_file(ONE, settings=RunSettings(time_limit=2.0), observers=[kept], stack=build)
    last = kept.frames[-1].view
    speed, limit = float(last.states[last.row("Ego")].speed), stacks[0].present["Ego"].max_acceleration * last.time
    assert 0.85 * limit < speed <= limit
    assert result.metrics["throttle.seconds"] == kept.frames[-1].view.time
    assert result.settings.stations == {"Ego": {"stack": "throttle"}}
    assert (result.channel, result.links) == ("none", {})


def test_events_of_other_stack_are_in_the_next_frame() -> None:
    kept = FrameCollector()
    run_file(ONE, settings=RunSettings(time_limit=0.3), observers=[kept], stack=ThrottleStack)
    assert kept.frames[0].links == ()
    for before, after in zip(kept.frames, kept.frames[1:], strict=False):
        assert [event.sent for event in after.links] == [before.view.time]


SPEED = (
    "<PrivateAction><LongitudinalAction><SpeedAction>"
    '<SpeedActionDynamics dynamicsShape="step" value="0" dynamicsDimension="time"/>'
    '<SpeedActionTarget><AbsoluteTargetSpeed value="7"/></SpeedActionTarget>'
    "</SpeedAction></LongitudinalAction></PrivateAction></Private>"
)


def test_stack_receives_goals_of_the_scenario_as_inputs(tmp_path: Path) -> None:
    """A SpeedAction in Init requests its speed from the first step on."""
    stacks = []

    def build(context: StackContext) -> ThrottleStack:
        stacks.append(ThrottleStack(context))
        return stacks[-1]

    text = ONE.read_text().replace('"../', f'"{ONE.parent.parent}/')
    start = text.index('<Private entityRef="Ego">')
    path = tmp_path / "speed.xosc"
    path.write_text(text[:start] + text[start:].replace("</Private>", SPEED, 1))
    run_file(path, settings=RunSettings(time_limit=0.3), stack=build)
    assert stacks[0].inputs[0].goals["Ego"].speed == 7.0


def without_controllers(folder: Path) -> Path:
    """Return scenario 1 in which no actor has a controller of this project."""
    text = re.sub(r"<ObjectController>.*?</ObjectController>", "", ONE.read_text(), flags=re.DOTALL)
    text = re.sub(r"<ControllerAction>.*?</ControllerAction>", "", text, flags=re.DOTALL)
    path = folder / "scripted.xosc"
    path.write_text(text.replace('"../', f'"{ONE.parent.parent}/'))
    return path


def test_scenario_without_stations_runs_without_a_stack(tmp_path: Path) -> None:
    path = without_controllers(tmp_path)
    settings = RunSettings(channel="none", time_limit=6.0)
    usual, empty = run_file(path, settings=settings), run_file(path, settings=settings, stack=EmptyStack)
    assert empty.trace_hash == usual.trace_hash
    assert empty.simulated_s == usual.simulated_s
    assert empty.settings.stations == {}


def test_channel_command_without_a_channel_is_a_warning(tmp_path: Path) -> None:
    result = run_file(ONE, settings=RunSettings(time_limit=0.3), stack=EmptyStack)
    assert any("the driving stack has no channel" in warning for warning in result.warnings)


@pytest.mark.parametrize(
    ("stack", "expected"),
    [(None, "a factory is expected (got None)"), (lambda context: 5, "returned no DrivingStack (got 5)")],
)
def test_invalid_stack_is_a_setting_error(stack: Any, expected: str) -> None:
    with pytest.raises(InputError, match=re.escape(expected)):
        run_file(ONE, stack=stack)
