"""Channels of tests, messages, and the traffic of stations on a radio channel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.v2x.link_models.composed import ComposedChannel, ComposedProfile
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage, StationState
from eidrive_scenario.v2x.radio.channel import RadioChannel
from eidrive_scenario.v2x.radio.profile import RadioProfile
from eidrive_scenario.v2x.radio_environment import RadioEnvironment

DT = 0.05
Place = tuple[float, float, float]
QUIET: dict[str, object] = {
    "shadowing_db": 0,
    "path_loss": {"kind": "tr37885", "blockage": "mean"},
    "line_of_sight": "clear",
}


def radio(seed: int = 0, **profile: Any) -> RadioChannel:
    return RadioChannel(RadioProfile.model_validate(profile), seed)


def composed(seed: int = 0, **profile: object) -> ComposedChannel:
    return ComposedChannel(ComposedProfile.model_validate(profile), seed)


def message(sender: str, number: int, time: float, size: int = 300) -> Message:
    return Message(sender, number, time, StationState(time, 0, 0, 0, 0, 0), Detections(time), size)


def exchange(
    carrier: RadioChannel,
    places: dict[str, Place],
    ticks: int,
    *,
    speed: float = 0.0,
    sizes: Sequence[int] = (300,),
    sight: Any = None,
    dt: float = DT,
) -> tuple[list[LinkEvent], list[tuple[str, float, ReceivedMessage]]]:
    """Send one message per station and tick, in the order of `places`, which move along x.

    Return the events, and the deliveries as (receiver, time, message).
    """
    events: list[LinkEvent] = []
    deliveries: list[tuple[str, float, ReceivedMessage]] = []
    for tick in range(ticks):
        now = tick * dt
        at = {name: (x + speed * now * (index + 1), y, z) for index, (name, (x, y, z)) in enumerate(places.items())}
        carrier.update_environment(RadioEnvironment(at, sight))
        for receiver in places:
            deliveries += [(receiver, now, received) for received in carrier.deliver(receiver, now)]
        outbox = [
            (message(name, tick, now, sizes[tick % len(sizes)]), [n for n in places if n != name]) for name in places
        ]
        events += carrier.transmit(outbox, now)
    return events, deliveries
