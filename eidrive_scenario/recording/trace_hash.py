"""A fingerprint of a run: equal where two runs did the same, bit by bit."""

from __future__ import annotations

import hashlib
import json
import math
import struct
from collections.abc import Mapping, Sequence

import numpy as np

from eidrive_scenario.recording.codec import Codec, codec
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.statistics.link_events import LinkEvents, OutcomeBlock
from eidrive_scenario.world.appearance import Appearance
from eidrive_scenario.world.environment import Environment

_AROUND: Mapping[str, Codec] = {
    "signals": codec(Mapping[str, str]),
    "appearances": codec(Mapping[str, Appearance]),
    "environment": codec(Environment),
    "monitors": codec(Mapping[str, bool]),
}
"""What a frame says beside the actors; it enters where it changes, and so not at all where nobody says anything."""

_FATE = struct.Struct("<3Q4d")
"""How the fate of a message enters: sender, receiver and outcome with reason as words of 64 bits; number, sent, arrives
[s], infinity where lost, and size [bytes]."""
_TIME = struct.Struct("<d")
_FLOAT = np.dtype("<f8")
_FEW = 16
"""So many fates are faster one by one."""


class TraceHash:
    """SHA-256 over every frame's actors, poses, velocities, contacts, state changes and fates of messages.

    What signals, appearances, environment and monitors change to enters too.

    Floats enter with their 64 bits, little-endian, so a difference in the last place shows. The hash is the same in
    every process with the same scenario, seed, settings and installed versions on one kind of machine. Other processor
    families and builds of libm, numpy or bullet may round differently; across those compare metrics, not hashes.
    """

    def __init__(self) -> None:
        self._sha = hashlib.sha256()
        self._names: tuple[str, ...] = ()
        self._named = _packed(())
        """The names of the last view, and how they enter."""
        self._around: dict[str, object] = dict.fromkeys(_AROUND)
        self._words: dict[tuple[str, ...], int] = {}

    def observe(self, frame: Frame) -> None:
        """Take one frame in."""
        view = frame.view
        if view.names is not self._names:
            self._names, self._named = view.names, _packed(view.names)
        poses = view.kinematics.astype(_FLOAT, copy=False).tobytes()
        self._sha.update(b"".join([self._named, _TIME.pack(view.time), poses]))
        for contact in view.contacts:
            self._texts("contact", contact.first, contact.second)
            self._floats(*contact.position, contact.impact_speed)
        for change in frame.changes:
            transition = change.transition.value if change.transition is not None else ""
            self._texts("change", change.path, change.kind, change.before.value, transition, change.after.value)
            self._floats(change.time)
        if frame.links:
            self._sha.update(_LINKS)
            self._floats(len(frame.links))
            self._fates(frame.links)
        for name, how in _AROUND.items():
            before, now = self._around[name], getattr(frame, name)
            if now is not before and now != before and (now or before):
                self._texts(name, json.dumps(how.encode(now), sort_keys=True))
            self._around[name] = now

    def hexdigest(self) -> str:
        """64 hexadecimal digits over the frames so far."""
        return self._sha.hexdigest()

    def close(self) -> None:
        """Nothing to finish; observers have it."""

    def _fates(self, links: Sequence[LinkEvent]) -> None:
        """The same bytes for the same events, be they objects or columns."""
        if not isinstance(links, LinkEvents) or len(links) <= _FEW:
            self._sha.update(b"".join([self._fate(link) for link in links]))
            return
        for part in links.parts:
            self._sha.update(
                self._columns(part) if isinstance(part, OutcomeBlock) else b"".join([self._fate(link) for link in part])
            )

    def _fate(self, link: LinkEvent) -> bytes:
        return _FATE.pack(
            self._word(link.sender),
            self._word(link.receiver),
            self._word(link.outcome, link.reason),
            link.number,
            link.sent,
            math.inf if link.arrives is None else link.arrives,
            link.size,
        )

    def _columns(self, block: OutcomeBlock) -> bytes:
        fates = block.columns()
        names = np.array([self._word(name) for name in fates.names], dtype="<u8")
        outcomes = np.array([self._word(*outcome) for outcome in fates.outcomes], dtype="<u8")
        words = np.empty((len(block), 7), dtype="<u8")
        numbers = words.view("<f8")
        words[:, 0], words[:, 1] = names[fates.senders], names[fates.receivers]
        words[:, 2] = outcomes[fates.outcome]
        numbers[:, 3], numbers[:, 4], numbers[:, 5], numbers[:, 6] = fates.number, fates.sent, fates.arrives, fates.size
        return words.tobytes()

    def _word(self, *texts: str) -> int:
        """Texts in 64 bits, the same in every process."""
        word = self._words.get(texts)
        if word is None:
            digest = hashlib.sha256(_packed(texts)).digest()
            word = self._words[texts] = int.from_bytes(digest[:8], "little")
        return word

    def _texts(self, *texts: str) -> None:
        self._sha.update(_packed(texts))

    def _floats(self, *numbers: float) -> None:
        self._sha.update(struct.pack(f"<{len(numbers)}d", *numbers))


def _packed(texts: Sequence[str]) -> bytes:
    """Texts with their lengths before them, so that ('ab', 'c') differs from ('a', 'bc')."""
    encoded = [text.encode() for text in texts]
    return struct.pack(f"<{len(encoded) + 1}I", len(encoded), *map(len, encoded)) + b"".join(encoded)


_LINKS = _packed(("links",))
