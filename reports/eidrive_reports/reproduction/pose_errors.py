"""Drives past parked cars with errors of the assumed pose, by tracker, fusion method and detector."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

from eidrive_reports.cooperative_perception.receivers import DRIFT_TIME, YAW_PER_POSITION
from eidrive_reports.paper import EGO
from eidrive_reports.reproduction.encounters import COLLISIONS
from eidrive_reports.reproduction.episodes import Episode
from eidrive_reports.reproduction.layout import DataTable, Row, Section, plain
from eidrive_reports.reproduction.part import Case, by_case
from eidrive_scenario.api.run import RunSettings

SCENE = "driving/parked_cars"
DEVIATIONS = (0.0, 0.05, 0.2, 0.4, 0.6)
"""Standard deviations of x and of y [m]; that of the heading is as in the measurement of average precision."""
PROCESSES = {"independent": 0.0, "drift": DRIFT_TIME}
"""Correlation time of the error by the name of its process [s]."""
STACKS = (
    *(
        ("oracle", tracker, fusion)
        for tracker in ("none", "cv", "ctrv")
        for fusion in ("covariance_intersection", "average")
    ),
    *(("lidar", "cv", fusion) for fusion in ("covariance_intersection", "average", "early")),
)
"""Detector, tracker and fusion method of both stations."""
BRAKING = "false_braking"


@dataclass(frozen=True)
class PoseErrorArm:
    """Settings of both stations of one drive."""

    detector: str
    tracker: str
    fusion: str
    process: str
    deviation: float

    @property
    def name(self) -> str:
        """Name of the arm in the record."""
        return f"{self.detector}, {self.tracker}, {self.fusion}, {self.process} {self.deviation:g} m"

    @property
    def settings(self) -> RunSettings:
        """Settings of the run; brakings harder than 3 m/s² are counted."""
        yaw, time = YAW_PER_POSITION * self.deviation, PROCESSES[self.process]
        parameters = {
            "Detector": self.detector,
            "Tracker": self.tracker,
            "Fusion": self.fusion,
            "Participants": "vehicle",
            "PoseNoise": f"{{position: {self.deviation}, yaw: {yaw}, correlation_time: {time}}}",
        }
        return RunSettings(channel="ideal", parameters=parameters, criteria={BRAKING: {"of": EGO, "at_most": 10**6}})


def arms() -> Iterator[PoseErrorArm]:
    """Yield all arms: drift only of the oracle, and not without an error, where both processes are the same."""
    for stack, process, deviation in product(STACKS, PROCESSES, DEVIATIONS):
        if process == "independent" or (stack[0] == "oracle" and deviation > 0.0):
            yield PoseErrorArm(*stack, process, deviation)


def cases(detectors: Sequence[str]) -> list[Case]:
    """Return the drives of the stacks with the oracle, and of those with these detectors."""
    return [Case(SCENE, arm.name, arm.settings) for arm in arms() if arm.detector in ("oracle", *detectors)]


def rows(episodes: Sequence[Episode]) -> Iterator[Row]:
    """Yield the outcome of each arm that was run.

    least_speed, mean_least_speed  minimum speed of the ego, and its mean over the runs [m/s]
    brakings, collisions           number of brakings of all runs, and of runs with a collision
    """
    runs = by_case(episodes)
    for arm in arms():
        if own := runs.get((SCENE, arm.name)):
            speeds = [episode.metrics[f"min_speed.{EGO}"] for episode in own]
            yield {
                "detector": arm.detector,
                "tracker": arm.tracker,
                "fusion": arm.fusion,
                "process": arm.process,
                "deviation": arm.deviation,
                "runs": len(own),
                "least_speed": min(speeds),
                "mean_least_speed": sum(speeds) / len(speeds),
                "brakings": round(sum(episode.metrics[f"{BRAKING}.{EGO}.brakings"] for episode in own)),
                "collisions": sum(episode.metrics.get(COLLISIONS, 0.0) > 0.0 for episode in own),
            }


COLUMNS = (
    *map(plain, ("detector", "tracker", "fusion")),
    plain("error", "process"),
    plain("deviation [m]", "deviation", "g"),
    plain("runs"),
    plain("least speed [m/s]", "least_speed", ".2f"),
    plain("mean of least speeds [m/s]", "mean_least_speed", ".2f"),
    *map(plain, ("brakings", "collisions")),
)


def section(episodes: Sequence[Episode]) -> Section:
    """Return the section of the report about closed loops with pose errors."""
    return Section(
        "Closed loop with pose errors",
        (
            f"`xosc/{SCENE}.xosc`: the ego passes parked cars at 10 m/s, and another parked car sends what it detects. "
            f"Both assume a pose with an error, drawn in each time step or with a correlation time of {DRIFT_TIME:g} s "
            "(drift). No object is a reason to brake harder than 3 m/s², so all brakings are false. The ego also "
            "drives by this pose.",
        ),
        DataTable("perception_closed_loop", COLUMNS, tuple(rows(episodes))),
    )
