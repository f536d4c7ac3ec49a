"""Signal controllers: phases, delays, states; and the names of signals."""

from __future__ import annotations

import math

import pytest
from opendrive_xml import map_xml, road_xml

from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.state.signals import Signals

SIGNALS = """<signals><signal s="50" t="-5" id="7" name="" dynamic="yes" orientation="+" type="1000001" subtype="-1"/>
  <signal s="60" t="-5" id="8" name="" dynamic="yes" orientation="+" type="1000002" subtype="-1"/></signals>"""
CONTROLLER = '<controller id="c1" name="crossing"><control signalId="7"/><control signalId="8"/></controller>'
ROAD = map_xml(road_xml(extra=SIGNALS), rest=CONTROLLER)


def phase(name: str, duration: float, group: str | None = None, **states: str) -> model.Phase:
    return model.Phase(
        name=name,
        duration=duration,
        traffic_signal_state=tuple(
            model.TrafficSignalState(traffic_signal_id=key.lstrip("s"), state=value) for key, value in states.items()
        ),
        traffic_signal_group_state=model.TrafficSignalGroupState(state=group) if group is not None else None,
    )


def controller(
    *phases: model.Phase, name: str = "c1", reference: str | None = None, delay: float | None = None
) -> model.TrafficSignalController:
    return model.TrafficSignalController(name=name, phase=phases, reference=reference, delay=delay)


def signals(*controllers: model.TrafficSignalController, roads: RoadNetwork | None = None) -> Signals:
    return Signals(model.TrafficSignals(traffic_signal_controller=controllers), roads)


CYCLE = (phase("go", 10, s7="green"), phase("caution", 3, s7="yellow"), phase("stop", 7, s7="red"))
SILENT = (phase("go", 10), phase("caution", 3), phase("stop", 7))


def course(found: Signals, times: list[float], name: str = "c1") -> list[str | None]:
    shown = []
    for time in times:
        found.advance(time)
        shown.append(found.phase(name))
    return shown


def test_phases_are_cyclic() -> None:
    found = signals(controller(*CYCLE))
    assert course(found, [0, 9.95, 10, 12.95, 13, 19.95, 20, 29.95, 30, 193]) == [
        *("go", "go", "caution", "caution", "stop", "stop", "go", "go", "caution", "stop")
    ]
    assert found.state("7") == "red"


def test_phases_change_in_their_tick_despite_rounding() -> None:
    found = signals(controller(*(phase(f"p{number}", 0.1) for number in range(3))))
    assert course(found, [tick * 0.1 for tick in range(3000)]) == [f"p{tick % 3}" for tick in range(3000)]


@pytest.mark.element("TrafficSignalController")
def test_delayed_controller_follows_its_reference_from_the_start() -> None:
    found = signals(controller(*CYCLE), controller(*CYCLE, name="c2", reference="c1", delay=5))
    assert course(found, [0, 4.95, 5, 14.95, 15, 18, 25], "c2") == [
        *("stop", "stop", "go", "go", "caution", "stop", "go")
    ]
    chain = signals(
        controller(*CYCLE),
        controller(*CYCLE, name="c2", reference="c1", delay=5),
        controller(*CYCLE, name="c3", reference="c2", delay=20),
    )
    assert course(chain, [0, 5, 15], "c3") == ["stop", "go", "caution"]


def test_action_starts_a_phase_and_the_cycle_continues() -> None:
    found = signals(controller(*CYCLE), controller(*SILENT, name="c2", reference="c1", delay=5))
    found.advance(0.0)
    found.set_phase("c1", "stop", 4.0)
    assert (found.phase("c1"), found.state("7")) == ("stop", "red")
    assert course(found, [10.95, 11, 20.95, 21]) == ["stop", "go", "go", "caution"]
    # c1's first phase begins at 11 s, c2's 5 s later
    assert course(found, [15.95, 16, 26], "c2") == ["stop", "go", "caution"]
    found.set_phase("c2", "go", 30.0)
    assert course(found, [39.95, 40], "c2") == ["go", "caution"]
    assert course(found, [31], "c1") == ["go"]
    # c1's cycle begins at 33 s instead of 31 s, c2's at 32 s instead of 30 s
    found.set_phase("c1", "go", 33.0)
    assert course(found, [41.95, 42], "c2") == ["go", "caution"]


def test_phase_without_end_is_kept() -> None:
    endless = (phase("go", 2), phase("dark", math.inf), phase("never", 1))
    found = signals(controller(*endless), controller(*endless, name="late", reference="c1", delay=3))
    assert course(found, [0, 2, 1e6]) == ["go", "dark", "dark"]
    assert course(found, [2.9, 3, 5], "late") == [None, "go", "dark"]
    found.set_phase("c1", "never", 7.0)
    assert course(found, [7.5, 8, 10]) == ["never", "go", "dark"]


def test_phases_without_duration_are_skipped() -> None:
    found = signals(controller(phase("none", 0), phase("go", 2), phase("nothing", 0)))
    assert course(found, [0, 1, 2, 3]) == ["go"] * 4
    assert course(signals(controller(phase("a", 0), phase("b", 0))), [0, 5]) == ["a", "a"]


def test_state_set_by_action_holds_until_the_next_phase() -> None:
    found = signals(controller(*CYCLE))
    found.advance(0.0)
    found.set_state("7", "flashing")
    found.advance(9.0)
    assert found.state("7") == "flashing"
    found.advance(10.0)
    assert found.state("7") == "yellow"


def test_group_state_holds_for_its_signals_unless_set_individually() -> None:
    roads = RoadNetwork.parse(ROAD)
    found = signals(controller(phase("go", 5, group="green", s8="red")), roads=roads)
    found.advance(0.0)
    assert found.states == {"7": "green", "8": "red"}
    by_name = signals(controller(phase("go", 5, group="green"), name="crossing"), roads=roads)
    by_name.advance(0.0)
    assert by_name.states == {"7": "green", "8": "green"}
    of_1_2 = model.Phase(
        name="go", duration=5, traffice_signal_group_state=model.TrafficSignalGroupState(state="red;off")
    )
    old = signals(controller(of_1_2), roads=roads)
    old.advance(0.0)
    assert old.states == {"7": "red;off", "8": "red;off"}


def test_states_are_the_same_object_without_a_change() -> None:
    found = signals(controller(*CYCLE))
    found.advance(0.0)
    before = found.states
    found.advance(5.0)
    found.set_state("7", "green")
    assert found.states is before
    found.set_state("7", "red")
    assert (found.states["7"], before["7"]) == ("red", "green")


def test_signal_names_of_scenario_runner_are_resolved() -> None:
    """The y axis of CARLA points to the right: the signal at (50, -5) has the coordinates 50,5."""
    found = signals(roads=RoadNetwork.parse(ROAD))
    assert found.identify("id=8") == "8"
    assert found.identify("pos=50.5,4.0") == "7"
    assert found.identify("pos=50.5, 7.5") == "pos=50.5, 7.5"
    assert found.identify("pos=here") == "pos=here"
    found.set_state("pos=50,5", "RED")
    assert found.state("7") == "RED"
    assert found.must_stop("7")
    assert not found.must_stop("8")


def test_unknown_signal_warning_suggests_the_nearest_name() -> None:
    roads = RoadNetwork.parse(ROAD.replace('id="7" name', 'id="north" name').replace('Id="7"', 'Id="north"'))
    found = signals(roads=roads)
    element = model.TrafficSignalStateAction(name="nord", state="red")
    assert "did you mean 'north'" in str(found.unknown("nord", element))
    assert found.unknown("north", element) is None


@pytest.mark.parametrize(
    ("controllers", "expected"),
    [
        ([controller(phase("go", -1))], "phase 'go' has an invalid duration; got -1 s"),
        ([controller(phase("go", math.nan))], "phase 'go' has an invalid duration; got nan s"),
        ([controller(*CYCLE, reference="c1", delay=-5)], "negative delay; got -5 s"),
        (
            [controller(*CYCLE, reference="c2", delay=1), controller(*CYCLE, name="c2", reference="c1", delay=1)],
            "'c1': reference to itself",
        ),
    ],
)
def test_invalid_controller_declaration_is_an_error(
    controllers: list[model.TrafficSignalController], expected: str
) -> None:
    assert any(expected in str(diagnostic) for diagnostic in signals(*controllers).errors)


@pytest.mark.parametrize(
    ("controllers", "expected"),
    [
        ([controller(*CYCLE, delay=5)], "delay without a reference"),
        ([controller(*CYCLE, reference="c9", delay=5)], "'c9' has no phases"),
        ([controller(*CYCLE), controller(*CYCLE, name="c2", reference="c1")], "without a delay"),
        ([controller(*CYCLE), controller(phase("go", 5), name="c2", reference="c1", delay=1)], "cycle of 5 s, but"),
    ],
)
def test_questionable_controller_declaration_is_a_warning(
    controllers: list[model.TrafficSignalController], expected: str
) -> None:
    found = signals(*controllers)
    assert found.errors == ()
    assert any(expected in str(diagnostic) for diagnostic in found.warnings)


@pytest.mark.parametrize(
    ("semantics", "stops"),
    [
        ("stop", True),
        ("attention_go", True),
        ("go", False),
        ("attention_stop", True),
        ("caution", False),
        ("fallback", False),
    ],
)
def test_phase_without_states_has_the_meaning_of_its_semantics(semantics: str, stops: bool) -> None:
    """Version 1.4: stop, and attention before and after it, require a stop. Signal 8 has no yellow lamp."""
    part = model.Phase(name="p", duration=5.0, semantics=model.TrafficSignalSemantics(semantics))
    found = signals(controller(part), roads=RoadNetwork.parse(ROAD))
    found.advance(0.0)
    assert [found.must_stop(name) for name in ("7", "8")] == [stops, stops]


def test_states_of_a_phase_precede_its_semantics() -> None:
    stated = model.Phase(
        name="p",
        duration=5.0,
        semantics=model.TrafficSignalSemantics.GO,
        traffic_signal_state=(model.TrafficSignalState(traffic_signal_id="7", state="red"),),
    )
    found = signals(controller(stated), roads=RoadNetwork.parse(ROAD))
    found.advance(0.0)
    assert (found.state("7"), found.state("8")) == ("red", None)
