"""Path loss of links: blockage by vehicles, distance, and correlated shadowing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from radio_traffic import DT, exchange, message, radio

from eidrive_scenario.v2x.radio.budget import LinkBudget
from eidrive_scenario.v2x.radio.channel import RadioChannel
from eidrive_scenario.v2x.radio.profile import RadioProfile
from eidrive_scenario.v2x.radio_environment import LOS, NLOS, NLOSV, LineOfSightStates, RadioEnvironment

ROW = {name: (60.0 * place, 2.0 * place, 1.6) for place, name in enumerate("ABCDE")}


def test_shadowing_of_a_link_is_independent_of_other_transmissions() -> None:
    """The shadowing between A and B is equal if C transmits in each tick and if only two messages are sent."""

    def path_losses(senders: Sequence[str], ticks: Sequence[int]) -> dict[int, float | None]:
        carrier, events = radio(7), []
        for tick in range(40):
            now = DT * tick
            places = {name: (30.0 * row + 5.0 * row * now, 0.0, 1.5) for row, name in enumerate("ABC")}
            carrier.update_environment(RadioEnvironment(places))
            for name in places:
                carrier.deliver(name, now)
            active = [name for name in places if name in senders or (name == "A" and tick in ticks)]
            events += list(carrier.transmit([(message(name, tick, now), ["B"]) for name in active if name != "B"], now))
        return {event.number: event.path_loss_db for event in events if event.sender == "A"}

    alone, among_others = path_losses((), (10, 25)), path_losses("AC", ())
    assert set(alone) == {10, 25}
    assert all(among_others[number] == loss for number, loss in alone.items())
    assert len(set(among_others.values())) > 30


def behind(state: int, top: float = 3.3) -> Any:
    def sight(pairs: Sequence[tuple[str, str]]) -> LineOfSightStates:
        names = {ray: ("Firetruck",) for ray in range(len(pairs))} if state == NLOSV else {}
        heights = np.full(len(pairs), top if state == NLOSV else -np.inf)
        return LineOfSightStates(np.full(len(pairs), state), heights, names)

    return sight


@pytest.mark.parametrize(("rsu", "loss"), [(1.6, 9.0), (5.0, 5.0), (3.2, 9.0)])
def test_path_loss_with_blocking_truck_rises_by_the_tr_37_885_loss(rsu: float, loss: float) -> None:
    """TR 37.885 for a truck of 3.3 m: 9 dB if both antennas are lower, 5 dB if one is higher."""
    places = {"Ego": (0.0, 0.0, 1.5), "RSU": (60.0, 0.0, rsu)}
    profile = {"shadowing_db": 0, "path_loss": {"kind": "tr37885", "blockage": "mean"}}
    events = {state: exchange(radio(1, **profile), places, 20, sight=behind(state))[0] for state in (LOS, NLOSV, NLOS)}
    clear, blocked = (events[state][0] for state in (LOS, NLOSV))
    assert (clear.los, clear.blockers) == ("los", ())
    assert (blocked.los, blocked.blockers) == ("nlosv", ("Firetruck",))
    assert events[NLOS][0].los == "nlos"
    for first, second in zip(events[LOS], events[NLOSV], strict=True):
        assert second.path_loss_db - first.path_loss_db == pytest.approx(loss)  # type: ignore[operator]
        assert first.snr_db - second.snr_db == pytest.approx(loss)  # type: ignore[operator]
    assert clear.snr_db == pytest.approx(29.0 - clear.path_loss_db + 95.0)  # type: ignore[operator]


def test_delivery_ratio_falls_with_distance_down_to_lost_by_sensing() -> None:
    kept = []
    for distance in (20.0, 1000.0, 2000.0, 4000.0, 30000.0):
        places = {"A": (0.0, 0.0, 1.5), "B": (distance, 0.0, 1.5)}
        events, _ = exchange(radio(4, path_loss={"kind": "tr37885", "environment": "urban"}), places, 300, speed=10.0)
        kept.append(np.mean([event.outcome == "delivered" for event in events]))
    assert all(nearer >= farther for nearer, farther in pairwise(kept))
    assert kept[0] == 1.0
    assert kept[-1] == 0.0
    assert {event.reason for event in events} <= {"sensing", "half_duplex"}


def test_shadowing_is_symmetric_and_correlated_over_covered_distance() -> None:
    """Over 5 m with a decorrelation distance of 10 m the correlation is e^(-1/2)."""
    budget = LinkBudget(RadioProfile(line_of_sight="clear", decorrelation=10.0), 1)
    names = [f"{n:02}" for n in range(30)]
    series = []
    for step in range(60):
        places = {name: (100.0 * n, 5.0 * step if n == 0 else 0.0, 1.5) for n, name in enumerate(names)}
        held = budget.at(RadioEnvironment(places))
        assert np.array_equal(held.loss, held.loss.T)
        shadow = held.loss - held.mean_loss
        series.append(shadow[0, 1:])
        if step == 0:
            still = shadow[1:, 1:]
        assert np.array_equal(shadow[1:, 1:], still), "the other stations do not move"
    values = np.array(series)
    assert values.std() == pytest.approx(3.0, abs=0.3)
    lagged = np.mean(values[1:] * values[:-1]) / np.mean(values**2)
    assert lagged == pytest.approx(math.exp(-0.5), abs=0.06)


def test_shadowing_of_a_pair_is_kept_while_other_stations_change() -> None:
    budget = LinkBudget(RadioProfile(line_of_sight="clear"), 1)
    two = {"B": (0.0, 0.0, 1.5), "D": (50.0, 0.0, 1.5)}
    loss = budget.at(RadioEnvironment(two)).loss[0, 1]
    three = {"A": (10.0, 5.0, 1.5), **two}
    assert budget.at(RadioEnvironment(three)).loss[1, 2] == loss
    assert budget.at(RadioEnvironment(two)).loss[0, 1] == loss


def test_shadowing_is_kept_when_the_profile_is_replaced() -> None:
    places = {"A": (0.0, 0.0, 1.5), "B": (40.0, 0.0, 1.5), "C": (70.0, 9.0, 1.5)}
    kept, other = radio(1), radio(1, tx_power_dbm=10)
    kept.update_environment(RadioEnvironment(places))

    def losses(carrier: RadioChannel, number: int) -> list[float | None]:
        now = 0.1 * number
        carrier.update_environment(RadioEnvironment(places))
        events = carrier.transmit([(message("A", number, now), ["B", "C"])], now)
        return [event.path_loss_db for event in [*events, *carrier.transmit([], now + 0.05)]]

    before = losses(kept, 0)
    other.continue_from(kept)
    assert losses(other, 1) == before
    assert losses(radio(2), 1) != before
