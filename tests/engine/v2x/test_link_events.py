"""Outcomes in columns: equality with event lists, and trace hash."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.trace_hash import TraceHash
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, StationState
from eidrive_scenario.v2x.radio.channel import RadioChannel
from eidrive_scenario.v2x.radio.profile import RadioProfile
from eidrive_scenario.v2x.radio_environment import RadioEnvironment
from eidrive_scenario.v2x.statistics.link_events import LinkEvents, OutcomeBlock
from eidrive_scenario.world.view import WorldView

DT = 0.05
NAMES = [f"station {number}" for number in range(12)]


def ticks(**profile: Any) -> list[LinkEvents]:
    """Return the events of ten ticks with messages of twelve stations; the last station leaves after seven."""
    carrier = RadioChannel(RadioProfile.model_validate(profile), 3)
    collected = []
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
        collected.append(events)
    return collected


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
    {"queue": {"length": 1}, "jitter": 0.02},
    {"technology": "cv2x_mode4", "tx_power_dbm": 5, "delay": {"kind": "uniform", "minimum": 0, "maximum": 0.2}},
    {"loss": {"kind": "bernoulli", "probability": 0.3}, "line_of_sight": "random"},
]


@pytest.mark.parametrize("profile", PROFILES, ids=range(len(PROFILES)))
def test_columns_of_outcome_blocks_equal_their_events(profile: dict[str, Any]) -> None:
    reasons = set()
    for links in ticks(**profile):
        for block in links.parts:
            if not isinstance(block, OutcomeBlock):
                continue
            columns, events = block.columns(), list(block)
            assert len(events) == len(block) > 0
            assert [columns.names[row] for row in columns.senders.tolist()] == [event.sender for event in events]
            assert [columns.names[row] for row in columns.receivers.tolist()] == [event.receiver for event in events]
            outcomes = [columns.outcomes[code] for code in columns.outcome.tolist()]
            assert outcomes == [(event.outcome, event.reason) for event in events]
            assert columns.number.tolist() == [event.number for event in events]
            assert columns.sent.tolist() == [event.sent for event in events]
            assert columns.size.tolist() == [event.size for event in events]
            assert [None if arrives == np.inf else arrives for arrives in columns.arrives.tolist()] == [
                event.arrives for event in events
            ]
            reasons |= {event.reason for event in events}
    assert len(reasons) > 2


@pytest.mark.parametrize("profile", PROFILES, ids=range(len(PROFILES)))
def test_trace_hash_of_columns_and_event_lists_is_equal(profile: dict[str, Any]) -> None:
    """Third-party channels may return a list."""
    prints = set()
    for links in ticks(**profile):
        assert fingerprint(links) == fingerprint(list(links)) == fingerprint(tuple(links))
        prints.add(fingerprint(links))
        if len(links) > 1:
            assert fingerprint(links[1:]) != fingerprint(links) != fingerprint(links[::-1])
    assert len(prints) == 10


def test_link_events_compare_and_index_like_a_list() -> None:
    links = ticks(queue={"length": 1}, jitter=0.2)[5]
    again = ticks(queue={"length": 1}, jitter=0.2)[5]
    plain = list(links)
    assert links == plain == links
    assert links == tuple(plain)
    assert tuple(plain) == links
    assert links == again
    assert hash(links) == hash(again)
    assert links != plain[1:]
    assert links != ticks(queue={"length": 1}, jitter=0.2)[4]
    assert links[0] is links[0]
    assert links[-1] == plain[-1]
    assert list(links[2:4]) == plain[2:4]
    assert not LinkEvents([[], []])
