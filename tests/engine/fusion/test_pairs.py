"""Association candidates of many tracks: the same as those of all pairs."""

from __future__ import annotations

import numpy as np
import pytest

from eidrive_scenario.fusion import pairs
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


@pytest.mark.parametrize("same_station", [True, False])
@pytest.mark.parametrize("spread", [5.0, 60.0, 3000.0])
def test_candidates_of_many_tracks_equal_those_of_all_pairs(
    monkeypatch: pytest.MonkeyPatch, spread: float, same_station: bool
) -> None:
    rng = np.random.default_rng(int(spread))
    first, second = random_tracks(rng, 70, spread), random_tracks(rng, 90, spread)
    first["mean"][:, 0] += rng.choice([0.0, 1e6], 70)
    monkeypatch.setattr(pairs, "_FEW_PAIRS", first.size * second.size)
    expected = gated_pairs(first, second, GATE, same_station=same_station)
    monkeypatch.setattr(pairs, "_FEW_PAIRS", 0)
    assert gated_pairs(first, second, GATE, same_station=same_station) == expected
    itself = gated_pairs(second, second, GATE, same_station=same_station)
    monkeypatch.setattr(pairs, "_FEW_PAIRS", second.size**2)
    assert gated_pairs(second, second, GATE, same_station=same_station) == itself
    assert itself.first


def test_infinitely_wide_track_is_a_candidate_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    tracks = random_tracks(np.random.default_rng(1), 40, 1000.0)
    tracks["covariance"][7], tracks["vague"] = np.eye(4) * 1e30, False
    monkeypatch.setattr(pairs, "_FEW_PAIRS", 0)
    few = gated_pairs(tracks, tracks, GATE, same_station=False)
    monkeypatch.setattr(pairs, "_FEW_PAIRS", 1600)
    assert few == gated_pairs(tracks, tracks, GATE, same_station=False)
    wide = {row for pair in zip(few.first, few.second, strict=True) if 7 in pair for row in pair}
    others = np.flatnonzero(tracks["station"] != tracks["station"][7]).tolist()
    assert wide == {7, *others}


@pytest.mark.parametrize("few", [0, 10**6])
def test_pairs_of_several_receiving_stations_equal_those_of_each(monkeypatch: pytest.MonkeyPatch, few: int) -> None:
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
    monkeypatch.setattr(pairs, "_FEW_PAIRS", few)
    both = np.concatenate(parts)
    found = gated_pairs(both, both, GATE, same_station=False)
    assert list(zip(found.first, found.second, strict=True)) == expected
    both["mean"][3, 0] = 1e150
    found = gated_pairs(both, both, GATE, same_station=False)
    assert list(zip(found.first, found.second, strict=True)) == [pair for pair in expected if 3 not in pair]
