"""Link budget between all stations: distance, line of sight, and path loss with correlated shadowing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.v2x.counter_random import Keys, combine_keys, key, uniforms
from eidrive_scenario.v2x.propagation import LinkGeometry, Tr37885, probability_of_los
from eidrive_scenario.v2x.radio.profile import RadioProfile
from eidrive_scenario.v2x.radio_environment import LOS, NLOSV, RadioEnvironment

OUT_OF_REACH = 170.0
"""LOS path loss from which the line of sight is not determined, because no message is received [dB]."""


@dataclass(frozen=True)
class Budget:
    """Link budget between N stations, in the order of `names`; all matrices are symmetric.

    distance   (N, N) [m]
    loss       (N, N) path loss with shadowing and blockage [dB]
    mean_loss  (N, N) path loss with blockage, without shadowing [dB]
    states     (N, N) LOS, NLOSV or NLOS
    blockers   names of the blocking bodies by pair of rows, the lower row first
    """

    names: tuple[str, ...]
    rows: Mapping[str, int]
    distance: Array
    loss: Array
    mean_loss: Array
    states: Integers
    blockers: Mapping[tuple[int, int], tuple[str, ...]]

    def bodies_between(self, sender: int, receiver: int) -> tuple[str, ...]:
        """Return the names of the blocking bodies between two stations (rows), in order from the sender."""
        if sender < receiver:
            return self.blockers.get((sender, receiver), ())
        return self.blockers.get((receiver, sender), ())[::-1]


class LinkBudget:
    """Link budget with the shadowing state of each pair of stations, symmetric in both directions.

    Shadowing and the loss by blocking vehicles are correlated over the distance s that both antennas have covered,
    e^(-s / d) (M. Gudmundson, Electronics Letters 27(23), 1991). Random numbers are keyed by pair and update count.
    """

    def __init__(self, profile: RadioProfile, seed: int) -> None:
        self._profile = profile
        self._seed = seed
        path_loss, spread, reach = profile.path_loss, profile.shadowing_db, profile.decorrelation
        self._spreads = np.array(path_loss.spreads if spread is None else (spread,) * 3)
        """Standard deviation of the shadowing by state [dB]."""
        self._reaches = np.array(path_loss.reaches if reach is None else (reach,) * 3)
        """Decorrelation distance of the shadowing by state [m]."""
        self._names: tuple[str, ...] = ()
        self._rows: dict[str, int] = {}
        self._first = self._second = np.zeros(0, dtype=np.int64)
        self._normals, self._updates, self._positions = np.zeros((2, 0)), np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        self._pairs: list[tuple[str, str]] | None = None
        """Names of the stations of each pair; None until line of sight is determined by rays."""
        self._set_stations(())

    def continue_from(self, previous: LinkBudget) -> None:
        """Take the stations and the shadowing of another link budget."""
        self._set_stations(previous._names)
        self._normals, self._updates, self._positions = previous._normals, previous._updates, previous._positions

    def at(self, surroundings: RadioEnvironment) -> Budget:
        """Return the link budget at the current antenna positions."""
        from scipy.special import ndtr

        names = surroundings.names
        if names != self._names:
            self._set_stations(names)
        positions = surroundings.positions
        offset = positions.take(self._first, axis=0) - positions.take(self._second, axis=0)
        distance = np.sqrt(np.einsum("pi,pi->p", offset, offset))
        between, blockers = self._link_geometry(surroundings, distance)
        shadowing, blockage = self._update_shadowing(positions, between.states)
        mean_loss = self._profile.path_loss.loss(between, self._profile.frequency_ghz, ndtr(blockage))
        # In matrices of stations each pair stands twice; the last entry, of zeros, is the link of a station to itself.
        links, states = np.zeros((3, len(self._first) + 1)), np.full(len(self._first) + 1, LOS)
        links[0, :-1] = distance
        links[1, :-1] = mean_loss + self._spreads.take(between.states) * shadowing
        links[2, :-1] = mean_loss
        states[:-1] = between.states
        square = links.take(self._pair_at, axis=1)
        return Budget(names, self._rows, square[0], square[1], square[2], states.take(self._pair_at), blockers)

    def _set_stations(self, names: tuple[str, ...]) -> None:
        """Replace the stations. Remaining pairs keep their shadowing."""
        count, former = len(names), len(self._names)
        first, second = np.triu_indices(count, 1)
        normals, updates = np.zeros((2, len(first))), np.full(len(first), -1)
        positions = np.full((count, 3), np.inf)  # a new station has moved from an infinite distance
        old = np.array([self._rows.get(name, -1) for name in names], dtype=np.int64)
        pair_at = np.full((former + 1, former + 1), -1)
        pair_at[self._first, self._second] = pair_at[self._second, self._first] = np.arange(len(self._first))
        former_pair = pair_at[old[first], old[second]] if count else updates
        remaining = former_pair >= 0
        normals[:, remaining] = self._normals[:, former_pair[remaining]]
        updates[remaining] = self._updates[former_pair[remaining]]
        positions[old >= 0] = self._positions[old[old >= 0]]
        self._names, self._rows = names, {name: row for row, name in enumerate(names)}
        self._first, self._second = first, second
        self._pair_at = np.full((count, count), len(first))
        """Index of the pair of two rows; the number of pairs on the diagonal."""
        self._pair_at[first, second] = self._pair_at[second, first] = np.arange(len(first))
        self._normals, self._updates, self._positions = normals, updates, positions
        self._pairs = None

        def keys(purpose: str) -> Keys:
            own = np.array([key(self._seed, purpose, name) for name in names], dtype=np.uint64)
            return combine_keys(own[first], own[second])

        self._keys = np.stack([keys("shadowing"), keys("blockage")])
        self._sight_keys = keys("sight")

    def _link_geometry(
        self, surroundings: RadioEnvironment, distance: Array
    ) -> tuple[LinkGeometry, dict[tuple[int, int], tuple[str, ...]]]:
        """Return the geometry of all pairs of stations, and the blocking bodies by rows of the stations."""
        heights = surroundings.heights
        ends = heights.take(self._first), heights.take(self._second)
        between = LinkGeometry.in_sight(distance, np.minimum(*ends), np.maximum(*ends))
        blockers: dict[tuple[int, int], tuple[str, ...]] = {}
        if self._profile.line_of_sight == "random":
            path_loss = self._profile.path_loss
            environment = path_loss.environment if isinstance(path_loss, Tr37885) else "highway"
            hidden = uniforms(self._sight_keys, 0) > probability_of_los(distance, environment)
            between.states[hidden], between.vehicles[hidden] = NLOSV, 1
            between.tops[hidden] = between.upper[hidden] + 0.1
        elif self._profile.line_of_sight == "rays" and surroundings.sight is not None and len(distance):
            draws = np.full(len(distance), 0.5)  # without effect in line of sight
            clear = self._profile.path_loss.loss(between, self._profile.frequency_ghz, draws)
            near = np.flatnonzero(clear < OUT_OF_REACH)
            if self._pairs is None:
                rows = zip(self._first.tolist(), self._second.tolist(), strict=True)
                self._pairs = [(self._names[a], self._names[b]) for a, b in rows]
            all_near = len(near) == len(self._pairs)
            sight = surroundings.sight(self._pairs if all_near else [self._pairs[pair] for pair in near.tolist()])
            between.states[near], between.tops[near] = sight.states, sight.heights
            for ray, names in sight.blockers.items():
                pair = int(near[ray])
                between.vehicles[pair] = len(names)
                blockers[int(self._first[pair]), int(self._second[pair])] = names
        return between, blockers

    def _update_shadowing(self, positions: Array, states: Integers) -> Array:
        """Return the standard normal numbers of shadowing and blockage (2, M), updated by the covered distance.

        x <- k x + sqrt(1 - k²) n with k = e^(-s / d) and a standard normal number n keeps the variance of 1. A pair at
        rest has k = 1 and keeps its numbers; a new pair has covered an infinite distance, so k = 0.
        """
        from scipy.special import ndtri

        step = positions - self._positions
        moved = np.sqrt(np.einsum("ni,ni->n", step, step))
        covered = moved.take(self._first) + moved.take(self._second)
        moving = covered > 0.0
        self._positions = positions.copy()
        if moving.any():
            self._updates += moving
            kept = np.exp(-covered / self._reaches.take(states))
            innovation = ndtri(uniforms(self._keys, self._updates))
            self._normals = kept * self._normals + np.sqrt(1.0 - kept * kept) * innovation
        return self._normals
