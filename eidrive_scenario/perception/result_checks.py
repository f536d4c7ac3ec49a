"""Checks of the results of detectors, trackers and fusion methods: finite numbers and possible sizes."""

from __future__ import annotations

import math
from numbers import Real

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.base.detections import CLASSES, Detections
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.errors import InvalidResult
from eidrive_scenario.perception.detector import Detector
from eidrive_scenario.sensing.settings import SensorSettings

LARGEST = 1e9
"""Maximum magnitude of a coordinate [m], as in road files, and of a speed [m/s]."""
LARGEST_SIZE = 1e5
"""Maximum length, width or height of an object [m], as in road files."""
ROUNDING = 1e-5
"""Excess of a probability over 1, and relative error of a covariance, that single precision explains."""

_REAL = "fiu"
"""Kinds of numpy arrays of real numbers."""
_CLASSES = frozenset(CLASSES)


def is_checked(extension: object) -> bool:
    """Return whether the results of a detector or fusion method have to be checked.

    Only classes that declare to copy or average finite numbers are not: checks in each tick would take 1 % of a run. A
    derived class has to declare it itself.
    """
    return not vars(type(extension)).get("is_finite_by_construction", False)


def checked_detections(extension: object, method: str, result: Detections, *, now: float | None = None) -> Detections:
    """Return a read-only copy of a result, into whose arrays the extension may write its next one.

    Raise InvalidResult as `check_detections` does.
    """
    check_detections(extension, method, result, now=now)
    return result.subset(range(len(result))).freeze()


def check_detections(extension: object, method: str, detections: object, *, now: float | None = None) -> None:
    """Raise InvalidResult unless `detections` is a Detections of finite numbers in their ranges.

    now  time after which nothing can have been measured [s]; None: fused reports, whose clocks may be fast

    Sizes are in [0, LARGEST_SIZE], scores and existence in [0, 1], variances at least 0, covariances symmetric and
    nowhere negative, and no coordinate or speed exceeds LARGEST. Velocity and covariance may be NaN; the variance of
    the velocity may not.
    """
    if not isinstance(detections, Detections):
        raise InvalidResult(extension, method, f"returned {describe(detections)} (expected Detections)")
    _check_rows(extension, method, detections)
    try:
        if now is not None and detections.time > now + TIME_TOLERANCE:
            text = f"returned the time {detections.time:g} s, which is later than that of the readings, {now:g} s"
            raise InvalidResult(extension, method, text)
        if math.isfinite(detections.time) and (not len(detections.boxes) or _is_in_range(detections)):
            return
    except (TypeError, ValueError, AttributeError):
        pass
    raise_not_finite(
        extension,
        method,
        {
            "time": detections.time,
            "boxes": detections.boxes,
            "scores": detections.scores,
            "existence": detections.existence,
            "velocity": _without_nan(detections.velocity),
            "covariance": _without_nan(detections.covariance),
            "velocity_variance": detections.velocity_variance,
        },
    )
    variances = detections.covariance.reshape(-1, 4)[:, ::3]
    raise_outside(extension, method, "boxes", detections.boxes, -LARGEST, LARGEST)
    raise_outside(extension, method, "a length, width or height", detections.boxes[:, 3:6], 0.0, LARGEST_SIZE)
    raise_outside(extension, method, "scores", detections.scores, 0.0, 1.0, ROUNDING)
    raise_outside(extension, method, "existence", detections.existence, 0.0, 1.0, ROUNDING)
    raise_outside(extension, method, "velocity", detections.velocity, -LARGEST, LARGEST)
    raise_outside(extension, method, "covariance", detections.covariance, -(LARGEST**2), LARGEST**2)
    raise_outside(extension, method, "a variance", variances, 0.0, LARGEST**2)
    impossible = detections.covariance[_are_impossible(detections.covariance)]
    if len(impossible):
        text = f"returned covariance with the value {impossible[0].tolist()}"
        raise InvalidResult(extension, method, f"{text} (expected a symmetric matrix without negative eigenvalues)")
    raise_outside(extension, method, "velocity_variance", detections.velocity_variance, 0.0, LARGEST**2)


def checked_range(detector: Detector, sensor: SensorSettings) -> float:
    """Return the range of a sensor by a detector [m]. Raise InvalidResult unless it is a number of at least 0."""
    value: object = detector.range_of(sensor)
    if not isinstance(value, Real) or not float(value) >= 0.0:
        raise InvalidResult(detector, "range_of", f"returned {value!r} (expected a number of at least 0 m)")
    return float(value)


def check_array(extension: object, method: str, name: str, values: object, shape: tuple[int, ...]) -> None:
    """Raise InvalidResult unless `values` is an array of finite numbers with this shape."""
    if not isinstance(values, np.ndarray) or values.shape != shape:
        given = f"an array of shape {values.shape}" if isinstance(values, np.ndarray) else describe(values)
        raise InvalidResult(extension, method, f"returned {given} (expected an array of shape {shape})")
    if values.size and not are_within(values, LARGEST):
        raise_not_finite(extension, method, {name: values})


def raise_not_finite(extension: object, method: str, fields: dict[str, object]) -> None:
    """Raise InvalidResult that names the first field that is not numeric or not finite."""
    for name, value in fields.items():
        try:
            converted = np.asarray(value)
            array = converted.astype(float) if converted.dtype.kind in _REAL else None
        except (TypeError, ValueError):
            array = None
        if array is None:
            raise InvalidResult(extension, method, f"returned {name} as {describe(value)} (expected numbers)")
        invalid = array[~np.isfinite(array)] if array.ndim else array[None][~np.isfinite(array[None])]
        if invalid.size:
            raise InvalidResult(
                extension, method, f"returned {name} with the value {invalid[0]} (expected finite numbers)"
            )


def raise_outside(
    extension: object, method: str, name: str, values: Array, low: float, high: float, tolerance: float = 0.0
) -> None:
    """Raise InvalidResult that names the first value outside of [low, high]; NaN counts as inside."""
    invalid = values[(values < low - tolerance) | (values > high + tolerance)]
    if invalid.size:
        text = f"returned {name} with the value {invalid[0]:g} (expected {low:g} to {high:g})"
        raise InvalidResult(extension, method, text)


def are_within(values: Array, limit: float) -> bool:
    """Return whether all values are real numbers in [-limit, limit]; False for NaN."""
    return bool(values.dtype.kind in _REAL and values.min() >= -limit and values.max() <= limit)


def describe(value: object) -> str:
    """Return a short description of a result: None, or the type of the object."""
    if isinstance(value, np.ndarray):
        return f"an array of type {value.dtype}"
    return "None" if value is None else f"an object of type {type(value).__name__}"


def _is_in_range(detections: Detections) -> bool:
    """Return whether all numbers of at least one object are certainly in range; each line is False for NaN."""
    boxes, covariance, variance = detections.boxes, detections.covariance, detections.velocity_variance
    sizes = boxes[:, 3:6]
    return bool(
        are_within(boxes, LARGEST)
        and sizes.min() >= 0.0
        and sizes.max() <= LARGEST_SIZE
        and _are_probabilities(detections.scores)
        and (not detections.existence.size or _are_probabilities(detections.existence))
        and not (np.abs(detections.velocity) > LARGEST).any()
        and not (np.abs(covariance) > LARGEST**2).any()
        and not (covariance.reshape(-1, 4)[:, ::3] < 0.0).any()
        and not _are_impossible(covariance).any()
        and (not variance.size or (are_within(variance, LARGEST**2) and variance.min() >= 0.0))
    )


def _are_impossible(covariance: Array) -> Bools:
    """Return which matrices (N, 2, 2) of variances of at least 0 are no covariances; False for NaN."""
    xx, xy, yx, yy = covariance.reshape(-1, 4).T.astype(float)
    return np.asarray((np.abs(xy - yx) > ROUNDING * (xx + yy)) | (xy * yx > (1.0 + ROUNDING) * xx * yy))


def _are_probabilities(values: Array) -> bool:
    return bool(values.min() >= 0.0 and values.max() <= 1.0 + ROUNDING)


def _check_rows(extension: object, method: str, detections: Detections) -> None:
    """Raise InvalidResult unless arrays are numeric, classes are known, and track numbers are integers."""
    for name in ("boxes", "scores", "velocity", "covariance", "existence", "velocity_variance"):
        array = getattr(detections, name)
        if array.dtype.kind not in _REAL:
            raise InvalidResult(extension, method, f"returned {name} as {describe(array)} (expected numbers)")
    for kind in detections.classes:
        if not isinstance(kind, str) or kind not in _CLASSES:
            classes = ", ".join(CLASSES)
            raise InvalidResult(extension, method, f"returned the class {kind!r} (expected one of {classes})")
    for track in detections.tracks:
        if not isinstance(track, int | np.integer) or not -(2**63) <= track < 2**63:
            raise InvalidResult(extension, method, f"returned the track {track!r} (expected an integer of 64 bits)")


def _without_nan(value: object) -> object:
    array = np.asarray(value)
    return np.nan_to_num(array, nan=0.0, posinf=math.inf, neginf=-math.inf) if array.dtype.kind == "f" else value
