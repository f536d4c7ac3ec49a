"""Radio channel: causality, order of stations, symmetry, blockage and distance."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from radio_traffic import DT, QUIET, Place, exchange, message, radio

from eidrive_scenario.simulation import RunSettings, run_file
from eidrive_scenario.v2x.link_models.composed import ComposedChannel, ComposedProfile
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.radio_environment import RadioEnvironment
from eidrive_scenario.v2x.standards import ieee80211p_airtime

ROW = {name: (60.0 * place, 2.0 * place, 1.6) for place, name in enumerate("ABCDE")}
PROFILES: list[dict[str, object]] = [
    {"technology": "80211p"},
    {"technology": "80211p", "congestion": {"kind": "reactive"}, "queue": {"discipline": "lcfs"}},
    {"technology": "80211p", "congestion": {"kind": "limeric"}, "queue": {"length": 2}},
    {"technology": "80211p", "delay": {"kind": "lognormal", "mean": 0.05, "sd": 0.05}, "jitter": 0.0},
    {"technology": "80211p", "loss": {"kind": "gilbert_elliott", "probability": 0.3, "burst": 4}},
    {"technology": "80211p", "background": {"kind": "80211p", "density": 0.1}},
    {"technology": "cv2x_mode4"},
    {"technology": "cv2x_mode4", "sidelink": {"interval": 0.05}, "queue": {"discipline": "lcfs"}},
    {"technology": "80211p", "fading": {"kind": "nakagami", "m": 1}},
    {"technology": "cv2x_mode4", "fading": {"kind": "nakagami", "m": [3, 1], "distances": [80]}},
    {"technology": "cv2x_mode4", "background": {"kind": "cv2x_mode4", "density": 0.2}, "line_of_sight": "random"},
]


@pytest.mark.statistical
@settings(max_examples=40, deadline=None)
@given(st.sampled_from(PROFILES), st.integers(0, 5), st.sampled_from([(300,), (121, 3000)]), st.floats(0, 40))
def test_radio_channel_delivers_each_message_once_after_arrival_and_counts_all(
    profile: dict[str, object], seed: int, sizes: tuple[int, ...], speed: float
) -> None:
    carrier = radio(seed, **profile)
    events, deliveries = exchange(carrier, ROW, 30, speed=speed, sizes=sizes)
    now = 30 * DT
    outcomes = {(event.sender, event.receiver, event.number): event for event in events}
    assert len(outcomes) == len(events), "each outcome is returned once"
    for receiver, time, received in deliveries:
        event = outcomes.pop((received.message.sender, receiver, received.message.number))
        assert event.outcome == "delivered"
        assert event.arrives == received.arrived
        assert event.sent < event.arrives <= time + 1e-9
        assert event.path_loss_db is not None
    carrier.update_environment(RadioEnvironment(ROW))
    statistics = carrier.statistics(now).values()
    assert all(link.sent == link.received + link.lost + link.in_flight for link in statistics)
    assert all(sum(link.lost_by.values()) == link.lost for link in statistics)
    assert sum(link.sent for link in statistics) == 30 * 5 * 4
    assert sum(link.received for link in statistics) == len(deliveries)
    assert sum(link.lost for link in statistics) == sum(event.outcome == "lost" for event in events)
    for receiver in ROW:
        carrier.deliver(receiver, now + 10.0)
    assert all(link.in_flight == 0 for link in carrier.statistics(now + 10.0).values())


@pytest.mark.parametrize("profile", PROFILES, ids=range(len(PROFILES)))
def test_radio_channel_with_reversed_stations_returns_equal_outcomes(profile: dict[str, object]) -> None:
    def outcomes(places: dict[str, Place]) -> set[LinkEvent]:
        return set(exchange(radio(3, **profile), places, 30, sizes=(200, 800))[0])

    forward = outcomes(ROW)
    assert outcomes(dict(reversed(ROW.items()))) == forward
    assert len(forward) > 300


def test_radio_channel_without_reordering_delays_messages_behind_earlier_ones() -> None:
    delay = {"delay": {"kind": "uniform", "minimum": 0.0, "maximum": 0.5}}
    arrivals = {}
    for reordering in (True, False):
        carrier = radio(2, reordering=reordering, **delay, **QUIET)
        events, _ = exchange(carrier, {"A": (0.0, 0.0, 1.5), "B": (30.0, 0.0, 1.5)}, 100)
        arrivals[reordering] = [event.arrives for event in events if event.sender == "A" and event.arrives is not None]
    assert arrivals[True] != sorted(arrivals[True])
    assert arrivals[False] == sorted(arrivals[False])
    assert all(late >= early for late, early in zip(arrivals[False], arrivals[True], strict=True))


@pytest.mark.parametrize("technology", ["80211p", "cv2x_mode4", "nr_v2x_mode2"])
@pytest.mark.parametrize(
    "delay", [{"kind": "constant"}, {"kind": "uniform", "minimum": 0.0, "maximum": 0.02}], ids=["constant", "uniform"]
)
def test_radio_channel_without_reordering_delivers_kinds_by_message_number(
    technology: str, delay: dict[str, object]
) -> None:
    """A CAM and a CPM of each tick are ready in random order."""

    def numbers(reordering: bool) -> list[int]:
        carrier = radio(1, technology=technology, reordering=reordering, jitter=0.04, delay=delay, **QUIET)
        received = []
        for tick in range(100):
            now = DT * tick
            carrier.update_environment(RadioEnvironment({"A": (0.0, 0.0, 1.5), "B": (30.0, 0.0, 1.5)}))
            received += [delivery.message.number for delivery in carrier.deliver("B", now)]
            cam = msgspec.structs.replace(message("A", 2 * tick, now), kind="cam")
            carrier.transmit([(cam, ["B"]), (message("A", 2 * tick + 1, now, 190), ["B"])], now)
        return received

    assert numbers(True) != sorted(numbers(True))
    assert numbers(False) == sorted(numbers(False))
    assert len(numbers(False)) > 40


@pytest.mark.parametrize("distance", [990.0, 1000.0, 1049.0, 40_010.0])
def test_reception_of_radio_channel_has_classes_of_25_m_at_any_distance(distance: float) -> None:
    """Half of the messages are lost by the loss model, which counts them itself."""
    strong = {"path_loss": {"kind": "log_distance", "exponent": 2, "reference_loss_db": 0}, "shadowing_db": 0}
    carrier = radio(1, loss={"kind": "bernoulli", "probability": 0.5}, line_of_sight="clear", **strong)
    events, _ = exchange(carrier, {"A": (0.0, 0.0, 1.5), "B": (distance, 0.0, 1.5)}, 100)
    outcomes = [event.outcome for event in events if event.sender == "A"]
    delivered = outcomes.count("delivered")
    assert 0 < delivered < len(outcomes)
    assert carrier.statistics(5.0)["A", "B"].reception == ((25.0 * (distance // 25.0), len(outcomes), delivered),)


def test_channel_busy_ratio_of_a_late_station_covers_its_own_time() -> None:
    """C enters in the middle of the run and measures the same channel busy ratio as the others."""
    carrier = radio(1, **QUIET)
    for tick in range(200):
        now = DT * tick
        present = "AB" if tick < 100 else "ABC"
        carrier.update_environment(RadioEnvironment({name: (20.0 * row, 0.0, 1.5) for row, name in enumerate(present)}))
        carrier.transmit([(message(name, tick, now, 1400), ["A"]) for name in "AB" if name != "A"], now)
    ratios = [carrier.channel_busy_ratio(name) for name in "ABC"]
    assert ratios == pytest.approx([ratios[0]] * 3, rel=0.03)
    assert ratios[0] == pytest.approx(ieee80211p_airtime(1400, 6.0, 1400) / DT, rel=0.03)


@pytest.mark.parametrize("profile", PROFILES[:7:6], ids=["80211p", "cv2x"])
def test_radio_channel_in_rotated_and_mirrored_scene_returns_equal_outcomes(profile: dict[str, object]) -> None:
    def outcomes(turn: Any) -> list[tuple[object, ...]]:
        places = {name: turn(*place) for name, place in ROW.items()}
        return sorted(
            (e.sender, e.receiver, e.number, e.outcome, e.reason) for e in exchange(radio(2, **profile), places, 40)[0]
        )

    cos, sin = math.cos(0.7), math.sin(0.7)
    original = outcomes(lambda x, y, z: (x, y, z))
    assert outcomes(lambda x, y, z: (cos * x - sin * y + 9.0, sin * x + cos * y, z)) == original
    assert outcomes(lambda x, y, z: (x, -y, z)) == original


@pytest.mark.exhaustive
@pytest.mark.parametrize("technology", ["80211p", "cv2x_mode4"])
def test_radio_channel_on_rotated_lattice_returns_equal_outcomes(technology: str) -> None:
    """Equal powers stay equal although the distances of the rotated positions differ in their last digits."""

    def outcomes(angle: float) -> list[tuple[object, ...]]:
        cos, sin = math.cos(angle), math.sin(angle)
        lattice = {f"{x}{y}": (400.0 * x, 400.0 * y) for x in range(4) for y in range(4)}
        places = {name: (cos * x - sin * y, sin * x + cos * y, 1.5) for name, (x, y) in lattice.items()}
        events = exchange(
            radio(2, **QUIET, technology=technology, sensing_dbm=-95.0), places, 40, sizes=(190,), dt=0.1
        )[0]
        return sorted((e.sender, e.receiver, e.number, e.outcome, e.reason, e.arrives or 0.0) for e in events)

    assert outcomes(0.7) == outcomes(0.0)


def test_radio_channel_messages_of_removed_stations_are_lost_as_absent() -> None:
    places = {"A": (0.0, 0.0, 1.5), "B": (50.0, 0.0, 1.5), "C": (90.0, 0.0, 1.5)}
    carrier = radio(1, jitter=0.04)
    carrier.update_environment(RadioEnvironment(places))
    carrier.transmit([(message("A", 0, 0.0), ["B", "C"]), (message("B", 0, 0.0), ["A", "C"])], 0.0)
    del places["B"]
    carrier.update_environment(RadioEnvironment(places))
    carrier.deliver("A", 0.05)
    events = {(e.sender, e.receiver): e for e in carrier.transmit([], 0.05)}
    assert {link: event.reason for link, event in events.items()} == {
        ("A", "B"): "absent", ("A", "C"): "", ("B", "A"): "absent", ("B", "C"): "absent",
    }  # fmt: skip
    statistics = carrier.statistics(0.05)
    assert all(link.sent == link.received + link.lost + link.in_flight == 1 for link in statistics.values())


def test_continue_from_radio_channel_keeps_its_queued_messages() -> None:
    places = {"A": (0.0, 0.0, 1.5), "B": (50.0, 0.0, 1.5)}
    old = radio(1, jitter=0.04)
    old.update_environment(RadioEnvironment(places))
    old.transmit([(message("A", 0, 0.0), ["B"])], 0.0)
    new = ComposedChannel(ComposedProfile.model_validate({"loss": {"kind": "bernoulli", "probability": 1.0}}), 1)
    new.continue_from(old)
    events = new.transmit([(message("A", 1, 0.05), ["B"])], 0.05)
    assert [(event.number, event.outcome) for event in events] == [(0, "delivered"), (1, "lost")]
    assert [received.message.number for received in new.deliver("B", 0.1)] == [0]
    link = new.statistics(0.1)["A", "B"]
    assert (link.sent, link.received, link.lost, link.in_flight) == (2, 1, 1, 0)


@pytest.mark.parametrize("technology", ["80211p", "cv2x_mode4", "nr_v2x_mode2"])
def test_radio_channel_replaced_before_its_first_tick_has_no_effect(technology: str) -> None:
    new = radio(1, technology=technology, **QUIET)
    new.continue_from(radio(2, technology=technology, **QUIET))
    events, deliveries = exchange(new, ROW, 10)
    assert events == exchange(radio(1, technology=technology, **QUIET), ROW, 10)[0]
    assert deliveries


def test_transmit_of_a_station_without_antenna_position_raises() -> None:
    with pytest.raises(ValueError, match="station 'A' has no antenna position"):
        radio().transmit([(message("A", 0, 0.0), ["B"])], 0.0)


@pytest.mark.parametrize("technology", ["80211p", "cv2x_mode4"])
@pytest.mark.parametrize(
    "setting",
    [
        {"antenna_gain_dbi": 1e5},
        {"noise_dbm": 1e308},
        {"noise_dbm": -1e5},
        {"sensing_dbm": -1e308},
        {"shadowing_db": 1e5},
        {"jitter": 1e308},
        {"queue": {"length": 10**30}},
        {"path_loss": {"kind": "log_distance", "reference_loss_db": -1e308}},
        {"path_loss": {"kind": "log_distance", "per_vehicle_db": 1e308}},
        {"congestion": {"kind": "reactive", "limits": [1.0], "intervals": [1e300]}},
        {"congestion": {"kind": "limeric", "interval_max": 1e300}},
    ],
)
def test_radio_profile_with_value_out_of_range_raises(technology: str, setting: dict[str, Any]) -> None:
    """Such values caused overflows or extended the end of a run by their duration."""
    with pytest.raises(ValueError, match=r"(less|greater) than or equal"):
        radio(technology=technology, **setting)


@pytest.mark.parametrize("discipline", ["fifo", "lcfs"])
@pytest.mark.parametrize("technology", ["80211p", "cv2x_mode4"])
def test_radio_channel_each_message_has_one_outcome_per_receiver(technology: str, discipline: str) -> None:
    """Stations enter and leave while the offered load exceeds the capacity of the medium."""
    all_places: dict[str, Place] = {f"S{n}": (30.0 * n, 0.0, 1.5) for n in range(8)}
    carrier = radio(1, **QUIET, technology=technology, queue={"discipline": discipline, "length": 3})
    sent_messages: list[tuple[str, int, str]] = []
    deliveries: list[tuple[str, int, str]] = []
    events: list[LinkEvent] = []
    for tick in range(100):
        now = DT * tick
        places = {name: place for row, (name, place) in enumerate(all_places.items()) if (tick // 3) % (row + 2) != 1}
        carrier.update_environment(RadioEnvironment(places))
        for name in places:
            deliveries += [(r.message.sender, r.message.number, name) for r in carrier.deliver(name, now)]
        outbox = [
            (message(name, 2 * tick + part, now, (190, 900, 2500)[tick % 3]), [n for n in places if n != name])
            for name in places
            for part in (0, 1)
        ]
        sent_messages += [(m.sender, m.number, receiver) for m, receivers in outbox for receiver in receivers]
        events += carrier.transmit(outbox, now)
    carrier.finalize()
    events += carrier.drain_events()
    assert sorted((event.sender, event.number, event.receiver) for event in events) == sorted(sent_messages)
    delivered = {(e.sender, e.number, e.receiver) for e in events if e.outcome == "delivered"}
    assert len(deliveries) == len(set(deliveries)) > 0
    assert set(deliveries) <= delivered
    assert {event.reason for event in events} >= {"", "absent", "half_duplex", "collision"}


@pytest.mark.parametrize(("jitter", "warned"), [(0, True), (0.01, False)])
def test_stations_that_always_transmit_at_once_are_a_warning(jitter: float, warned: bool) -> None:
    """With an idle channel each station transmits 110 µs (AIFS) after the message (IEEE 802.11): all at one instant."""
    channel = f"{{model: radio, jitter: {jitter}}}"
    result = run_file("coop/scenario_1", settings=RunSettings(channel=channel, time_limit=1.0))
    simultaneous = [text for text in result.warnings if "half_duplex" in text]
    assert [text.startswith("station 'Ego' receives none of") for text in simultaneous] == [True] * warned
    assert (result.links["RSU", "Ego"].received == 0) == warned
