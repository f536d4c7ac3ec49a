"""Whole runs: the paper's scenarios, determinism, commands, ends."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from openscenario_xml import object_xml, scenario_xml
from scenario_1 import FrameCollector, edited
from storyboard_xml import (
    act_xml,
    acts_xml,
    condition_xml,
    end_xml,
    event_xml,
    global_xml,
    group_xml,
    init_xml,
    maneuver_xml,
    speed_xml,
    teleport_xml,
    time_xml,
    trigger_xml,
    world_position_xml,
)

from eidrive_scenario.errors import ExtensionError, InputError
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunResult, RunSettings, Simulation, load_for_seed, run_file
from eidrive_scenario.world import World

ONE = "coop/scenario_1"


def play(
    name: str = ONE, seed: int = 1, *observers: FrameCollector, channel: str | None = None, **more: object
) -> RunResult:
    settings = RunSettings(channel=channel, **more)  # type: ignore[arg-type]
    return run_file(resolve_scenario(name), seed=seed, settings=settings, observers=observers)


def test_set_driven_is_called_in_order_of_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The order of bodies in pybullet hangs on it, and that of a set differs from process to process."""
    names = [f"Car{number}" for number in range(8)]
    source = resolve_scenario(ONE)
    text = source.read_text().replace('"../', f'"{source.parent.parent}/')
    start, end = text.index('<ScenarioObject name="Ego">'), text.index('<ScenarioObject name="Incoming">')
    more = "".join(text[start:end].replace('name="Ego"', f'name="{name}"') for name in names)
    init = "".join(
        init_xml(name, teleport_xml(world_position_xml(60 + 8 * number)), speed_xml(5))
        for number, name in enumerate(names)
    )
    text = (
        text[:start] + more + text[start:].replace('<Private entityRef="Ego">', init + '<Private entityRef="Ego">', 1)
    )
    path = tmp_path / "many.xosc"
    path.write_text(text)
    asked: list[str] = []
    monkeypatch.setattr(World, "set_driven", lambda self, name, driven: asked.append(name))
    Simulation(load_scenario(path)).close()
    assert asked == sorted([*names, "Ego"])


@pytest.mark.parametrize("name", ["coop/scenario_1", "coop/scenario_2"])
def test_hidden_car_collides_without_cooperation_only(name: str) -> None:
    alone, helped = play(name, channel="none"), play(name, channel="ideal")
    assert (alone.passed, alone.exit_code) == (False, 1)
    collision = next(verdict for verdict in alone.criteria if verdict.name == "collision")
    assert "Ego and Incoming hit each other at" in collision.reason
    assert (helped.passed, helped.exit_code, helped.end_reason) == (True, 0, "stop trigger")
    center = "min_distance.Ego.Incoming.center"
    assert helped.metrics[center] > alone.metrics[center]
    assert alone.metrics["min_distance.Ego.Incoming.box"] == 0.0


def test_ego_receives_detection_of_hidden_car_before_line_of_sight() -> None:
    watch = FrameCollector()
    play(ONE, 1, watch, channel="ideal")

    def first(kind: str) -> float:
        for frame in watch.frames:
            step = frame.steps["Ego"]
            truth = frame.view.boxes[frame.view.rows["Incoming"], :2]
            boxes = getattr(step, kind).boxes[:, :2]
            if len(boxes) and min(abs(boxes - truth).sum(axis=1)) < 3.0:
                return frame.view.time
        raise AssertionError(f"never in {kind}")

    assert first("fused") < 0.2
    assert first("detections") > 3.0


@pytest.mark.process
def test_equal_seed_gives_equal_trace_in_any_order_and_process() -> None:
    first, other, again = play(seed=3).trace_hash, play(seed=4).trace_hash, play(seed=3).trace_hash
    assert first == again
    assert first != other
    code = (
        "from eidrive_scenario.simulation import run_file;"
        "from eidrive_scenario.extensions.library import resolve_scenario;"
        f"import sys; sys.stdout.write(run_file(resolve_scenario('{ONE}'), seed=3).trace_hash)"
    )
    elsewhere = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert elsewhere.stdout == first


def test_total_loss_equals_no_cooperation_and_zero_loss_equals_ideal(tmp_path: Path) -> None:
    def trace(channel: str) -> list[tuple[float, ...]]:
        watch = FrameCollector()
        play(ONE, 2, watch, channel=channel)
        return [tuple(frame.view.position[frame.view.rows["Ego"]].tolist()) for frame in watch.frames]

    deaf = tmp_path / "deaf.yaml"
    deaf.write_text("model: composed\nloss: {kind: bernoulli, probability: 1.0}\n")
    clear = tmp_path / "clear.yaml"
    clear.write_text("loss: {kind: bernoulli, probability: 0.0}\ndelay: {kind: constant, seconds: 0}\n")
    assert trace(str(deaf)) == trace("none")
    assert trace(str(clear)) == trace("ideal")


def test_cooperate_option_disables_cooperation() -> None:
    assert play(channel="ideal", cooperate=()).passed is False
    assert play(channel="ideal", cooperate=("RSU",)).passed is True


def test_added_roadside_unit_transmits_from_its_entry() -> None:
    watch = FrameCollector()
    result = play("coop/scenario_1_late_rsu", 1, watch)
    assert "RSU" not in watch.frames[0].view
    assert "RSU" in watch.frames[-1].view
    assert result.passed


def test_channel_command_of_event_loses_all_later_messages(tmp_path: Path) -> None:
    jammer = """<Action name="Jam"><UserDefinedAction><CustomCommandAction type="eidrive.channel">
        {loss: {kind: bernoulli, probability: 1.0}}</CustomCommandAction></UserDefinedAction></Action>
        <Action name="EgoSpeedsUp">"""
    path = edited(tmp_path, ('<Action name="EgoSpeedsUp">', jammer))
    result = run_file(path, seed=1)
    assert result.passed is False
    # The message of the first tick was sent before the event
    assert result.metrics["messages.received"] == 1
    assert result.metrics["messages.lost"] == result.metrics["messages.sent"] - 1 > 0


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('type="eidrive.channel">ideal<', 'type="eidrive.channel">idael<', "did you mean 'ideal'"),
        ('type="eidrive.channel">', 'type="eidrive.chanel">', "did you mean 'eidrive.channel'"),
        ("min_distance: {of: Ego", "min_distance: {of: Egoo", "did you mean 'Ego'"),
        ("min_distance: {of: Ego", "min_distanse: {of: Ego", "did you mean 'min_distance'"),
        ('name="planner" value="$Planner"', 'name="planer" value="$Planner"', "did you mean 'planner'"),
        ('name="detector" value="oracle"', 'name="detector" value="orakle"', "did you mean 'oracle'"),
        ("$Participants", "[RUS]", "'RUS', which is no station"),
        ("{EgoOffset: {uniform", "{EgoOfset: {uniform", "did you mean 'EgoOffset'"),
        ("{uniform: [-0.15, 0.15]}", "{uniform: [0.15, -0.15]}", "lower bound"),
        ("{uniform: [-0.15, 0.15]}", "{unifrom: [-0.15, 0.15]}", "did you mean 'uniform'"),
    ],
)
def test_invalid_setting_is_reported_with_file_and_line_before_run(
    old: str, new: str, expected: str, tmp_path: Path
) -> None:
    path = edited(tmp_path, (old, new))
    with pytest.raises(InputError) as caught:
        Simulation(load_for_seed(path, 1, {}))
    diagnostic = caught.value.diagnostics[0]
    assert expected in str(diagnostic)
    assert diagnostic.source == str(path)
    line = path.read_text().splitlines()[(diagnostic.line or 0) - 1]
    assert new.strip('"')[:8] in line or "eidrive" in line


def test_unknown_detector_and_sender_are_reported_with_their_option() -> None:
    with pytest.raises(InputError, match=r"RunSettings\.detector: unknown detector 'yolo'"):
        play(detector="yolo")
    with pytest.raises(InputError, match=r"RunSettings\.cooperate: no station 'RSU2'; did you mean 'RSU'"):
        play(cooperate=("RSU2",))
    with pytest.raises(InputError, match=r"RunSettings\.channel: no channel profile 'latency'"):
        play(channel="latency")


def test_run_without_stop_ends_at_time_limit() -> None:
    """After 10 s the ego has passed the crossing, which fulfills all criteria, and has not reached its goal."""
    result = play(channel="ideal", time_limit=10.0)
    assert (result.end_reason, result.exit_code, result.passed) == ("time limit", 3, False)
    assert result.simulated_s == pytest.approx(10.0)


def test_drawn_parameters_differ_by_seed_and_given_ones_override() -> None:
    path = resolve_scenario(ONE)
    one, two = load_for_seed(path, 1, {}), load_for_seed(path, 2, {})
    assert one.parameters["EgoOffset"] != two.parameters["EgoOffset"]
    assert abs(float(one.parameters["EgoOffset"])) <= 0.15
    assert load_for_seed(path, 1, {"EgoOffset": "0.5"}).parameters["EgoOffset"] == "0.5"
    assert load_scenario(path).parameters["EgoOffset"] == "0"


def test_observers_are_closed_once_after_an_exception() -> None:
    class Breaks(FrameCollector):
        def observe(self, frame: Frame) -> None:
            raise RuntimeError("full disk")

    watch = Breaks()
    with pytest.raises(ExtensionError, match=r"observer 'Breaks' at t = 0\.000 s: RuntimeError: full disk"):
        play(ONE, 1, watch)
    assert watch.closed == 1


def test_observers_are_closed_even_if_one_raises() -> None:
    order: list[str] = []

    class Closes(FrameCollector):
        def __init__(self, name: str, error: str = "") -> None:
            super().__init__()
            self.name, self.error = name, error

        def close(self) -> None:
            order.append(self.name)
            if self.error:
                raise OSError(self.error)

    with pytest.raises(ExtensionError, match=r"observer 'Closes' .*OSError: full disk"):
        play(ONE, 1, Closes("first"), Closes("second", "full disk"), Closes("third"))
    assert order == ["first", "second", "third"]


@pytest.mark.parametrize(("x", "touches"), [(4.4, True), (4.6, False)])
def test_actor_added_inside_of_a_standing_one_is_a_collision(x: float, touches: bool) -> None:
    """The bodies are 4.5 m long; the event of 0.5 s adds Other, which the next view shows."""
    place = f"<AddEntityAction><Position>{world_position_xml(x)}</Position></AddEntityAction>"
    action = global_xml(f'<EntityAction entityRef="Other">{place}</EntityAction>')
    event = event_xml("e", action, trigger_xml(condition_xml(time_xml(0.5, "greaterOrEqual"))))
    source = scenario_xml(
        entities=object_xml("Ego") + object_xml("Other"),
        init=init_xml("Ego", teleport_xml(world_position_xml(0))),
        story=acts_xml(act_xml(group_xml(maneuver_xml(event), ""), "<StartTrigger/>")),
        stop=end_xml(1),
    )
    (verdict,) = run_file(source, settings=RunSettings(criteria={"collision": {"of": "Ego"}})).criteria
    assert verdict.passed is not touches
    assert ("Ego and Other hit each other at 0.55 s" in verdict.reason) is touches
