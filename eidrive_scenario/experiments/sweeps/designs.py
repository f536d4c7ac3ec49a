"""Designs of a sweep: which combinations of the values of its axes are run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.experiments.sweeps.axes import Axis, Point
from eidrive_scenario.randomness import integer_key

GRID = "grid"
MOST_POINTS = 1_000_000
"""Maximum number of combinations of a sweep."""


def _latin_hypercube(axes: int, count: int, rng: np.random.Generator) -> Array:
    from scipy.stats import qmc

    return np.asarray(qmc.LatinHypercube(axes, rng=rng).random(count))


def _sobol(axes: int, count: int, rng: np.random.Generator) -> Array:
    from scipy.stats import qmc

    # The first points of a longer sequence are those of a shorter one, so that more samples add points.
    complete = 1 << max(count - 1, 0).bit_length()
    return np.asarray(qmc.Sobol(axes, rng=rng).random(complete)[:count])


_SAMPLED: Mapping[str, Callable[[int, int, np.random.Generator], Array]] = {"lhs": _latin_hypercube, "sobol": _sobol}
DESIGNS = (GRID, *_SAMPLED)
"""Names of the designs: grid, Latin hypercube, and scrambled Sobol sequence."""


def points_of(axes: Sequence[Axis], design: str, samples: int | None, seed: int) -> list[Point]:
    """Return the combinations of a design; one without axes.

    design   one of DESIGNS. The grid contains all combinations of lists and ranges; the last axis varies fastest
    samples  number of sampled combinations
    seed     seed of the sampling

    Raise SettingError for an unknown design, an interval in a grid, or a number of samples that does not fit.
    """
    if design not in DESIGNS:
        raise SettingError(Diagnostic(f"--design: unknown design {design!r}", f"expected {', '.join(DESIGNS)}"))
    if design == GRID:
        return _grid(axes, samples)
    if not axes:
        raise SettingError(Diagnostic(f"--design {design} without --vary", "give the axes of the design"))
    if samples is None or not 1 <= samples <= MOST_POINTS:
        raise SettingError(
            Diagnostic(f"--design {design}: --samples is {samples}", f"expected 1 to {MOST_POINTS} combinations")
        )
    shares = _SAMPLED[design](len(axes), samples, np.random.default_rng(integer_key(seed, "design", design, size=16)))
    return [{axis.name: axis.at(float(share)) for axis, share in zip(axes, row, strict=True)} for row in shares]


def _grid(axes: Sequence[Axis], samples: int | None) -> list[Point]:
    if samples is not None:
        raise SettingError(Diagnostic("--samples has no effect in a grid", "select --design lhs or sobol"))
    for axis in axes:
        if axis.is_interval:
            hint = f"give a step ({axis.name}={axis.low:g}:{axis.high:g}:STEP), or --design lhs or sobol"
            raise SettingError(Diagnostic(f"--vary: {axis.name} is an interval in a grid", hint))
    count = int(np.prod([len(axis.values) for axis in axes], dtype=np.float64))
    if count > MOST_POINTS:
        raise SettingError(Diagnostic(f"the grid has {count} combinations", f"at most {MOST_POINTS} are possible"))
    names = [axis.name for axis in axes]
    return [dict(zip(names, values, strict=True)) for values in product(*(axis.values for axis in axes))]
