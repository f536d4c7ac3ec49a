"""Association candidates of many tracks, compared with all pairs."""

from __future__ import annotations

import numpy as np
import pytest

from eidrive_scenario.fusion.pairs import AssociationGate, Table, gated_pairs
from eidrive_scenario.fusion.tracks import TRACK

GATE = AssociationGate.of(0.99, 4.0)


def random_tracks(rng: np.random.Generator, count: int, spread: float) -> Table:
    """Return tracks of ten stations in a square of this side, a fifth of them without a covariance."""
    tracks = np.zeros(count, TRACK)
    tracks["station"] = rng.integers(0, 10, count)
    tracks["number"] = rng.integers(-1, 6, count)
    tracks["mean"] = rng.uniform(0.0, spread, (count, 4))
    tracks["covariance"] = np.eye(4) * rng.uniform(0.01, 9.0, count)[:, None, None]
    tracks["pose"] = np.eye(2) * rng.uniform(0.0, 0.5, count)[:, None, None]
    tracks["vague"] = rng.random(count) < 0.2
    tracks["body"][:, 2] = rng.uniform(0.4, 2.6, count)
    return tracks


@pytest.mark.exhaustive
@pytest.mark.parametrize("same_station", [True, False])
@pytest.mark.parametrize("spread", [5.0, 60.0, 3000.0])
def test_candidates_of_many_tracks_equal_those_of_one_by_one(spread: float, same_station: bool) -> None:
    rng = np.random.default_rng(int(spread))
    first, second = random_tracks(rng, 30, spread), random_tracks(rng, 40, spread)
    first["mean"][:, 0] += rng.choice([0.0, 1e6], 30)
    for one, other in ((first, second), (second, second)):
        pairs = gated_pairs(one, other, GATE, same_station=same_station)
        assert list(zip(*pairs, strict=True)) == pairs_one_by_one(one, other, same_station)
    assert pairs.first or spread == 3000.0


def pairs_one_by_one(first: Table, second: Table, same_station: bool) -> list[tuple[int, int, float, float, bool]]:
    """Return the candidates, each from a comparison of two single tracks."""
    found = []
    for row in range(len(first)):
        for column in range(len(second)):
            pair = gated_pairs(first[row : row + 1], second[column : column + 1], GATE, same_station=same_station)
            found += [(row, column, *rest) for rest in zip(pair.cost, pair.limit, pair.inside, strict=True)]
    return found


def test_infinitely_wide_track_is_a_candidate_of_all() -> None:
    tracks = random_tracks(np.random.default_rng(1), 40, 1000.0)
    tracks["covariance"][7], tracks["vague"] = np.eye(4) * 1e30, False
    pairs = gated_pairs(tracks, tracks, GATE, same_station=False)
    assert list(zip(*pairs, strict=True)) == pairs_one_by_one(tracks, tracks, False)
    wide = {row for pair in zip(pairs.first, pairs.second, strict=True) if 7 in pair for row in pair}
    others = np.flatnonzero(tracks["station"] != tracks["station"][7]).tolist()
    assert wide == {7, *others}


def test_pairs_of_several_receiving_stations_equal_those_of_each() -> None:
    """Tracks of two receiving stations are no candidates, though they are at the same places."""
    rng = np.random.default_rng(5)
    parts = [random_tracks(rng, count, spread) for count, spread in ((40, 30.0), (1, 30.0), (70, 90.0), (25, 8.0))]
    expected = []
    begin = 0
    for receiver, part in enumerate(parts):
        part["receiver"] = receiver
        found = gated_pairs(part, part, GATE, same_station=False)
        expected += [(first + begin, second + begin) for first, second in zip(found.first, found.second, strict=True)]
        begin += len(part)
    both = np.concatenate(parts)
    found = gated_pairs(both, both, GATE, same_station=False)
    assert list(zip(found.first, found.second, strict=True)) == expected
    both["mean"][3, 0] = 1e150
    found = gated_pairs(both, both, GATE, same_station=False)
    assert list(zip(found.first, found.second, strict=True)) == [pair for pair in expected if 3 not in pair]
