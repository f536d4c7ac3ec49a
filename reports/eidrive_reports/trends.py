"""Known trends of cooperative perception over a radio channel: measured and expected values.

Each function returns the arrays of one figure of `make reproduce`. Expected values follow from closed forms that
are independent of the measured code.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import typer
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.special import ndtr

from eidrive_reports.studies import command
from eidrive_scenario.api.common import ActorSpec, Array, Placement, iou_bev, write_atomically
from eidrive_scenario.api.driving import Detections, line_of_sight_states
from eidrive_scenario.api.experiments import average_precision, match_by_share
from eidrive_scenario.api.fusion import AverageFusion, CovarianceIntersectionFusion, FusionMethod, Report
from eidrive_scenario.api.run import World
from eidrive_scenario.api.v2x import (
    CURVES,
    ComposedChannel,
    ComposedProfile,
    LineOfSightStates,
    Message,
    RadioChannel,
    RadioEnvironment,
    RadioProfile,
    StationState,
    blockage_moments,
    highway_los,
)

CAR = (4.5, 1.8, 1.5)
"""Length, width and height of a car [m]."""
TRUCK = (8.5, 2.5, 3.3)
"""Length, width and height of the firetruck [m]."""


@dataclass(frozen=True)
class Curve:
    """Measured and expected values over `x`, each (N,).

    chance  (N,) half width of the range that contains 95 % of the measured shares of random draws; None if exact
    """

    label: str
    x: Array
    measured: Array
    expected: Array
    chance: Array | None = None


def largest_shift(iou: float, length: float = CAR[0]) -> float:
    """Return the maximum longitudinal shift between a box and its object with an overlap of at least `iou` [m].

    IoU = (L - s) / (L + s) for a shift s.
    """
    return length * (1.0 - iou) / (1.0 + iou)


def precision_by_delay(
    speed: float, iou: float, delays: Sequence[float], *, compensated: bool = False, cars: int = 20, seed: int = 1
) -> Curve:
    """Return the average precision of a receiving station for cars at constant speed [m/s] over message delays [s].

    Without prediction, a box is v tau behind its car, so precision falls from 1 to 0 at `largest_shift`.
    """
    dt = 0.005
    headings = np.random.Generator(np.random.Philox(key=seed)).uniform(-math.pi, math.pi, cars)
    start = 40.0 * np.stack([np.arange(cars) % 5, np.arange(cars) // 5], axis=1)
    velocity = speed * np.stack([np.cos(headings), np.sin(headings)], axis=1)

    def true_detections(time: float) -> Detections:
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
            fused = Detections(now)
            for received in channel.deliver("Ego", now):
                report = Report("RSU", received.message.detections, received.arrived)
                fusion.add_report(report)
                fused = fusion.fuse([report], now) if tick == ticks else fused
            detections = true_detections(now)
            state = StationState(now, 0.0, 0.0, 0.0, 0.0, 0.0)
            channel.send(Message("RSU", tick, now, state, detections, 0), ["Ego"], now)
        truth = detections.boxes
        matches = match_by_share(iou_bev(fused.boxes, truth), fused.scores, np.zeros(cars, dtype=bool), iou)
        measured.append(average_precision([matches], cars))
    late = np.array([math.ceil(max(delay, dt) / dt - 1e-6) * dt for delay in delays])
    expected = np.ones(len(late)) if compensated else (speed * late <= largest_shift(iou) + 1e-9).astype(float)
    label = f"{speed:g} m/s, IoU {iou:g}" + (", predicted to the current time" if compensated else "")
    return Curve(label, np.array(delays), np.array(measured), expected)


def reception_by_distance(distances: Sequence[float], *, truck: bool, messages: int = 300) -> Curve:
    """Return the packet reception ratio between two antennas at 1.5 m on a highway, with or without a firetruck.

    The truck is a body in the world, which rays detect. Each message has independent shadowing. The expected
    value is the probability of a signal above -85 dBm, times the packet success ratio at that power. Random losses are
    shadowing (3 dB) and, behind the truck, blockage (TR 37.885, lognormal).
    """
    profile = RadioProfile.model_validate({"path_loss": {"kind": "tr37885", "environment": "highway"}, "jitter": 0.0})
    measured = []
    for distance in distances:
        antennas = {"Ego": (0.0, 0.0, 1.5), "RSU": (distance, 0.0, 1.5)}
        states = _line_of_sight(antennas, truck)
        delivered = 0
        for seed in range(messages):
            channel = RadioChannel(profile, seed)
            channel.update_environment(RadioEnvironment(antennas, lambda pairs, fixed=states: fixed))  # type: ignore[misc]
            state = StationState(0.0, distance, 0.0, 0.0, 0.0, 0.0)
            channel.transmit([(Message("RSU", 0, 0.0, state, Detections(0.0), 350), ["Ego"])], 0.0)
            delivered += len(channel.deliver("Ego", 0.05))
        measured.append(delivered / messages)
    at = np.array(distances)
    label = "behind the firetruck" if truck else "line of sight"
    expected = _expected_reception(at, profile, truck)
    return Curve(label, at, np.array(measured), expected, 1.96 * np.sqrt(expected * (1.0 - expected) / messages))


def _line_of_sight(antennas: dict[str, tuple[float, float, float]], truck: bool) -> LineOfSightStates:
    with World(None) as world:
        if truck:
            spec = ActorSpec("Firetruck", "firetruck", "truck", TRUCK, (0.0, 0.0, TRUCK[2] / 2.0))
            world.add(spec, Placement(antennas["RSU"][0] / 2.0, 0.0, yaw=math.pi / 2.0))
        return line_of_sight_states(world, antennas, [("Ego", "RSU")])


def _expected_reception(distance: Array, profile: RadioProfile, truck: bool) -> Array:
    """Return the expected packet reception ratio by the midpoint rule over both random losses."""
    steps = 400
    normal = np.linspace(-5.0, 5.0, steps + 1)
    weight = np.diff(ndtr(normal))
    middle = (normal[:-1] + normal[1:]) / 2.0
    low, top = np.full(len(distance), 1.5), np.full(len(distance), TRUCK[2] if truck else -np.inf)
    mean, spread = blockage_moments(distance, low, low, top)
    positive_mean = np.where(mean > 0.0, mean, 1.0)
    variance = np.log1p((spread / positive_mean) ** 2)
    exponent = np.log(positive_mean) - variance / 2.0
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
    """Return mean and mean peak age of information over the mean length of loss bursts, at a fixed loss ratio.

    Gilbert-Elliott: mean age d + T E[K²] / 2 E[K] with E[K] = 1 + p/r, E[K²] = 1 + p (2 + r) / r², r = 1 / burst,
    p = r share / (1 - share). The peak age is d + T E[K], independent of the burst length.
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
        link = channel.statistics(messages * period)["RSU", "Ego"]
        mean.append(link.mean_age or math.nan)
        peak.append(link.peak_age or math.nan)
    length = np.array(bursts)
    back = 1.0 / length
    into = back * share / (1.0 - share)
    slots, squared = 1.0 + into / back, 1.0 + into * (2.0 + back) / back**2
    return (
        Curve("mean age", length, np.array(mean), delay + period * squared / (2.0 * slots)),
        Curve("mean peak age", length, np.array(peak), delay + period * slots),
    )


COLORS = ("#0b6e99", "#c2410c", "#4d7c0f", "#7e22ce")
SPEEDS = (5.0, 10.0, 15.0)
DELAYS = tuple(round(0.005 + 0.01 * step, 3) for step in range(40))
"""Message delays [s], between the knees, which are near multiples of 0.01 s."""
DISTANCES = (100, 200, 300, 400, 500, 600, 700, 800, 1000, 1200, 1500, 1800, 2100, 2500, 3000)
BURSTS = (1 / 0.7, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0)


def precision_figure() -> Figure:
    """Draw average precision over message delay, for three speeds and two IoU thresholds."""
    figure = Figure(figsize=(9.0, 6.5), layout="constrained")
    for axes, iou in zip(figure.subplots(2, 1, sharex=True), (0.7, 0.5), strict=True):
        for color, speed, size in zip(COLORS, SPEEDS, (11, 8, 5), strict=False):
            curve = precision_by_delay(speed, iou, DELAYS)
            look = {"ms": size, "mfc": "none", "lw": 1, "color": color}
            axes.plot(1e3 * curve.x, curve.measured, "o-", label=f"{speed:g} m/s, as received", **look)
            knee = 1e3 * largest_shift(iou) / speed
            axes.axvline(knee, color=color, lw=1, ls="--")
            axes.text(knee, 1.09, f"{knee:.0f} ms", color=color, ha="center", fontsize=8)
        predicted = precision_by_delay(SPEEDS[-1], iou, DELAYS, compensated=True)
        label = f"{SPEEDS[-1]:g} m/s, predicted to the current time"
        axes.plot(1e3 * predicted.x, predicted.measured, "x", ms=4, color=COLORS[3], label=label)
        axes.set_title(f"IoU {iou:g}: limit of speed times delay at {largest_shift(iou):.2f} m (dashed)", pad=16)
        axes.set_ylabel("average precision")
        axes.set_ylim(-0.05, 1.05)
    axes.set_xlabel("message delay [ms]")
    axes.legend(fontsize=8, loc="center right")
    return figure


def reception_figure() -> Figure:
    """Draw the packet reception ratio over distance, with and without the firetruck."""
    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.subplots()
    curves = [reception_by_distance(DISTANCES, truck=truck) for truck in (False, True)]
    _draw(axes, curves)
    axes.set_xscale("log")
    axes.set_xticks([100, 200, 500, 1000, 2000, 3000], labels=["100", "200", "500", "1000", "2000", "3000"])
    axes.minorticks_off()
    axes.set_xlabel("distance between antennas at 1.5 m height [m]")
    axes.set_ylabel("packet reception ratio")
    axes.set_title("IEEE 802.11p, TR 37.885 highway, 350 bytes; 300 messages at each distance")
    axes.legend(fontsize=8)
    return figure


def age_figure() -> Figure:
    """Draw the age of information over the mean length of loss bursts."""
    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.subplots()
    _draw(axes, age_by_burst(BURSTS))
    axes.set_xlabel("mean length of loss bursts [messages]")
    axes.set_ylabel("age of information [s]")
    axes.set_ylim(bottom=0.0)
    axes.set_title("Loss 30 %, period 0.1 s, delay 0.02 s: bursts increase the mean age, not the mean peak age")
    axes.legend(fontsize=8)
    return figure


def _draw(axes: Axes, curves: Sequence[Curve]) -> None:
    for color, curve in zip(COLORS, curves, strict=False):
        axes.plot(curve.x, curve.expected, "--", lw=1.2, color=color, label=f"{curve.label}, expected")
        if curve.chance is not None:
            low, high = curve.expected - curve.chance, curve.expected + curve.chance
            axes.fill_between(curve.x, low, high, color=color, alpha=0.15, lw=0, label="  95 % of all samples")
        axes.plot(curve.x, curve.measured, "o", ms=4, color=color, label=f"{curve.label}, measured")
        off = float(np.max(np.abs(curve.measured - curve.expected)))
        axes.plot([], [], " ", label=f"  largest difference {off:.3f}")


FIGURES = {
    "precision_by_delay": precision_figure,
    "reception_by_distance": reception_figure,
    "age_by_burst": age_figure,
}


@command
def main(arguments: Sequence[str] | None = None) -> None:
    """Draw all figures into a folder."""
    parser = argparse.ArgumentParser(description="Draw known trends, measured and expected.")
    parser.add_argument("--out", type=Path, default=Path("reports/trends"))
    folder: Path = parser.parse_args(arguments).out
    for name, figure in FIGURES.items():
        path = folder / f"{name}.png"
        with write_atomically(path) as stream:
            figure().savefig(stream, format="png", dpi=130)
        typer.echo(f"wrote {path}")


if __name__ == "__main__":
    sys.exit(main())
