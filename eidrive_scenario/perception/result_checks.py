"""Checks of what detectors and fusion methods return: a list of objects without infinite or undefined numbers."""

from __future__ import annotations

import math

import numpy as np

from eidrive_scenario.detections import CLASSES, Detections
from eidrive_scenario.errors import InvalidResult
from eidrive_scenario.registry import is_built_in

_FINITE_BY_CONSTRUCTION = ("perception.oracle", "fusion.average")
"""Modules whose classes copy or average finite numbers; a check of theirs in each tick would cost 1 % of a run."""

_REAL = "fiu"
"""Kinds of numpy arrays of real numbers."""
_CLASSES = frozenset(CLASSES)


def is_checked(extension: object) -> bool:
    """Return whether the results of a detector or fusion method have to be checked."""
    module = type(extension).__module__
    return not (is_built_in(type(extension)) and module.endswith(_FINITE_BY_CONSTRUCTION))


def check_detections(extension: object, method: str, found: object) -> None:
    """Raise InvalidResult unless `found` is a Detections of finite numbers; velocity and covariance may be NaN."""
    if not isinstance(found, Detections):
        raise InvalidResult(extension, method, f"returned {describe(found)} (expected Detections)")
    boxes, scores = found.boxes, found.scores
    _check_rows(extension, method, found)
    try:
        # One product per array is a third of the time of np.isfinite; a sum that overflows is looked at closely.
        quick = found.time + np.vdot(boxes, boxes) + np.vdot(scores, scores)
        if found.existence.size:
            quick += np.vdot(found.existence, found.existence)
        if math.isfinite(quick) and not (np.isinf(found.velocity).any() or np.isinf(found.covariance).any()):
            return
    except (TypeError, ValueError, AttributeError):
        pass
    raise_not_finite(
        extension,
        method,
        {
            "time": found.time,
            "boxes": boxes,
            "scores": scores,
            "existence": found.existence,
            "velocity": _without_nan(found.velocity),
            "covariance": _without_nan(found.covariance),
        },
    )


def check_in_view(extension: object, shares: object, count: int) -> None:
    """Raise InvalidResult unless `shares` is an array of `count` finite numbers."""
    if not isinstance(shares, np.ndarray) or shares.shape != (count,):
        shape = f"an array of shape {shares.shape}" if isinstance(shares, np.ndarray) else describe(shares)
        raise InvalidResult(extension, "in_view", f"returned {shape} (expected an array of shape {(count,)})")
    raise_not_finite(extension, "in_view", {"shares": shares})


def raise_not_finite(extension: object, method: str, fields: dict[str, object]) -> None:
    """Raise InvalidResult that names the first field that is no number or not finite; return if all are."""
    for name, value in fields.items():
        try:
            found = np.asarray(value)
            array = found.astype(float) if found.dtype.kind in _REAL else None
        except (TypeError, ValueError):
            array = None
        if array is None:
            raise InvalidResult(extension, method, f"returned {name} as {describe(value)} (expected numbers)")
        wrong = array[~np.isfinite(array)] if array.ndim else array[None][~np.isfinite(array[None])]
        if wrong.size:
            raise InvalidResult(
                extension, method, f"returned {name} with the value {wrong[0]} (expected finite numbers)"
            )


def describe(value: object) -> str:
    """Return what was returned in a few words: None, or the type of the object."""
    if isinstance(value, np.ndarray):
        return f"an array of type {value.dtype}"
    return "None" if value is None else f"an object of type {type(value).__name__}"


def _check_rows(extension: object, method: str, found: Detections) -> None:
    """Raise InvalidResult unless arrays are of real numbers, classes known, and tracks whole numbers."""
    for name in ("boxes", "scores", "velocity", "covariance", "existence"):
        array = getattr(found, name)
        if array.dtype.kind not in _REAL:
            raise InvalidResult(extension, method, f"returned {name} as {describe(array)} (expected numbers)")
    for kind in found.classes:
        if not isinstance(kind, str) or kind not in _CLASSES:
            known = ", ".join(CLASSES)
            raise InvalidResult(extension, method, f"returned the class {kind!r} (expected one of {known})")
    for track in found.tracks:
        if not isinstance(track, int | np.integer):
            raise InvalidResult(extension, method, f"returned the track {track!r} (expected a whole number)")


def _without_nan(value: object) -> object:
    array = np.asarray(value)
    return np.nan_to_num(array, nan=0.0, posinf=math.inf, neginf=-math.inf) if array.dtype.kind == "f" else value
