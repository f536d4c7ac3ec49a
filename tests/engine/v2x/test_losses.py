"""Burst losses, losses by distance, measured delays, and closed forms of the age of information."""

from __future__ import annotations

import math
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np
import pytest
from processor_time import within_readings
from pydantic import TypeAdapter, ValidationError
from radio_traffic import composed

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.v2x.link_models.composed import ComposedChannel, ComposedProfile
from eidrive_scenario.v2x.link_models.delay import TraceDelay
from eidrive_scenario.v2x.link_models.loss import DistanceLoss, GilbertElliottLoss, Loss
from eidrive_scenario.v2x.messages.message import Message, StationState
from eidrive_scenario.v2x.profile import load_profile
from eidrive_scenario.v2x.radio_environment import RadioEnvironment

DT = 0.1


def message(number: int, sender: str = "RSU") -> Message:
    time = number * DT
    return Message(sender, number, time, StationState(time, 0, 0, 0, 0, 0), Detections(time), 121)


def received(carrier: ComposedChannel, count: int) -> list[bool]:
    """Return whether each message of RSU reaches Ego."""
    return [carrier.send(message(n), ["Ego"], n * DT)[0].outcome == "delivered" for n in range(count)]


def burst(probability: float, length: float) -> dict[str, object]:
    return {"kind": "gilbert_elliott", "probability": probability, "burst": length}


@pytest.mark.statistical
@pytest.mark.parametrize(("probability", "length"), [(0.05, 2.0), (0.1, 10.0), (0.3, 2.0), (0.3, 10.0)])
def test_burst_loss_has_its_probability_and_burst_length(probability: float, length: float) -> None:
    """Burst lengths are geometric, so the standard error of their mean is length / sqrt(bursts)."""
    kept = received(composed(5, loss=burst(probability, length)), 40000)
    bursts = [len(list(run)) for lost, run in groupby(not got for got in kept) if lost]
    assert np.mean(bursts) == pytest.approx(length, abs=5 * length / math.sqrt(len(bursts)))
    spread = math.sqrt(probability * (1 - probability) * 2 * length / 40000)
    assert 1 - np.mean(kept) == pytest.approx(probability, abs=5 * spread)


def test_burst_loss_with_minimum_burst_length_is_bernoulli() -> None:
    loss = GilbertElliottLoss(kind="gilbert_elliott", probability=0.3, burst=1 / 0.7)
    to_bad, to_good = loss.steps
    assert to_bad == pytest.approx(0.3)
    assert to_good == pytest.approx(0.7)


def test_burst_loss_with_losses_in_both_states_has_closed_form() -> None:
    loss = GilbertElliottLoss(kind="gilbert_elliott", to_bad=0.1, to_good=0.3, good_loss=0.02, bad_loss=0.8)
    assert loss.share_bad == pytest.approx(0.25)
    kept = received(composed(2, loss=loss.model_dump(exclude_none=True)), 40000)
    assert 1 - np.mean(kept) == pytest.approx(0.25 * 0.8 + 0.75 * 0.02, abs=0.02)


def test_burst_loss_of_a_late_receiver_equals_that_of_an_early_one() -> None:
    """The state of a link is a function of seed, link and number, without the preceding messages."""
    early = received(composed(6, loss=burst(0.3, 4)), 10_000)
    late = composed(6, loss=burst(0.3, 4))
    for number in (4095, 4096, 4200, 9990, 9999):
        assert (late.send(message(number), ["Ego"], number * DT)[0].outcome == "delivered") == early[number]
    for number in (70, 3, 4100, 9):
        assert (late.send(message(number), ["Ego"], number * DT)[0].outcome == "delivered") == early[number]
    far = composed(6, loss=burst(0.3, 4))
    within_readings(2, lambda: far.send(message(10**9), ["Ego"], 1e8))


def test_messages_delivered_with_more_bursts_are_delivered_with_fewer() -> None:
    """The share of the bad state grows at constant burst length."""
    sets = [
        {n for n, got in enumerate(received(composed(4, loss=burst(p, 5.0)), 2000)) if got} for p in (0.05, 0.2, 0.5)
    ]
    assert all(larger > smaller for larger, smaller in pairwise(sets))


@pytest.mark.exhaustive
@pytest.mark.parametrize(("length", "mean"), [(1 / 0.7, 0.11286), (2.0, 0.130), (10.0, 0.370)])
def test_mean_age_depends_on_bursts_and_peak_age_does_not(length: float, mean: float) -> None:
    """d + T E[K²] / 2 E[K] with E[K] = 1 + p/r, E[K²] = 1 + p (2 + r) / r²; 30 % lost, T = 0.1 s, d = 0.02 s."""
    to_good = 1 / length
    to_bad = to_good * 0.3 / 0.7
    closed = 0.02 + DT * (1 + to_bad * (2 + to_good) / to_good**2) / (2 * (1 + to_bad / to_good))
    assert closed == pytest.approx(mean, abs=5e-4)
    carrier = composed(6, loss=burst(0.3, length), delay={"kind": "constant", "seconds": 0.02})
    for number in range(60000):
        carrier.send(message(number), ["Ego"], number * DT)
        carrier.deliver("Ego", (number + 1) * DT)
    link = carrier.statistics(60000 * DT)["RSU", "Ego"]
    assert link.mean_age == pytest.approx(closed, rel=0.07)
    assert link.peak_age == pytest.approx(0.02 + DT / 0.7, rel=0.03)


def test_p95_age_of_two_period_lengths_equals_hand_calculation() -> None:
    """Ages run from 0.1 to 1.1 s nine times and to 2.1 s once: 10 of 11 s are below 1.1 s, so 95 % at 1.55 s."""
    carrier = composed(delay={"kind": "constant", "seconds": 0.1})
    times = [*range(10), 11]
    for number, time in enumerate(times):
        sent = Message("RSU", number, time, StationState(time, 0, 0, 0, 0, 0), Detections(time), 121)
        carrier.send(sent, ["Ego"], time)
        carrier.deliver("Ego", time + 0.5)
    link = carrier.statistics(11.1)["RSU", "Ego"]
    assert link.p95_age == pytest.approx(1.1 + 0.45)
    assert link.mean_age == pytest.approx((9 * 0.6 + 2 * 1.1) / 11)


def test_mean_age_with_random_delays_is_half_the_period_plus_mean_delay() -> None:
    """Closed form T/2 + E[D], because delays are shorter than the period."""
    carrier = composed(1, delay={"kind": "uniform", "minimum": 0.0, "maximum": 0.09})
    for number in range(20000):
        carrier.send(message(number), ["Ego"], number * DT)
        carrier.deliver("Ego", (number + 1) * DT)
    assert carrier.statistics(2000.0)["RSU", "Ego"].mean_age == pytest.approx(DT / 2 + 0.045, rel=0.01)


def test_loss_by_distance_follows_its_table() -> None:
    loss = {"kind": "by_distance", "distances": [0, 100, 200], "reception": [1.0, 0.8, 0.0]}
    for distance, reception in ((0.0, 1.0), (50.0, 0.9), (150.0, 0.4), (500.0, 0.0)):
        carrier = composed(3, loss=loss)
        carrier.update_environment(RadioEnvironment({"RSU": (0.0, 0.0, 0.0), "Ego": (distance, 0.0, 0.0)}))
        kept = received(carrier, 4000)
        assert np.mean(kept) == pytest.approx(reception, abs=5 * math.sqrt(0.25 / 4000))
        link = carrier.statistics(0.0)["RSU", "Ego"]
        assert link.reception == ((25.0 * (distance // 25), 4000, sum(kept)),)
        assert set(link.lost_by) <= {"distance"}


def test_loss_by_distance_without_antenna_positions_raises() -> None:
    with pytest.raises(ValueError, match="requires antenna positions of 'RSU' and 'Ego'"):
        received(composed(loss={"kind": "by_distance", "distances": [0], "reception": [1]}), 1)


def test_analytic_loss_counts_losses_by_cause() -> None:
    carrier = composed(3, loss={"kind": "80211p", "density": 0.12, "rate": 25, "size": 500})
    carrier.update_environment(RadioEnvironment({"RSU": (0.0, 0.0, 0.0), "Ego": (150.0, 0.0, 0.0)}))
    kept = received(carrier, 4000)
    table = carrier.profile.loss.table()  # type: ignore[union-attr]
    expected = float(np.interp(150.0, table.distance, table.delivery_ratio))
    assert np.mean(kept) == pytest.approx(expected, abs=5 * math.sqrt(0.25 / 4000))
    link = carrier.statistics(0.0)["RSU", "Ego"]
    assert set(link.lost_by) == {"busy", "propagation", "collision"}
    assert sum(link.lost_by.values()) == link.lost
    assert link.channel_busy_ratio == pytest.approx(table.channel_busy_ratio)


def test_trace_delay_from_a_list_is_interpolated_or_replayed() -> None:
    delay = TraceDelay.model_validate({"kind": "trace", "seconds": [0.3, 0.1, 0.2]})
    assert [delay.quantile(u) for u in (0.0, 0.25, 0.5, 1.0)] == pytest.approx([0.1, 0.15, 0.2, 0.3])
    carrier = composed(delay={"kind": "trace", "seconds": [0.3, 0.1, 0.2], "replay": True})
    arrives = [carrier.send(message(n), ["Ego"], 0.0)[0].arrives for n in range(5)]
    assert arrives == [0.3, 0.1, 0.2, 0.3, 0.1]


def test_trace_delay_from_a_file_is_relative_to_the_profile(tmp_path: Path) -> None:
    (tmp_path / "delays.csv").write_text("time,latency\n0,20\n1,40\n\n2,30\n")
    profile = tmp_path / "measured.yaml"
    profile.write_text("delay: {kind: trace, file: delays.csv, column: latency, unit: ms, replay: true}\n")
    loaded = load_profile(profile)
    assert isinstance(loaded, ComposedProfile)
    assert isinstance(loaded.delay, TraceDelay)
    assert loaded.delay.seconds == pytest.approx((0.02, 0.04, 0.03))
    (tmp_path / "bare.csv").write_text("0.5\n0.25\n")
    bare = TraceDelay.model_validate({"kind": "trace", "file": str(tmp_path / "bare.csv")})
    assert bare.seconds == (0.5, 0.25)


@pytest.mark.parametrize(
    ("text", "column"), [("0.5\n0.25\n", 0), ("late\n0.5\n0.25\n", "late"), ('"late"\n0.5\n0.25\n', 0)]
)
def test_trace_delay_from_a_file_with_byte_order_mark_has_all_values(
    tmp_path: Path, text: str, column: int | str
) -> None:
    (tmp_path / "marked.csv").write_text(text, encoding="utf-8-sig")
    delay = TraceDelay.model_validate({"kind": "trace", "file": str(tmp_path / "marked.csv"), "column": column})
    assert delay.seconds == (0.5, 0.25)


INVALID = [
    ({"kind": "gilbert_elliott"}, "either to_bad and to_good, or probability and burst are expected"),
    ({"kind": "gilbert_elliott", "to_bad": 0.1, "to_good": 0.1, "burst": 3}, "either to_bad and to_good"),
    (burst(0.5, 1.5), "burst must be at least 2 messages with probability 0.5"),
    ({"kind": "gilbert_elliott", "to_bad": 0.0, "to_good": 0.0}, "to_bad or to_good must be above 0"),
    (burst(1.3, 3), "less than 1"),
    ({"kind": "by_distance", "distances": [0, 0], "reception": [1, 1]}, "distances must be ascending"),
    ({"kind": "by_distance", "distances": [0, 9], "reception": [1]}, r"one value per distance \(got 1 for 2\)"),
    ({"kind": "80211p", "density": -0.1}, "greater than 0"),
    ({"kind": "cv2x_mode4", "density": 0.1, "subchannels": 3}, "2 or 4"),
]


@pytest.mark.parametrize(("settings", "message"), INVALID)
def test_loss_settings_invalid_raise_with_expected_value(settings: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        TypeAdapter(Loss).validate_python(settings)


@pytest.mark.parametrize(
    ("content", "settings", "message"),
    [
        (None, {}, "cannot read"),
        ("", {}, "is empty"),
        ("a,b\n1,2\n", {"column": "c"}, "has no column 'c' in its first row"),
        ("a\n1\nx\n", {}, ":3: column 0 is not a delay"),
        ("a\n1\n", {"column": 4}, r"has no column 4 \(expected 0 to 0\)"),
        ("-1\n", {}, ":1: delay is negative"),
        ("nan\n1\n", {}, ":1: column 0 is not a delay"),
        ("0,inf\n1,1\n", {"column": 1}, ":1: column 1 is not a delay"),
        ("1\n", {"seconds": [1.0]}, "either seconds or file is expected"),
    ],
)
def test_trace_delay_with_invalid_file_raises(
    tmp_path: Path, content: str | None, settings: dict[str, object], message: str
) -> None:
    file = tmp_path / "trace.csv"
    if content is not None:
        file.write_text(content)
    with pytest.raises(ValidationError, match=message):
        TraceDelay.model_validate({"kind": "trace", "file": str(file), **settings})


def test_loss_by_distance_interpolates_and_extends_its_table() -> None:
    loss = DistanceLoss(kind="by_distance", distances=(10.0, 20.0), reception=(0.9, 0.5))
    assert loss.probability_at(0.0) == pytest.approx(0.1)
    assert loss.probability_at(15.0) == pytest.approx(0.3)
