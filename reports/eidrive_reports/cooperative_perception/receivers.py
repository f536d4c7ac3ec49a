"""Receivers of one run: agents of the ego under several conditions, on the sensor readings of one run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np
from msgspec.structs import replace

from eidrive_scenario.api.common import ActorSpec
from eidrive_scenario.api.driving import Agent, AgentSettings, Detections, EgoState, StackContext, build_agent
from eidrive_scenario.api.perception import Detector, FeatureMap, PoseNoise, Readings
from eidrive_scenario.api.v2x import Message, ReceivedMessage, build_channel, load_profile

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
    shares       content of the messages in addition to boxes
    boxes        whether it receives boxes
    """

    fusion: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    cooperates: bool = True
    shares: Literal["points", "features"] | None = None
    boxes: bool = True


_FILTERED = {"existence": LEAST_EXISTENCE}


def _intermediate(
    fusion: str, share: float, encoding: str = "int8", *, aligned: bool = False, boxes: bool = True
) -> Arm:
    """Return an arm whose senders send a share of the cells of their features."""
    settings = {**_FILTERED, "share": share, "encoding": encoding, "align_poses": aligned}
    return Arm(fusion, settings, shares="features", boxes=boxes)


ARMS: Mapping[str, Arm] = {
    "none": Arm("average", cooperates=False),
    "none, filtered": Arm("covariance_intersection", _FILTERED, cooperates=False),
    "average": Arm("average"),
    "covariance_intersection": Arm("covariance_intersection", _FILTERED),
    "covariance_intersection, aligned": Arm("covariance_intersection", {**_FILTERED, "align_poses": True}),
    "early": Arm("early", {**_FILTERED, "max_age": ONE_SCAN}, shares="points"),
    "max": _intermediate("max", 1.0),
    "attention": _intermediate("attention", 1.0),
    "attention, aligned": _intermediate("attention", 1.0, aligned=True),
    "attention, codes": _intermediate("attention", 1.0, "codes"),
    "where2comm, 10 %": _intermediate("where2comm", 0.1),
    "where2comm, 5 %": _intermediate("where2comm", 0.05),
    "where2comm": _intermediate("where2comm", 0.01),
    "where2comm, codes": _intermediate("where2comm", 0.01, "codes"),
    "where2comm, 0.1 %": _intermediate("where2comm", 0.001),
    "features only": _intermediate("attention", 1.0, boxes=False),
    "features only, 5 %": _intermediate("attention", 0.05, boxes=False),
    "features only, 1 %": _intermediate("attention", 0.01, boxes=False),
    "features only, 0.1 %": _intermediate("attention", 0.001, boxes=False),
    "features only, 0.02 %": _intermediate("attention", 0.0002, boxes=False),
}
"""Arms by name. `none, filtered` applies the filter of covariance intersection to the own detections only; `aligned`
corrects the poses of senders by shared objects; `features only` is `attention` or `where2comm` without boxes of others,
as in the literature. Without a share in its name, `where2comm` sends 1 % of the cells and other intermediate fusion
sends all."""


SenderSettings = tuple[PoseNoise | None, str, tuple[tuple[str, Any], ...]]
"""Pose error, fusion method and its settings."""


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
    def senders(self) -> SenderSettings:
        """Settings of the senders. Conditions with equal ones have the same messages, of which those for boxes only
        lack the points."""
        arm = ARMS[self.arm]
        if arm.shares == "features":
            return self.pose_noise, "attention", tuple((name, arm.settings[name]) for name in ("share", "encoding"))
        return self.pose_noise, "early", (("cell", self.cell),)

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


POSE_AND_LATENCY = "pose error, 0.1 s late"
"""Axis with both faults of the noisy setting of V2XSet: 0.2 m and 0.1 s."""
AXES: Mapping[str, tuple[str, Mapping[str, float], tuple[float, ...]]] = {
    "pose error": ("deviation", {}, (0.0, 0.2, 0.4, 0.6)),
    "pose drift": ("deviation", {"correlation": DRIFT_TIME}, (0.0, 0.2, 0.4, 0.6)),
    "latency": ("latency", {}, (0.0, 0.1, 0.2, 0.3, 0.5)),
    "loss": ("loss", {}, (0.0, 0.3, 0.6, 0.9)),
    POSE_AND_LATENCY: ("deviation", {"latency": 0.1}, (0.0, 0.2)),
}
"""Axes of the curves: varied field, other fields, and values. The value 0 is the condition without faults."""


def on_axis(arm: str, axis: str, value: float) -> Condition:
    """Return the condition of an arm at a value of an axis."""
    varied, others, _ = AXES[axis]
    return Condition(arm, **{varied: value, **(others if value else {})})  # type: ignore[arg-type]


@dataclass(frozen=True)
class Study:
    """Conditions of one part of the reproduction.

    name      of the part and of its tables
    arms      arms without faults
    compared  arms of the curves
    axes      axes of the curves
    volumes   conditions of the table of precision and volume, in addition to the first arm
    reach     number of range classes whose objects and detections count, see RANGES of `scores`
    """

    name: str
    arms: tuple[str, ...]
    compared: tuple[str, ...]
    axes: tuple[str, ...]
    volumes: tuple[Condition, ...]
    reach: int

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """All conditions, each once."""
        curves = [on_axis(arm, axis, value) for axis in self.axes for arm in self.compared for value in AXES[axis][2]]
        return tuple(dict.fromkeys([*(Condition(arm) for arm in self.arms), *curves, *self.volumes]))


WAIT = 0.001
"""Time that the ego waits for messages of the same scan [s]: scans are simultaneous, and no message arrives at once."""


def move_detections(detections: Detections, before: EgoState, after: EgoState) -> Detections:
    """Return detections of a station at pose `before` as it reports them from pose `after`."""
    return detections.move(before.position[:2], after.position[:2], after.yaw - before.yaw)


def move_features(features: FeatureMap, before: EgoState, after: EgoState) -> FeatureMap:
    """Return features of a station at pose `before` as it sends them from pose `after`: the grid moves as boxes do."""
    turn = after.yaw - before.yaw
    dx, dy = features.x - before.position[0], features.y - before.position[1]
    return replace(
        features,
        x=float(np.cos(turn) * dx - np.sin(turn) * dy + after.position[0]),
        y=float(np.sin(turn) * dx + np.cos(turn) * dy + after.position[1]),
        yaw=features.yaw + turn,
    )


class SharedDetector(Detector):
    """Detections and features of a station that were computed for its true pose. All receivers of a run share them.

    The detector of the station detects objects in fused features.

    fused  last fused features in which objects were detected
    """

    needs: ClassVar[frozenset[str]] = frozenset({"lidar"})
    provides_features: ClassVar[bool] = True

    def __init__(self, detector: Detector) -> None:
        self.detections = Detections(0.0)
        self.features: FeatureMap | None = None
        self.fused: FeatureMap | None = None
        self.pose: EgoState | None = None
        self.velocity_deviation = detector.velocity_deviation
        self._detector = detector

    @property
    def codec(self) -> Any:
        """Codec of the detector of the station."""
        return self._detector.codec

    def update(self, detections: Detections, pose: EgoState) -> None:
        """Store the detections of the station and its last features, at its true pose."""
        self.detections, self.features, self.pose = detections, self._detector.feature_map, pose

    def detect(self, readings: Readings) -> Detections:
        """Return the objects in fused features, or the stored detections relative to the pose of the readings."""
        if readings.features is not None:
            self.fused = readings.features
            return self._detector.detect(readings)
        assert self.pose is not None
        before, after = self.pose, readings.ego
        self.feature_map = self.features
        if before.yaw == after.yaw and (before.position == after.position).all():
            return self.detections
        if self.features is not None:
            self.feature_map = move_features(self.features, before, after)
        return move_detections(self.detections, before, after)


class AgentFactory:
    """Stations of a run: their bodies, settings and detectors. It builds further agents of them."""

    def __init__(self, context: StackContext, settings: Mapping[str, AgentSettings], ego: str) -> None:
        self.ego = ego
        self.seed = context.seed
        self.roads = context.roads
        self.specs: dict[str, ActorSpec] = {}
        self.detectors: dict[str, SharedDetector] = {}
        self._context = context
        self._settings = settings

    @property
    def senders(self) -> list[str]:
        """Names of the present stations that send."""
        accepted = self._settings[self.ego].cooperates_with
        return sorted(name for name in self.specs if name != self.ego and (accepted is None or name in accepted))

    def add(self, spec: ActorSpec, detector: Detector) -> None:
        """Add a station that enters the world, with its detector."""
        self.specs[spec.name] = spec
        self.detectors[spec.name] = SharedDetector(detector)

    def agent(self, name: str, **changes: object) -> Agent:
        """Return an agent of a station that does not drive, with other settings."""
        settings = self._settings[name].model_copy(update={"planner": "none", **changes})
        context, detector = self._context, self.detectors[name]
        return build_agent(settings, self.specs[name], self.roads, seed=self.seed, dt=context.dt, detector=detector)

    def sending_agents(self, settings: SenderSettings) -> dict[str, Agent]:
        """Return agents of all senders. They do not receive messages, and send boxes and points or features."""
        pose_noise, fusion, fusion_settings = settings
        changes = {"fusion": fusion, "fusion_settings": dict(fusion_settings), "cooperates_with": ()}
        return {name: self.agent(name, pose_noise=pose_noise, **changes) for name in self.senders}


@dataclass(frozen=True)
class Reception:
    """Messages that were sent and have arrived in one scan, and what the receiver makes of them.

    features  fused ones; None if the receiver does not fuse features, or has not received any
    objects   of the receiver, relative to its true pose
    """

    sent: Sequence[Message]
    arrived: Sequence[ReceivedMessage]
    features: FeatureMap | None
    objects: Detections


class Receiver:
    """Ego under one condition, with its own channel."""

    def __init__(self, factory: AgentFactory, condition: Condition) -> None:
        arm = ARMS[condition.arm]
        self._arm, self._every, self._ego = arm, condition.every, factory.ego
        self._detector = factory.detectors[factory.ego]
        self._agent = factory.agent(
            factory.ego,
            fusion=arm.fusion,
            fusion_settings=dict(arm.settings),
            cooperates_with=tuple(factory.senders) if arm.cooperates else (),
            pose_noise=condition.pose_noise,
        )
        channel = build_channel(load_profile(condition.channel), factory.seed)
        assert channel is not None
        self._channel = channel
        self._scans = 0

    def scan(self, readings: Readings, messages: Sequence[Message], *, merged: bool) -> Reception:
        """Transmit the messages of a scan, and return what arrives of them with the objects of the ego.

        merged  whether points of the ego are merged with others and objects detected in them
        """
        now, sent = readings.time, list[Message]()
        self._detector.fused = None
        if self._arm.cooperates and (self._scans + self._every // 2) % self._every == 0:
            sent = list(messages) if self._arm.shares else [_without_points(message) for message in messages]
            if not self._arm.boxes:
                sent = [message for message in sent if message.kind == "features"]
            self._channel.transmit([(message, [self._ego]) for message in sent], now)
        self._scans += 1
        arrived = self._channel.deliver(self._ego, now + WAIT)
        used = readings if merged or self._arm.shares != "points" else replace(readings, lidars={})
        step = self._agent.act(used, arrived, now, None)
        objects = step.fused if step.estimate is None else move_detections(step.fused, step.estimate, readings.ego)
        return Reception(sent, arrived, self._detector.fused, objects)

    def megabytes_per_second(self, now: float) -> float:
        """Return the size of the sent messages per second."""
        sent = sum(link.bytes_sent for link in self._channel.statistics(now).values())
        return sent / now / 1e6 if now > 0.0 else 0.0


def _without_points(message: Message) -> Message:
    if message.points is None:
        return message
    return replace(message, points=None, size=message.size - message.points.size)
