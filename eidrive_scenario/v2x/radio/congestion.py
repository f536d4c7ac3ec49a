"""Decentralized congestion control (ETSI TS 102 687): minimum message interval by channel busy ratio."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.extensions.settings import Settings

LONGEST_INTERVAL = 10.0
"""Maximum message interval in a profile [s]; that of the standard is 1 s."""


class NoDcc(Settings):
    """No congestion control."""

    kind: Literal["none"] = "none"

    period: ClassVar[float] = 0.1


class ReactiveDcc(Settings):
    """Reactive approach: minimum interval by channel busy ratio of the last 100 ms (ETSI TS 102 687 V1.2.1, table A.1,
    for messages of at most 1 ms).

    limits     channel busy ratios below which each interval applies, ascending; the last interval also applies above
    intervals  minimum time between two messages [s]
    """

    kind: Literal["reactive"]
    limits: tuple[Annotated[float, Field(gt=0.0, le=1.0)], ...] = (0.30, 0.40, 0.50, 0.60, 1.0)
    intervals: tuple[Annotated[float, Field(gt=0.0, le=LONGEST_INTERVAL)], ...] = (0.1, 0.2, 0.4, 0.5, 1.0)

    period: ClassVar[float] = 0.1

    @model_validator(mode="after")
    def _check_table(self) -> ReactiveDcc:
        if len(self.limits) != len(self.intervals) or list(self.limits) != sorted(self.limits) or not self.limits:
            raise ValueError("limits must be ascending, with one value of intervals each")
        return self

    def interval_at(self, busy: Array) -> Array:
        """Return the minimum intervals [s] at these channel busy ratios."""
        rows = np.minimum(np.searchsorted(self.limits, busy, side="right"), len(self.limits) - 1)
        return np.array(self.intervals)[rows]


class Limeric(Settings):
    """Adaptive approach (LIMERIC): every station adapts its share of the channel to a common target.

    G. Bansal, J. Kenney, C. Rohrs: LIMERIC, IEEE Transactions on Vehicular Technology 62(9), 2013; parameters as in
    ETSI TS 102 687, 5.4. Update every 200 ms, with the step limited by the gains:
    ratio <- 0.5 ratio + 0.25 (current + previous); share <- (1 - alpha) share + beta (target - ratio).
    The interval after a message of duration T is T / share.
    """

    kind: Literal["limeric"]
    alpha: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.016
    beta: Annotated[float, Field(gt=0.0)] = 0.0012
    target: Annotated[float, Field(gt=0.0, le=1.0)] = 0.68
    gain_down: Annotated[float, Field(lt=0.0)] = -0.00025
    gain_up: Annotated[float, Field(gt=0.0)] = 0.0005
    share_min: Annotated[float, Field(gt=0.0)] = 0.0006
    share_max: Annotated[float, Field(gt=0.0)] = 0.03
    interval_min: Annotated[float, Field(ge=0.0, le=LONGEST_INTERVAL)] = 0.025
    interval_max: Annotated[float, Field(gt=0.0, le=LONGEST_INTERVAL)] = 1.0

    period: ClassVar[float] = 0.2

    @model_validator(mode="after")
    def _check_ranges(self) -> Limeric:
        for low, high in (("share_min", "share_max"), ("interval_min", "interval_max")):
            if getattr(self, low) > getattr(self, high):
                limit = getattr(self, high)
                raise ValueError(f"{low} must be at most {high} (got {getattr(self, low):g}, above {limit:g})")
        return self

    def steady_share(self, busy: float) -> float:
        """Return the steady-state share of a station at a constant channel busy ratio."""
        gain = min(max(self.beta * (self.target - busy), self.gain_down), self.gain_up)
        return min(max(gain / self.alpha, self.share_min), self.share_max)

    def next_share(self, share: Array, busy: Array) -> Array:
        """Return the share of each station after one update, at these filtered channel busy ratios."""
        gain = np.clip(self.beta * (self.target - busy), self.gain_down, self.gain_up)
        return np.clip((1.0 - self.alpha) * share + gain, self.share_min, self.share_max)


CongestionControl = Annotated[NoDcc | ReactiveDcc | Limeric, Field(discriminator="kind")]


class DccGate:
    """DCC gate: minimum interval between two messages of each of N stations.

    background  channel busy ratio of traffic that is not simulated; stations start in its steady state
    """

    def __init__(self, control: NoDcc | ReactiveDcc | Limeric, count: int, background: float = 0.0) -> None:
        self.control = control
        self.background = background
        self.share = np.full(count, control.steady_share(background) if isinstance(control, Limeric) else 1.0)
        self.filtered = np.full(count, background)
        self.before = np.full(count, background)
        alone = np.full(count, background)
        self.reactive = control.interval_at(alone) if isinstance(control, ReactiveDcc) else np.zeros(count)

    def update(self, busy: Array) -> None:
        """Update with the channel busy ratios (N,) of the last period, caused by simulated stations."""
        busy = np.minimum(1.0, busy + self.background)
        if isinstance(self.control, ReactiveDcc):
            self.reactive = self.control.interval_at(busy)
        elif isinstance(self.control, Limeric):
            self.filtered = 0.5 * self.filtered + 0.25 * (busy + self.before)
            self.before = busy.copy()
            self.share = self.control.next_share(self.share, self.filtered)

    def interval(self, station: int, duration: float) -> float:
        """Return the minimum time from the start of a message of this duration to the start of the next [s]."""
        if isinstance(self.control, Limeric):
            wanted = duration / float(self.share[station])
            return min(max(wanted, self.control.interval_min), self.control.interval_max)
        return float(self.reactive[station])

    def reorder(self, rows: list[int | None]) -> DccGate:
        """Return the gate for reordered stations, each with the state of its former row or a new state."""
        gate = DccGate(self.control, len(rows), self.background)
        kept = [new for new, old in enumerate(rows) if old is not None]
        former = [old for old in rows if old is not None]
        for field in ("share", "filtered", "before", "reactive"):
            getattr(gate, field)[kept] = getattr(self, field)[former]
        return gate
