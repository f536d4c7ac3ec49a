"""Environment, user-defined values, monitors, lights and animations in simulation runs."""

from __future__ import annotations

from datetime import datetime

import pytest
from storyboard_xml import global_xml, private_xml
from street_scene import NOTHING, after
from whole_run import Run

from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunSettings, Simulation
from eidrive_scenario.storyboard.state.element_states import ElementTransition


@pytest.mark.element("EnvironmentAction")
def test_environment_action_keeps_omitted_values(run: Run) -> None:
    first = global_xml("""<EnvironmentAction><Environment name="morning">
      <TimeOfDay animation="true" dateTime="2024-06-01T06:00:00"/>
      <Weather fractionalCloudCover="fourOktas" temperature="283"><Sun azimuth="1" elevation="0.2" illuminance="9000"/>
      <Fog visualRange="150"/><Precipitation precipitationType="rain" precipitationIntensity="4"/></Weather>
      <RoadCondition frictionScaleFactor="0.7"/></Environment></EnvironmentAction>""")
    later = global_xml(
        '<EnvironmentAction><Environment name="clearer"><Weather><Fog visualRange="900"/></Weather></Environment>'
        "</EnvironmentAction>"
    )
    played = run(2, ("Ego", later, after(1.0)), globally=first)
    before, now = played.frames[0].environment, played.frames[-1].environment
    assert before is not None
    assert now is not None
    assert (before.name, before.fog_range, before.precipitation, before.precipitation_intensity) == (
        *("morning", 150.0, "rain", 4.0),
    )
    assert (now.name, now.fog_range, now.friction, now.clouds) == ("clearer", 900.0, 0.7, "fourOktas")
    assert (now.illuminance, now.sun_elevation, now.temperature) == (9000.0, 0.2, 283.0)
    assert now.clock(2.0) == datetime(2024, 6, 1, 6, 0, 2)


@pytest.mark.element("UserDefinedValueCondition")
def test_user_defined_value_starts_an_event(run: Run) -> None:
    condition = '<UserDefinedValueCondition name="signal strength" rule="lessThan" value="5"/>'
    condition = f"<ByValueCondition>{condition}</ByValueCondition>"

    def during(simulation: Simulation, frame: Frame) -> None:
        if frame.view.tick == 10:
            simulation.set_user_value("signal strength", "3.5")

    alone = run(1, ("Ego", NOTHING, condition))
    assert alone.begun("event 0") == []
    assert any(
        "UserDefinedValueCondition 'signal strength' is never fulfilled" in warning for warning in alone.result.warnings
    )
    assert run(1, ("Ego", NOTHING, condition), during=during).begun("event 0") == pytest.approx([0.55])
    given = RunSettings(dt=0.05, user_values={"signal strength": "4"})
    answered = run(1, ("Ego", NOTHING, condition), settings=given)
    assert (answered.begun("event 0"), answered.result.warnings[1:]) == ([0.0], ()), "after: not judged"


@pytest.mark.element("SetMonitorAction", "MonitorDeclaration")
def test_monitor_is_in_frames_metrics_and_verdict(run: Run) -> None:
    criterion = (
        '<UserDefinedAction><CustomCommandAction type="eidrive.criterion">[{{monitor: {{of: Passed{0}}}}}]'
        "</CustomCommandAction></UserDefinedAction>"
    )
    passed = global_xml('<SetMonitorAction monitorRef="Passed" value="true"/>')
    played = run(2, ("Ego", passed, after(1.0)), globally=criterion.format(""))
    assert [frame.monitors["Passed"] for frame in played.frames] == [False] * 21 + [True] * 20
    assert played.result.metrics["monitor.Passed"] == 1.0
    assert played.result.metrics["monitor.Passed.changed"] == pytest.approx(1.05)
    (verdict,) = played.result.criteria
    assert (verdict.passed, verdict.reason) == (True, "Passed is true since 1.05 s")
    failed = run(2, globally=criterion.format("")).result
    assert (failed.passed, failed.metrics["monitor.Passed"]) == (False, 0.0)
    assert not run(2, ("Ego", passed, after(1.0)), globally=criterion.format(", throughout: true")).result.passed


@pytest.mark.element("LightStateAction", "AnimationAction")
def test_light_and_animation_states_are_in_the_frames(run: Run) -> None:
    light = private_xml("""<AppearanceAction><LightStateAction transitionTime="0.5"><LightType><UserDefinedLight
      userDefinedLightType="rotating beacon"/></LightType><LightState mode="flashing" flashingOnDuration="0.2"
      flashingOffDuration="0.3" luminousIntensity="40"><Color colorType="blue">
      <ColorRgb red="0" green="0" blue="1"/></Color></LightState></LightStateAction>
      </AppearanceAction>""")
    door = private_xml("""<AppearanceAction><AnimationAction animationDuration="1"><AnimationType><ComponentAnimation>
      <VehicleComponent vehicleComponentType="doorFrontLeft"/></ComponentAnimation></AnimationType>
      <AnimationState state="0.8"/></AnimationAction></AppearanceAction>""")
    played = run(2, ("Ego", light, after(0.3)), ("Ego", door, after(0.5)))
    looks = played.frames[-1].appearances["Ego"]
    beacon = looks.lights["rotating beacon"]
    assert (beacon.mode, beacon.color, beacon.intensity) == ("flashing", (0.0, 0.0, 1.0), 40.0)
    assert beacon.since == pytest.approx(0.35)
    assert [beacon.brightness(0.35 + t) for t in (0.0, 0.15, 0.25, 0.45, 0.5)] == [1, 1, 0, 0, 1]
    opened = looks.animations["doorFrontLeft"]
    assert (opened.kind, opened.state, opened.duration) == ("component", 0.8, 1.0)
    assert opened.since == pytest.approx(0.55)
    ended = [
        change.time
        for frame in played.frames
        for change in frame.changes
        if change.element == "action 1" and change.after.value == "completeState"
    ]
    assert ended == pytest.approx([1.55])
    assert played.frames[0].appearances == {}


@pytest.mark.parametrize(
    ("color", "expected"),
    [
        ('colorType="other"><ColorRgb red="0.1" green="0.2" blue="0.3"/>', (0.1, 0.2, 0.3)),
        ('colorType="other"><ColorCmyk cyan="0.5" magenta="0" yellow="1" key="0.5"/>', (0.25, 0.5, 0.0)),
    ],
)
def test_light_color_is_converted_to_rgb(run: Run, color: str, expected: tuple[float, ...]) -> None:
    light = private_xml(f"""<AppearanceAction><LightStateAction><LightType><VehicleLight vehicleLightType="highBeam"/>
      </LightType><LightState mode="on"><Color {color}</Color></LightState></LightStateAction></AppearanceAction>""")
    found = run(0.2, ("Ego", light)).frames[-1].appearances["Ego"].lights["highBeam"].color
    assert found == pytest.approx(expected)


def test_light_brightness_changes_over_its_transition(run: Run) -> None:
    light = private_xml("""<AppearanceAction><LightStateAction transitionTime="1"><LightType><VehicleLight
      vehicleLightType="lowBeam"/></LightType><LightState mode="{}"/></LightStateAction></AppearanceAction>""")
    lights = run(0.5, ("Ego", light.format("on"))).frames[-1].appearances["Ego"].lights
    assert [lights["lowBeam"].brightness(t) for t in (0.0, 0.25, 1.0, 3.0)] == [0.0, 0.25, 1.0, 1.0]
    lights = run(0.5, ("Ego", light.format("off"))).frames[-1].appearances["Ego"].lights
    assert [lights["lowBeam"].brightness(t) for t in (0.0, 0.25, 1.0)] == [1.0, 0.75, 0.0]


@pytest.mark.element("AnimationAction")
def test_pedestrian_animation_in_a_loop_does_not_end(run: Run) -> None:
    wave = private_xml("""<AppearanceAction><AnimationAction loop="true" animationDuration="0.2"><AnimationType>
      <PedestrianAnimation motion="standing"><PedestrianGesture gesture="wavingRightArm"/></PedestrianAnimation>
      </AnimationType></AnimationAction></AppearanceAction>""")
    played = run(1, ("Ego", wave))
    held = played.frames[-1].appearances["Ego"]
    assert (held.motion, held.animations["motion"].gestures) == ("standing", ("wavingRightArm",))
    assert not any(
        c.element == "action 0" and c.transition is ElementTransition.END for f in played.frames for c in f.changes
    )


@pytest.mark.element("VisibilityAction")
def test_visibility_action_hides_an_entity_from_sensors_only(run: Run) -> None:
    hide = private_xml('<VisibilityAction graphics="true" sensors="{}" traffic="true"/>')
    played = run(
        2,
        ("Other", hide.format("false"), after(0.5)),
        ("Other", hide.format("true"), after(1.2)),
        others={"Other": (-1, 120.0, 20.0)},
    )
    seen = [len(frame.steps["Ego"].detections) for frame in played.frames]
    assert seen == [1] * 12 + [0] * 14 + [1] * 15
    assert all("Other" in frame.view for frame in played.frames)


@pytest.mark.element("VisibilityAction")
def test_sensor_reference_set_hides_from_listed_sensors_only(run: Run) -> None:
    hide = private_xml("""<VisibilityAction graphics="true" sensors="{}" traffic="true"><SensorReferenceSet>
      <SensorReference name="{}"/></SensorReferenceSet></VisibilityAction>""")
    played = run(
        2,
        ("Other", hide.format("false", "another"), after(0.25)),
        ("Other", hide.format("false", "truth"), after(0.5)),
        ("Other", hide.format("true", "truth"), after(1.2)),
        others={"Other": (-1, 120.0, 20.0)},
    )
    assert [len(frame.steps["Ego"].detections) for frame in played.frames] == [1] * 12 + [0] * 14 + [1] * 15
    seen = played.frames[-1].appearances["Other"].visibility
    assert [seen.by(name) for name in ("another", "truth", "a third")] == [False, True, True]


def test_time_of_day_condition_without_time_of_day_warns(run: Run) -> None:
    noon = '<TimeOfDayCondition rule="greaterThan" dateTime="2024-06-01T12:00:00"/>'
    played = run(0.5, ("Ego", NOTHING, f"<ByValueCondition>{noon}</ByValueCondition>"))
    assert played.begun("event 0") == []
    assert "TimeOfDayCondition is never fulfilled" in played.result.warnings[1], "after: not judged"
