"""Fit of an oriented box to the points of one object; a lidar measures only the sides that face it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.kernels import kernel
from eidrive_scenario.perception.geometry.lidar_geometry import Pattern
from eidrive_scenario.perception.geometry.map_context import LANE_DEVIATION
from eidrive_scenario.perception.geometry.size_priors import REPORTED, SizePrior, prior_of

HEADINGS = np.radians(np.arange(0.0, 90.0, 1.0))
"""Tested headings of the first axis [rad]."""
_COS, _SIN = np.cos(HEADINGS), np.sin(HEADINGS)
CLOSEST = 0.2
"""Minimum distance from an edge that counts [m]: the sides of bodies are not flat."""
MOST_POINTS = 300
"""Maximum number of points in the search for the heading; the extent uses all points."""
AS_GOOD = 0.9
"""Share of the best closeness from which a heading is equivalent: with few points there are several."""
MOST = 4
"""Maximum number of returned rectangles."""


class Rectangle(NamedTuple):
    """Rectangle in plan view: the heading of its first axis [rad], and its bounds along both axes [m]."""

    yaw: float
    low: tuple[float, float]
    high: tuple[float, float]

    @property
    def widest(self) -> float:
        """Length of the longer side [m]."""
        return max(self.high[0] - self.low[0], self.high[1] - self.low[1])


def rectangles(plan: Array) -> list[Rectangle]:
    """Return the rectangles around points (N, 2) whose edges are closest to them, the best first.

    Search by the closeness criterion: Zhang, Xu, Dong and Dolan, Efficient L-shape fitting for vehicle detection using
    laser scanners, IV 2017, algorithm 4. Other headings that are peaks of about the same closeness follow.
    """
    chosen = plan if len(plan) <= MOST_POINTS else plan[:: math.ceil(len(plan) / MOST_POINTS)]
    nearest = np.empty((len(HEADINGS), len(chosen)))
    _find_nearest_edges(np.ascontiguousarray(chosen[:, 0]), np.ascontiguousarray(chosen[:, 1]), _COS, _SIN, nearest)
    # The second term decides between headings that are equal by the criterion, by the distances of all points. Without
    # it the first one would be selected, and a mirrored object would not have a mirrored heading.
    closeness = np.sum(1.0 / np.maximum(nearest, CLOSEST), axis=1) + 1.0 / (1.0 + np.sum(nearest, axis=1))
    peaks = (closeness >= np.roll(closeness, 1)) & (closeness > np.roll(closeness, -1))
    peaks |= closeness == closeness.max()
    good = np.flatnonzero(peaks & (closeness >= AS_GOOD * closeness.max()))
    order = good[np.argsort(-closeness[good], kind="stable")][:MOST]
    return [bounds(plan, float(HEADINGS[number])) for number in order.tolist()]


def bounds(plan: Array, yaw: float) -> Rectangle:
    """Return the rectangle of a given heading around points (N, 2)."""
    along = math.cos(yaw) * plan[:, 0] + math.sin(yaw) * plan[:, 1]
    across = math.cos(yaw) * plan[:, 1] - math.sin(yaw) * plan[:, 0]
    return Rectangle(yaw, (float(along.min()), float(across.min())), (float(along.max()), float(across.max())))


@kernel("void(f8[::1], f8[::1], f8[::1], f8[::1], f8[:,::1])")
def _find_nearest_edges(x: Array, y: Array, cos: Array, sin: Array, nearest: Array) -> None:
    """Find the distances (H, N) of points to the nearer of two edges of the rectangle of each heading around them.

    Of both edges across an axis, the one that is closer to all points by the sum of squares counts.
    """
    count = len(x)
    for heading in range(len(cos)):
        for axis in range(2):
            ax, ay = (cos[heading], sin[heading]) if axis == 0 else (-sin[heading], cos[heading])
            low, high = math.inf, -math.inf
            for point in range(count):
                along = ax * x[point] + ay * y[point]
                low, high = min(low, along), max(high, along)
            of_low = of_high = 0.0
            for point in range(count):
                along = ax * x[point] + ay * y[point]
                of_low, of_high = of_low + (along - low) ** 2, of_high + (high - along) ** 2
            for point in range(count):
                along = ax * x[point] + ay * y[point]
                distance = high - along if of_high < of_low else along - low
                nearest[heading, point] = min(nearest[heading, point], distance) if axis else distance


RANGE_NOISE = 0.03
"""Standard deviation of the points on a surface [m]."""


class Span(NamedTuple):
    """Extent of a box along one axis, as far as the points determine it."""

    low: float
    high: float
    gap: float
    """Maximum extent of the object beyond its points at an end that nothing hides; inf if the side along this axis is
    not visible [m]."""
    open_low: bool
    """Whether the object may extend beyond its points at either end."""
    open_high: bool
    hidden: bool
    """Whether something nearer hides one of the ends."""
    may_miss: bool
    """Whether the rays may have missed the side that ends the object at the near end: it is seen at a grazing angle."""


def size_cost(span: Span, mean: float, deviation: float) -> float:
    """Return the squared deviation of the size from the usual one; 0 if the unseen part may explain it."""
    measured = span.high - span.low
    if measured > mean:
        return ((measured - mean) / deviation) ** 2
    least = mean - measured - span.gap
    if span.hidden or least <= 0.0:
        return 0.0
    return (least / deviation) ** 2


def blend_size(measured: float, gap: float, mean: float, deviation: float) -> float:
    """Return the fusion of a measured size, which may be up to `gap` too small, with the usual one [m]."""
    if not math.isfinite(gap):
        return max(measured, mean)
    expected, variance = measured + gap / 2.0, gap**2 / 12.0 + RANGE_NOISE**2
    return max(measured, (expected * deviation**2 + mean * variance) / (variance + deviation**2))


def complete_span(span: Span, mean: float, deviation: float) -> tuple[float, float, float]:
    """Return size, middle and variance of the middle along one axis."""
    measured = span.high - span.low
    if span.hidden or span.gap > 2.0 * mean:
        size, spread = max(measured, mean), deviation**2
    else:
        size = blend_size(measured, span.gap, mean, deviation)
        variance = span.gap**2 / 12.0
        spread = variance * deviation**2 / (variance + deviation**2)
    if span.open_low == span.open_high:
        unseen = size - measured
        return size, (span.low + span.high) / 2.0, unseen**2 / 12.0 + RANGE_NOISE**2
    # Beyond the end that is not hidden, the object may extend by the gap, at most by what is unseen of it.
    beyond = min(span.gap, size - measured) if span.hidden else 0.0
    spread += beyond**2 / 3.0
    middle = span.low + (size - beyond) / 2.0 if span.open_high else span.high - (size - beyond) / 2.0
    # If the side was missed, the middle of the points is as likely that of the object.
    offset = (size - measured) / 2.0 if span.may_miss else 0.0
    return size, middle, spread / 4.0 + offset**2 + RANGE_NOISE**2


THIN = 0.4
"""Maximum extent of points that may be those of one side across the axis [m]: of a rounded end or a sloping window."""
SHAPELESS = 0.4
"""Maximum size of a rectangle around points that show no heading [m]."""
FEW_COLUMNS = 1.6
"""Number of gaps between columns of rays below which the heading of a rectangle is worse than that of the lane: two
columns, one of which may have hit the rear and one the side, show a line that is neither."""
HEADING_DEVIATION = 0.4
"""Standard deviation of an assumed heading [rad]."""
NEGLIGIBLE = 12.0
"""Excess cost above which a hypothesis is neglected."""
POOR_FIT = 9.0
"""Sum of squared size deviations of a fit above which its points may be a part of an object, or several objects. With
three sizes, three in a hundred objects of the class exceed it."""
ABOVE_TOP = 0.3
"""Height of a sensor above an object from which its top is visible [m]."""
ON_RAY = 1e-9
"""Maximum distance of an end from the sensor along an axis that is a rounding error [m]: the points of one column show
no end across their rays, and the object extends to both sides."""
DROP, TRUNK = 0.35, 1.0
"""Height of the top above the lower ends of an object, as a share, and maximum length of these [m]: a roof hides the
trunk or the hood behind it."""


@dataclass(frozen=True)
class Fit:
    """Box fitted to the points of an object.

    box         x y z l w h yaw in the level frame
    name        class
    covariance  (2, 2) of the center x y [m²]
    deviation   sum of squared deviations of the size from that of the class, in standard deviations
    """

    box: tuple[float, float, float, float, float, float, float]
    name: str
    covariance: Array
    deviation: float


class _Hypothesis(NamedTuple):
    """Hypothesis about the points: costs by size and by heading, class, length axis, rectangle and extents."""

    cost: float
    heading_cost_term: float
    name: str
    lengthwise: int
    shape: Rectangle
    spans: tuple[Span, Span]

    @property
    def total(self) -> float:
        """Minus twice the log-likelihood, up to a constant."""
        return self.cost + self.heading_cost_term


def fit_box(
    points: Array,
    *,
    sensor_height: float,
    ground: float,
    pattern: Pattern,
    classes: Sequence[str],
    hidden: tuple[bool, bool] = (False, False),
    cut: tuple[bool, bool] = (False, False),
    cut_above: bool = False,
    heading: float | None = None,
    heading_cost: Callable[[float], float] | None = None,
) -> Fit:
    """Return the box of the likeliest of `classes` around points (N, 3) of a level frame with the sensor above its
    origin.

    ground   height of the ground below the object [m]; the box stands on it
    hidden   whether something nearer hides the left and the right end of the object, as viewed from the sensor
    cut      whether the field of view of the sensor ends there
    cut_above  whether it ends at the top of the points
    heading  expected heading of the length [rad]; used if there are too few points to determine one
    heading_cost  squared deviations of a heading of the length from other information; None is the deviation from
             `heading`

    Measured extents are uncertain by the gaps between the rays. Sides that face away or are hidden are completed to the
    usual size of the class, towards the end that is not visible. The axis of the length follows from the fit. Its
    direction points away from the sensor, because points do not distinguish front and rear.

    Raise ValueError if `classes` is empty.
    """
    x, y = points[:, :2].mean(axis=0).tolist()
    top = float(points[:, 2].max()) - ground
    highest = math.inf if cut_above else _highest(points, sensor_height, top, ground, pattern)
    shapes = rectangles(points[:, :2])
    shapeless = shapes[0].widest < SHAPELESS
    axes: tuple[int, ...] = (0, 1)
    if heading is not None and (shapeless or float(np.ptp(_bearings(points[:, :2]))) < FEW_COLUMNS * pattern.azimuth):
        shapes, axes = [bounds(points[:, :2], heading)], (0,)
    elif shapeless:
        shapes = [bounds(points[:, :2], math.atan2(y, x))]
    hypotheses: list[_Hypothesis] = []
    for shape in shapes:
        spans = _spans(points, shape, sensor_height - ground, top, pattern, hidden, cut)
        # The longer side first: of equally likely axes of the length, the first would depend on the axes of the frame.
        for lengthwise in sorted(axes, key=lambda axis: shape.low[axis] - shape.high[axis]):
            yaw = shape.yaw + lengthwise * math.pi / 2.0
            if heading_cost is not None:
                turned = heading_cost(yaw)
            else:
                off = 0.0 if heading is None else (yaw - heading + math.pi / 2.0) % math.pi - math.pi / 2.0
                turned = (off / LANE_DEVIATION) ** 2
            for name in classes:
                cost = _cost(prior_of(name), spans, lengthwise, top, highest)
                hypotheses.append(_Hypothesis(cost, turned, name, lengthwise, shape, spans))
    if not hypotheses:
        raise ValueError("classes: no class is given (expected at least one)")
    best = hypotheses[0]
    for hypothesis in hypotheses:
        if hypothesis.total < best.total - 1e-9:
            best = hypothesis
    sizes, center, covariance = _complete_box(best, shapeless)
    x, y = center
    yaw = best.shape.yaw + best.lengthwise * math.pi / 2.0
    if math.cos(yaw) * x + math.sin(yaw) * y < 0.0:
        yaw -= math.pi
    prior = prior_of(best.name)
    height = blend_size(top, highest - top, prior.mean[2], prior.deviation[2])
    return Fit(
        (x, y, ground + height / 2.0, sizes[0], sizes[1], height, yaw),
        REPORTED.get(best.name, best.name),
        covariance + _hypothesis_spread(hypotheses, best, center, shapeless),
        best.cost + 2.0 * math.log(prior.share),
    )


def _bearings(plan: Array) -> Array:
    """Return the angles (N,) from the direction of the mean of points (N, 2) to them, viewed from the sensor [rad]."""
    x, y = plan.mean(axis=0).tolist()
    return np.asarray(np.arctan2(x * plan[:, 1] - y * plan[:, 0], x * plan[:, 0] + y * plan[:, 1]))


def _complete_box(hypothesis: _Hypothesis, shapeless: bool) -> tuple[list[float], tuple[float, float], Array]:
    """Return length and width, the center and its covariance (2, 2) under this hypothesis."""
    prior = prior_of(hypothesis.name)
    order = (0, 1) if hypothesis.lengthwise == 0 else (1, 0)
    sizes, middles, variances = [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]
    for dimension, axis in enumerate(order):
        sizes[dimension], middles[axis], variances[axis] = complete_span(
            hypothesis.spans[axis], prior.mean[dimension], prior.deviation[dimension]
        )
    if shapeless:
        swing = (HEADING_DEVIATION * sizes[0] / 2.0) ** 2
        variances = [variance + swing for variance in variances]
    cos, sin = math.cos(hypothesis.shape.yaw), math.sin(hypothesis.shape.yaw)
    center = cos * middles[0] - sin * middles[1], sin * middles[0] + cos * middles[1]
    turn = np.array([[cos, -sin], [sin, cos]])
    return sizes, center, turn @ np.diag(variances) @ turn.T


def _hypothesis_spread(
    hypotheses: Sequence[_Hypothesis], best: _Hypothesis, center: tuple[float, float], shapeless: bool
) -> Array:
    """Return the spread (2, 2) of the center over the other hypotheses of this class, weighted by likelihood [m²].

    Spread of the means of a Gaussian mixture (Bar-Shalom, Li and Kirubarajan 2001, section 1.4.16).
    """
    spread, total = np.zeros((2, 2)), 0.0
    for hypothesis in hypotheses:
        excess = hypothesis.total - best.total
        if hypothesis.name != best.name or excess > NEGLIGIBLE:
            continue
        weight = math.exp(-0.5 * excess)
        total += weight
        if hypothesis is not best:
            there = _complete_box(hypothesis, shapeless)[1]
            off = np.array([there[0] - center[0], there[1] - center[1]])
            spread += weight * np.outer(off, off)
    return spread / total


def _spans(
    points: Array,
    shape: Rectangle,
    above: float,
    top: float,
    pattern: Pattern,
    hidden: tuple[bool, bool],
    cut: tuple[bool, bool],
) -> tuple[Span, Span]:
    """Return the extents along both axes; `above` is the height of the sensor above the ground."""
    axes = ((math.cos(shape.yaw), math.sin(shape.yaw)), (-math.sin(shape.yaw), math.cos(shape.yaw)))
    x, y = points[:, :2].mean(axis=0).tolist()
    distance = math.hypot(x, y)
    gaps = [max(low, -high) for low, high in zip(shape.low, shape.high, strict=True)]
    gaps = [gap if gap > ON_RAY else 0.0 for gap in gaps]
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
            lower_end = min(DROP * top * distance / over, TRUNK)
            across = math.sqrt(1.0 - min(outwards**2, 1.0))
            spacing = min(spacing, outwards * (rings + lower_end) + across * columns)
        open_low, open_high = low <= ON_RAY, high >= -ON_RAY
        ends = _hidden_ends(points[:, :2], (ax, ay), low, high, hidden)
        depth = shape.high[1 - axis] - shape.low[1 - axis]
        if depth <= THIN < high - low:
            # Only the side along this axis is hit: the object may extend beyond its points at the near end as well.
            open_low = open_high = True
        middle = float(np.median(points[:, :2] @ (ax, ay)))
        if min(high - low, 2.0 * min(middle - low, high - middle)) <= THIN < depth:
            # A side across this axis faces the sensor and ends the object, even if something hides more of it.
            ends = ends[0] and open_low, ends[1] and open_high
        if any(cut):
            # A side that faces the sensor ends the object; only the other end may be outside the field of view.
            at_low, at_high = _ends_of(points[:, :2], (ax, ay), low, high, cut)
            ends = ends[0] or (at_low and open_low), ends[1] or (at_high and open_high)
        if any(ends):
            # The other end is exact if the side there is visible.
            exact = depth > THIN and not ((ends[0] and open_high) or (ends[1] and open_low))
            spacing = 0.0 if exact else spacing
            open_low, open_high = ends
        gap = spacing * (2.0 if open_low and open_high else 1.0)
        may_miss = 0.0 < gaps[axis] < gaps[1 - axis] and pattern.azimuth * distance**2 / gaps[axis] > depth
        spans.append(Span(low, high, gap, open_low, open_high, any(ends), may_miss))
    return spans[0], spans[1]


def _hidden_ends(
    plan: Array, axis: tuple[float, float], low: float, high: float, hidden: tuple[bool, bool]
) -> tuple[bool, bool]:
    """Return whether the low and the high end along an axis is a hidden left or right end of the object."""
    if not any(hidden):
        return False, False
    x, y = plan.mean(axis=0).tolist()
    across = abs(axis[0] * y - axis[1] * x) / max(math.hypot(x, y), 1e-9)
    if across < 0.5:
        return False, False  # the axis points away from the sensor: the object itself hides its far end
    return _ends_of(plan, axis, low, high, hidden)


def _ends_of(
    plan: Array, axis: tuple[float, float], low: float, high: float, flags: tuple[bool, bool]
) -> tuple[bool, bool]:
    """Return whether the low and the high end along an axis is an end that `flags` (left, right) select."""
    x, y = plan.mean(axis=0).tolist()
    if high - low <= THIN:
        # The points have almost equal positions along the axis, so their order is noise; the axis points to one side.
        leads_left = x * axis[1] - y * axis[0] > 0.0
        return (flags[1], flags[0]) if leads_left else flags
    bearing = _bearings(plan)
    at_low = at_high = False
    for is_hidden, outermost in zip(flags, (int(np.argmax(bearing)), int(np.argmin(bearing))), strict=True):
        if is_hidden:
            coordinate = axis[0] * float(plan[outermost, 0]) + axis[1] * float(plan[outermost, 1])
            if coordinate - low < high - coordinate:
                at_low = True
            else:
                at_high = True
    return at_low, at_high


def _highest(points: Array, sensor_height: float, top: float, ground: float, pattern: Pattern) -> float:
    """Return the maximum height of the object above the ground, from the next ring above its highest point [m]."""
    x, y, z = points[int(np.argmax(points[:, 2]))].tolist()
    reach = math.hypot(x, y)
    elevation = math.atan2(z - sensor_height, max(reach, 1e-6))
    return max(sensor_height - ground + reach * math.tan(elevation + pattern.elevation), top)


def _cost(prior: SizePrior, spans: tuple[Span, Span], lengthwise: int, top: float, highest: float) -> float:
    """Return squared deviations from a class, in standard deviations, minus twice the log of its share in traffic."""
    cost = -2.0 * math.log(prior.share)
    for dimension, axis in enumerate((lengthwise, 1 - lengthwise)):
        cost += size_cost(spans[axis], prior.mean[dimension], prior.deviation[dimension])
    mean, deviation = prior.mean[2], prior.deviation[2]
    return cost + ((mean - min(max(mean, top), highest)) / deviation) ** 2
