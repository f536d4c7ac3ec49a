"""Conditions of the measurement: a fusion method, and faults of the poses and of the channel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from eidrive_scenario.perception.pose_noise import PoseNoise

SCAN_RATE = 10.0
"""Lidar scans of each station per second, at equal times [Hz]."""
DRIFT_TIME = 10.0
"""Correlation time of a drifting pose error [s], of the order of that of GNSS."""
YAW_PER_POSITION = 1.0 / 0.6
"""Standard deviation of the heading per that of the position [degrees/m]: 1° at 0.6 m."""
LEAST_EXISTENCE = 0.05
"""Minimum existence probability of fused objects, that of the detector: unlikely objects are part of the curve."""
ONE_SCAN = 0.05
"""Memory of early fusion [s]: less than the interval of two scans, so that each frame is detected separately."""


@dataclass(frozen=True)
class Arm:
    """Use of messages by the receiving station.

    fusion       fusion method; `settings` are its settings
    cooperates   whether it receives messages
    points       whether messages contain points
    """

    fusion: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    cooperates: bool = True
    points: bool = False


_FILTERED = {"existence": LEAST_EXISTENCE}
ARMS: Mapping[str, Arm] = {
    "none": Arm("average", cooperates=False),
    "none, filtered": Arm("covariance_intersection", _FILTERED, cooperates=False),
    "average": Arm("average"),
    "covariance_intersection": Arm("covariance_intersection", _FILTERED),
    "early": Arm("early", {**_FILTERED, "max_age": ONE_SCAN}, points=True),
}
"""Arms by name. `none, filtered` applies the filter of covariance intersection to the own detections only."""


@dataclass(frozen=True)
class Condition:
    """Arm under faults.

    deviation    standard deviation of the assumed position of each station, the ego included, along x and y [m];
                 that of the heading is proportional
    correlation  correlation time of the pose errors; 0: independent in each scan [s]
    latency, loss  delay of each message [s], and probability of its loss
    every        number of scans per message
    cell         grid of transmitted points [m]
    """

    arm: str
    deviation: float = 0.0
    correlation: float = 0.0
    latency: float = 0.0
    loss: float = 0.0
    every: int = 1
    cell: float = 0.1

    @property
    def name(self) -> str:
        """Name in the record."""
        parts = [f"{name} {getattr(self, name):g}" for name in ("deviation", "correlation", "latency", "loss")]
        return "; ".join([self.arm, *parts, f"every {self.every}", f"cell {self.cell:g}"])

    @property
    def senders(self) -> tuple[PoseNoise | None, float]:
        """Settings of the senders: pose error and grid of points. Conditions with equal ones have the same messages."""
        return self.pose_noise, self.cell

    @property
    def pose_noise(self) -> PoseNoise | None:
        """Pose error of every station; None for exact poses."""
        if not self.deviation:
            return None
        yaw = YAW_PER_POSITION * self.deviation
        return PoseNoise(position=self.deviation, yaw=yaw, correlation_time=self.correlation)

    @property
    def channel(self) -> dict[str, Any]:
        """Profile of the channel."""
        loss = {"kind": "bernoulli", "probability": self.loss} if self.loss else {"kind": "none"}
        return {"model": "composed", "delay": {"kind": "constant", "seconds": self.latency}, "loss": loss}


AXES: Mapping[str, tuple[str, Mapping[str, float], tuple[float, ...]]] = {
    "pose error": ("deviation", {}, (0.0, 0.2, 0.4, 0.6)),
    "pose drift": ("deviation", {"correlation": DRIFT_TIME}, (0.0, 0.2, 0.4, 0.6)),
    "latency": ("latency", {}, (0.0, 0.1, 0.2, 0.3, 0.5)),
    "loss": ("loss", {}, (0.0, 0.3, 0.6, 0.9)),
}
"""Axes of the curves: varied field, other fields, and values. The value 0 is the condition without faults."""
COMPARED = ("none", "average", "covariance_intersection", "early")
"""Arms of the curves."""
SCANS_PER_MESSAGE = (1, 2, 5)
CELLS = (0.2,)
"""Grids of points in addition to that of the other conditions [m]."""


def on_axis(arm: str, axis: str, value: float) -> Condition:
    """Return the condition of an arm at a value of an axis."""
    varied, others, _ = AXES[axis]
    return Condition(arm, **{varied: value, **(others if value else {})})  # type: ignore[arg-type]


def by_volume() -> list[Condition]:
    """Return the conditions with fewer messages, or fewer points."""
    sending = [arm for arm in COMPARED if ARMS[arm].cooperates]
    found = [Condition(arm, every=every) for arm in sending for every in SCANS_PER_MESSAGE]
    return found + [Condition(arm, cell=cell) for arm in sending if ARMS[arm].points for cell in CELLS]


def all_conditions() -> tuple[Condition, ...]:
    """Return all conditions, each once."""
    curves = [
        on_axis(arm, axis, value) for axis, (_, _, values) in AXES.items() for arm in COMPARED for value in values
    ]
    return tuple(dict.fromkeys([*(Condition(arm) for arm in ARMS), *curves, *by_volume()]))
