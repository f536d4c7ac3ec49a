"""Losses in bursts and by distance; measured delays; ages of information by their closed forms."""

from __future__ import annotations

import math
from itertools import groupby, pairwise
from pathlib import Path
from time import process_time

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from eidrive_scenario.detections import Detections
from eidrive_scenario.v2x.link_models.composed import ComposedChannel, ComposedProfile
from eidrive_scenario.v2x.link_models.delay_trace import TraceDelay
from eidrive_scenario.v2x.link_models.loss import DistanceLoss, GilbertElliottLoss, Loss
from eidrive_scenario.v2x.messages.message import Message, StationState
from eidrive_scenario.v2x.profile import load_profile
from eidrive_scenario.v2x.radio_environment import RadioEnvironment

DT = 0.1


def channel(seed: int = 0, **profile: object) -> ComposedChannel:
    return ComposedChannel(ComposedProfile.model_validate(profile), seed)


def message(number: int, sender: str = "RSU") -> Message:
    time = number * DT
    return Message(sender, number, time, StationState(time, 0, 0, 0, 0, 0), Detections(time), 121)


def received(carrier: ComposedChannel, count: int) -> list[bool]:
    """Which of RSU's messages reach Ego."""
    return [carrier.send(message(n), ["Ego"], n * DT)[0].outcome == "delivered" for n in range(count)]


def burst(probability: float, length: float) -> dict[str, object]:
    return {"kind": "gilbert_elliott", "probability": probability, "burst": length}


@pytest.mark.parametrize(("probability", "length"), [(0.05, 2.0), (0.1, 10.0), (0.3, 2.0), (0.3, 10.0)])
def test_bursts_have_their_share_and_length(probability: float, length: float) -> None:
    """40,000 messages; a burst's length is geometric, so its mean has a standard error of length / sqrt(bursts)."""
    kept = received(channel(5, loss=burst(probability, length)), 40000)
    bursts = [len(list(run)) for lost, run in groupby(not got for got in kept) if lost]
    assert np.mean(bursts) == pytest.approx(length, abs=5 * length / math.sqrt(len(bursts)))
    spread = math.sqrt(probability * (1 - probability) * 2 * length / 40000)
    assert 1 - np.mean(kept) == pytest.approx(probability, abs=5 * spread)


def test_a_burst_of_independent_length_is_bernoulli() -> None:
    loss = GilbertElliottLoss(kind="gilbert_elliott", probability=0.3, burst=1 / 0.7)
    to_bad, to_good = loss.steps
    assert to_bad == pytest.approx(0.3)
    assert to_good == pytest.approx(0.7)


def test_losses_within_both_states() -> None:
    loss = GilbertElliottLoss(kind="gilbert_elliott", to_bad=0.1, to_good=0.3, good_loss=0.02, bad_loss=0.8)
    assert loss.share_bad == pytest.approx(0.25)
    assert loss.share_lost == pytest.approx(0.25 * 0.8 + 0.75 * 0.02)
    kept = received(channel(2, loss=loss.model_dump(exclude_none=True)), 40000)
    assert 1 - np.mean(kept) == pytest.approx(loss.share_lost, abs=0.02)


def test_who_begins_to_listen_late_meets_the_bursts_that_others_met() -> None:
    """The state of a link is one of seed, link and number; it does not take the messages before to know it."""
    early = received(channel(6, loss=burst(0.3, 4)), 10_000)
    late = channel(6, loss=burst(0.3, 4))
    for number in (4095, 4096, 4200, 9990, 9999):
        assert (late.send(message(number), ["Ego"], number * DT)[0].outcome == "delivered") == early[number]
    far = channel(6, loss=burst(0.3, 4))
    begun = process_time()
    far.send(message(10**9), ["Ego"], 1e8)
    assert process_time() - begun < 1.0


def test_what_arrives_with_more_bursts_arrives_with_fewer() -> None:
    """Larger shares of the bad state with the same length of bursts."""
    sets = [
        {n for n, got in enumerate(received(channel(4, loss=burst(p, 5.0)), 2000)) if got} for p in (0.05, 0.2, 0.5)
    ]
    assert all(larger > smaller for larger, smaller in pairwise(sets))


@pytest.mark.parametrize(("length", "mean"), [(1 / 0.7, 0.11286), (2.0, 0.130), (10.0, 0.370)])
def test_age_of_information_sees_bursts_and_its_peak_does_not(length: float, mean: float) -> None:
    """d + T E[K²] / 2 E[K] with E[K] = 1 + p/r, E[K²] = 1 + p (2 + r) / r²; 30 % lost, T = 0.1 s, d = 0.02 s."""
    to_good = 1 / length
    to_bad = to_good * 0.3 / 0.7
    closed = 0.02 + DT * (1 + to_bad * (2 + to_good) / to_good**2) / (2 * (1 + to_bad / to_good))
    assert closed == pytest.approx(mean, abs=5e-4)
    carrier = channel(6, loss=burst(0.3, length), delay={"kind": "constant", "seconds": 0.02})
    for number in range(60000):
        carrier.send(message(number), ["Ego"], number * DT)
        carrier.deliver("Ego", (number + 1) * DT)
    book = carrier.statistics(60000 * DT)["RSU", "Ego"]
    assert book.mean_age == pytest.approx(closed, rel=0.07)
    assert book.peak_age == pytest.approx(0.02 + DT / 0.7, rel=0.03)


def test_the_95th_percentile_of_age_by_hand() -> None:
    """Ages run 0.1 to 1.1 s nine times, and 0.1 to 2.1 s once: below 1.1 s lie 10 of 11 s, so 95 % at 1.55 s."""
    carrier = channel(delay={"kind": "constant", "seconds": 0.1})
    times = [*range(10), 11]
    for number, time in enumerate(times):
        said = Message("RSU", number, time, StationState(time, 0, 0, 0, 0, 0), Detections(time), 121)
        carrier.send(said, ["Ego"], time)
        carrier.deliver("Ego", time + 0.5)
    book = carrier.statistics(11.1)["RSU", "Ego"]
    assert book.p95_age == pytest.approx(1.1 + 0.45)
    assert book.mean_age == pytest.approx((9 * 0.6 + 2 * 1.1) / 11)


def test_random_delays_add_to_half_the_period() -> None:
    """Independent delays without reordering: T/2 + E[D]."""
    carrier = channel(1, delay={"kind": "uniform", "minimum": 0.0, "maximum": 0.09})
    for number in range(20000):
        carrier.send(message(number), ["Ego"], number * DT)
        carrier.deliver("Ego", (number + 1) * DT)
    assert carrier.statistics(2000.0)["RSU", "Ego"].mean_age == pytest.approx(DT / 2 + 0.045, rel=0.01)


def test_loss_by_distance_follows_its_table() -> None:
    loss = {"kind": "by_distance", "distances": [0, 100, 200], "reception": [1.0, 0.8, 0.0]}
    for distance, reception in ((0.0, 1.0), (50.0, 0.9), (150.0, 0.4), (500.0, 0.0)):
        carrier = channel(3, loss=loss)
        carrier.update_environment(RadioEnvironment({"RSU": (0.0, 0.0, 0.0), "Ego": (distance, 0.0, 0.0)}))
        kept = received(carrier, 4000)
        assert np.mean(kept) == pytest.approx(reception, abs=5 * math.sqrt(0.25 / 4000))
        book = carrier.statistics(0.0)["RSU", "Ego"]
        assert book.reception == ((25.0 * (distance // 25), 4000, sum(kept)),)
        assert set(book.lost_by) <= {"distance"}


def test_loss_by_distance_without_places_says_so() -> None:
    with pytest.raises(ValueError, match="needs to know where 'RSU' and 'Ego' are"):
        received(channel(loss={"kind": "by_distance", "distances": [0], "reception": [1]}), 1)


def test_the_analytic_model_as_a_loss_names_its_causes() -> None:
    carrier = channel(3, loss={"kind": "80211p", "density": 0.12, "rate": 25, "size": 500})
    carrier.update_environment(RadioEnvironment({"RSU": (0.0, 0.0, 0.0), "Ego": (150.0, 0.0, 0.0)}))
    kept = received(carrier, 4000)
    table = carrier.profile.loss.table()  # type: ignore[union-attr]
    expected = float(np.interp(150.0, table.distance, table.delivery_ratio))
    assert np.mean(kept) == pytest.approx(expected, abs=5 * math.sqrt(0.25 / 4000))
    book = carrier.statistics(0.0)["RSU", "Ego"]
    assert set(book.lost_by) == {"busy", "propagation", "collision"}
    assert sum(book.lost_by.values()) == book.lost
    assert book.channel_busy_ratio == pytest.approx(table.channel_busy_ratio)


def test_a_measured_delay_from_a_list() -> None:
    delay = TraceDelay.model_validate({"kind": "trace", "seconds": [0.3, 0.1, 0.2]})
    assert [delay.quantile(u) for u in (0.0, 0.25, 0.5, 1.0)] == pytest.approx([0.1, 0.15, 0.2, 0.3])
    carrier = channel(delay={"kind": "trace", "seconds": [0.3, 0.1, 0.2], "replay": True})
    arrives = [carrier.send(message(n), ["Ego"], 0.0)[0].arrives for n in range(5)]
    assert arrives == [0.3, 0.1, 0.2, 0.3, 0.1]


def test_a_measured_delay_from_a_file_beside_the_profile(tmp_path: Path) -> None:
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


WRONG = [
    ({"kind": "gilbert_elliott"}, "give either to_bad and to_good, or probability and burst"),
    ({"kind": "gilbert_elliott", "to_bad": 0.1, "to_good": 0.1, "burst": 3}, "give either"),
    (burst(0.5, 1.5), "a burst is at least 2 messages long"),
    ({"kind": "gilbert_elliott", "to_bad": 0.0, "to_good": 0.0}, "never moves"),
    (burst(1.3, 3), "less than 1"),
    ({"kind": "by_distance", "distances": [0, 0], "reception": [1, 1]}, "distances must rise"),
    ({"kind": "by_distance", "distances": [0, 9], "reception": [1]}, "2 distances for 1 values"),
    ({"kind": "80211p", "density": -0.1}, "greater than 0"),
    ({"kind": "cv2x_mode4", "density": 0.1, "subchannels": 3}, "2 or 4"),
]


@pytest.mark.parametrize(("settings", "words"), WRONG)
def test_wrong_losses_say_what_would_be_right(settings: dict[str, object], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        TypeAdapter(Loss).validate_python(settings)


@pytest.mark.parametrize(
    ("content", "settings", "words"),
    [
        (None, {}, "cannot read"),
        ("", {}, "is empty"),
        ("a,b\n1,2\n", {"column": "c"}, "has no column 'c' in its first row"),
        ("a\n1\nx\n", {}, ":3: column 0 holds no delay"),
        ("a\n1\n", {"column": 4}, "has no column 4; it has 1"),
        ("-1\n", {}, ":1: a delay is negative"),
        ("1\n", {"seconds": [1.0]}, "either seconds or a file"),
    ],
)
def test_wrong_traces_say_what_is_wrong(
    tmp_path: Path, content: str | None, settings: dict[str, object], words: str
) -> None:
    file = tmp_path / "trace.csv"
    if content is not None:
        file.write_text(content)
    with pytest.raises(ValidationError, match=words):
        TraceDelay.model_validate({"kind": "trace", "file": str(file), **settings})


def test_distances_of_the_table_are_in_meters() -> None:
    loss = DistanceLoss(kind="by_distance", distances=(10.0, 20.0), reception=(0.9, 0.5))
    assert loss.probability_at(0.0) == pytest.approx(0.1)
    assert loss.probability_at(15.0) == pytest.approx(0.3)
