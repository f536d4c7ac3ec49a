"""Outcomes in columns: iteration yields the same events as a plain list, with the same hash."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from eidrive_scenario.detections import Detections
from eidrive_scenario.recording import TraceHash
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, StationState
from eidrive_scenario.v2x.radio.channel import RadioChannel
from eidrive_scenario.v2x.radio.profile import RadioProfile
from eidrive_scenario.v2x.radio_environment import RadioEnvironment
from eidrive_scenario.v2x.statistics.link_events import LinkEvents, OutcomeBlock
from eidrive_scenario.world.view import WorldView

DT = 0.05
NAMES = [f"station {number}" for number in range(12)]


def ticks(**profile: Any) -> list[LinkEvents]:
    """What a radio told in each of ten ticks in which twelve stations said something; the last of them then left."""
    carrier = RadioChannel(RadioProfile.model_validate(profile), 3)
    told = []
    for tick in range(10):
        now = DT * tick
        present = NAMES if tick < 7 else NAMES[:-1]
        places = {name: (150.0 * row + 5.0 * now, 3.0 * row, 1.5) for row, name in enumerate(present)}
        carrier.update_environment(RadioEnvironment(places))
        outbox = [
            (
                Message(name, 2 * tick + part, now, StationState(now, 0, 0, 0, 0, 0), Detections(now), 300 + row),
                [other for other in present if other != name],
            )
            for row, name in enumerate(present)
            for part in range(2)
        ]
        events = carrier.transmit(outbox, now)
        assert isinstance(events, LinkEvents)
        told.append(events)
    return told


def fingerprint(links: Sequence[LinkEvent]) -> str:
    one, three = np.ones(1), np.ones((1, 3))
    trace = TraceHash()
    trace.observe(
        Frame(
            WorldView(0.05, 1, ("Ego",), ("car",), three, one, one, one, three, three, one, one, three, three),
            links=links,
        )
    )
    return trace.hexdigest()


PROFILES: list[dict[str, Any]] = [
    {"queue": {"length": 1}, "jitter": 0.2},
    {"technology": "cv2x_mode4", "tx_power_dbm": 5, "delay": {"kind": "uniform", "minimum": 0, "maximum": 0.2}},
    {"loss": {"kind": "bernoulli", "probability": 0.3}, "line_of_sight": "random"},
]


@pytest.mark.parametrize("profile", PROFILES, ids=range(len(PROFILES)))
def test_columns_say_what_events_say(profile: dict[str, Any]) -> None:
    reasons = set()
    for told in ticks(**profile):
        for block in told.parts:
            if not isinstance(block, OutcomeBlock):
                continue
            fates, events = block.columns(), list(block)
            assert len(events) == len(block) > 0
            assert [fates.names[row] for row in fates.senders.tolist()] == [event.sender for event in events]
            assert [fates.names[row] for row in fates.receivers.tolist()] == [event.receiver for event in events]
            outcomes = [fates.outcomes[code] for code in fates.outcome.tolist()]
            assert outcomes == [(event.outcome, event.reason) for event in events]
            assert fates.number.tolist() == [event.number for event in events]
            assert fates.sent.tolist() == [event.sent for event in events]
            assert fates.size.tolist() == [event.size for event in events]
            assert [None if arrives == np.inf else arrives for arrives in fates.arrives.tolist()] == [
                event.arrives for event in events
            ]
            reasons |= {event.reason for event in events}
    assert len(reasons) > 2


@pytest.mark.parametrize("profile", PROFILES, ids=range(len(PROFILES)))
def test_the_hash_does_not_tell_columns_from_plain_events(profile: dict[str, Any]) -> None:
    """A channel of somebody else may return a list."""
    prints = set()
    for told in ticks(**profile):
        assert fingerprint(told) == fingerprint(list(told)) == fingerprint(tuple(told))
        prints.add(fingerprint(told))
        if len(told) > 1:
            assert fingerprint(told[1:]) != fingerprint(told) != fingerprint(told[::-1])
    assert len(prints) == 10


def test_it_is_a_sequence_like_any_other() -> None:
    told = ticks(queue={"length": 1}, jitter=0.2)[5]
    again = ticks(queue={"length": 1}, jitter=0.2)[5]
    plain = list(told)
    assert told == plain == told
    assert told == tuple(plain)
    assert tuple(plain) == told
    assert told == again
    assert hash(told) == hash(again)
    assert told != plain[1:]
    assert told != ticks(queue={"length": 1}, jitter=0.2)[4]
    assert told[0] is told[0]
    assert told[-1] == plain[-1]
    assert list(told[2:4]) == plain[2:4]
    assert not LinkEvents([[], []])
