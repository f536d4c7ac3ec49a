"""Criterion: accelerations, jerks and yaw rates within the limits of comfort."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from eidrive_criteria.folds import exceeds
from eidrive_scenario.api.common import EPSILON, Array
from eidrive_scenario.api.criteria import Continuity, Criterion, CriterionSettings, Frame, Verdict, actor_never_present

Limit = Annotated[float, Field(gt=0)]

ACCELERATION_WINDOW = 0.8
"""Length of the filter of accelerations [s]: 8 samples of nuPlan."""
JERK_WINDOW = 1.5
"""Length of the filter of jerks, yaw rates and yaw accelerations [s]: 15 samples of nuPlan."""
FEWEST = 3
"""Minimum number of frames for a filter of order 2."""


class ComfortSettings(CriterionSettings):
    """Settings: `{of: Ego}` and the limits of nuPlan.

    max_acceleration, max_deceleration, lateral_acceleration [m/s²]; longitudinal_jerk, jerk [m/s³];
    yaw_rate [rad/s]; yaw_acceleration [rad/s²]
    """

    of: str
    max_acceleration: Limit = 2.40
    max_deceleration: Limit = 4.05
    lateral_acceleration: Limit = 4.89
    longitudinal_jerk: Limit = 4.13
    jerk: Limit = 8.37
    yaw_rate: Limit = 0.95
    yaw_acceleration: Limit = 1.93


class Sample(NamedTuple):
    """Motion in one frame."""

    time: float
    velocity_x: float
    velocity_y: float
    yaw: float


class Worst(NamedTuple):
    """Largest ratio of a quantity to its limit, with the value and its time [s]."""

    ratio: float
    quantity: str
    value: float
    time: float


class Comfort(Criterion):
    """Criterion that fails if an acceleration, a jerk or a yaw rate exceeds its limit.

    The value is the largest ratio to a limit. Derivatives are those of quadratic polynomials that are fitted to
    velocity and heading in a sliding window (Savitzky-Golay). It is evaluated at the end of the run, so it never ends
    one. Fewer than three frames without a teleport have no value.
    """

    settings_type = ComfortSettings
    name = "comfort"

    def __init__(self, settings: ComfortSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self.subjects = (settings.of,)
        self._parts: list[list[Sample]] = []
        """Frames without a gap or teleport."""
        self._continuity = Continuity()

    def observe(self, frame: Frame) -> None:
        view = frame.view
        row = view.rows.get(self._settings.of)
        step = self._continuity.step(view, row)
        if row is None:
            return
        if step is None:
            self._parts.append([])
        state = view.states[row]
        self._parts[-1].append(Sample(view.time, state.velocity_x, state.velocity_y, state.yaw))

    def _extremes(self) -> tuple[dict[str, Worst], float]:
        """Return the value with the largest ratio to its limit, by quantity, and the time of the first violation [s].

        The time is infinite without a violation.
        """
        extremes: dict[str, Worst] = {}
        first = math.inf
        for part in self._parts:
            if len(part) < FEWEST:
                continue
            for quantity, values, low, high in self._quantities(part):
                ratios = np.where(values >= 0.0, values / high, values / low)
                index = int(np.argmax(ratios))
                worst = Worst(float(ratios[index]), quantity, float(values[index]), part[index].time)
                if quantity not in extremes or worst.ratio > extremes[quantity].ratio:
                    extremes[quantity] = worst
                if exceeds(worst.ratio, 1.0):
                    first = min(first, part[int(np.argmax(ratios > 1.0 + EPSILON))].time)
        return extremes, first

    def _quantities(self, part: Sequence[Sample]) -> Iterator[tuple[str, Array, float, float]]:
        """Yield name, values (N,), minimum and maximum of each quantity."""
        own = self._settings
        time, vx, vy, yaw = np.array(part).T
        dt = float(time[-1] - time[0]) / (len(part) - 1)
        yaw = np.unwrap(yaw)
        cos, sin = np.cos(yaw), np.sin(yaw)
        ax, ay = (_derivative(values, dt, ACCELERATION_WINDOW, 1) for values in (vx, vy))
        jx, jy = (_derivative(values, dt, JERK_WINDOW, 2) for values in (vx, vy))
        yield "acceleration", cos * ax + sin * ay, -own.max_deceleration, own.max_acceleration
        for quantity, values, limit in (
            ("lateral_acceleration", cos * ay - sin * ax, own.lateral_acceleration),
            ("longitudinal_jerk", cos * jx + sin * jy, own.longitudinal_jerk),
            ("jerk", np.hypot(jx, jy), own.jerk),
            ("yaw_rate", _derivative(yaw, dt, JERK_WINDOW, 1), own.yaw_rate),
            ("yaw_acceleration", _derivative(yaw, dt, JERK_WINDOW, 2), own.yaw_acceleration),
        ):
            yield quantity, values, -limit, limit

    def verdict(self) -> Verdict:
        of = self._settings.of
        extremes, first = self._extremes()
        worst = max(extremes.values(), default=None)
        if not self._parts:
            reason = actor_never_present([of])
        elif worst is None:
            reason = f"{of} was present in fewer than {FEWEST} successive frames, so there are no accelerations"
        else:
            quantity = worst.quantity.replace("_", " ")
            reason = f"{quantity} of {of} was {worst.value:.2f}, {worst.ratio:.2f} of its limit, at {worst.time:.2f} s"
        is_violated = math.isfinite(first)
        return self.conclude(
            bool(self._parts) and not is_violated,
            reason,
            value=worst.ratio if worst is not None else None,
            limit=1.0,
            first_violation=first if is_violated else None,
            is_final=False,
        )

    def metrics(self) -> Mapping[str, float]:
        """Return the value of each quantity with the largest ratio to its limit."""
        return {f"{self.name}.{quantity}": worst.value for quantity, worst in self._extremes()[0].items()}


def _derivative(values: Array, dt: float, window: float, order: int) -> Array:
    """Return the derivative of the order 1 or 2 of samples (N,) by fitted quadratics; the window shrinks to N.

    At both ends it is that of the first and of the last quadratic.
    """
    length = min(max(round(window / dt), FEWEST), len(values))
    length -= 1 - length % 2
    half = length // 2
    times = (np.arange(length) - half) * dt
    fit = np.linalg.pinv(np.vander(times, 3, increasing=True))
    quadratics: Array = np.lib.stride_tricks.sliding_window_view(values, length) @ fit.T
    if order == 2:
        return np.pad(2.0 * quadratics[:, 2], half, mode="edge")
    slope, bend = quadratics[:, 1], 2.0 * quadratics[:, 2]
    first, last = slope[0] + bend[0] * times[:half], slope[-1] + bend[-1] * times[half + 1 :]
    return np.concatenate([first, slope, last])
