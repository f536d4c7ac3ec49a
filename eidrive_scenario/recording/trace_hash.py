"""Trace hash: a fingerprint that is equal for runs that are bit for bit equal."""

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

_SCENE_FIELDS: Mapping[str, Codec] = {
    "signals": codec(Mapping[str, str]),
    "appearances": codec(Mapping[str, Appearance]),
    "environment": codec(Environment),
    "monitors": codec(Mapping[str, bool]),
}
"""Frame fields beside the actors, hashed only when they change: a field that is never set has no effect."""

_OUTCOME = struct.Struct("<3Q4d")
"""Layout of a message outcome: sender, receiver, and outcome with reason as 64-bit words; number, time sent and time of
arrival [s] (infinity for a lost message), and size [bytes]."""
_TIME = struct.Struct("<d")
_FLOAT = np.dtype("<f8")


class TraceHash:
    """SHA-256 over actors, poses, velocities, contacts, state changes and message outcomes of all frames.

    Changes of signals, appearances, environment and monitors are hashed as well.

    Floats are hashed with all 64 bits, little-endian, so a difference in the last bit changes the hash. The hash is the
    same in every process with the same scenario, seed, settings and installed versions on one kind of machine. Other
    processor families and builds of libm, numpy or bullet may round differently: compare metrics there, not hashes.
    """

    def __init__(self) -> None:
        self._sha = hashlib.sha256()
        self._names: tuple[str, ...] = ()
        self._packed_names = _packed(())
        """Names of the last view in packed form."""
        self._scene: tuple[object, ...] = (None,) * len(_SCENE_FIELDS)
        self._words: dict[tuple[str, ...], int] = {}

    def observe(self, frame: Frame) -> None:
        """Add one frame."""
        view = frame.view
        if view.names is not self._names:
            self._names, self._packed_names = view.names, _packed(view.names)
        poses = view.kinematics.astype(_FLOAT, copy=False).tobytes()
        self._sha.update(b"".join([self._packed_names, _TIME.pack(view.time), poses]))
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
            self._add_outcomes(frame.links)
        scene = frame.signals, frame.appearances, frame.environment, frame.monitors
        if scene != self._scene:
            for now, last, (name, field_codec) in zip(scene, self._scene, _SCENE_FIELDS.items(), strict=True):
                if now != last and (now or last):
                    self._texts(name, json.dumps(field_codec.encode(now), sort_keys=True))
        self._scene = scene

    def hexdigest(self) -> str:
        """Return 64 hexadecimal digits over the frames so far."""
        return self._sha.hexdigest()

    def close(self) -> None:
        """Do nothing: required by the observer protocol."""

    def _add_outcomes(self, links: Sequence[LinkEvent]) -> None:
        """Add outcomes; objects and columns of equal events give equal bytes."""
        for part in links.parts if isinstance(links, LinkEvents) else (links,):
            self._sha.update(self._columns(part) if isinstance(part, OutcomeBlock) else self._rows(part))

    def _rows(self, links: Sequence[LinkEvent]) -> bytes:
        rows = []
        for link in links:
            sender, receiver = self._word(link.sender), self._word(link.receiver)
            arrives = math.inf if link.arrives is None else link.arrives
            outcome = self._word(link.outcome, link.reason)
            rows.append(_OUTCOME.pack(sender, receiver, outcome, link.number, link.sent, arrives, link.size))
        return b"".join(rows)

    def _columns(self, block: OutcomeBlock) -> bytes:
        table = block.columns()
        names = np.array([self._word(name) for name in table.names], dtype="<u8")
        outcomes = np.array([self._word(*outcome) for outcome in table.outcomes], dtype="<u8")
        words = np.empty((len(block), 7), dtype="<u8")
        numbers = words.view("<f8")
        words[:, 0], words[:, 1] = names[table.senders], names[table.receivers]
        words[:, 2] = outcomes[table.outcome]
        numbers[:, 3], numbers[:, 4], numbers[:, 5], numbers[:, 6] = table.number, table.sent, table.arrives, table.size
        return words.tobytes()

    def _word(self, *texts: str) -> int:
        """Return a 64-bit digest of texts, equal in every process."""
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
    """Return length-prefixed texts, so that ('ab', 'c') differs from ('a', 'bc')."""
    encoded = [text.encode() for text in texts]
    return struct.pack(f"<{len(encoded) + 1}I", len(encoded), *map(len, encoded)) + b"".join(encoded)


_LINKS = _packed(("links",))
