"""Table II: minimum distance between the ego and an occluded car in scenarios 1 and 2.

The cells of the paper are those of four arms and two detectors in two scenarios. Each is run with both rules for the
channel and with two planners: the paper's, which brakes while an object is in the conflict area, and `behavior`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

from eidrive_scenario.experiments.paper import ARMS, SCENARIOS, VARIANTS, ExperimentArm, ModelVariant
from eidrive_scenario.experiments.published import TABLE_2
from eidrive_scenario.experiments.reproduction.encounters import (
    CRITERIA,
    DISTANCE_COLUMNS,
    GAP_COLUMNS,
    centers,
    encounter_fields,
)
from eidrive_scenario.experiments.reproduction.episodes import Episode
from eidrive_scenario.experiments.reproduction.layout import (
    Column,
    DataTable,
    PartReport,
    Row,
    Section,
    Value,
    plain,
    result_sections,
)
from eidrive_scenario.experiments.reproduction.part import Case, Part, select
from eidrive_scenario.experiments.reproduction.rows import finite
from eidrive_scenario.experiments.reproduction.table_2_text import SUMMARY_COLUMNS, conclusions, setup, summary
from eidrive_scenario.experiments.statistics.paired import PairedDifference, paired_difference, paired_spread
from eidrive_scenario.simulation import RunSettings

PLANNERS = ("conflict_area", "behavior")
"""The rule of the paper, and the default planner of this project."""
DETECTORS = ("oracle", "yolov5")
DURATION = 5.5
"""End of an episode [s]. The cars are nearest before 5 s; afterwards they move away from each other."""


@dataclass(frozen=True)
class Comparison:
    """Comparison of two arms: of the means, or of the standard deviations."""

    greater: str
    smaller: str
    spread: bool = False

    @property
    def statement(self) -> str:
        """The statement that the comparison examines."""
        return f"{'sd of ' if self.spread else ''}{self.greater} > {self.smaller}"

    def measured(self, smaller: Sequence[float], greater: Sequence[float]) -> PairedDifference:
        """Return the difference of pairs with equal seeds [m]."""
        return (paired_spread if self.spread else paired_difference)(smaller, greater)


COMPARISONS = (
    Comparison("cooperation", "none"),
    Comparison("cooperation", "latency"),
    Comparison("error", "cooperation", spread=True),
    Comparison("none", "latency"),
    Comparison("none", "error"),
)


def cases(detectors: Sequence[str]) -> list[Case]:
    """Return the distinct runs of all cells. No cooperation is equal under both rules for the channel."""
    channels = dict.fromkeys(arm.channel(variant) for variant in VARIANTS for arm in ARMS)
    return [
        Case(scenario, _arm(detector, planner, channel), _settings(detector, planner, channel))
        for scenario, detector, planner, channel in product(SCENARIOS, detectors, PLANNERS, channels)
    ]


def _arm(detector: str, planner: str, channel: str) -> str:
    return f"{detector} {planner} {channel}"


def _settings(detector: str, planner: str, channel: str) -> RunSettings:
    return RunSettings(channel=channel, detector=detector, planner=planner, criteria=CRITERIA, time_limit=DURATION)


@dataclass(frozen=True)
class Cell:
    """Cell of the table with its episodes, ordered by seed."""

    scenario: str
    detector: str
    planner: str
    variant: ModelVariant
    arm: ExperimentArm
    episodes: tuple[Episode, ...]

    def row(self) -> dict[str, Value]:
        """Return the fields of the cell beside those of the paper."""
        published = TABLE_2[self.scenario, self.detector, self.arm.name]
        fields = encounter_fields(self.episodes)
        return {
            **column_fields(self.scenario, self.detector, self.planner, self.variant),
            "arm": self.arm.name,
            **fields,
            "paper_mean": published.mean,
            "paper_sd": published.sd,
            "difference": float(fields["mean"] or 0.0) - published.mean,
        }


def column_fields(scenario: str, detector: str, planner: str, variant: ModelVariant) -> dict[str, Value]:
    """Return the fields that identify a column of the paper under a planner and a rule for the channel."""
    return {"scenario": scenario, "detector": detector, "planner": planner, "channel": variant.name}


def cells_of(episodes: Sequence[Episode], detectors: Sequence[str]) -> Iterator[tuple[Cell, ...]]:
    """Yield the cells of each column in the order of the arms."""
    for planner, variant, scenario, detector in product(PLANNERS, VARIANTS, SCENARIOS, detectors):
        yield tuple(
            Cell(
                scenario,
                detector,
                planner,
                variant,
                arm,
                tuple(select(episodes, scenario, _arm(detector, planner, arm.channel(variant)))),
            )
            for arm in ARMS
        )


def compare(column: Sequence[Cell]) -> Iterator[dict[str, Value]]:
    """Yield the comparisons of the arms of a column, with the difference that the paper has."""
    by_arm = {cell.arm.name: cell for cell in column}
    first = column[0]
    for one in COMPARISONS:
        greater, smaller = by_arm[one.greater], by_arm[one.smaller]
        found = one.measured(centers(smaller.episodes), centers(greater.episodes))
        paper = {name: TABLE_2[first.scenario, first.detector, name] for name in (one.greater, one.smaller)}
        means = [(value.sd if one.spread else value.mean) for value in paper.values()]
        yield {
            **column_fields(first.scenario, first.detector, first.planner, first.variant),
            "statement": one.statement,
            "difference": found.mean,
            "low": finite(found.low),
            "high": finite(found.high),
            "holds": found.mean > 0.0,
            "certain": found.low > 0.0,
            "paper_difference": means[0] - means[1],
        }


CELL_COLUMNS = (
    plain("scenario", "scenario"),
    plain("detector", "detector"),
    plain("arm", "arm"),
    *DISTANCE_COLUMNS,
    Column("paper [m]", "{paper_mean:.2f} ± {paper_sd:.2f}", ("paper_mean", "paper_sd")),
    Column(
        "collisions",
        "{collisions} of {episodes} ({collision_low:.2f} to {collision_high:.2f})",
        ("collisions", "episodes", "collision_low", "collision_high"),
    ),
    *GAP_COLUMNS,
)
COMPARISON_COLUMNS = (
    plain("statement", "statement"),
    plain("scenario", "scenario"),
    plain("detector", "detector"),
    plain("planner", "planner"),
    plain("channel", "channel"),
    Column("difference [m]", "{difference:+.2f}", ("difference",)),
    Column("95 %", "{low:+.2f} to {high:+.2f}", ("low", "high")),
    Column("paper [m]", "{paper_difference:+.2f}", ("paper_difference",)),
)


def report(episodes: Sequence[Episode], detectors: Sequence[str]) -> PartReport:
    """Return the report: what agrees with the paper, the cells, and the comparisons."""
    columns = list(cells_of(episodes, detectors))
    rows = tuple(cell.row() for column in columns for cell in column)
    order = [one.statement for one in COMPARISONS]
    compared = [row for column in columns for row in compare(column)]
    compared.sort(key=lambda row: order.index(str(row["statement"])))
    sections = [
        Section("Set-up", setup(len(columns[0][0].episodes))),
        *result_sections(conclusions(rows, compared), DataTable("table2_summary", SUMMARY_COLUMNS, summary(compared))),
    ]
    for planner, variant in product(PLANNERS, VARIANTS):
        sections.append(Section(f"Planner `{planner}`, {variant.title}", (), _table(rows, planner, variant)))
    sections.append(Section("Comparisons", (), DataTable("table2_comparisons", COMPARISON_COLUMNS, tuple(compared))))
    return PartReport(PART.title, tuple(sections))


def _table(rows: Sequence[Row], planner: str, variant: ModelVariant) -> DataTable:
    mine = tuple(row for row in rows if (row["planner"], row["channel"]) == (planner, variant.name))
    return DataTable("table2", CELL_COLUMNS, mine)


PART = Part(
    "table2",
    "Table II: minimum distance to an occluded car",
    (
        "Does a car avoid a collision with a car that a parked truck hides, if a roadside unit (scenario 1) "
        "or a vehicle (scenario 2) sends what it detects? What do latency and loss of the messages change?"
    ),
    20,
    DETECTORS,
    DETECTORS,
    cases,
    report,
    has_replays=True,
)
