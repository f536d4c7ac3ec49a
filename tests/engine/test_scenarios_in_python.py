"""Scenarios written in Python with scenariogeneration: a cut-in that is built, run, and never becomes a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest
from lxml import etree
from scenariogeneration import xodr, xosc

from eidrive_scenario.checks.scenario_checks import check_scenario
from eidrive_scenario.errors import Diagnostic, ScenarioError
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.openscenario import load_distribution, load_scenario
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.simulation import RunSettings, Simulation, run_file

STEP = xosc.TransitionDynamics(xosc.DynamicsShapes.step, xosc.DynamicsDimension.time, 0)
Build = Callable[..., xosc.Scenario]


@pytest.fixture
def road(tmp_path: Path) -> Path:
    """A straight road, 500 m long, two lanes of 3.5 m on each side."""
    line = xodr.create_road(xodr.Line(500), id=1, left_lanes=2, right_lanes=2, lane_width=3.5)
    straight = xodr.OpenDrive("straight")
    straight.add_road(line)
    straight.adjust_roads_and_lanes()
    path = tmp_path / "straight.xodr"
    straight.write_xml(str(path))
    return path


@pytest.fixture
def cut_in(road: Path) -> Build:
    """The target drives 20 m/s one lane left of the ego, which drives 15 m/s, and changes into its lane at 2 s."""

    def build(*, changing: str = "Target") -> xosc.Scenario:
        box = xosc.BoundingBox(2, 5, 1.5, 1.4, 0, 0.75)
        axles = xosc.Axle(0.5, 0.6, 1.6, 2.8, 0.3), xosc.Axle(0, 0.6, 1.6, 0, 0.3)
        entities = xosc.Entities()
        init = xosc.Init()
        for name, s, lane, speed in (("Ego", 50, -2, 15), ("Target", 40, -1, 20)):
            car = xosc.Vehicle(name.lower(), xosc.VehicleCategory.car, box, *axles, 60, 10, 10)
            entities.add_scenario_object(name, car)
            init.add_init_action(name, xosc.TeleportAction(xosc.LanePosition(s, 0, lane, 1)))
            init.add_init_action(name, xosc.AbsoluteSpeedAction(speed, STEP))
        start = xosc.ValueTrigger(
            "two seconds", 0, xosc.ConditionEdge.none, xosc.SimulationTimeCondition(2, xosc.Rule.greaterOrEqual)
        )
        change = xosc.RelativeLaneChangeAction(
            -1,
            changing,
            xosc.TransitionDynamics(xosc.DynamicsShapes.sinusoidal, xosc.DynamicsDimension.time, 3),
        )
        event = xosc.Event("cut in", xosc.Priority.override)
        event.add_trigger(start)
        event.add_action("change lane", change)
        maneuver = xosc.Maneuver("maneuver")
        maneuver.add_event(event)
        end = xosc.ValueTrigger(
            "eight seconds",
            0,
            xosc.ConditionEdge.none,
            xosc.SimulationTimeCondition(8, xosc.Rule.greaterThan),
            triggeringpoint="stop",
        )
        storyboard = xosc.StoryBoard(init, end)
        storyboard.add_maneuver(maneuver, "Target")
        parameters = xosc.ParameterDeclarations()
        return xosc.Scenario(
            "cut-in", "nobody", parameters, entities, storyboard, xosc.RoadNetwork(str(road)), xosc.Catalog()
        )

    return build


def test_a_cut_in_is_driven(cut_in: Build) -> None:
    with Simulation(load_scenario(cut_in()), settings=RunSettings(dt=0.1)) as simulation:
        lateral = {}
        end = None
        while end is None:
            frame, end = simulation.tick()
            lateral[round(frame.view.time, 1)] = frame.view.position[frame.view.row("Target"), 1]
    assert end == "stop trigger"
    assert lateral[2.0] == pytest.approx(-1.75, abs=1e-6), "in the middle of its lane when it begins"
    assert lateral[3.5] == pytest.approx(-3.5, abs=0.1), "between the lanes halfway"
    assert lateral[6.0] == pytest.approx(-5.25, abs=1e-6)
    target, ego = (frame.view.position[frame.view.row(name), 0] for name in ("Target", "Ego"))
    assert target == pytest.approx(40 + 20 * frame.view.time, abs=0.5)
    assert ego == pytest.approx(50 + 15 * frame.view.time, abs=0.5)


def test_it_is_the_same_run_as_that_of_its_file(cut_in: Build, tmp_path: Path) -> None:
    path = tmp_path / "cut_in.xosc"
    cut_in().write_xml(str(path))
    runs = [
        run_file(source)
        for source in (
            path,
            cut_in(),
            cut_in().get_element(),
            ElementTree.ElementTree(cut_in().get_element()),
            etree.parse(path),
            etree.parse(path).getroot(),
            path.read_bytes(),
        )
    ]
    assert len({run.trace_hash for run in runs}) == 1
    assert load_scenario(cut_in()).name == "cut-in"
    assert load_scenario(cut_in()).path is None


def test_its_name_is_one_line(cut_in: Build) -> None:
    scenario = cut_in()
    for description, name in (("a cut-in,\n  from the left", "a cut-in, from the left"), ("", "<Scenario>")):
        scenario.header.description = description
        assert load_scenario(scenario).name == name


def test_a_mistake_has_the_line_that_the_file_would_have(cut_in: Build, tmp_path: Path) -> None:
    wrong = cut_in(changing="Taget")
    path = tmp_path / "cut_in.xosc"
    wrong.write_xml(str(path))
    diagnostics: list[Diagnostic] = []
    for source in (path, wrong):
        with pytest.raises(ScenarioError) as caught:
            load_scenario(source)
        diagnostics += caught.value.diagnostics
    in_file, in_python = diagnostics
    assert "refers to entity 'Taget', which does not exist; did you mean 'Target'?" in str(in_python)
    assert in_python.source == "<Scenario>"
    assert in_python.line == in_file.line
    assert "Taget" in path.read_text(encoding="utf-8").splitlines()[(in_file.line or 0) - 1]


def test_what_the_library_itself_gets_wrong_is_played_as_it_is_meant(cut_in: Build, tmp_path: Path) -> None:
    """Version 0.16 writes the state of a light before the light, and a limit that is not given as 'None'."""
    scenario = cut_in()
    for action in (
        xosc.LightStateAction(xosc.VehicleLightType.brakeLights, xosc.LightMode.on),
        xosc.AbsoluteLaneOffsetAction(0.5, xosc.DynamicsShapes.step, continuous=False),
    ):
        scenario.storyboard.init.add_init_action("Ego", action)
    path = tmp_path / "offset.xosc"
    scenario.write_xml(str(path))
    runs = [run_file(scenario), run_file(path)]
    assert runs[0].trace_hash == runs[1].trace_hash
    for run in runs:
        assert ["LightType" in warning for warning in run.warnings[1:]] == [True, False], "after: not judged"
        assert ["is 'None', which is read as" in warning for warning in run.warnings[1:]] == [False, True]


def test_attributes_that_are_none_are_not_there(cut_in: Build) -> None:
    """An AngleCondition without a coordinate system is in the world's; the library cannot write such a file."""
    scenario = cut_in()
    angle = xosc.AngleCondition(0.0, 0.1, xosc.AngleType.heading)
    scenario.storyboard.stoptrigger = xosc.EntityTrigger(
        "ahead", 0, xosc.ConditionEdge.none, angle, "Ego", triggeringpoint="stop"
    )
    run = run_file(scenario)
    assert (run.end_reason, run.simulated_s) == ("stop trigger", 0.0)


def test_what_the_library_refuses_to_write_is_no_traceback(cut_in: Build) -> None:
    scenario = cut_in()
    scenario.header.setVersion(minor=1)  # the library's version is one for all: that of the object made last
    try:
        with pytest.raises(ScenarioError, match=r"<Scenario>: get_element\(\) raises \w+: Priority.override is"):
            load_scenario(scenario)
    finally:
        scenario.header.setVersion(minor=3)


def test_what_is_no_scenario_is_refused() -> None:
    with pytest.raises(ScenarioError, match="<int>: the source is neither a path nor XML; use a path, bytes"):
        load_scenario(5)  # type: ignore[arg-type]
    with pytest.raises(ScenarioError, match="<Element>: version of OpenSCENARIO is 5 of the type int; use a text"):
        load_scenario(ElementTree.Element("OpenSCENARIO", {"version": 5}))  # type: ignore[dict-item]
    with pytest.raises(ScenarioError, match=r"<Element>:2: the root element is Catalog \(expected OpenSCENARIO\)"):
        load_scenario(ElementTree.Element("Catalog"))


def test_what_check_finds_it_finds_in_an_object(cut_in: Build) -> None:
    collector = check_scenario(cut_in())
    assert (collector.errors, collector.warnings) == ((), ())
    scenario = cut_in()
    scenario.parameters.add_parameter(xosc.Parameter("Speed", xosc.ParameterType.double, "3"))
    (unused,) = check_scenario(scenario).warnings
    assert str(unused).startswith("<Scenario>:5: parameter 'Speed' is never used")
    (diagnostic,) = check_scenario(cut_in(changing="Taget")).errors
    assert "did you mean 'Target'?" in diagnostic.hint


def test_a_distribution_over_it(cut_in: Build) -> None:
    scenario = cut_in()
    scenario.parameters.add_parameter(xosc.Parameter("Speed", xosc.ParameterType.double, "15"))
    init = scenario.storyboard.init
    init.add_init_action("Ego", xosc.AbsoluteSpeedAction("$Speed", STEP))
    speeds = xosc.DistributionSet()
    speeds.add_value("10")
    speeds.add_value("12")
    deterministic = xosc.Deterministic()
    deterministic.add_single_distribution("Speed", speeds)
    given = xosc.ParameterValueDistribution("speeds", "nobody", "never_written.xosc", deterministic)
    runs = load_distribution(given)
    assert "scenario 'never_written.xosc' does not exist" in str(runs.warnings[0])
    played = [run_file(scenario, settings=RunSettings(parameters=run.assignments)) for run in runs]
    assert [run.parameters["Speed"] for run in played] == ["10", "12"]
    assert played[0].trace_hash != played[1].trace_hash


def test_a_record_of_it_has_its_text(cut_in: Build, tmp_path: Path) -> None:
    result = run_and_save(cut_in(), out=tmp_path / "out")
    recording = read_recording(tmp_path / "out" / "recording.mcap")
    text = recording.attachments["scenario.xosc"]
    assert run_file(text).trace_hash == result.trace_hash
