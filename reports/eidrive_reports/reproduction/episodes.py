"""Episode: one run of a part of the reproduction, with the measured values that the record keeps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import msgspec

from eidrive_reports.cooperative_perception.receivers import Condition
from eidrive_reports.cooperative_perception.scores import PerceptionRecord
from eidrive_reports.cooperative_perception.trial import run_trial
from eidrive_reports.paper import EGO
from eidrive_reports.reproduction.channel_load import with_load
from eidrive_scenario.api.criteria import Frame, LinkStatistics
from eidrive_scenario.api.experiments import Job, resolve_scenario
from eidrive_scenario.api.run import NOT_JUDGED, run_file


class Episode(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Outcome of one run.

    arm      name of the settings within the part
    digest   digest of the settings and of the code
    metrics  finite metrics of the run, by name
    failed   names of the criteria that failed
    counts   number of objects that the counted station knew at each time step, after fusion
    wall_s   duration of the run [s]
    perception  detections of the ego by condition, of a run that measures them
    passed   whether the run passed; None if no criterion judges it
    """

    scenario: str
    arm: str
    seed: int
    digest: str
    trace_hash: str
    simulated_s: float
    wall_s: float
    metrics: dict[str, float]
    failed: tuple[str, ...] = ()
    counts: tuple[int, ...] = ()
    perception: PerceptionRecord | None = None
    passed: bool | None = None


@dataclass(frozen=True)
class EpisodeJob(Job):
    """Run of a part.

    digest   digest of the settings and of the code
    counted  station whose objects after fusion are counted at each time step; "" for none
    load     number of stations that are added to the scenario
    conditions  conditions under which the perception of the ego is measured
    """

    digest: str = ""
    counted: str = ""
    load: int = 0
    conditions: tuple[Condition, ...] = ()


class ObjectCounter:
    """Observer that counts the objects of a station after fusion, as EI-Drive counts the boxes of its ego.

    Objects of the class `misc` do not count: the masts of roadside units, which are no actors in EI-Drive.
    """

    def __init__(self, station: str) -> None:
        self._station = station
        self.counts: list[int] = []

    def observe(self, frame: Frame) -> None:
        """Add the number of one time step; before the station is present there is none."""
        step = frame.steps.get(self._station)
        if step is not None:
            self.counts.append(sum(name != "misc" for name in step.fused.classes))

    def close(self) -> None:
        """Finish after the last frame."""


def run_episode(job: EpisodeJob) -> Episode:
    """Run a job and return its outcome."""
    counter = ObjectCounter(job.counted)
    observers = (counter,) if job.counted else ()
    perception = None
    if job.conditions:
        result, measurement = run_trial(job.scenario, job.seed, job.settings, EGO, job.conditions)
        perception = measurement.record()
    else:
        path = resolve_scenario(job.scenario)
        source = with_load(path, job.load) if job.load else path
        result = run_file(source, seed=job.seed, settings=job.settings, observers=observers)
    metrics = {**result.metrics, **air_metrics(result.links)}
    return Episode(
        scenario=job.scenario,
        arm=job.arm,
        seed=job.seed,
        digest=job.digest,
        trace_hash=result.trace_hash,
        simulated_s=result.simulated_s,
        wall_s=round(result.wall_s, 3),
        metrics={name: float(value) for name, value in metrics.items() if math.isfinite(value)},
        failed=tuple(verdict.name for verdict in result.criteria if not verdict.passed),
        counts=tuple(counter.counts),
        perception=perception,
        passed=None if result.exit_code == NOT_JUDGED else result.passed,
    )


def gaps(episode: Episode) -> list[float]:
    """Return the minimum distances between the bodies of actors, of each criterion that measures them [m]."""
    metrics = episode.metrics.items()
    return [value for name, value in metrics if name.startswith("min_distance.") and name.endswith(".box")]


BYTES, BUSY = "air.bytes", "air.busy"
"""Metrics of the radio: bytes of the messages that another station uses, and largest channel busy ratio."""


def air_metrics(links: Mapping[tuple[str, str], LinkStatistics]) -> dict[str, float]:
    """Return the metrics of the radio. A message counts once, whatever the number of its receivers."""
    sent: dict[str, int] = {}
    for (sender, _), link in links.items():
        sent[sender] = max(sent.get(sender, 0), link.bytes_sent)
    busy = [link.channel_busy_ratio for link in links.values() if link.channel_busy_ratio is not None]
    return {BYTES: float(sum(sent.values())), **({BUSY: max(busy)} if busy else {})}
