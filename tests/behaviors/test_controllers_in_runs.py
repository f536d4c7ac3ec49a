"""Overrides of pedals, wheel and gear, and activation of controllers, in simulation runs with physics."""

from __future__ import annotations

from itertools import pairwise

import pytest
from storyboard_xml import global_xml, private_xml, speed_xml
from street_scene import after
from whole_run import Run, slope


def hold(*controls: str) -> str:
    inside = "".join(controls)
    return private_xml(
        f"<ControllerAction><OverrideControllerValueAction>{inside}</OverrideControllerValueAction></ControllerAction>"
    )


def activate(on: str) -> str:
    return private_xml(
        f'<ControllerAction><ActivateControllerAction lateral="{on}" longitudinal="{on}"/></ControllerAction>'
    )


@pytest.mark.element("OverrideControllerValueAction")
@pytest.mark.parametrize(("value", "warns"), [("50", False), ("0.5", True)])
def test_brake_override_decelerates_by_its_share_and_is_released(run: Run, value: str, warns: bool) -> None:
    """Half of 10 m/s² during 1.5 s, plus rolling resistance and drag (below 0.5 m/s²)."""
    brake = '<Throttle active="{0}" value="0"/><Brake active="{0}"><BrakePercent value="{1}"/></Brake>'
    start, end = (hold(brake.format(active, value)) for active in ("true", "false"))
    played = run(5, ("Ego", start, after(1.0)), ("Ego", end, after(2.5)))
    assert any("is read as 50 %" in text for text in played.result.warnings) is warns
    speed = played.of("Ego", "speed")
    assert abs(slope(speed, 0.0, 1.0)) < 0.3
    assert -5.5 < slope(speed, 1.2, 2.4) < -5.0
    assert slope(speed, 2.7, 4.5) > 1.0


@pytest.mark.parametrize("throttle", ['<Throttle active="true" value="0"/>', ""])
def test_brake_force_and_parking_brake_overrides_decelerate(run: Run, throttle: str) -> None:
    """CAR specifies no mass: 1500 kg. 3000 N are 2 m/s²; 0.3 of the parking brake is 3 m/s².

    The driver, which would keep its speed, releases the throttle.
    """
    force = f'{throttle}<Brake active="true"><BrakeForce value="3000"/></Brake>'
    assert -2.5 < slope(run(2, ("Ego", hold(force))).of("Ego", "speed"), 0.5, 1.9) < -2.0
    parking = f'{throttle}<ParkingBrake active="true"><BrakePercent value="30"/></ParkingBrake>'
    assert -3.5 < slope(run(2, ("Ego", hold(parking))).of("Ego", "speed"), 0.5, 1.9) < -3.0


def test_pedal_override_with_max_rate_changes_gradually(run: Run) -> None:
    """At 50 %/s the brake is at 25 % after 0.5 s and at 50 % after 1 s."""
    brake = '<Throttle active="true" value="0"/><Brake active="true"><BrakePercent value="50" maxRate="50"/></Brake>'
    speed = run(2.5, ("Ego", hold(brake))).of("Ego", "speed")
    assert -3.1 < slope(speed, 0.45, 0.55) < -2.4
    assert -5.5 < slope(speed, 1.2, 2.2) < -5.0


def test_brake_force_with_max_rate_changes_gradually(run: Run) -> None:
    """At 6000 N/s the brake of 1500 kg is at 3000 N after 0.5 s, 2 m/s², and at 6000 N after 1 s, 4 m/s²."""
    brake = '<Throttle active="true" value="0"/><Brake active="true"><BrakeForce value="6000" maxRate="6000"/></Brake>'
    speed = run(2.5, ("Ego", hold(brake))).of("Ego", "speed")
    assert -2.6 < slope(speed, 0.45, 0.55) < -1.9
    assert -4.5 < slope(speed, 1.2, 2.2) < -4.0


def test_steering_override_yields_the_yaw_rate(run: Run) -> None:
    """1.6 rad at the wheel are 0.1 rad at the axle: at 5 m/s over 3 m the yaw rate is 5 tan(0.1) / 3 = 0.167 rad/s."""
    played = run(3, ("Ego", hold('<SteeringWheel active="true" value="1.6"/>')), ego=(-1, 100.0, 5.0))
    assert slope(played.of("Ego", "yaw"), 1.0, 2.5) == pytest.approx(0.167, rel=0.05)
    right = run(3, ("Ego", hold('<SteeringWheel active="true" value="-1.6"/>')), ego=(-1, 100.0, 5.0))
    assert slope(right.of("Ego", "yaw"), 1.0, 2.5) == pytest.approx(-0.167, rel=0.05)


@pytest.mark.element("OverrideControllerValueAction")
def test_gear_and_clutch_overrides(run: Run) -> None:
    """Reverse drives backwards, neutral and a pressed clutch roll, park holds."""

    def speeds(*controls: str, speed: float = 0.0) -> list[float]:
        return run(2, ("Ego", hold(*controls)), ego=(-1, 100.0, speed)).of("Ego", "speed")

    gas = '<Throttle active="true" value="0.3"/><Brake active="true"><BrakePercent value="0"/></Brake>'
    assert slope(speeds(gas, '<Gear active="true"><AutomaticGear gear="r"/></Gear>'), 0.5, 1.9) < -2.5
    assert slope(speeds(gas, '<Gear active="true"><AutomaticGear gear="d"/></Gear>'), 0.5, 1.9) > 2.5
    assert abs(slope(speeds(gas, '<Gear active="true"><ManualGear number="0"/></Gear>'), 0.5, 1.9)) < 0.2
    assert abs(slope(speeds(gas, '<Clutch active="true" value="1"/>', speed=10.0), 0.5, 1.9)) < 0.5
    assert speeds(gas, '<Gear active="true"><AutomaticGear gear="p"/></Gear>', speed=5.0)[-1] == pytest.approx(
        0, abs=1e-3
    )


@pytest.mark.element("ActivateControllerAction")
def test_controller_activation_continues_without_a_jump(run: Run) -> None:
    stop = speed_xml(14, 2, dimension="rate")
    played = run(
        8,
        ("Ego", activate("false"), after(1.0)),
        ("Ego", stop, after(1.5)),
        ("Ego", activate("true"), after(5.0)),
    )
    speed, x = played.of("Ego", "speed"), played.x("Ego")
    handed = speed[21]
    assert speed[22:30] == pytest.approx([handed] * 8, abs=1e-9)
    assert slope(speed, 2.0, 4.0) == pytest.approx(-2.0, abs=1e-6)
    steps = [b - a for a, b in pairwise(x)]
    assert max(abs(b - a) for a, b in pairwise(steps)) < 0.05
    # From 5 s the station drives again: toward its goal, by its pedals, not at an exactly constant speed.
    assert max(abs(s - 14.0) for s in speed[102:]) < 0.5
    assert any(s != 14.0 for s in speed[102:])


def test_pedal_override_of_deactivated_controller_has_no_effect(run: Run) -> None:
    brake = hold('<Brake active="true"><BrakePercent value="100"/></Brake>')
    played = run(3, ("Ego", activate("false"), after(0.5)), ("Ego", brake, after(1.0)))
    speed = played.of("Ego", "speed")
    assert speed[25:] == pytest.approx([speed[25]] * (len(speed) - 25), abs=1e-9)


@pytest.mark.element("EnvironmentAction")
def test_low_road_friction_limits_braking(run: Run) -> None:
    """The brakes use 0.95 of the grip 0.2 · 9.81 m/s²."""
    ice = global_xml(
        '<EnvironmentAction><Environment name="ice"><RoadCondition frictionScaleFactor="0.2" wetness="moist"/>'
        "</Environment></EnvironmentAction>"
    )
    brake = hold('<Throttle active="true" value="0"/><Brake active="true"><BrakePercent value="100"/></Brake>')
    played = run(3, ("Ego", brake, after(0.5)), globally=ice)
    assert slope(played.of("Ego", "speed"), 1.0, 2.5) == pytest.approx(-0.95 * 0.2 * 9.81, abs=0.35)
    environment = played.frames[0].environment
    assert environment is not None
    assert (environment.friction, environment.wetness, environment.name) == (0.2, "moist", "ice")


def other(name: str, **activate: str) -> str:
    """Return the assignment of a controller of another tool."""
    given = " ".join(f'activate{domain}="{on}"' for domain, on in activate.items())
    return private_xml(
        f"<ControllerAction><AssignControllerAction {given}><ObjectController>"
        f'<Controller name="{name}" controllerType="movement"><Properties/></Controller></ObjectController>'
        "</AssignControllerAction></ControllerAction>"
    )


def by_name(name: str, on: str) -> str:
    return private_xml(
        f'<ControllerAction><ActivateControllerAction objectControllerRef="{name}" lateral="{on}" longitudinal="{on}"/>'
        "</ControllerAction>"
    )


@pytest.mark.element("AssignControllerAction")
def test_activation_of_another_tools_controller_deactivates_the_station(run: Run) -> None:
    """A scripted speed is constant to the last bit; a driven speed is not."""

    def scripted(*steps: tuple[str, ...]) -> list[bool]:
        speed = run(2, *steps).of("Ego", "speed")
        return [speed[tick] == speed[tick + 1] for tick in (10, 25, 35)]

    assert scripted(("Ego", other("foreign"), after(0.0))) == [False, False, False]
    assert scripted(("Ego", other("foreign", Lateral="true", Longitudinal="true"), after(1.0))) == [False, True, True]
    assigned = ("Ego", other("foreign"), after(0.0))
    assert scripted(assigned, ("Ego", by_name("foreign", "true"), after(1.0))) == [False, True, True]
    assert scripted(assigned, ("Ego", by_name("foreign", "false"), after(1.0))) == [False, False, False]
    assert scripted(("Ego", by_name("c", "false"), after(1.0)), ("Ego", by_name("c", "true"), after(1.5))) == [
        *(False, True, False)
    ]
