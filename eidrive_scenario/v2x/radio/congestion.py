"""Congestion control (ETSI TS 102 687): how long a station waits between two messages as the channel fills."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from eidrive_scenario.arrays import Array
from eidrive_scenario.settings import Settings

LONGEST_INTERVAL = 10.0
"""Largest time between two messages that a profile can ask for [s]; the standard has 1 s."""


class NoDcc(Settings):
    """Everybody sends when it likes."""

    kind: Literal["none"] = "none"

    period: ClassVar[float] = 0.1


class ReactiveDcc(Settings):
    """A table from the busy ratio of the last 100 ms to the least interval (ETSI TS 102 687, table A.2).

    limits     upper bounds of the busy ratio, rising
    intervals  least time between two messages up to each bound [s]
    """

    kind: Literal["reactive"]
    limits: tuple[Annotated[float, Field(gt=0.0, le=1.0)], ...] = (0.20, 0.30, 0.40, 0.50, 1.0)
    intervals: tuple[Annotated[float, Field(gt=0.0, le=LONGEST_INTERVAL)], ...] = (0.1, 0.2, 0.4, 0.5, 1.0)

    period: ClassVar[float] = 0.1

    @model_validator(mode="after")
    def _a_table(self) -> ReactiveDcc:
        if len(self.limits) != len(self.intervals) or list(self.limits) != sorted(self.limits) or not self.limits:
            raise ValueError("limits must rise, and each has one interval")
        return self

    def interval_at(self, busy: Array) -> Array:
        """Least intervals [s] at these busy ratios."""
        rows = np.minimum(np.searchsorted(self.limits, busy), len(self.limits) - 1)
        return np.array(self.intervals)[rows]


class Limeric(Settings):
    """The adaptive approach: every station moves its share of the channel towards a common target (LIMERIC).

    G. Bansal, J. Kenney, C. Rohrs: LIMERIC, IEEE Transactions on Vehicular Technology 62(9), 2013; parameters as in
    ETSI TS 102 687, 5.4. Every 200 ms: busy ratio <- 0.5 busy ratio + 0.25 (now + before); share <- (1 - alpha) share +
    beta (target - busy ratio), the step within the gains; a message of duration T is followed by T / share.
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
    def _ranges(self) -> Limeric:
        for low, high in (("share_min", "share_max"), ("interval_min", "interval_max")):
            if getattr(self, low) > getattr(self, high):
                raise ValueError(f"{low} {getattr(self, low):g} is above {high} {getattr(self, high):g}")
        return self

    def steady_share(self, busy: float) -> float:
        """Where the share of a station settles while the busy ratio stays what it is."""
        gain = min(max(self.beta * (self.target - busy), self.gain_down), self.gain_up)
        return min(max(gain / self.alpha, self.share_min), self.share_max)

    def next_share(self, share: Array, busy: Array) -> Array:
        """The share of each station after one step, at these filtered busy ratios."""
        gain = np.clip(self.beta * (self.target - busy), self.gain_down, self.gain_up)
        return np.clip((1.0 - self.alpha) * share + gain, self.share_min, self.share_max)


CongestionControl = Annotated[NoDcc | ReactiveDcc | Limeric, Field(discriminator="kind")]


class DccGate:
    """The least interval between two messages of each of N stations.

    background  busy ratio by traffic that is not simulated; stations begin as if they had long been in it alone
    """

    def __init__(self, control: NoDcc | ReactiveDcc | Limeric, count: int, background: float = 0.0) -> None:
        self.control = control
        self.background = background
        self.share = np.full(count, control.steady_share(background) if isinstance(control, Limeric) else 1.0)
        self.filtered = np.full(count, background)
        self.before = np.full(count, background)
        alone = np.full(count, background)
        self.reactive = control.interval_at(alone) if isinstance(control, ReactiveDcc) else np.zeros(count)

    def measured(self, busy: Array) -> None:
        """The busy ratios (N,) of the last period of the control, by simulated stations."""
        busy = np.minimum(1.0, busy + self.background)
        if isinstance(self.control, ReactiveDcc):
            self.reactive = self.control.interval_at(busy)
        elif isinstance(self.control, Limeric):
            self.filtered = 0.5 * self.filtered + 0.25 * (busy + self.before)
            self.before = busy.copy()
            self.share = self.control.next_share(self.share, self.filtered)

    def interval(self, station: int, duration: float) -> float:
        """Least time from the start of a message of this duration to the start of the next [s]."""
        if isinstance(self.control, Limeric):
            wanted = duration / float(self.share[station])
            return min(max(wanted, self.control.interval_min), self.control.interval_max)
        return float(self.reactive[station])

    def rearranged(self, rows: list[int | None]) -> DccGate:
        """The same for other stations: each takes the state of its former row, or begins anew."""
        gate = DccGate(self.control, len(rows), self.background)
        for row, old in enumerate(rows):
            if old is not None:
                for mine, former in (
                    (gate.share, self.share),
                    (gate.filtered, self.filtered),
                    (gate.before, self.before),
                    (gate.reactive, self.reactive),
                ):
                    mine[row] = former[old]
        return gate
