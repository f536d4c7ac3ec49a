"""Link budget between all stations: distance, line of sight, and path loss with correlated shadowing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.arrays import Array, Integers
from eidrive_scenario.v2x.counter_random import Keys, combine_keys, key, uniform, uniforms
from eidrive_scenario.v2x.propagation.path_loss import Link, LinkGeometry, PathLoss, probability_of_los
from eidrive_scenario.v2x.radio_environment import LOS, NLOSV, RadioEnvironment
from eidrive_scenario.v2x.standards import ANTENNA_HEIGHT

OUT_OF_REACH = 170.0
"""LOS path loss from which the line of sight is not determined, because no message is received [dB]."""
MAX_SCALAR = 8
"""Maximum number of station pairs for scalar evaluation, which is then faster than arrays."""


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

    line_of_sight  `rays` through the world, `random` by the probabilities of TR 37.885, or `clear`
    """

    def __init__(
        self,
        path_loss: PathLoss,
        *,
        seed: int,
        frequency_ghz: float,
        line_of_sight: str = "rays",
        environment: str = "urban",
        shadowing_db: float | None = None,
        decorrelation: float | None = None,
    ) -> None:
        self._path_loss = path_loss
        self._seed = seed
        self._frequency = frequency_ghz
        self._line_of_sight = line_of_sight
        self._environment = environment
        self._spread = shadowing_db
        self._decorrelation = decorrelation
        self._reach = self._distance_of(OUT_OF_REACH)
        self._names: tuple[str, ...] = ()
        self._rows: dict[str, int] = {}
        self._first = self._second = np.zeros(0, dtype=np.int64)
        self._normals, self._updates, self._places = np.zeros((2, 0)), np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        self._pairs: list[tuple[str, str]] | None = None
        """Names of the stations of each pair; None until line of sight is determined by rays."""
        self._set_stations(())

    def continue_from(self, previous: LinkBudget) -> None:
        """Take the stations and the shadowing of another link budget."""
        self._set_stations(previous._names)
        self._normals, self._updates, self._places = previous._normals, previous._updates, previous._places

    def at(self, surroundings: RadioEnvironment) -> Budget:
        """Return the link budget at the current antenna positions."""
        names = surroundings.names
        if names != self._names:
            self._set_stations(names)
        return self._at_scalar(surroundings) if 0 < len(self._first) <= MAX_SCALAR else self._at_array(surroundings)

    def _at_array(self, surroundings: RadioEnvironment) -> Budget:
        from scipy.special import ndtr

        names, positions = surroundings.names, surroundings.positions
        first, second = self._first, self._second
        distance = np.linalg.norm(positions[first] - positions[second], axis=1)
        between, blockers = self._link_geometry(surroundings, positions, distance)
        shadow = self._update_shadowing(positions, between.states)
        mean_loss = self._path_loss.loss(between, self._frequency, ndtr(shadow[1]))
        spread = np.take(self._path_loss.spreads, between.states) if self._spread is None else self._spread
        links = np.zeros((3, len(first) + 1))  # the last link is that of a station to itself
        links[0, :-1], links[1, :-1], links[2, :-1] = distance, mean_loss + spread * shadow[0], mean_loss
        square = links.take(self._pair_at, axis=1)
        states = np.append(between.states, LOS).take(self._pair_at)
        return Budget(names, self._rows, square[0], square[1], square[2], states, blockers)

    def _at_scalar(self, surroundings: RadioEnvironment) -> Budget:
        """Return the link budget, evaluated pair by pair."""

        from scipy.special import ndtr

        names = surroundings.names
        places = [surroundings.places[name] for name in names]
        moved = [math.dist(here, there) for here, there in zip(self._places.tolist(), places, strict=True)]
        self._places = np.array(places, dtype=float).reshape(-1, 3)
        between, blockers = self._link_geometry_scalar(surroundings, places)
        distance, loss, mean_loss = ([[0.0] * len(names) for _ in names] for _ in range(3))
        states = [[LOS] * len(names) for _ in names]
        for pair, (link, a, b) in enumerate(zip(between, self._first.tolist(), self._second.tolist(), strict=True)):
            shadow, blockage = self._update_pair(pair, moved[a] + moved[b], link.state)
            mean = self._path_loss.loss_of(link, self._frequency, float(ndtr(blockage)))
            spread = self._path_loss.spreads[link.state] if self._spread is None else self._spread
            distance[a][b] = distance[b][a] = link.distance
            loss[a][b] = loss[b][a] = mean + spread * shadow
            mean_loss[a][b] = mean_loss[b][a] = mean
            states[a][b] = states[b][a] = link.state
        codes = np.array(states, dtype=np.int64)
        return Budget(names, self._rows, np.array(distance), np.array(loss), np.array(mean_loss), codes, blockers)

    def _link_geometry_scalar(
        self, surroundings: RadioEnvironment, places: Sequence[tuple[float, float, float]]
    ) -> tuple[list[Link], dict[tuple[int, int], tuple[str, ...]]]:
        """Return the geometry of each link, and the blocking bodies by rows, evaluated pair by pair."""
        links, blockers = [], {}
        heights = surroundings.heights.tolist()
        ends = list(zip(self._first.tolist(), self._second.tolist(), strict=True))
        for pair, (a, b) in enumerate(ends):
            lower, upper = sorted((heights[a], heights[b]))
            link = Link(math.dist(places[a], places[b]), LOS, lower, upper, -math.inf, 0)
            if self._line_of_sight == "random":
                draw = uniform(int(self._sight_keys[pair]), 0)
                if draw > float(probability_of_los(link.distance, self._environment)):
                    link = link._replace(state=NLOSV, top=upper + 0.1, vehicles=1)
            links.append(link)
        if self._line_of_sight == "rays" and surroundings.sight is not None and links:
            near = [pair for pair, link in enumerate(links) if link.distance < self._reach]
            sight = surroundings.sight(self._names_of(near))
            for ray, (pair, state, top) in enumerate(
                zip(near, sight.states.tolist(), sight.heights.tolist(), strict=True)
            ):
                if state != LOS:
                    bodies = sight.blockers.get(ray, ())
                    links[pair] = links[pair]._replace(state=state, top=top, vehicles=len(bodies))
                    if bodies:
                        blockers[ends[pair]] = bodies
        return links, blockers

    def _update_pair(self, pair: int, covered: float, state: int) -> tuple[float, float]:
        """Return `_update_shadowing` of one pair of stations after the covered distance [m]."""

        from scipy.special import ndtri

        shadow, blockage = self._normals[:, pair].tolist()
        if covered == 0.0:
            return shadow, blockage
        self._updates[pair] += 1
        reach = self._path_loss.reaches[state] if self._decorrelation is None else self._decorrelation
        kept = 0.0 if math.isnan(covered) else math.exp(-covered / reach)
        fresh, count = math.sqrt(1.0 - kept * kept), int(self._updates[pair])
        for_shadow, for_blockage = (float(ndtri(uniform(own, count))) for own in self._keys[:, pair].tolist())
        shadow, blockage = kept * shadow + fresh * for_shadow, kept * blockage + fresh * for_blockage
        self._normals[:, pair] = shadow, blockage
        return shadow, blockage

    def _distance_of(self, loss: float) -> float:
        """Return the distance from which the LOS path loss is at least `loss` [dB], in meters."""
        near, far = 1.0, 1e9
        for _ in range(100):
            middle = math.sqrt(near * far)
            link = Link(middle, LOS, ANTENNA_HEIGHT, ANTENNA_HEIGHT, -math.inf, 0)
            there = self._path_loss.loss_of(link, self._frequency, 0.5)
            near, far = (near, middle) if there >= loss else (middle, far)
        return far

    def _set_stations(self, names: tuple[str, ...]) -> None:
        """Replace the stations. Remaining pairs keep their shadowing."""
        count, former = len(names), len(self._names)
        first, second = np.triu_indices(count, 1)
        normals, updates = np.zeros((2, len(first))), np.full(len(first), -1)
        places = np.full((count, 3), np.nan)
        old = np.array([self._rows.get(name, -1) for name in names], dtype=np.int64)
        pair_at = np.full((former + 1, former + 1), -1)
        pair_at[self._first, self._second] = pair_at[self._second, self._first] = np.arange(len(self._first))
        former_pair = pair_at[old[first], old[second]] if count else updates
        known = former_pair >= 0
        normals[:, known], updates[known] = self._normals[:, former_pair[known]], self._updates[former_pair[known]]
        places[old >= 0] = self._places[old[old >= 0]]
        self._names, self._rows = names, {name: row for row, name in enumerate(names)}
        self._first, self._second = first, second
        self._pair_at = np.full((count, count), len(first))
        """Index of the pair of two rows; the number of pairs on the diagonal."""
        self._pair_at[first, second] = self._pair_at[second, first] = np.arange(len(first))
        self._normals, self._updates, self._places = normals, updates, places
        self._pairs = None

        def keys(purpose: str) -> Keys:
            own = np.array([key(self._seed, purpose, name) for name in names], dtype=np.uint64)
            return combine_keys(own[first], own[second])

        self._keys = np.stack([keys("shadowing"), keys("blockage")])
        self._sight_keys = keys("sight")

    def _names_of(self, pairs: Sequence[int]) -> Sequence[tuple[str, str]]:
        """Return the names of the stations of these pairs."""
        if self._pairs is None:
            names, ends = self._names, zip(self._first.tolist(), self._second.tolist(), strict=True)
            self._pairs = [(names[a], names[b]) for a, b in ends]
        known = self._pairs
        return known if len(pairs) == len(known) else [known[pair] for pair in pairs]

    def _link_geometry(
        self, surroundings: RadioEnvironment, positions: Array, distance: Array
    ) -> tuple[LinkGeometry, dict[tuple[int, int], tuple[str, ...]]]:
        count = len(distance)
        heights = surroundings.heights
        lower = np.minimum(heights[self._first], heights[self._second])
        upper = np.maximum(heights[self._first], heights[self._second])
        states, tops = np.full(count, LOS), np.full(count, -np.inf)
        vehicles = np.zeros(count, dtype=np.int64)
        between = LinkGeometry(distance, states, lower, upper, tops, vehicles)
        blockers: dict[tuple[int, int], tuple[str, ...]] = {}
        if self._line_of_sight == "random":
            hidden = uniforms(self._sight_keys, 0) > probability_of_los(distance, self._environment)
            states[hidden], tops[hidden], vehicles[hidden] = NLOSV, upper[hidden] + 0.1, 1
        elif self._line_of_sight == "rays" and surroundings.sight is not None and count:
            near = np.flatnonzero(distance < self._reach)
            sight = surroundings.sight(self._names_of(near.tolist()))
            states[near], tops[near] = sight.states, sight.heights
            for ray, names in sight.blockers.items():
                pair = int(near[ray])
                vehicles[pair] = len(names)
                blockers[int(self._first[pair]), int(self._second[pair])] = names
        return between, blockers

    def _update_shadowing(self, positions: Array, states: Integers) -> Array:
        """Return the standard normal numbers of shadowing and blockage (2, M), updated by the covered distance."""

        from scipy.special import ndtri

        step = positions - self._places
        moved = np.sqrt(np.einsum("ni,ni->n", step, step))
        covered = moved[self._first] + moved[self._second]
        covered[np.isnan(covered)] = math.inf
        moving = covered > 0.0
        self._places = positions.copy()
        if moving.any():
            self._updates += moving
            reach = np.take(self._path_loss.reaches, states) if self._decorrelation is None else self._decorrelation
            kept = np.exp(-covered / reach)
            innovation = ndtri(uniforms(self._keys, self._updates))
            updated = kept * self._normals + np.sqrt(1.0 - kept * kept) * innovation
            self._normals = np.where(moving, updated, self._normals)
        return self._normals
