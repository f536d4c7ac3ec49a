"""Receivers of one run: agents of the ego under several conditions, on the sensor readings of one run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np
from msgspec.structs import replace

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import Detections
from eidrive_scenario.driving.agent import Agent
from eidrive_scenario.driving.agent_factory import build_agent
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.stack import StackContext
from eidrive_scenario.experiments.cooperative_perception.conditions import ARMS, Condition
from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.perception.detector import Detector
from eidrive_scenario.perception.pose_noise import PoseNoise
from eidrive_scenario.sensing.readings import EgoState, Readings
from eidrive_scenario.v2x.messages.message import Message
from eidrive_scenario.v2x.profile import build_channel, load_profile
from eidrive_scenario.world.actor import ActorSpec

WAIT = 0.001
"""Time that the ego waits for messages of the same scan [s]: scans are simultaneous, and no message arrives at once."""


def moved(found: Detections, before: EgoState, after: EgoState) -> Detections:
    """Return detections of a station at pose `before` as it reports them from pose `after`."""
    turn = after.yaw - before.yaw
    cos, sin = np.cos(turn), np.sin(turn)
    rotation = np.array([[cos, -sin], [sin, cos]])
    boxes = found.boxes.copy()
    boxes[:, :2] = (boxes[:, :2] - before.position[:2]) @ rotation.T + after.position[:2]
    boxes[:, 6] = wrap_angle(boxes[:, 6] + turn)
    covariance = rotation @ found.covariance @ rotation.T
    return replace(found, boxes=boxes, velocity=found.velocity @ rotation.T, covariance=covariance)


class KnownDetections(Detector):
    """Detections of a station that were computed for its true pose. All receivers of a run share them."""

    needs: ClassVar[frozenset[str]] = frozenset({"lidar"})

    def __init__(self) -> None:
        self.found = Detections(0.0)
        self.pose: EgoState | None = None

    def detect(self, readings: Readings) -> Detections:
        """Return the known detections, relative to the pose of the readings."""
        assert self.pose is not None
        same = self.pose.yaw == readings.ego.yaw and (self.pose.position == readings.ego.position).all()
        return self.found if same else moved(self.found, self.pose, readings.ego)


class Crew:
    """Stations of a run: their bodies, settings and known detections; it builds further agents of them."""

    def __init__(self, context: StackContext, settings: Mapping[str, AgentSettings], ego: str) -> None:
        self.ego = ego
        self.seed = context.seed
        self.specs: dict[str, ActorSpec] = {}
        self.known: dict[str, KnownDetections] = {}
        self._context = context
        self._settings = settings

    @property
    def senders(self) -> list[str]:
        """Names of the present stations that send."""
        accepted = self._settings[self.ego].cooperates_with
        return sorted(name for name in self.specs if name != self.ego and (accepted is None or name in accepted))

    def add(self, spec: ActorSpec) -> None:
        """Add a station that enters the world."""
        self.specs[spec.name] = spec
        self.known[spec.name] = KnownDetections()

    def agent(self, name: str, **changes: object) -> Agent:
        """Return an agent of a station that does not drive, with other settings."""
        settings = self._settings[name].model_copy(update={"planner": "none", **changes})
        context, detector = self._context, self.known[name]
        return build_agent(settings, self.specs[name], context.roads, seed=self.seed, dt=context.dt, detector=detector)


class Senders:
    """Agents of all senders with one pose error and one grid of points."""

    def __init__(self, crew: Crew, pose_noise: PoseNoise | None, cell: float) -> None:
        shared = {"fusion": "early", "fusion_settings": {"cell": cell}, "cooperates_with": ()}
        self._agents = {name: crew.agent(name, pose_noise=pose_noise, **shared) for name in crew.senders}

    def messages(self, readings: Mapping[str, Readings], now: float) -> list[Message]:
        """Return the messages of a scan, with boxes and points."""
        return [
            message
            for name, agent in self._agents.items()
            for message in agent.act(readings[name], (), now, None).outbox
        ]


class Receiver:
    """Ego under one condition, with its own channel."""

    def __init__(self, crew: Crew, condition: Condition) -> None:
        arm = ARMS[condition.arm]
        self._arm, self._every, self._ego = arm, condition.every, crew.ego
        self._agent = crew.agent(
            crew.ego,
            fusion=arm.fusion,
            fusion_settings=dict(arm.settings),
            cooperates_with=tuple(crew.senders) if arm.cooperates else (),
            pose_noise=condition.pose_noise,
        )
        channel = build_channel(load_profile(condition.channel, []), crew.seed)
        assert channel is not None
        self._channel = channel
        self._scans = 0

    def scan(self, readings: Readings, messages: Sequence[Message], *, sampled: bool) -> Detections:
        """Transmit the messages of a scan, and return the objects of the ego relative to its true pose.

        sampled  whether the result is used; otherwise points of the ego are not merged with others
        """
        now = readings.time
        if self._arm.cooperates and (self._scans + self._every // 2) % self._every == 0:
            sent = messages if self._arm.points else [_without_points(message) for message in messages]
            self._channel.transmit([(message, [self._ego]) for message in sent], now)
        self._scans += 1
        inbox = self._channel.deliver(self._ego, now + WAIT)
        used = readings if sampled or not self._arm.points else replace(readings, lidars={})
        step = self._agent.act(used, inbox, now, None)
        return step.fused if step.estimate is None else moved(step.fused, step.estimate, readings.ego)

    def megabytes_per_second(self, now: float) -> float:
        """Return the size of the sent messages per second."""
        sent = sum(link.bytes_sent for link in self._channel.statistics(now).values())
        return sent / now / 1e6 if now > 0.0 else 0.0


def _without_points(message: Message) -> Message:
    if message.points is None:
        return message
    return replace(message, points=None, size=message.size - message.points.size)


def world_points(readings: Readings) -> Array:
    """Return the points (N, 3) of all lidars of a station in the world frame."""
    return np.concatenate(
        [reading.points @ reading.pose[:3, :3].T + reading.pose[:3, 3] for reading in readings.lidars.values()]
    )
