"""Table II of the EI-Drive paper: minimum distance between the ego and an occluded car.

The table has four arms in two scenarios: no cooperation, cooperation, cooperation with a latency of 0.3 s, cooperation
with a loss of 30 % of the frames. Each arm has two model variants. In the text of the paper the channel acts on links
between stations; its code also delays and drops the ego's own detections.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from eidrive_scenario.api.common import SimulationError
from eidrive_scenario.api.experiments import (
    Job,
    PairedDifference,
    Proportion,
    Summary,
    interval_text,
    paired_difference,
    summarize,
    wilson,
)
from eidrive_scenario.api.run import RunResult, RunSettings


@dataclass(frozen=True)
class Published:
    """Published mean, standard deviation and distances of the five episodes [m]."""

    mean: float
    sd: float
    episodes: tuple[float, ...]


TABLE_2 = {
    ("coop/scenario_1", "oracle", "none"): Published(3.26, 0.08, (3.2948, 3.2945, 3.2914, 3.1012, 3.2947)),
    ("coop/scenario_1", "oracle", "cooperation"): Published(3.98, 0.16, (3.8461, 3.8395, 3.8452, 4.1794, 4.1811)),
    ("coop/scenario_1", "oracle", "latency"): Published(2.50, 0.68, (1.9975, 1.9975, 3.3246, 3.3245, 1.8549)),
    ("coop/scenario_1", "oracle", "error"): Published(3.15, 1.07, (4.0286, 1.8226, 4.0330, 1.8549, 4.0292)),
    ("coop/scenario_1", "yolov5", "none"): Published(3.32, 0.00, (3.3174, 3.3218, 3.3179, 3.3186, 3.3192)),
    ("coop/scenario_1", "yolov5", "cooperation"): Published(5.09, 0.13, (4.9683, 5.2543, 5.2461, 4.9905, 4.9690)),
    ("coop/scenario_1", "yolov5", "latency"): Published(3.62, 0.08, (3.5766, 3.5755, 3.7794, 3.5766, 3.5766)),
    ("coop/scenario_1", "yolov5", "error"): Published(4.84, 0.55, (4.9683, 5.2563, 5.2470, 3.7794, 4.9684)),
    ("coop/scenario_2", "oracle", "none"): Published(3.90, 0.01, (3.9105, 3.9156, 3.8966, 3.8785, 3.9165)),
    ("coop/scenario_2", "oracle", "cooperation"): Published(4.42, 0.00, (4.4243, 4.4243, 4.4243, 4.4243, 4.4245)),
    ("coop/scenario_2", "oracle", "latency"): Published(3.50, 0.01, (3.5012, 3.4880, 3.5024, 3.5010, 3.5052)),
    ("coop/scenario_2", "oracle", "error"): Published(4.32, 0.21, (4.4409, 4.4243, 3.9156, 4.4243, 4.4243)),
    ("coop/scenario_2", "yolov5", "none"): Published(3.91, 0.00, (3.9183, 3.9182, 3.9191, 3.9201, 3.9183)),
    ("coop/scenario_2", "yolov5", "cooperation"): Published(4.58, 0.04, (4.5289, 4.5289, 4.6107, 4.6105, 4.6105)),
    ("coop/scenario_2", "yolov5", "latency"): Published(3.40, 0.00, (3.3985, 3.3985, 3.3991, 3.3985, 3.3996)),
    ("coop/scenario_2", "yolov5", "error"): Published(4.23, 0.49, (3.9201, 4.6104, 3.3985, 4.6105, 4.6105)),
}
"""Minimum distance between the centers by scenario, detector and arm (Table II)."""


@dataclass(frozen=True)
class PublishedSuccess:
    """Published share of runs without a collision, with its standard deviation, and minimum distance [m]."""

    rate: float
    rate_sd: float
    distance: float
    distance_sd: float


TABLE_3 = {
    ("coop/scenario_5", "both"): PublishedSuccess(1.0, 0.0, 3.51, 0.55),
    ("coop/scenario_5", "rsu"): PublishedSuccess(0.9333, 0.0471, 3.03, 0.03),
    ("coop/scenario_5", "vehicle"): PublishedSuccess(0.2051, 0.0363, 2.98, 0.48),
    ("coop/scenario_6", "both"): PublishedSuccess(0.8205, 0.0725, 4.05, 1.07),
    ("coop/scenario_6", "rsu"): PublishedSuccess(0.7846, 0.0166, 3.10, 0.08),
    ("coop/scenario_6", "vehicle"): PublishedSuccess(0.4872, 0.0363, 3.32, 0.63),
    ("coop/scenario_7", "both"): PublishedSuccess(1.0, 0.0, 3.83, 0.11),
    ("coop/scenario_7", "rsu"): PublishedSuccess(0.9833, 0.0236, 3.60, 0.00),
    ("coop/scenario_7", "vehicle"): PublishedSuccess(0.0, 0.0, 2.82, 0.03),
    ("coop/scenario_8", "both"): PublishedSuccess(1.0, 0.0, 3.60, 0.00),
    ("coop/scenario_8", "rsu"): PublishedSuccess(1.0, 0.0, 3.61, 0.01),
    ("coop/scenario_8", "vehicle"): PublishedSuccess(0.0, 0.0, 2.88, 0.04),
}
"""Success rates by scenario and senders (Table III)."""


@dataclass(frozen=True)
class PublishedCount:
    """Number of boxes of the ego in one run of 400 time steps: mean, minimum and maximum."""

    mean: float
    least: int
    most: int


COUNTS = {
    ("coop/scenario_3", "oracle", "none"): PublishedCount(9.1, 6, 11),
    ("coop/scenario_3", "oracle", "cooperation"): PublishedCount(14.4, 9, 18),
    ("coop/scenario_3", "yolov5", "none"): PublishedCount(2.7, 0, 9),
    ("coop/scenario_3", "yolov5", "cooperation"): PublishedCount(4.4, 0, 12),
    ("coop/scenario_4", "oracle", "none"): PublishedCount(8.5, 6, 10),
    ("coop/scenario_4", "oracle", "cooperation"): PublishedCount(14.7, 9, 18),
    ("coop/scenario_4", "yolov5", "none"): PublishedCount(2.8, 0, 6),
    ("coop/scenario_4", "yolov5", "cooperation"): PublishedCount(10.4, 1, 17),
}
"""Counts by scenario, detector and arm (figure of the number of detected objects)."""

RATIOS = {
    ("coop/scenario_3", "oracle"): 1.58,
    ("coop/scenario_3", "yolov5"): 1.63,
    ("coop/scenario_4", "oracle"): 1.73,
    ("coop/scenario_4", "yolov5"): 3.7,
}
"""Mean count with cooperation over that without, by scenario and detector."""


EGO, HIDDEN = "Ego", "Incoming"

SCENARIOS = {"coop/scenario_1": "Scenario 1, roadside unit", "coop/scenario_2": "Scenario 2, spectator vehicle"}


@dataclass(frozen=True)
class ExperimentArm:
    """Row of the table with the channel profile of each model variant, `links` and `own`."""

    name: str
    title: str
    links: str
    own: str

    def channel(self, variant: ModelVariant) -> str:
        """Return the name of the channel profile of a variant."""
        return self.own if variant.own_perception else self.links


@dataclass(frozen=True)
class ModelVariant:
    """Variant of the channel model: links only, or links and own detections."""

    name: str
    title: str
    own_perception: bool


ARMS = (
    ExperimentArm("none", "no cooperation", "none", "none"),
    ExperimentArm("cooperation", "cooperation", "ideal", "paper_ideal"),
    ExperimentArm("latency", "latency 0.3 s", "latency_300ms", "paper_latency_300ms"),
    ExperimentArm("error", "error 30 %", "error_30pct", "paper_error_30pct"),
)

LINKS = ModelVariant("links", "the channel acts on links only", False)
OWN = ModelVariant("own_perception", "the ego's own detections too, as the paper's code has it", True)
VARIANTS = (LINKS, OWN)


def run_settings(detector: str | None = None) -> dict[str, RunSettings]:
    """Return the distinct runs of both tables by channel. No cooperation is equal in both variants."""
    return {
        arm.channel(variant): RunSettings(channel=arm.channel(variant), detector=detector)
        for variant in VARIANTS
        for arm in ARMS
    }


@dataclass(frozen=True)
class Cell:
    """One arm in one scenario: minimum distances of all seeds [m] and the proportion of collision-free runs."""

    scenario: str
    arm: ExperimentArm
    seeds: tuple[int, ...]
    centers: tuple[float, ...]
    boxes: tuple[float, ...]
    collision_free: Proportion
    published: Published

    @property
    def center(self) -> Summary:
        """Distance between the centers of the two cars, the metric of the paper."""
        return summarize(self.centers)

    @property
    def box(self) -> Summary:
        """Distance between the bodies, 0 for a contact."""
        return summarize(self.boxes)


@dataclass(frozen=True)
class Table:
    """Table of one model variant, with cells in the order of SCENARIOS, then ARMS."""

    variant: ModelVariant
    cells: tuple[Cell, ...]

    def cell(self, scenario: str, arm: str) -> Cell:
        """Return the cell of an arm. Raise KeyError if there is none."""
        for cell in self.cells:
            if cell.scenario == scenario and cell.arm.name == arm:
                return cell
        raise KeyError(f"no cell for {arm!r} in {scenario!r}")

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Scenarios of this table, in order."""
        return tuple(dict.fromkeys(cell.scenario for cell in self.cells))


def tabulate(runs: Sequence[tuple[Job, RunResult]], variant: ModelVariant) -> Table:
    """Return the table of one model variant. Raise SimulationError if a run lacks one of the metrics."""
    cells = []
    for scenario in dict.fromkeys(job.scenario for job, _ in runs):
        for arm in ARMS:
            name = arm.channel(variant)
            mine = sorted(
                ((job.seed, result) for job, result in runs if job.scenario == scenario and job.arm == name),
                key=lambda run: run[0],
            )
            free = sum(_metric(result, "collision.count") == 0 for _, result in mine)
            cells.append(
                Cell(
                    scenario=scenario,
                    arm=arm,
                    seeds=tuple(seed for seed, _ in mine),
                    centers=tuple(_metric(result, f"min_distance.{EGO}.{HIDDEN}.center") for _, result in mine),
                    boxes=tuple(_metric(result, f"min_distance.{EGO}.{HIDDEN}.box") for _, result in mine),
                    collision_free=wilson(free, len(mine)),
                    published=TABLE_2[scenario, "oracle", arm.name],
                )
            )
    return Table(variant, tuple(cells))


def _metric(result: RunResult, name: str) -> float:
    try:
        return float(result.metrics[name])
    except KeyError:
        raise SimulationError(
            f"{result.scenario}, seed {result.seed}: metric {name} is missing "
            "(expected a scenario with the criteria collision and min_distance)"
        ) from None


@dataclass(frozen=True)
class PublishedClaim:
    """Published statement about the order of the arms, and whether these runs confirm it."""

    scenario: str
    statement: str
    holds: bool
    evidence: str


def evaluate_claims(table: Table) -> tuple[PublishedClaim, ...]:
    """Compare the order of the arms in each scenario with the published order."""
    claims = []
    for scenario in table.scenarios:
        none, cooperation, latency, error = (table.cell(scenario, arm.name) for arm in ARMS)
        claims.append(_order(scenario, "cooperation > none", none, cooperation))
        claims.append(_order(scenario, "latency < cooperation", latency, cooperation))
        claims.append(_mixture(scenario, latency, error, cooperation))
    return tuple(claims)


def _order(scenario: str, statement: str, smaller: Cell, larger: Cell) -> PublishedClaim:
    difference = _paired(smaller, larger)
    evidence = (
        f"{larger.arm.name} {larger.center.mean:.2f} m, {smaller.arm.name} {smaller.center.mean:.2f} m; "
        f"difference per seed {difference.mean:+.2f} m, 95 % interval [m]: "
        f"{interval_text(difference.low, difference.high, '+.2f')}"
    )
    return PublishedClaim(scenario, statement, difference.mean > 0, evidence)


def _mixture(scenario: str, latency: Cell, error: Cell, cooperation: Cell) -> PublishedClaim:
    """Compare the error arm: lost frames degrade some runs, and others equal the cooperation arm."""
    between = latency.center.mean <= error.center.mean <= cooperation.center.mean
    wider = error.center.population_sd > cooperation.center.population_sd
    fewer = error.collision_free.share < cooperation.collision_free.share
    evidence = (
        f"mean {latency.center.mean:.2f} / {error.center.mean:.2f} / {cooperation.center.mean:.2f} m; "
        f"sd {error.center.population_sd:.3f} against {cooperation.center.population_sd:.3f} m; collision-free "
        f"{error.collision_free.successes} against {cooperation.collision_free.successes} of {len(error.seeds)}"
    )
    statement = "latency <= error <= cooperation, error with a larger sd or fewer collision-free runs than cooperation"
    return PublishedClaim(scenario, statement, between and (wider or fewer), evidence)


def _paired(first: Cell, second: Cell) -> PairedDifference:
    if first.seeds != second.seeds:
        raise ValueError(f"{first.arm.name} and {second.arm.name} have different seeds")
    return paired_difference(first.centers, second.centers)


NOTEWORTHY = 0.05
"""Minimum change of a mean minimum distance that the sentence states [m]."""


def difference(links: Table, own: Table) -> str:
    """Return a sentence about the effect of delaying and dropping the ego's own detections.

    Latency counts as worse than no cooperation if the 95 % interval of the paired difference is below zero.
    """
    shifts, smaller, worse = [], 0.0, {LINKS.name: 0, OWN.name: 0}
    for scenario in links.scenarios:
        title = SCENARIOS.get(scenario, scenario).split(",")[0].lower()
        for arm in ARMS[1:]:
            before, after = links.cell(scenario, arm.name), own.cell(scenario, arm.name)
            change = after.center.mean - before.center.mean
            if abs(change) < NOTEWORTHY and before.collision_free == after.collision_free:
                smaller = max(smaller, abs(change))
                continue
            shifts.append(
                f"{title} {arm.title} {before.center.mean:.2f} → {after.center.mean:.2f} m, collision-free "
                f"{before.collision_free.successes} → {after.collision_free.successes} of {len(after.seeds)}"
            )
        for table in (links, own):
            latency, none = table.cell(scenario, "latency"), table.cell(scenario, "none")
            worse[table.variant.name] += _paired(none, latency).high < 0
    total = len(links.scenarios)
    changes = "; ".join(shifts) if shifts else "nothing"
    rest = f" (the other means by {smaller:.2f} m at most)" if shifts else f" (means by {smaller:.2f} m at most)"
    return (
        f"Delaying and dropping the ego's own detections as well changes {changes}{rest}; latency is worse than no "
        f"cooperation in {worse[OWN.name]} of {total} scenarios with this variant, and in {worse[LINKS.name]} of "
        f"{total} with a channel that acts on links only."
    )
