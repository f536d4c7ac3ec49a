"""Table II of the EI-Drive paper: the minimal distance between the ego and the car that it cannot see in time.

Four arms in two places: no cooperation, cooperation, cooperation with 0.3 s of latency, cooperation with 30 % of the
frames lost. Each is run under two rules, as the paper's text puts the channel between stations, while its code also
delays and drops the ego's own detections.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from eidrive_scenario.errors import SimulationError
from eidrive_scenario.experiments.repetitions import Job
from eidrive_scenario.experiments.statistics import (
    PairedDifference,
    Proportion,
    Summary,
    paired_difference,
    summarize,
    wilson,
)
from eidrive_scenario.simulation import RunResult, RunSettings

EGO, HIDDEN = "Ego", "Incoming"

SCENARIOS = {"coop/scenario_1": "Scenario 1, roadside unit", "coop/scenario_2": "Scenario 2, spectator vehicle"}


@dataclass(frozen=True)
class ExperimentArm:
    """One row of the table: the channel profile under each rule, `links` and `own`."""

    name: str
    title: str
    links: str
    own: str

    def channel(self, rule: ModelVariant) -> str:
        """The name of the profile under a rule."""
        return self.own if rule.own_perception else self.links


@dataclass(frozen=True)
class ModelVariant:
    """What the channel acts upon."""

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
RULES = (LINKS, OWN)


@dataclass(frozen=True)
class Published:
    """What the paper's table prints (mean ± sd), and the five episodes behind it [m]."""

    mean: float
    sd: float
    episodes: tuple[float, ...]


PUBLISHED = {
    ("coop/scenario_1", "none"): Published(3.26, 0.08, (3.2948, 3.2945, 3.2914, 3.1012, 3.2947)),
    ("coop/scenario_1", "cooperation"): Published(3.98, 0.16, (3.8461, 3.8395, 3.8452, 4.1794, 4.1811)),
    ("coop/scenario_1", "latency"): Published(2.50, 0.68, (1.9975, 1.9975, 3.3246, 3.3245, 1.8549)),
    ("coop/scenario_1", "error"): Published(3.15, 1.07, (4.0286, 1.8226, 4.0330, 1.8549, 4.0292)),
    ("coop/scenario_2", "none"): Published(3.90, 0.01, (3.9105, 3.9156, 3.8966, 3.8785, 3.9165)),
    ("coop/scenario_2", "cooperation"): Published(4.42, 0.00, (4.4243, 4.4243, 4.4243, 4.4243, 4.4245)),
    ("coop/scenario_2", "latency"): Published(3.50, 0.01, (3.5012, 3.4880, 3.5024, 3.5010, 3.5052)),
    ("coop/scenario_2", "error"): Published(4.32, 0.21, (4.4409, 4.4243, 3.9156, 4.4243, 4.4243)),
}


def run_settings(detector: str | None = None) -> dict[str, RunSettings]:
    """The distinct runs behind both tables, by the name of their channel; no cooperation is the same under both."""
    return {
        arm.channel(rule): RunSettings(channel=arm.channel(rule), detector=detector) for rule in RULES for arm in ARMS
    }


@dataclass(frozen=True)
class Cell:
    """One arm in one place: the minimal distance of every seed [m], and how many runs stayed free of collisions."""

    scenario: str
    arm: ExperimentArm
    seeds: tuple[int, ...]
    centers: tuple[float, ...]
    boxes: tuple[float, ...]
    collision_free: Proportion
    published: Published

    @property
    def center(self) -> Summary:
        """Between the centers of the two cars: the paper's metric."""
        return summarize(self.centers)

    @property
    def box(self) -> Summary:
        """Between the bodies: 0 where they touch."""
        return summarize(self.boxes)


@dataclass(frozen=True)
class Table:
    """The table under one rule; cells in the order of SCENARIOS, then ARMS."""

    rule: ModelVariant
    cells: tuple[Cell, ...]

    def cell(self, scenario: str, arm: str) -> Cell:
        """The cell of that arm. Raise KeyError if there is none."""
        for cell in self.cells:
            if cell.scenario == scenario and cell.arm.name == arm:
                return cell
        raise KeyError(f"no cell for {arm!r} in {scenario!r}")

    @property
    def scenarios(self) -> tuple[str, ...]:
        """The places of this table, in order."""
        return tuple(dict.fromkeys(cell.scenario for cell in self.cells))


def tabulate(runs: Sequence[tuple[Job, RunResult]], rule: ModelVariant) -> Table:
    """The table under one rule. Raise SimulationError where a run lacks one of the metrics."""
    cells = []
    for scenario in dict.fromkeys(job.scenario for job, _ in runs):
        for arm in ARMS:
            name = arm.channel(rule)
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
                    published=PUBLISHED[scenario, arm.name],
                )
            )
    return Table(rule, tuple(cells))


def _metric(result: RunResult, name: str) -> float:
    try:
        return float(result.metrics[name])
    except KeyError:
        raise SimulationError(
            f"{result.scenario} with seed {result.seed} measured no {name}; "
            "its file needs the criteria collision and min_distance"
        ) from None


@dataclass(frozen=True)
class PublishedClaim:
    """One statement about the order of the arms, and whether these runs bear it out."""

    scenario: str
    statement: str
    holds: bool
    evidence: str


def evaluate_claims(table: Table) -> tuple[PublishedClaim, ...]:
    """The order that the paper found, in each place."""
    found = []
    for scenario in table.scenarios:
        none, cooperation, latency, error = (table.cell(scenario, arm.name) for arm in ARMS)
        found.append(_order(scenario, "cooperation > none", none, cooperation))
        found.append(_order(scenario, "latency < cooperation", latency, cooperation))
        found.append(_mixture(scenario, latency, error, cooperation))
    return tuple(found)


def _order(scenario: str, statement: str, smaller: Cell, larger: Cell) -> PublishedClaim:
    difference = _paired(smaller, larger)
    evidence = (
        f"{larger.arm.name} {larger.center.mean:.2f} m, {smaller.arm.name} {smaller.center.mean:.2f} m; "
        f"difference per seed {difference.mean:+.2f} m, 95 % interval [{difference.low:+.2f}, {difference.high:+.2f}]"
    )
    return PublishedClaim(scenario, statement, difference.mean > 0, evidence)


def _mixture(scenario: str, latency: Cell, error: Cell, cooperation: Cell) -> PublishedClaim:
    """Lost frames leave some runs as good as cooperation and spoil others."""
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
        raise ValueError(f"{first.arm.name} and {second.arm.name} were not run with the same seeds")
    return paired_difference(first.centers, second.centers)


NOTEWORTHY = 0.05
"""A change of a mean minimal distance that the sentence names [m]."""


def difference(links: Table, own: Table) -> str:
    """One sentence on what delaying and dropping the ego's own detections changes, read off the two tables.

    Latency counts as worse than no cooperation where the 95 % interval of the paired difference lies below zero.
    """
    shifts, smaller, worse = [], 0.0, {LINKS.name: 0, OWN.name: 0}
    for scenario in links.scenarios:
        place = SCENARIOS.get(scenario, scenario).split(",")[0].lower()
        for arm in ARMS[1:]:
            before, after = links.cell(scenario, arm.name), own.cell(scenario, arm.name)
            change = after.center.mean - before.center.mean
            if abs(change) < NOTEWORTHY and before.collision_free == after.collision_free:
                smaller = max(smaller, abs(change))
                continue
            shifts.append(
                f"{place} {arm.title} {before.center.mean:.2f} → {after.center.mean:.2f} m, collision-free "
                f"{before.collision_free.successes} → {after.collision_free.successes} of {len(after.seeds)}"
            )
        for table in (links, own):
            latency, none = table.cell(scenario, "latency"), table.cell(scenario, "none")
            worse[table.rule.name] += _paired(none, latency).high < 0
    total = len(links.scenarios)
    what = "; ".join(shifts) if shifts else "nothing"
    rest = f" (the other means by {smaller:.2f} m at most)" if shifts else f" (means by {smaller:.2f} m at most)"
    return (
        f"Delaying and dropping the ego's own detections as well changes {what}{rest}; latency is worse than no "
        f"cooperation in {worse[OWN.name]} of {total} places under that rule, and in {worse[LINKS.name]} of {total} "
        "where the channel acts on links only."
    )
