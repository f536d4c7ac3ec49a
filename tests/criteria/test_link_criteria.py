"""Criteria on links: packet reception ratio, latency, age of information, channel busy ratio."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal

import pytest
from eidrive_criteria.age_of_information import AgeOfInformation, AgeOfInformationSettings
from eidrive_criteria.channel_busy_ratio import ChannelBusyRatio, ChannelBusyRatioSettings
from eidrive_criteria.latency import Latency, LatencySettings
from eidrive_criteria.packet_reception_ratio import PacketReceptionRatio, PacketReceptionRatioSettings
from msgspec.structs import replace
from pydantic import ValidationError

from eidrive_scenario.api.criteria import Criterion, LinkStatistics, Verdict, evaluate_criteria
from eidrive_scenario.api.v2x import LinkEvent, Message, ReceivedMessage
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.simulation import RunSettings, run_file
from eidrive_scenario.v2x.messages.message import StationState

Transmission = tuple[str, str, float, float | None]
"""Sender, receiver, time of sending and of arrival [s]; None for a lost message."""


def judge(criterion: Criterion, frames: list[Any], links: Any = None) -> Verdict:
    (verdict,) = evaluate_criteria(frames, [criterion], links=links)
    return verdict


def ratio(frames: list[Any], **settings: Any) -> Verdict:
    return judge(PacketReceptionRatio(PacketReceptionRatioSettings(**settings)), frames)


def latency(frames: list[Any], **settings: Any) -> Verdict:
    return judge(Latency(LatencySettings(**settings)), frames)


def age(frames: list[Any], **settings: Any) -> Verdict:
    return judge(AgeOfInformation(AgeOfInformationSettings(**settings)), frames)


@pytest.fixture
def exchange(frame: Any, car: Any, perceived: Any) -> Callable[..., list[Any]]:
    """Return a function that makes frames every 0.2 s until `end` in which Ego, A and B exchange messages."""

    def make(end: float, *transmissions: Transmission) -> list[Any]:
        frames = []
        for tick in range(round(end / 0.2) + 1):
            time, before = 0.2 * tick, 0.2 * (tick - 1)
            found = frame(time, {"Ego": car(0), "A": car(20), "B": car(40)})
            events = []
            inboxes: dict[str, list[ReceivedMessage]] = {"Ego": [], "A": [], "B": []}
            for number, (sender, receiver, sent, arrives) in enumerate(transmissions):
                if abs(sent - before) < 1e-9:
                    outcome: Literal["delivered", "lost"] = "lost" if arrives is None else "delivered"
                    reason = "error" if arrives is None else ""
                    events.append(LinkEvent(sender, receiver, number, sent, outcome, arrives, reason, 100))
                if arrives is not None and before + 1e-9 < arrives <= time + 1e-9:
                    state = StationState(sent, 0.0, 0.0, 0.0, 0.0, 0.0)
                    message = Message(sender, number, sent, state, Detections(sent), 100)
                    inboxes[receiver].append(ReceivedMessage(message, arrives))
            for name, inbox in inboxes.items():
                found = perceived(found, name)
                steps = {**found.steps, name: replace(found.steps[name], inbox=tuple(inbox))}
                found = replace(found, steps=steps)
            frames.append(replace(found, links=tuple(events)))
        return frames

    return make


@pytest.fixture
def traffic(exchange: Any) -> list[Any]:
    """Messages from A to the Ego with delays of 0.2, 0.2 and 0.4 s and a lost one, one from B, one from the Ego."""
    return list(
        exchange(
            3.0,
            ("A", "Ego", 0.0, 0.2),
            ("A", "Ego", 0.4, 0.6),
            ("A", "Ego", 0.8, None),
            ("A", "Ego", 1.2, 1.6),
            ("B", "Ego", 1.0, 1.8),
            ("Ego", "B", 1.0, None),
            ("Ego", "Ego", 1.0, 1.2),
        )
    )


def test_margin_of_packet_reception_is_relative_to_the_possible_losses(traffic: list[Any]) -> None:
    """The ratio is 0.8."""
    criterion = PacketReceptionRatio(PacketReceptionRatioSettings(receiver="Ego", at_least=0.6))
    judge(criterion, traffic)
    assert criterion.metrics()["packet_reception_ratio.margin"] == pytest.approx(0.5)


def test_packet_reception_ratio(traffic: list[Any]) -> None:
    assert ratio(traffic, sender="A", receiver="Ego").value == 0.75
    assert ratio(traffic, receiver="Ego").value == 0.8
    assert ratio(traffic, receiver="Ego", at_least=0.8).passed
    assert ratio(traffic, receiver="Ego", at_least=0.8 + 9e-7).passed
    verdict = ratio(traffic, receiver="Ego", at_least=0.81)
    assert (verdict.passed, verdict.limit) == (False, 0.81)
    assert "4 of 5 messages to Ego" in verdict.reason
    assert ratio(traffic, sender="Ego").value == 0.0
    assert ratio(traffic, sender="Ego", receiver="Ego").value == 1.0


def test_latency(traffic: list[Any]) -> None:
    """Delays to the Ego: 0.2, 0.2, 0.4 and 0.8 s. The 95th percentile is at rank 2.85 of 0 to 3."""
    assert latency(traffic, receiver="Ego").value == pytest.approx(0.4)
    assert latency(traffic, receiver="Ego", measure="p95").value == pytest.approx(0.4 + 0.85 * 0.4)
    verdict = latency(traffic, receiver="Ego", measure="max", at_most=0.5, fatal=True)
    assert (verdict.passed, verdict.fatal) == (False, True)
    assert verdict.value == pytest.approx(0.8)
    assert verdict.first_violation == pytest.approx(1.8)
    assert latency(traffic, sender="A", measure="max", at_most=0.41).passed
    verdict = latency(traffic, sender="Ego", at_most=0.1)
    assert (verdict.passed, verdict.value) == (True, None)


def test_age_of_information(exchange: Any) -> None:
    """Messages each second with a delay of 0.2 s: the age rises from 0.2 to 1.2 s twice, then to 1 s at 3 s.

    Mean: (0.7 + 0.7 + 0.48) s² in 2.8 s. Share of the time below an age a between 0.2 and 1 s: 3 (a - 0.2) / 2.8; above
    1 s: 2 (a - 1) / 2.8 more. 95 %: 2.4 + 2 (a - 1) = 2.66.
    """
    frames = exchange(3.0, *(("A", "Ego", float(second), second + 0.2) for second in range(3)))
    assert age(frames, receiver="Ego").value == pytest.approx(1.88 / 2.8)
    assert age(frames, receiver="Ego", measure="peak").value == pytest.approx(1.2)
    assert age(frames, receiver="Ego", measure="p95").value == pytest.approx(1.13)
    assert age(frames, sender="A", at_most=0.68).passed
    assert not age(frames, sender="A", at_most=0.67).passed


def test_age_of_information_does_not_count_the_absence_of_the_receiver(exchange: Any, frame: Any, car: Any) -> None:
    """The age rises from 0.2 s at 0.2 s to 1 s at 1 s, and after the absence from 0.2 s at 2.2 s to 1 s at 3 s."""
    frames = [
        frame(present.view.time, {"A": car(20), "B": car(40)}) if 1.1 < present.view.time < 1.9 else present
        for present in exchange(3.0, ("A", "Ego", 0.0, 0.2), ("A", "Ego", 2.0, 2.2))
    ]
    assert age(frames, receiver="Ego").value == pytest.approx(0.6)


def test_age_of_the_worst_link_counts(exchange: Any) -> None:
    """The age of B at the Ego rises from 0.2 s at 1.2 s to 2 s at 3 s, that of A from 0.2 s at 2.2 s to 1 s."""
    frames = exchange(3.0, ("A", "Ego", 2.0, 2.2), ("B", "Ego", 1.0, 1.2))
    verdict = age(frames, receiver="Ego")
    assert verdict.value == pytest.approx(1.1)
    assert "from B" in verdict.reason
    assert age(frames, sender="A").value == pytest.approx(0.6)


def test_link_without_reception_has_an_infinite_age(exchange: Any) -> None:
    frames = exchange(1.0, ("A", "Ego", 0.0, 0.2), ("B", "Ego", 0.0, None))
    verdict = age(frames, receiver="Ego", at_most=5)
    assert (verdict.passed, verdict.value) == (False, math.inf)
    assert "no message from B" in verdict.reason
    verdict = age(frames, sender="Ego", at_most=5)
    assert (verdict.passed, verdict.value) == (True, None)


def test_stations_that_were_never_present_fail(traffic: list[Any]) -> None:
    for judged in (ratio, latency, age):
        verdict = judged(traffic, sender="Stranger", receiver="Ego")
        assert (verdict.passed, verdict.value) == (False, None)
        assert "Stranger was never present" in verdict.reason
    with pytest.raises(ValidationError, match="neither 'sender' nor 'receiver'"):
        LatencySettings()


def statistics(busy: float | None) -> LinkStatistics:
    return LinkStatistics(1, 1, 0, 0, 100, 0.1, 0.1, 0.1, 0.1, 0.1, channel_busy_ratio=busy)


def test_channel_busy_ratio(traffic: list[Any]) -> None:
    links = {("A", "Ego"): statistics(0.3), ("Ego", "B"): statistics(0.5)}

    def busy(links: Any, **settings: Any) -> Verdict:
        return judge(ChannelBusyRatio(ChannelBusyRatioSettings(**settings)), traffic, links)

    assert busy(links, of="Ego", at_most=0.3).value == 0.3
    assert busy(links, of="Ego", at_most=0.3 - 9e-7).passed
    verdict = busy(links, at_most=0.4)
    assert (verdict.passed, verdict.value, verdict.limit) == (False, 0.5, 0.4)
    assert "B measured" in verdict.reason
    for empty in ({}, None, {("A", "Ego"): statistics(None)}):
        verdict = busy(empty, at_most=0.4)
        assert (verdict.passed, verdict.value) == (True, None)
    assert not busy(links, of="Stranger").passed


@pytest.mark.statistical
@pytest.mark.parametrize(
    ("kind", "settings", "passing", "failing"),
    [
        ("packet_reception_ratio", {"sender": "RSU", "receiver": "Ego", "at_least": 0.9}, "ideal", "error_30pct"),
        ("latency", {"receiver": "Ego", "at_most": 0.2}, "ideal", "latency_300ms"),
        ("age_of_information", {"receiver": "Ego", "at_most": 0.2}, "ideal", "latency_300ms"),
        ("channel_busy_ratio", {"of": "Ego", "at_most": 0.5}, "80211p_urban", "congested"),
    ],
)
def test_criterion_in_runs_of_scenario_1(kind: str, settings: dict[str, Any], passing: str, failing: str) -> None:
    for channel, passed in ((passing, True), (failing, False)):
        result = run_file("coop/scenario_1", settings=RunSettings(channel=channel, criteria={kind: settings}))
        (verdict,) = [verdict for verdict in result.criteria if verdict.name == kind]
        assert verdict.passed == passed
        link = result.links["RSU", "Ego"]
        values = {
            "packet_reception_ratio": link.received / (link.received + link.lost),
            "latency": link.mean_delay,
            "age_of_information": link.mean_age,
            "channel_busy_ratio": link.channel_busy_ratio,
        }
        assert verdict.value == pytest.approx(values[kind], rel=0.02), "the statistics of the channel"
