"""What is known of cooperative perception over a radio, measured with this package beside what it should be.

Each function gives arrays for one picture of `make reproduce-trends`; expectations come from closed forms, not from the
code that is measured.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import Detections
from eidrive_scenario.driving.communication.radio_line_of_sight import line_of_sight_states
from eidrive_scenario.fusion.average import AverageFusion
from eidrive_scenario.fusion.covariance_intersection import CovarianceIntersectionFusion
from eidrive_scenario.fusion.method import FusionMethod, Report
from eidrive_scenario.geometry import iou_bev
from eidrive_scenario.perception.learned.average_precision import average_precision, match_by_share
from eidrive_scenario.v2x.link_models.composed import ComposedChannel, ComposedProfile
from eidrive_scenario.v2x.messages.message import Message, StationState
from eidrive_scenario.v2x.propagation.gains import blockage_moments, highway_los
from eidrive_scenario.v2x.radio.channel import RadioChannel
from eidrive_scenario.v2x.radio.packet_error import CURVES
from eidrive_scenario.v2x.radio.profile import RadioProfile
from eidrive_scenario.v2x.radio_environment import LineOfSightStates, RadioEnvironment
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement

CAR = (4.5, 1.8, 1.5)
"""Length, width and height of a car [m]."""
TRUCK = (8.5, 2.5, 3.3)
"""Those of the firetruck."""


@dataclass(frozen=True)
class Curve:
    """One measured line and what it should be: `x` (N,), `measured` (N,), `expected` (N,).

    chance  (N,) how far 95 % of the measured shares lie off the expected ones at most, where they are shares of draws
    """

    label: str
    x: Array
    measured: Array
    expected: Array
    chance: Array | None = None


def largest_shift(iou: float, length: float = CAR[0]) -> float:
    """How far a box may lie ahead of or behind its object along its length before their overlap falls below `iou` [m].

    IoU = (L - s) / (L + s) for a shift s.
    """
    return length * (1.0 - iou) / (1.0 + iou)


def precision_by_delay(
    speed: float, iou: float, delays: Sequence[float], *, compensated: bool = False, cars: int = 20, seed: int = 1
) -> Curve:
    """Average precision of what a listener knows of cars at constant speed [m/s] when messages are late [s].

    Uncompensated, a box lies v tau behind its car: precision falls from 1 to 0 where that is `largest_shift`.
    """
    dt = 0.005
    headings = np.random.Generator(np.random.Philox(key=seed)).uniform(-math.pi, math.pi, cars)
    start = 40.0 * np.stack([np.arange(cars) % 5, np.arange(cars) // 5], axis=1)
    velocity = speed * np.stack([np.cos(headings), np.sin(headings)], axis=1)

    def seen(time: float) -> Detections:
        boxes = np.column_stack(
            [start + velocity * time, np.full(cars, CAR[2] / 2.0), np.tile(CAR, (cars, 1)), headings]
        )
        names = ("car",) * cars
        return Detections(time, boxes, np.ones(cars), names, velocity, np.tile(0.01 * np.eye(2), (cars, 1, 1)))

    measured = []
    for delay in delays:
        profile = ComposedProfile.model_validate({"delay": {"kind": "constant", "seconds": delay}})
        channel = ComposedChannel(profile, seed)
        fusion: FusionMethod = CovarianceIntersectionFusion() if compensated else AverageFusion()
        ticks = math.ceil(delay / dt - 1e-6) + 20
        for tick in range(ticks + 1):
            now = tick * dt
            known = Detections(now)
            for received in channel.deliver("Ego", now):
                report = Report("RSU", received.message.detections, received.arrived)
                fusion.add_report(report)
                known = fusion.fuse([report], now) if tick == ticks else known
            said = seen(now)
            state = StationState(now, 0.0, 0.0, 0.0, 0.0, 0.0)
            channel.send(Message("RSU", tick, now, state, said, 0), ["Ego"], now)
        truth = said.boxes
        found = match_by_share(iou_bev(known.boxes, truth), known.scores, np.zeros(cars, dtype=bool), iou)
        measured.append(average_precision([found], cars))
    late = np.array([math.ceil(max(delay, dt) / dt - 1e-6) * dt for delay in delays])
    expected = np.ones(len(late)) if compensated else (speed * late <= largest_shift(iou) + 1e-9).astype(float)
    label = f"{speed:g} m/s, IoU {iou:g}" + (", moved on to the present" if compensated else "")
    return Curve(label, np.array(delays), np.array(measured), expected)


def reception_by_distance(distances: Sequence[float], *, truck: bool, messages: int = 300) -> Curve:
    """Packet reception ratio between two antennas 1.5 m high on a highway, with or without a firetruck in between.

    The truck is a body in the world, and rays find it. Each message meets its own shadowing. Expected: the share of
    shadowing (3 dB) and, behind the truck, of its loss (TR 37.885, lognormal) that leaves the signal above -85 dBm,
    times the share of packets without error there.
    """
    profile = RadioProfile.model_validate({"path_loss": {"kind": "tr37885", "environment": "highway"}, "jitter": 0.0})
    measured = []
    for distance in distances:
        places = {"Ego": (0.0, 0.0, 1.5), "RSU": (distance, 0.0, 1.5)}
        sight = _seen_in_the_world(places, truck)
        kept = 0
        for seed in range(messages):
            channel = RadioChannel(profile, seed)
            channel.update_environment(RadioEnvironment(places, lambda pairs, seen=sight: seen))  # type: ignore[misc]
            state = StationState(0.0, distance, 0.0, 0.0, 0.0, 0.0)
            channel.transmit([(Message("RSU", 0, 0.0, state, Detections(0.0), 350), ["Ego"])], 0.0)
            kept += len(channel.deliver("Ego", 0.05))
        measured.append(kept / messages)
    at = np.array(distances)
    label = "the firetruck in between" if truck else "nothing in between"
    expected = _expected_reception(at, profile, truck)
    return Curve(label, at, np.array(measured), expected, 1.96 * np.sqrt(expected * (1.0 - expected) / messages))


def _seen_in_the_world(places: dict[str, tuple[float, float, float]], truck: bool) -> LineOfSightStates:
    with World(None) as world:
        if truck:
            spec = ActorSpec("Firetruck", "firetruck", "truck", TRUCK, (0.0, 0.0, TRUCK[2] / 2.0))
            world.add(spec, Placement(places["RSU"][0] / 2.0, 0.0, yaw=math.pi / 2.0))
        return line_of_sight_states(world, places, [("Ego", "RSU")])


def _expected_reception(distance: Array, profile: RadioProfile, truck: bool) -> Array:
    """By the midpoint rule over both random losses."""
    steps = 400
    normal = np.linspace(-5.0, 5.0, steps + 1)
    weight = np.diff(ndtr(normal))
    middle = (normal[:-1] + normal[1:]) / 2.0
    low, top = np.full(len(distance), 1.5), np.full(len(distance), TRUCK[2] if truck else -np.inf)
    mean, spread = blockage_moments(distance, low, low, top)
    some = np.where(mean > 0.0, mean, 1.0)
    variance = np.log1p((spread / some) ** 2)
    exponent = np.log(some) - variance / 2.0
    extra = np.exp(exponent[:, None] + np.sqrt(variance)[:, None] * middle) * (mean > 0.0)[:, None]
    curve = CURVES["80211p_highway_nlos" if truck else "80211p_highway_los"]
    open_power = profile.radiated - highway_los(distance, profile.frequency_ghz)
    power = open_power[:, None, None] - extra[:, :, None] - 3.0 * middle
    through = (power >= profile.sensing) * (1.0 - curve.at(power - profile.noise, 350))
    share: Array = np.einsum("dbs,b,s->d", through, weight, weight)
    return share


def age_by_burst(
    bursts: Sequence[float], *, share: float = 0.3, period: float = 0.1, delay: float = 0.02, messages: int = 150_000
) -> tuple[Curve, Curve]:
    """Mean and mean peak age of information when a share of the messages is lost in bursts of this mean length.

    Gilbert-Elliott: mean age d + T E[K²] / 2 E[K] with E[K] = 1 + p/r, E[K²] = 1 + p (2 + r) / r², r = 1 / burst,
    p = r share / (1 - share); peak age d + T E[K], whatever the bursts.
    """
    mean, peak = [], []
    for burst in bursts:
        loss = {"kind": "gilbert_elliott", "probability": share, "burst": burst}
        delays = {"kind": "constant", "seconds": delay}
        channel = ComposedChannel(ComposedProfile.model_validate({"loss": loss, "delay": delays}), 1)
        for number in range(messages):
            now = number * period
            state = StationState(now, 0.0, 0.0, 0.0, 0.0, 0.0)
            channel.send(Message("RSU", number, now, state, Detections(now), 0), ["Ego"], now)
            channel.deliver("Ego", now + period)
        book = channel.statistics(messages * period)["RSU", "Ego"]
        mean.append(book.mean_age or math.nan)
        peak.append(book.peak_age or math.nan)
    length = np.array(bursts)
    back = 1.0 / length
    into = back * share / (1.0 - share)
    slots, squared = 1.0 + into / back, 1.0 + into * (2.0 + back) / back**2
    return (
        Curve("mean age", length, np.array(mean), delay + period * squared / (2.0 * slots)),
        Curve("mean peak age", length, np.array(peak), delay + period * slots),
    )
