"""Phases of messages: stations are not synchronized."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from pydantic import ValidationError

from eidrive_scenario.base.coverage import ViewSector
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.communication.message_generator import MessageGenerator
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.v2x.messages.message import Message, StationState
from eidrive_scenario.world.actor import ActorSpec

DT = 0.01
VIEW = ViewSector(0.0, 0.0, 1.0, 0.0, math.pi, 50.0)


def sent(
    name: str,
    seconds: float,
    *,
    speed: float = 0.0,
    seed: int = 1,
    begin: float = 0.0,
    dt: float = DT,
    seen: bool = False,
    **properties: object,
) -> list[float]:
    """Times of the messages of a station that drives straight on, and that sees a vehicle before it if `seen`."""
    spec = ActorSpec(name, "car", "car", (4.5, 1.8, 1.5), (1.4, 0.0, 0.75), wheelbase=2.7)
    generator = MessageGenerator(spec, AgentSettings.model_validate(properties), view=(VIEW,), seed=seed, dt=dt)
    times = [begin + tick * dt for tick in range(round(seconds / dt))]
    found = []
    for now in times:
        state = StationState(now, speed * now, 0.0, 0.0, 0.0, speed)
        box, unknown = [speed * now + 20.0, 0.0, 0.75, 4.5, 1.8, 1.5, 0.0], np.full((1, 2, 2), np.nan)
        ahead = Detections(now, np.array([box]), np.ones(1), ("car",), np.array([[speed, 0.0]]), unknown)
        detections = ahead if seen else Detections(now)
        found += [message.generated for message in generator.generate(state, detections, now)]
    return found


def is_uniform(values: Sequence[float], span: float) -> bool:
    """Whether values are uniform in [0, span): Kolmogorov-Smirnov, with a chance of 0.1 % of a false alarm."""
    ordered = np.sort(values) / span
    steps = np.arange(len(ordered) + 1) / len(ordered)
    apart = max(np.max(np.abs(ordered - steps[1:])), np.max(np.abs(ordered - steps[:-1])))
    return bool(apart <= 1.95 / math.sqrt(len(ordered)) + DT / span)


def test_stations_with_a_rate_start_at_random_times_within_the_interval() -> None:
    first = [sent(f"Car{number}", 0.6, message_rate=2)[0] for number in range(100)]
    assert is_uniform(first, 0.5)
    assert np.diff(sent("Car3", 5.0, message_rate=2)).tolist() == pytest.approx([0.5] * 9)


def test_standing_stations_with_etsi_rules_are_spread_over_a_second() -> None:
    """T_GenCamMax of EN 302 637-2 is 1 s."""
    runs = [sent(f"Car{number}", 3.0, messages="cam", generation="etsi") for number in range(100)]
    assert is_uniform([run[0] for run in runs], 1.0)
    assert all(np.diff(run).tolist() == pytest.approx([1.0] * (len(run) - 1)) for run in runs)


@pytest.mark.parametrize("speed", [8.0, 20.0, -8.0])
def test_first_cam_of_a_moving_station_follows_within_four_meters(speed: float) -> None:
    """The rules are evaluated every 0.1 s, from a time in [0, 0.1 s) on, and require more than 4 m."""
    runs = [sent(f"Car{number}", 2.0, speed=speed, messages="cam", generation="etsi") for number in range(60)]
    assert max(run[0] for run in runs) <= 4.0 / abs(speed) + 0.1 + DT
    assert np.mean([run[0] for run in runs]) == pytest.approx(2.0 / abs(speed) + 0.1, abs=0.05)


@pytest.mark.parametrize("dt", [0.02, 0.03, 0.04, 0.05, 0.07, 0.1])
@pytest.mark.parametrize(
    ("messages", "speed", "interval"),
    [
        ("cam", 0.0, 1.0),
        ("cam", 15.0, 0.3),
        ("cam", 25.0, 0.2),
        ("cam", 45.0, 0.1),
        ("cpm", 0.0, 1.0),
        ("cpm", 70.0, 0.1),
    ],
)
def test_etsi_messages_are_sent_in_the_tick_after_each_interval(
    messages: str, speed: float, interval: float, dt: float
) -> None:
    """(floor(4 / 0.1 v) + 1) 0.1 s, at most 1 s, also if the time step does not divide it."""
    times = sent("Car", 6.0, speed=speed, seen=True, dt=dt, messages=messages, generation="etsi", message_phase=0)
    assert times == pytest.approx([dt * math.ceil(n * interval / dt - 1e-6) for n in range(len(times))])
    assert len(times) >= 5.8 / interval


def test_phase_depends_on_seed_and_name_only() -> None:
    assert sent("Car", 1.0, message_rate=3) == sent("Car", 1.0, message_rate=3)
    assert sent("Car", 1.0, message_rate=3) != sent("Car", 1.0, message_rate=3, seed=2)
    assert sent("Car", 1.0, message_rate=3) != sent("Van", 1.0, message_rate=3)


def test_given_phase_counts_from_the_entry_of_the_station() -> None:
    assert sent("Car", 0.5, message_rate=5, message_phase=0)[:2] == pytest.approx([0.0, 0.2])
    late = sent("Car", 1.0, begin=7.0, message_rate=5, message_phase=0.13)
    assert late == pytest.approx([7.13, 7.33, 7.53, 7.73, 7.93])
    assert sent("Car", 1.5, messages="cam", generation="etsi", message_phase=0.25) == pytest.approx([0.25, 1.25])
    assert sent("Car", 1.0, message_rate=5, message_phase=3) == []


def test_messages_in_each_tick_have_no_phase() -> None:
    assert len(sent("Car", 0.1)) == 10
    with pytest.raises(ValidationError, match="message_phase needs a message_rate or generation 'etsi'"):
        AgentSettings.model_validate({"message_phase": 0.1})


def ready_times(dt: float, seconds: float = 2.0) -> dict[str, list[float]]:
    """Return the times at which forty stations with 10 Hz pass their messages to the radio."""
    times: dict[str, list[float]] = {}
    for number in range(40):
        spec = ActorSpec(f"Car{number}", "car", "car", (4.5, 1.8, 1.5), (1.4, 0.0, 0.75), wheelbase=2.7)
        settings = AgentSettings.model_validate({"message_rate": 10})
        generator = MessageGenerator(spec, settings, view=(VIEW,), seed=3, dt=dt)
        for tick in range(round(seconds / dt)):
            now = tick * dt
            for message in generator.generate(StationState(now, 0.0, 0.0, 0.0, 0.0, 0.0), Detections(now), now):
                times.setdefault(spec.name, []).append(message.generated + message.offset)
    return times


@pytest.mark.parametrize("dt", [0.01, 0.02, 0.05, 0.1])
def test_messages_of_stations_spread_equally_at_all_time_steps(dt: float) -> None:
    times, finest = ready_times(dt), ready_times(0.001)
    assert is_uniform([instants[0] % 0.1 for instants in times.values()], 0.1)
    for name, instants in times.items():
        late = (np.array(instants[:15]) - finest[name][:15]) / dt
        assert np.diff(instants) == pytest.approx(0.1)
        assert late[0] >= -1e-6
        assert late[0] <= 1.0 + 0.001 / dt


def test_message_at_a_multiple_of_the_time_step_has_no_offset() -> None:
    for phase, expected in ((0.0, 0.0), (0.1, 0.0), (0.15, 0.0), (0.13, 0.03)):
        spec = ActorSpec("Car", "car", "car", (4.5, 1.8, 1.5), (1.4, 0.0, 0.75), wheelbase=2.7)
        settings = AgentSettings.model_validate({"message_rate": 1, "message_phase": phase})
        generator = MessageGenerator(spec, settings, view=(VIEW,), dt=0.05)
        found: list[Message] = []
        for tick in range(10):
            now = tick * 0.05
            found += generator.generate(StationState(now, 0.0, 0.0, 0.0, 0.0, 0.0), Detections(now), now)
        assert [message.offset for message in found] == pytest.approx([expected])


@pytest.mark.parametrize("interval", [0.0, 0.4, 1.0])
def test_object_without_tracker_keeps_its_id_at_any_message_interval(interval: float) -> None:
    """10 m/s are 1 m from one list of detections to the next, and 10 m in a second of congestion control."""
    spec = ActorSpec("RSU", "rsu", "misc", (0.3, 0.3, 5.0), (0.0, 0.0, 2.5))
    settings = AgentSettings.model_validate({"generation": "etsi", "message_phase": 0.0})
    message_generator = MessageGenerator(spec, settings, dt=0.1)
    ids: list[int] = []
    for tick in range(40):
        now, unknown = 0.1 * tick, np.full((1, 2), np.nan)
        boxes = np.array([[10.0 * now, 0.0, 0.75, 4.5, 1.8, 1.5, 0.0]])
        seen = Detections(now, boxes, np.ones(1), ("car",), unknown, np.full((1, 2, 2), np.nan))
        state = StationState(now, 0.0, 0.0, 0.0, 0.0, 0.0)
        for message in message_generator.generate(state, seen, now, interval=interval):
            ids += message.objects or ()
    assert len(ids) >= 4
    assert set(ids) == {0}
