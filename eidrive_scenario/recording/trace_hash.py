"""A fingerprint of a run: equal where two runs did the same, bit by bit."""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Mapping, Sequence

from eidrive_scenario.recording.codec import Codec, codec
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.world.appearance import Appearance
from eidrive_scenario.world.environment import Environment

_AROUND: Mapping[str, Codec] = {
    "signals": codec(Mapping[str, str]),
    "appearances": codec(Mapping[str, Appearance]),
    "environment": codec(Environment),
    "monitors": codec(Mapping[str, bool]),
}
"""What a frame says beside the actors; it enters where it changes, and so not at all where nobody says anything."""


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

    def observe(self, frame: Frame) -> None:
        """Take one frame in."""
        view = frame.view
        if view.names is not self._names:
            self._names, self._named = view.names, _packed(view.names)
        self._sha.update(self._named)
        self._floats(view.time)
        kinematics = (view.position, view.yaw, view.pitch, view.roll, view.velocity)
        self._sha.update(b"".join([part.astype("<f8", copy=False).tobytes() for part in kinematics]))
        for contact in view.contacts:
            self._texts("contact", contact.first, contact.second)
            self._floats(*contact.position, contact.impact_speed)
        for change in frame.changes:
            transition = change.transition.value if change.transition is not None else ""
            self._texts("change", change.path, change.kind, change.before.value, transition, change.after.value)
            self._floats(change.time)
        for link in frame.links:
            self._texts("link", link.sender, link.receiver, link.outcome, link.reason)
            arrives = float("inf") if link.arrives is None else link.arrives
            self._floats(link.number, link.sent, arrives, link.size)
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

    def _texts(self, *texts: str) -> None:
        self._sha.update(_packed(texts))

    def _floats(self, *numbers: float) -> None:
        self._sha.update(struct.pack(f"<{len(numbers)}d", *numbers))


def _packed(texts: Sequence[str]) -> bytes:
    """Texts with their lengths before them, so that ('ab', 'c') differs from ('a', 'bc')."""
    encoded = [text.encode() for text in texts]
    return struct.pack(f"<{len(encoded) + 1}I", len(encoded), *map(len, encoded)) + b"".join(encoded)
