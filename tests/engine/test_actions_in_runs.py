"""Decisions for stations from outside, between both halves of a tick."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from lone_car import lone_car
from written_recording import detected

from eidrive_scenario.driving.stack import EmptyStack
from eidrive_scenario.driving.step import StationAction
from eidrive_scenario.errors import SettingError, SimulationError
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunResult, RunSettings, Simulation, run_file
from eidrive_scenario.simulation.tick import TickStart
from eidrive_scenario.world.actor import Control

ONE = "coop/scenario_1"
Decide = Callable[[TickStart], StationAction | None]


def controlled(
    decide: Decide, settings: RunSettings, station: str = "Ego", source: str | bytes = ONE
) -> tuple[RunResult, list[Frame]]:
    """Run a scenario with the actions of a function for one station."""
    frames: list[Frame] = []
    with Simulation(source, settings=settings) as simulation:
        end = None
        while end is None:
            action = decide(simulation.begin_tick())
            if action is not None:
                simulation.set_action(station, action)
            frame, end = simulation.tick()
            frames.append(frame)
        return simulation.result(), frames


@pytest.mark.process
@pytest.mark.parametrize("source", [ONE, "coop/scenario_5", "coop/scenario_8", "corner_cases/jammer"])
def test_run_in_half_ticks_is_that_of_whole_ticks(source: str) -> None:
    settings = RunSettings(time_limit=6.0)
    halves, _ = controlled(lambda start: None, settings, source=source)
    assert halves.trace_hash == run_file(source, settings=settings).trace_hash


@pytest.mark.parametrize("speed", [0.0, 5.0, 9.5])
def test_target_speed_action_equals_setting_of_same_speed(speed: float) -> None:
    by_setting = run_file(lone_car(target_speed=speed))
    by_action, frames = controlled(
        lambda start: StationAction(target_speed=speed), RunSettings(), source=lone_car(target_speed=3.0)
    )
    assert by_action.trace_hash == by_setting.trace_hash
    assert float(frames[-1].view.speed[0]) == pytest.approx(speed, abs=0.05)


def test_pedal_actions_accelerate_and_brake_by_their_share_of_the_limits() -> None:
    throttle, brake = StationAction(control=Control(0.3, 0.0, 0.0)), StationAction(control=Control(0.0, 0.5, 0.0))
    _, frames = controlled(
        lambda start: throttle if start.view.tick < 20 else brake, RunSettings(), source=lone_car(1.5)
    )
    # Limits of the car: 10 m/s². For 1 s it accelerates by 3 m/s², then it brakes by 5 m/s². Air drag and rolling
    # resistance take at most 0.2 m/s².
    speed = [float(frame.view.speed[0]) for frame in frames]
    assert speed[20] == pytest.approx(3.0, abs=0.2)
    assert speed[20] - speed[28] == pytest.approx(2.0, abs=0.1)
    assert float(frames[-1].view.position[0, 1] - frames[0].view.position[0, 1]) == pytest.approx(0.0, abs=1e-9)
    assert frames[3].steps["Ego"].control == throttle.control


def test_perceptions_of_a_begun_tick_are_those_of_its_step() -> None:
    with Simulation(ONE) as simulation:
        for _ in range(40):
            start = simulation.begin_tick()
            assert simulation.begin_tick() is start
            frame, _ = simulation.tick()
            assert frame.view is start.view
            for name, step in frame.steps.items():
                perceived = start.perceived[name]
                assert (step.fused, step.detections, step.inbox) == (
                    perceived.fused,
                    perceived.detections,
                    perceived.inbox,
                )


def test_postponed_messages_are_never_sent() -> None:
    result, frames = controlled(lambda start: StationAction(send=False), RunSettings(time_limit=3.0), "RSU")
    assert result.metrics["messages.sent"] == 0
    assert not any(frame.steps["RSU"].outbox for frame in frames)


def test_message_contains_the_shared_rows_in_order() -> None:
    def newest_first(start: TickStart) -> StationAction:
        return StationAction(share=tuple(reversed(range(len(start.perceived["RSU"].detections))))[:1])

    _, frames = controlled(newest_first, RunSettings(time_limit=3.0), "RSU")
    seen = [frame.steps["RSU"] for frame in frames if len(frame.steps["RSU"].detections) > 1]
    assert seen
    for step in seen:
        (message,) = step.outbox
        assert message.detections.boxes.tolist() == step.detections.boxes[-1:].tolist()


def test_begun_tick_states_the_scheduled_end() -> None:
    with Simulation(ONE, settings=RunSettings(time_limit=0.1)) as simulation:
        ends = []
        for _ in range(3):
            ends.append(simulation.begin_tick().ends)
            simulation.tick()
        assert ends == [False, False, True]
        with pytest.raises(SimulationError, match="the run has ended"):
            simulation.begin_tick()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"target_speed": -1.0}, "target_speed of an action is -1.0; give a number from 0 to 10000"),
        ({"target_speed": float("nan")}, "target_speed of an action is nan"),
        ({"control": 5}, "control of an action is 5; give a Control"),
        ({"share": 5}, "share of an action is 5; give a tuple of rows"),
        ({"control": Control(1.5, 0.0, 0.0)}, "control.throttle of an action is 1.5; give a number from 0 to 1"),
        ({"control": Control(0.0, 0.0, float("inf"))}, "control.steering of an action is inf"),
    ],
)
def test_action_with_invalid_values_is_an_error(values: dict[str, object], message: str) -> None:
    with pytest.raises(SettingError, match=message):
        StationAction(**values)  # type: ignore[arg-type]


def test_actions_that_no_station_can_execute_are_errors() -> None:
    with Simulation(ONE) as simulation:
        with pytest.raises(SettingError, match="None is not a station that accepts actions; known: Ego"):
            simulation.set_action(None, StationAction())  # type: ignore[arg-type]
        with pytest.raises(SettingError, match="'Eg' is not a station that accepts actions; did you mean 'Ego'"):
            simulation.set_action("Eg", StationAction())
        with pytest.raises(SettingError, match="the action of 'RSU' drives, and the station does not"):
            simulation.set_action("RSU", StationAction(target_speed=3.0))
        with pytest.raises(SettingError, match="the action of 'Ego' is 3; give a StationAction"):
            simulation.set_action("Ego", 3)  # type: ignore[arg-type]
        simulation.set_action("RSU", StationAction(share=(99,)))
        with pytest.raises(SettingError, match="share of an action contains the row 99"):
            simulation.tick()
    objects = detected(0.0, [(5.0, 0.0, 0.75, 4.0, 2.0, 1.5, 0.0)])
    for share, problem in (((0, 0), "row 0 twice"), ((0.5,), "row 0.5")):
        with pytest.raises(SettingError, match=f"share of an action contains the {problem}"):
            StationAction(share=share).shared(objects)  # type: ignore[arg-type]
    with Simulation(ONE, stack=EmptyStack) as empty, pytest.raises(SettingError, match="has no station"):
        empty.set_action("Ego", StationAction())
