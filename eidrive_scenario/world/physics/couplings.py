"""Vehicles and their trailers, whose bodies may overlap."""

from __future__ import annotations

from collections.abc import Mapping

from eidrive_scenario.geometry import box_distance
from eidrive_scenario.world.physics.bodies import Body
from eidrive_scenario.world.physics.bullet import bullet

PARTED = 0.05
"""Minimum gap after a contact before a new one is counted [m], and before a disconnected trailer collides again. It
prevents that a scrape counts as many contacts."""

Pair = frozenset[str]


class Couplings:
    """Pairs of a vehicle and its trailer: no collision between them is resolved, and no contact begins."""

    def __init__(self, client: int) -> None:
        self._client = client
        self.pairs: frozenset[Pair] = frozenset()
        """Names of connected actors."""
        self._apart: dict[Pair, tuple[int, int]] = {}
        """Handles of the bodies that do not collide with each other."""

    @property
    def any_affected(self) -> bool:
        """Whether `update` has pairs to process."""
        return bool(self.pairs or self._apart)

    def attached(self, name: str) -> frozenset[str]:
        """Return the actors that are connected to an actor directly or by others, without the actor itself."""
        if not self.pairs:
            return frozenset()
        found, added = {name}, {name}
        while added:
            added = {other for pair in self.pairs if pair & added for other in pair} - found
            found |= added
        return frozenset(found - {name})

    def update(self, bodies: Mapping[str, Body]) -> None:
        """Set which bodies collide; those of a disconnected trailer and its vehicle only after they have parted."""
        for pair in sorted(self.pairs | self._apart.keys(), key=sorted):
            if not pair <= bodies.keys():
                self._apart.pop(pair, None)
                continue
            first, second = (bodies[name] for name in sorted(pair))
            handles = first.handle, second.handle
            if pair not in self.pairs and box_distance(first.box, second.box) > PARTED:
                self._collide(handles, True)
                del self._apart[pair]
            elif self._apart.get(pair) != handles:
                self._collide(handles, False)
                self._apart[pair] = handles

    def _collide(self, handles: tuple[int, int], enabled: bool) -> None:
        bullet.setCollisionFilterPair(*handles, -1, -1, int(enabled), physicsClientId=self._client)
