"""Loss and delay belong to a message and a link, whoever else talks."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from pydantic import TypeAdapter

from eidrive_scenario.detections import Detections
from eidrive_scenario.v2x.link_models.composed import ComposedChannel, ComposedProfile
from eidrive_scenario.v2x.link_models.delay import Delay, LognormalDelay
from eidrive_scenario.v2x.messages.message import Message, StationState
from eidrive_scenario.v2x.messages.size import cpm_size


def channel(seed: int = 0, **profile: object) -> ComposedChannel:
    return ComposedChannel(ComposedProfile.model_validate(profile), seed)


def message(sender: str, number: int) -> Message:
    time = number * 0.05
    return Message(sender, number, time, StationState(time, 0, 0, 0, 0, 0), Detections(time), 121)


def received(carrier: ComposedChannel, count: int = 400) -> set[int]:
    """Numbers of RSU's messages that are not lost on the way to Ego."""
    sent = [carrier.send(message("RSU", number), ["Ego"], number * 0.05)[0] for number in range(count)]
    return {event.number for event in sent if event.outcome == "delivered"}


def bernoulli(probability: float, scope: str = "link") -> dict[str, object]:
    return {"kind": "bernoulli", "probability": probability, "scope": scope}


@pytest.mark.parametrize("scope", ["link", "frame"])
def test_what_arrives_with_more_loss_arrives_with_less(scope: str) -> None:
    sets = [received(channel(4, loss=bernoulli(p, scope))) for p in (0.0, 0.1, 0.3, 0.6, 0.9, 1.0)]
    assert all(larger > smaller for larger, smaller in pairwise(sets))
    assert len(sets[0]) == 400
    assert sets[-1] == set()


def test_the_share_lost_is_the_probability() -> None:
    """4000 draws at 0.3: five standard deviations are 0.036."""
    kept = received(channel(1, loss=bernoulli(0.3)), 4000)
    assert len(kept) / 4000 == pytest.approx(0.7, abs=5 * math.sqrt(0.21 / 4000))


def test_a_link_s_fate_depends_neither_on_other_stations_nor_on_their_order() -> None:
    profile = {"loss": bernoulli(0.4), "delay": {"kind": "shifted_gamma", "minimum": 0.01, "mean": 0.1}}
    alone, crowd = channel(7, **profile), channel(7, **profile)
    for number in range(300):
        expected = alone.send(message("RSU", number), ["Ego"], number * 0.05)
        senders = ["X", "RSU", "A"] if number % 2 else ["A", "X", "RSU"]
        events = [
            event
            for sender in senders
            for event in crowd.send(message(sender, number), ["A", "Ego", "X"], number * 0.05)
        ]
        assert [event for event in events if (event.sender, event.receiver) == ("RSU", "Ego")] == list(expected)


def test_loss_does_not_shift_the_delays() -> None:
    delay = {"kind": "uniform", "minimum": 0.0, "maximum": 1.0}
    calm = [channel(2, delay=delay).send(message("RSU", n), ["Ego"], 0.0)[0].arrives for n in range(50)]
    lossy = channel(2, delay=delay, loss=bernoulli(0.5))
    for number, arrives in enumerate(calm):
        event = lossy.send(message("RSU", number), ["Ego"], 0.0)[0]
        assert event.arrives in (None, arrives)


def test_seeds_and_links_differ() -> None:
    assert received(channel(1, loss=bernoulli(0.5))) != received(channel(2, loss=bernoulli(0.5)))
    carrier = channel(1, loss=bernoulli(0.5))
    outcomes = [
        tuple(event.outcome for event in carrier.send(message("RSU", number), ["Ego", "Other"], 0.0))
        for number in range(200)
    ]
    assert {("lost", "delivered"), ("delivered", "lost")} <= set(outcomes)


def test_frame_loss_takes_all_or_nothing_of_a_receiver_in_a_tick() -> None:
    """The fault of the published code: the own list and the received ones vanish together."""
    carrier = channel(5, own_perception=True, loss=bernoulli(0.3, "frame"))
    per_tick: list[dict[str, set[str]]] = []
    for number in range(200):
        outcomes: dict[str, set[str]] = {}
        for sender in ("Ego", "RSU"):
            for event in carrier.send(message(sender, number), ["Ego", "RSU"], number * 0.05):
                outcomes.setdefault(event.receiver, set()).add(event.outcome)
        per_tick.append(outcomes)
    assert all(len(fates) == 1 for outcomes in per_tick for fates in outcomes.values())
    lost = [outcomes["Ego"] == {"lost"} for outcomes in per_tick]
    assert sum(lost) / 200 == pytest.approx(0.3, abs=5 * math.sqrt(0.21 / 200))
    assert lost != [outcomes["RSU"] == {"lost"} for outcomes in per_tick]


DISTRIBUTIONS = [
    ({"kind": "constant", "seconds": 0.3}, 0.3, 0.0),
    ({"kind": "uniform", "minimum": 0.1, "maximum": 0.4}, 0.25, 0.3 / math.sqrt(12)),
    ({"kind": "shifted_gamma", "minimum": 0.02, "mean": 0.1}, 0.1, 0.08 / math.sqrt(2)),
    ({"kind": "lognormal", "mean": 0.1, "sd": 0.05, "minimum": 0.02}, 0.12, 0.05),
    # a normal cut at its mean is a half normal: mean sd sqrt(2/pi), variance sd² (1 - 2/pi)
    (
        {"kind": "truncated_normal", "mean": 0.0, "sd": 0.1},
        0.1 * math.sqrt(2 / math.pi),
        0.1 * math.sqrt(1 - 2 / math.pi),
    ),
]


@pytest.mark.parametrize(("settings", "mean", "sd"), DISTRIBUTIONS, ids=[str(row[0]["kind"]) for row in DISTRIBUTIONS])
def test_delays_have_their_mean_and_spread(settings: dict[str, object], mean: float, sd: float) -> None:
    """Moments by the midpoint rule over the quantile function."""
    delay = TypeAdapter(Delay).validate_python(settings)
    values = np.array([delay.quantile(u) for u in (np.arange(20000) + 0.5) / 20000])
    assert values.mean() == pytest.approx(mean, rel=1e-3)
    assert values.std() == pytest.approx(sd, rel=1e-2, abs=1e-12)
    assert np.all(np.diff(values) >= 0)
    assert delay.random == (sd > 0)


def test_a_larger_mean_delays_every_single_message_more() -> None:
    short, long = (channel(9, delay={"kind": "lognormal", "mean": mean, "sd": 0.05}) for mean in (0.1, 0.2))
    for number in range(100):
        first, second = (c.send(message("RSU", number), ["Ego"], 0.0)[0].arrives for c in (short, long))
        assert first is not None
        assert second is not None
        assert first < second


@pytest.mark.parametrize(("mean", "sd"), [(0.1, 0.05), (1e-3, 10.0), (1e-9, 1e6), (1e6, 1e6)])
def test_lognormal_delay_of_any_mean_and_sd_has_its_median(mean: float, sd: float) -> None:
    """The median of a lognormal distribution is mean / sqrt(1 + (sd / mean)²), here 0 beside the minimum or not."""
    delay = LognormalDelay(kind="lognormal", mean=mean, sd=sd, minimum=0.02)
    median = mean * (mean / math.hypot(mean, sd))
    assert delay.quantile(0.5) - 0.02 == pytest.approx(median, rel=1e-9, abs=1e-15)
    assert all(math.isfinite(delay.quantile(u)) for u in (1e-300, 1e-9, 0.1, 0.9, 1.0 - 1e-16))


def test_size_of_a_message() -> None:
    assert cpm_size(0, 1) == 156
    assert cpm_size(10, 2) == 541
