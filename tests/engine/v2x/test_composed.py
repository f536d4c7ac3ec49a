"""Composed channel: loss and delay depend only on message and link."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from pydantic import TypeAdapter
from radio_traffic import composed

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.v2x.link_models.composed import ComposedChannel
from eidrive_scenario.v2x.link_models.delay import Delay, LognormalDelay
from eidrive_scenario.v2x.messages.generation import cpm_size
from eidrive_scenario.v2x.messages.message import Message, StationState


def message(sender: str, number: int) -> Message:
    time = number * 0.05
    return Message(sender, number, time, StationState(time, 0, 0, 0, 0, 0), Detections(time), 121)


def received(carrier: ComposedChannel, count: int = 400) -> set[int]:
    """Return the numbers of the messages of RSU that reach Ego."""
    sent = [carrier.send(message("RSU", number), ["Ego"], number * 0.05)[0] for number in range(count)]
    return {event.number for event in sent if event.outcome == "delivered"}


def bernoulli(probability: float, scope: str = "link") -> dict[str, object]:
    return {"kind": "bernoulli", "probability": probability, "scope": scope}


@pytest.mark.parametrize("scope", ["link", "frame"])
def test_messages_delivered_with_more_loss_are_delivered_with_less(scope: str) -> None:
    sets = [received(composed(4, loss=bernoulli(p, scope))) for p in (0.0, 0.1, 0.3, 0.6, 0.9, 1.0)]
    assert all(larger > smaller for larger, smaller in pairwise(sets))
    assert len(sets[0]) == 400
    assert sets[-1] == set()


def test_bernoulli_loss_ratio_is_the_probability() -> None:
    """Five standard deviations of 4000 draws at 0.3 are 0.036."""
    kept = received(composed(1, loss=bernoulli(0.3)), 4000)
    assert len(kept) / 4000 == pytest.approx(0.7, abs=5 * math.sqrt(0.21 / 4000))


def test_outcome_of_a_link_is_independent_of_other_stations() -> None:
    profile = {"loss": bernoulli(0.4), "delay": {"kind": "shifted_gamma", "minimum": 0.01, "mean": 0.1}}
    alone, crowd = composed(7, **profile), composed(7, **profile)
    for number in range(300):
        expected = alone.send(message("RSU", number), ["Ego"], number * 0.05)
        senders = ["X", "RSU", "A"] if number % 2 else ["A", "X", "RSU"]
        events = [
            event
            for sender in senders
            for event in crowd.send(message(sender, number), ["A", "Ego", "X"], number * 0.05)
        ]
        assert [event for event in events if (event.sender, event.receiver) == ("RSU", "Ego")] == list(expected)


def test_delay_is_independent_of_loss() -> None:
    delay = {"kind": "uniform", "minimum": 0.0, "maximum": 1.0}
    calm = [composed(2, delay=delay).send(message("RSU", n), ["Ego"], 0.0)[0].arrives for n in range(50)]
    lossy = composed(2, delay=delay, loss=bernoulli(0.5))
    for number, arrives in enumerate(calm):
        event = lossy.send(message("RSU", number), ["Ego"], 0.0)[0]
        assert event.arrives in (None, arrives)


def test_losses_of_seeds_and_links_differ() -> None:
    assert received(composed(1, loss=bernoulli(0.5))) != received(composed(2, loss=bernoulli(0.5)))
    carrier = composed(1, loss=bernoulli(0.5))
    outcomes = [
        tuple(event.outcome for event in carrier.send(message("RSU", number), ["Ego", "Other"], 0.0))
        for number in range(200)
    ]
    assert {("lost", "delivered"), ("delivered", "lost")} <= set(outcomes)


def test_frame_loss_drops_all_messages_of_a_receiver_in_a_tick() -> None:
    """Fault of the published code: own detections and received messages are lost together."""
    carrier = composed(5, own_perception=True, loss=bernoulli(0.3, "frame"))
    per_tick: list[dict[str, set[str]]] = []
    for number in range(200):
        outcomes: dict[str, set[str]] = {}
        for sender in ("Ego", "RSU"):
            for event in carrier.send(message(sender, number), ["Ego", "RSU"], number * 0.05):
                outcomes.setdefault(event.receiver, set()).add(event.outcome)
        per_tick.append(outcomes)
    assert all(len(known) == 1 for outcomes in per_tick for known in outcomes.values())
    lost = [outcomes["Ego"] == {"lost"} for outcomes in per_tick]
    assert sum(lost) / 200 == pytest.approx(0.3, abs=5 * math.sqrt(0.21 / 200))
    assert lost != [outcomes["RSU"] == {"lost"} for outcomes in per_tick]


DISTRIBUTIONS = [
    ({"kind": "constant", "seconds": 0.3}, 0.3, 0.0),
    ({"kind": "uniform", "minimum": 0.1, "maximum": 0.4}, 0.25, 0.3 / math.sqrt(12)),
    ({"kind": "shifted_gamma", "minimum": 0.02, "mean": 0.1}, 0.1, 0.08 / math.sqrt(2)),
    ({"kind": "lognormal", "mean": 0.1, "sd": 0.05, "minimum": 0.02}, 0.12, 0.05),
    # a normal distribution truncated at its mean is half-normal: mean sd sqrt(2/pi), variance sd² (1 - 2/pi)
    (
        {"kind": "truncated_normal", "mean": 0.0, "sd": 0.1},
        0.1 * math.sqrt(2 / math.pi),
        0.1 * math.sqrt(1 - 2 / math.pi),
    ),
    # far in the tail, at z = 7 standard deviations, the hazard h = 7.137546: mean h, variance 1 + z h - h²
    (
        {"kind": "truncated_normal", "mean": 0.0, "sd": 0.01, "minimum": 0.07},
        0.01 * 7.137546,
        0.01 * math.sqrt(1.0 + 7.0 * 7.137546 - 7.137546**2),
    ),
]


@pytest.mark.parametrize(("settings", "mean", "sd"), DISTRIBUTIONS, ids=[str(row[0]["kind"]) for row in DISTRIBUTIONS])
def test_delay_distribution_has_its_mean_and_spread(settings: dict[str, object], mean: float, sd: float) -> None:
    """Moments by the midpoint rule over the quantile function."""
    delay = TypeAdapter(Delay).validate_python(settings)
    values = np.array([delay.quantile(u) for u in (np.arange(20000) + 0.5) / 20000])
    assert values.mean() == pytest.approx(mean, rel=1e-3)
    assert values.std() == pytest.approx(sd, rel=1e-2, abs=1e-12)
    assert np.all(np.diff(values) >= 0)


def test_delay_of_every_message_grows_with_the_mean() -> None:
    short, long = (composed(9, delay={"kind": "lognormal", "mean": mean, "sd": 0.05}) for mean in (0.1, 0.2))
    for number in range(100):
        first, second = (c.send(message("RSU", number), ["Ego"], 0.0)[0].arrives for c in (short, long))
        assert first is not None
        assert second is not None
        assert first < second


@pytest.mark.parametrize(("mean", "sd"), [(0.1, 0.05), (1e-3, 10.0), (1e-9, 1e6), (1e6, 1e6)])
def test_lognormal_delay_of_any_mean_and_sd_has_its_median(mean: float, sd: float) -> None:
    """The median of a lognormal distribution is mean / sqrt(1 + (sd / mean)²), also if it underflows to 0."""
    delay = LognormalDelay(kind="lognormal", mean=mean, sd=sd, minimum=0.02)
    median = mean * (mean / math.hypot(mean, sd))
    assert delay.quantile(0.5) - 0.02 == pytest.approx(median, rel=1e-9, abs=1e-15)
    assert all(math.isfinite(delay.quantile(u)) for u in (1e-300, 1e-9, 0.1, 0.9, 1.0 - 1e-16))


def test_cpm_size_by_number_of_objects_and_sensors() -> None:
    assert cpm_size(0, 1) == 156
    assert cpm_size(10, 2) == 541
