"""An oriented box around the points of one object, of which a LiDAR sees only the sides that face it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.perception.geometry.lidar_geometry import Pattern
from eidrive_scenario.perception.geometry.size_priors import SizePrior, prior_of
from eidrive_scenario.perception.lidar.l_shape import Rectangle, bounds, rectangles

RANGE_NOISE = 0.03
"""Of the points on a surface, standard deviation [m]."""
THIN = 3.0 * RANGE_NOISE
"""Points within so small an extent may be those of a surface across it [m]."""
SHAPELESS = 0.4
"""Points within so small a rectangle have no heading of their own [m]."""
FEW_COLUMNS = 1.6
"""A rectangle of fewer gaps between columns of rays has one that is worse than that of the lane."""
LANE_DEVIATION = math.radians(25.0)
"""How much an object's heading differs from the expected one [rad]."""
HEADING_DEVIATION = 0.4
"""Of a heading that is a guess [rad]."""
NEGLIGIBLE = 12.0
"""Choices whose cost exceeds the least one by more are not likely enough to matter."""
ABOVE_TOP = 0.3
"""A sensor this much above an object sees its top [m]."""


@dataclass(frozen=True)
class Fit:
    """A box x y z l w h yaw in the level frame, its class, the covariance of its center x y [m²], how well the points
    fit the class: the sum of squared deviations of its size from what is usual; and whether something nearer hides its
    left and its right end."""

    box: tuple[float, float, float, float, float, float, float]
    name: str
    covariance: Array
    deviation: float
    hidden: tuple[bool, bool]


class _Span(NamedTuple):
    """What the points say of a box along one axis."""

    low: float
    high: float
    gap: float
    """How much longer than its points the object may be; inf where the side along this axis is not seen [m]."""
    open_low: bool
    """Whether it may reach farther than its points at either end."""
    open_high: bool
    hidden: bool
    """Whether something stands before one of the ends."""


class _Choice(NamedTuple):
    """A way to see the points: its costs, by size and by heading, and what it takes them for."""

    cost: float
    astray: float
    name: str
    lengthwise: int
    shape: Rectangle
    spans: tuple[_Span, _Span]

    @property
    def total(self) -> float:
        """Minus twice the log of its likelihood, up to a constant."""
        return self.cost + self.astray


def fit_box(
    points: Array,
    *,
    sensor_height: float,
    ground: float,
    pattern: Pattern,
    classes: Sequence[str],
    hidden: tuple[bool, bool] = (False, False),
    cut: tuple[bool, bool] = (False, False),
    heading: float | None = None,
    heading_cost: Callable[[float], float] | None = None,
) -> Fit:
    """The box of the likeliest of `classes` around points (N, 3) of a level frame, the sensor above its origin.

    ground   height of the ground below the object [m]; the box stands on it
    hidden   whether something nearer ends the object's points at its left and its right end, as the sensor sees it
    cut      whether the sensor's field of view ends them there
    heading  of its length, where one is to be expected; taken if the points are too few to show one [rad]
    heading_cost  squared deviations of a heading of the length from what else is known of it; None is the deviation
             from `heading`

    Extents that the points show are believed as far as the gaps between the rays allow; sides that face away or are
    hidden are completed to the usual size of the class, towards the end that is not seen. The axis of the length
    follows from the fit; its direction leads away from the sensor, as points do not tell front from back.
    """
    x, y = points[:, :2].mean(axis=0).tolist()
    top = float(points[:, 2].max()) - ground
    highest = _highest(points, sensor_height, top, ground, pattern)
    shapes = rectangles(points[:, :2])
    shapeless = shapes[0].widest < SHAPELESS
    axes: tuple[int, ...] = (0, 1)
    if heading is not None and shapes[0].widest < max(SHAPELESS, FEW_COLUMNS * pattern.azimuth * math.hypot(x, y)):
        shapes, axes = [bounds(points[:, :2], heading)], (0,)
    elif shapeless:
        shapes = [bounds(points[:, :2], math.atan2(y, x))]
    choices: list[_Choice] = []
    for shape in shapes:
        spans = _spans(points, shape, sensor_height - ground, top, pattern, hidden, cut)
        for lengthwise in axes:
            yaw = shape.yaw + lengthwise * math.pi / 2.0
            if heading_cost is not None:
                turned = heading_cost(yaw)
            else:
                turned = 0.0 if heading is None else _astray(yaw - heading)
            for name in classes:
                cost = _cost(prior_of(name), spans, lengthwise, top, highest)
                choices.append(_Choice(cost, turned, name, lengthwise, shape, spans))
    if not choices:
        raise ValueError("a box needs a class to fit")
    best = choices[0]
    for choice in choices:
        if choice.total < best.total - 1e-9:
            best = choice
    sizes, center, covariance = _placed(best, shapeless)
    x, y = center
    yaw = best.shape.yaw + best.lengthwise * math.pi / 2.0
    if math.cos(yaw) * x + math.sin(yaw) * y < 0.0:
        yaw -= math.pi
    prior = prior_of(best.name)
    height = _blend(top, highest - top, prior.mean[2], prior.deviation[2])
    return Fit(
        (x, y, ground + height / 2.0, sizes[0], sizes[1], height, yaw),
        best.name,
        covariance + _doubt(choices, best, center, shapeless),
        best.cost + 2.0 * math.log(prior.share),
        hidden,
    )


def _placed(choice: _Choice, shapeless: bool) -> tuple[list[float], tuple[float, float], Array]:
    """Length and width, the center and its covariance (2, 2), if this choice is right."""
    prior = prior_of(choice.name)
    order = (0, 1) if choice.lengthwise == 0 else (1, 0)
    sizes, middles, variances = [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]
    for place, axis in enumerate(order):
        sizes[place], middles[axis], variances[axis] = _completed(
            choice.spans[axis], prior.mean[place], prior.deviation[place]
        )
    if shapeless:
        swing = (HEADING_DEVIATION * sizes[0] / 2.0) ** 2
        variances = [variance + swing for variance in variances]
    cos, sin = math.cos(choice.shape.yaw), math.sin(choice.shape.yaw)
    center = cos * middles[0] - sin * middles[1], sin * middles[0] + cos * middles[1]
    turn = np.array([[cos, -sin], [sin, cos]])
    return sizes, center, turn @ np.diag(variances) @ turn.T


def _doubt(choices: Sequence[_Choice], best: _Choice, center: tuple[float, float], shapeless: bool) -> Array:
    """(2, 2) how far the center would be elsewhere by the other ways to see an object of this class in the points, each
    as likely as its cost says [m²].

    Spread of the means of a Gaussian mixture (Bar-Shalom, Li and Kirubarajan 2001, section 1.4.16).
    """
    spread, total = np.zeros((2, 2)), 0.0
    for choice in choices:
        excess = choice.total - best.total
        if choice.name != best.name or excess > NEGLIGIBLE:
            continue
        weight = math.exp(-0.5 * excess)
        total += weight
        if choice is not best:
            there = _placed(choice, shapeless)[1]
            off = np.array([there[0] - center[0], there[1] - center[1]])
            spread += weight * np.outer(off, off)
    return spread / total


def _astray(angle: float) -> float:
    """The squared deviation of an axis from where it should lead."""
    off = (angle + math.pi / 2.0) % math.pi - math.pi / 2.0
    return (off / LANE_DEVIATION) ** 2


def _spans(
    points: Array,
    shape: Rectangle,
    above: float,
    top: float,
    pattern: Pattern,
    hidden: tuple[bool, bool],
    cut: tuple[bool, bool],
) -> tuple[_Span, _Span]:
    """Both axes; `above` is how high the sensor stands over the ground."""
    axes = ((math.cos(shape.yaw), math.sin(shape.yaw)), (-math.sin(shape.yaw), math.cos(shape.yaw)))
    x, y = points[:, :2].mean(axis=0).tolist()
    distance = math.hypot(x, y)
    gaps = [max(low, -high, 0.0) for low, high in zip(shape.low, shape.high, strict=True)]
    over = above - top
    spans = []
    for axis, (ax, ay) in enumerate(axes):
        low, high = shape.low[axis], shape.high[axis]
        facing = gaps[1 - axis]
        spacing = pattern.azimuth * distance**2 / facing if facing > 0.0 else math.inf
        if over > ABOVE_TOP and distance > 0.0:
            outwards = abs(ax * x + ay * y) / distance
            rings = pattern.elevation * (distance**2 + over**2) / over
            columns = pattern.azimuth * distance
            spacing = min(spacing, outwards * rings + math.sqrt(1.0 - min(outwards**2, 1.0)) * columns)
        open_low, open_high = not low > 0.0, not high < 0.0
        ends = _hidden_ends(points[:, :2], (ax, ay), low, high, hidden)
        if high - low <= THIN < shape.high[1 - axis] - shape.low[1 - axis]:
            # A side across this axis: it faces the sensor and ends the object, whatever hides more of it.
            ends = ends[0] and open_low, ends[1] and open_high
        if any(cut):
            # A side that faces the sensor ends the object: only the other end may lie beyond the field of view.
            at_low, at_high = _ends_of(points[:, :2], (ax, ay), low, high, cut)
            ends = ends[0] or (at_low and open_low), ends[1] or (at_high and open_high)
        if any(ends):
            open_low, open_high = ends
        gap = spacing * (2.0 if open_low and open_high else 1.0)
        spans.append(_Span(low, high, gap, open_low, open_high, any(ends)))
    return spans[0], spans[1]


def _hidden_ends(
    plan: Array, axis: tuple[float, float], low: float, high: float, hidden: tuple[bool, bool]
) -> tuple[bool, bool]:
    """Whether the low and the high end along an axis is where something hides the object's left or right end."""
    if not any(hidden):
        return False, False
    x, y = plan.mean(axis=0).tolist()
    across = abs(axis[0] * y - axis[1] * x) / max(math.hypot(x, y), 1e-9)
    if across < 0.5:
        return False, False  # the axis leads away from the sensor: its far end is hidden by the object itself
    return _ends_of(plan, axis, low, high, hidden)


def _ends_of(
    plan: Array, axis: tuple[float, float], low: float, high: float, flags: tuple[bool, bool]
) -> tuple[bool, bool]:
    """Whether the low and the high end along an axis is the left or right end that `flags` (left, right) name."""
    x, y = plan.mean(axis=0).tolist()
    if high - low <= THIN:
        # The points lie side by side along the axis, so their places are noise; the axis itself leads to one side.
        leads_left = x * axis[1] - y * axis[0] > 0.0
        return (flags[1], flags[0]) if leads_left else flags
    bearing = np.arctan2(x * plan[:, 1] - y * plan[:, 0], x * plan[:, 0] + y * plan[:, 1])
    at_low = at_high = False
    for is_hidden, row in zip(flags, (int(np.argmax(bearing)), int(np.argmin(bearing))), strict=True):
        if is_hidden:
            place = axis[0] * float(plan[row, 0]) + axis[1] * float(plan[row, 1])
            if place - low < high - place:
                at_low = True
            else:
                at_high = True
    return at_low, at_high


def _highest(points: Array, sensor_height: float, top: float, ground: float, pattern: Pattern) -> float:
    """How high above the ground the object may reach, by the next ring over its highest point [m]."""
    row = int(np.argmax(points[:, 2]))
    reach = math.hypot(float(points[row, 0]), float(points[row, 1]))
    elevation = math.atan2(float(points[row, 2]) - sensor_height, max(reach, 1e-6))
    if elevation > pattern.highest - 0.5 * pattern.elevation:
        return math.inf
    return max(sensor_height - ground + reach * math.tan(elevation + pattern.elevation), top)


def _cost(prior: SizePrior, spans: tuple[_Span, _Span], lengthwise: int, top: float, highest: float) -> float:
    """Squared deviations of what is seen from a class, in its standard deviations, less twice the log of its share."""
    cost = -2.0 * math.log(prior.share)
    for place, axis in enumerate((lengthwise, 1 - lengthwise)):
        cost += _deviation(spans[axis], prior.mean[place], prior.deviation[place])
    mean, deviation = prior.mean[2], prior.deviation[2]
    return cost + ((mean - min(max(mean, top), highest)) / deviation) ** 2


def _deviation(span: _Span, mean: float, deviation: float) -> float:
    seen = span.high - span.low
    if seen > mean:
        return ((seen - mean) / deviation) ** 2
    least = mean - seen - span.gap
    if span.hidden or least <= 0.0:
        return 0.0
    return (least / deviation) ** 2


def _blend(seen: float, gap: float, mean: float, deviation: float) -> float:
    """A size of which `seen` is certain and up to `gap` more is possible, joined with what is usual [m]."""
    if not math.isfinite(gap):
        return max(seen, mean)
    measured, variance = seen + gap / 2.0, gap**2 / 12.0 + RANGE_NOISE**2
    return max(seen, (measured * deviation**2 + mean * variance) / (variance + deviation**2))


def _completed(span: _Span, mean: float, deviation: float) -> tuple[float, float, float]:
    """Size, middle and variance of the middle along one axis."""
    seen = span.high - span.low
    if span.hidden or span.gap > 2.0 * mean:
        size, spread = max(seen, mean), deviation**2
    else:
        size = _blend(seen, span.gap, mean, deviation)
        variance = span.gap**2 / 12.0
        spread = variance * deviation**2 / (variance + deviation**2)
    if span.open_low == span.open_high:
        slack = size - seen
        return size, (span.low + span.high) / 2.0, slack**2 / 12.0 + RANGE_NOISE**2
    middle = span.low + size / 2.0 if span.open_high else span.high - size / 2.0
    return size, middle, spread / 4.0 + RANGE_NOISE**2
