"""Table II: minimum distance between the ego and an occluded car in scenarios 1 and 2.

The cells of the paper are those of four arms and two detectors in two scenarios. Each is run with both rules for the
channel and with two planners: the paper's, which brakes while an object is in the conflict area, and `behavior`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

from eidrive_reports.paper import ARMS, SCENARIOS, TABLE_2, VARIANTS, ExperimentArm, ModelVariant
from eidrive_reports.reproduction.encounters import (
    CRITERIA,
    DISTANCE_COLUMNS,
    GAP_COLUMNS,
    centers,
    encounter_fields,
)
from eidrive_reports.reproduction.episodes import Episode
from eidrive_reports.reproduction.layout import (
    REASON,
    Column,
    DataTable,
    PartReport,
    Row,
    Section,
    Value,
    finite,
    plain,
    result_sections,
)
from eidrive_reports.reproduction.part import Case, Part, select
from eidrive_scenario.api.experiments import PairedDifference, paired_difference, paired_spread
from eidrive_scenario.api.run import RunSettings

PAPERS_PLANNER = "conflict_area"
"""Planner with the rule of the paper."""
AIM = 0.6
"""Mean absolute difference to the paper's means that counts as agreement [m]."""


def setup(episodes: int) -> tuple[str, ...]:
    """Return the paragraphs about the runs: what is from the paper, what was free, and how seeds differ."""
    return (
        f"Scenarios 1 and 2, {episodes} episodes a cell with seeds from 1. Positions, speeds, areas and the rule of "
        "the ego are those of EI-Drive; the latency is 0.3 s, the loss 30 %. The metric of the paper is the minimum "
        "distance between the centers of the two cars, which remains above 0 in a crash: 3.4 m for a square hit. "
        "The gap between the bodies, the speed of impact and the minimum time to collision stand beside it. An episode "
        "ends after 5.5 s, half a second after the cars were nearest, because nothing that is measured changes later.",
        "Free parameters: the acceleration of both cars (3.5 m/s²; the paper does not specify that of CARLA's cars) "
        "and, one per scenario, the start of the hidden car: the largest distance in steps of half a meter from which "
        "cooperation avoids the crash with the oracle in seeds 1 to 20. They are equal in all cells; none was chosen "
        "to match a distance of the paper. That cooperation avoids the crash with the oracle and the rule of the paper "
        "is therefore a condition of the set-up; the other arms, YOLOv5 and the planner `behavior` are results.",
        "Seeds vary the starts of both cars by ±0.15 m and their speeds by ±0.1 m/s.",
        "`links`: the channel acts on messages between stations, as the text of the paper says. `own_perception`: it "
        "also delays and drops the detections of the ego itself, as the published code does.",
        "The code that the paper's numbers come from runs at 0.03 s per step and converts the latency with 0.05 s, so "
        "that its 0.3 s are 0.18 s of simulated time; here they are 0.3 s.",
    )


SUMMARY_COLUMNS = (
    plain("planner", "planner"),
    plain("channel", "channel"),
    plain("statement", "statement"),
    Column("holds", "{holds} of {columns}", ("holds", "columns")),
    Column("95 % interval above 0", "{certain} of {columns}", ("certain", "columns")),
    Column("paper", "{paper} of {columns}", ("paper", "columns")),
)

REASONS = {
    "none > latency": (
        "With a channel that acts on links only, latency can cost the ego what it gains by cooperation, but not more: "
        "it brakes for what it detects as without cooperation. An order below that of no cooperation needs a delay "
        "of the ego's detections, too, and time to brake for them, which scenario 1 does not leave."
    ),
    "none > error": (
        "A loss of single frames delays the start of braking by few time steps (by k with probability 0.3^k), and the "
        "rule holds the brake for 1.05 s after the last detection. In the paper's episodes two of five of scenario 1 "
        "with the oracle end at 1.8 m; one of these values is also one of its episodes with latency."
    ),
    "sd of error > cooperation": (
        "The loss of single frames changes the outcome only if it delays the start of braking, so that most episodes "
        "equal those without loss; the paper's larger spread comes from one or two of its five episodes."
    ),
}
"""Likely reasons of departures from the paper, by statement."""


def summary(compared: Sequence[Row]) -> tuple[Row, ...]:
    """Return in how many columns each statement holds, by planner and rule for the channel, and in the paper."""
    rows: list[Row] = []
    for planner, channel in dict.fromkeys(_settings_of(row) for row in compared):
        mine = [row for row in compared if _settings_of(row) == (planner, channel)]
        for statement in dict.fromkeys(str(row["statement"]) for row in mine):
            some = [row for row in mine if row["statement"] == statement]
            rows.append(
                {
                    "planner": planner,
                    "channel": channel,
                    "statement": statement,
                    "columns": len(some),
                    "holds": sum(bool(row["holds"]) for row in some),
                    "certain": sum(bool(row["certain"]) for row in some),
                    "paper": sum(float(row["paper_difference"] or 0.0) > 0.0 for row in some),
                }
            )
    return tuple(rows)


def conclusions(rows: Sequence[Row], compared: Sequence[Row]) -> tuple[str, ...]:
    """Return the paragraphs about what agrees with the paper and what does not."""
    return (*_agreement(compared), *_means(rows), _spread(rows), _collisions(rows))


def _settings_of(row: Row) -> tuple[str, str]:
    return str(row["planner"]), str(row["channel"])


def _agreement(compared: Sequence[Row]) -> tuple[str, ...]:
    """Return the statements whose sign differs from the paper's with the planner of the paper, and likely reasons."""
    with_rule = [row for row in compared if row["planner"] == PAPERS_PLANNER]
    apart = [row for row in with_rule if (float(row["paper_difference"] or 0.0) > 0.0) != bool(row["holds"])]
    agree = len(with_rule) - len(apart)
    signs = f"With the planner of the paper, {agree} of {len(with_rule)} comparisons have the sign of the paper."
    if not apart:
        return (signs,)
    listed = "; ".join(
        f"{row['statement']} in {_column(row)} and `{row['channel']}` ({row['difference']:+.2f} m, paper "
        f"{row['paper_difference']:+.2f} m)"
        for row in apart
    )
    statements = dict.fromkeys(str(row["statement"]) for row in apart)
    reasons = [f"{REASON} ({name}): {REASONS[name]}" for name in statements if name in REASONS]
    return (f"{signs} The others are: {listed}.", *reasons)


def _column(row: Row) -> str:
    return f"{str(row['scenario']).removeprefix('coop/').replace('_', ' ')} with {row['detector']}"


def _means(rows: Sequence[Row]) -> tuple[str, ...]:
    texts = []
    for planner, channel in dict.fromkeys(_settings_of(row) for row in rows):
        mine = [row for row in rows if _settings_of(row) == (planner, channel)]
        differences = [float(row["difference"] or 0.0) for row in mine]
        mean = sum(map(abs, differences)) / len(differences)
        farthest = max(mine, key=lambda row: abs(float(row["difference"] or 0.0)))
        texts.append(
            f"`{planner}`, `{channel}`: {mean:.2f} m from the {len(mine)} means of the paper on average "
            f"({'within' if mean <= AIM else 'beyond'} {AIM} m); farthest is {_column(farthest)} "
            f"and {farthest['arm']}: {farthest['mean']:.2f} m against "
            f"{farthest['paper_mean']:.2f} m"
        )
    return (f"Mean absolute difference to the paper's means. {'; '.join(texts)}.", *_crashes(rows))


def _crashes(rows: Sequence[Row]) -> tuple[str, ...]:
    """Return a likely reason of the differences of the means, if there are runs with a crash."""
    least = [float(row["crash_least"]) for row in rows if row["crash_least"] is not None]
    if not least:
        return ()
    return (
        f"{REASON} (differences of the means): the minimum of a run with a crash depends on the motion after the "
        "hit. Episodes of the paper with 1.8 to 2.0 m have the distance of two cars of 1.84 m width side by side, as "
        f"if they turned parallel after the hit. Here the least distance of a run with a crash is {min(least):.2f} m.",
    )


def _spread(rows: Sequence[Row]) -> str:
    """Return the mean standard deviation of the cells without latency and loss: how much the seeds differ."""
    mine = [row for row in rows if row["planner"] == PAPERS_PLANNER and row["arm"] in ("none", "cooperation")]
    ours, paper = (sum(float(row[name] or 0.0) for row in mine) / len(mine) for name in ("sd", "paper_sd"))
    return (
        f"Standard deviation in the cells without latency and loss, with the planner of the paper: {ours:.3f} m on "
        f"average, in the paper {paper:.3f} m."
    )


def _collisions(rows: Sequence[Row]) -> str:
    texts = []
    for planner, channel in dict.fromkeys(_settings_of(row) for row in rows):
        counts = []
        for arm in dict.fromkeys(str(row["arm"]) for row in rows):
            mine = [row for row in rows if (*_settings_of(row), row["arm"]) == (planner, channel, arm)]
            hits, runs = (sum(int(row[name] or 0) for row in mine) for name in ("collisions", "episodes"))
            counts.append(f"{arm} {hits} of {runs}")
        texts.append(f"`{planner}`, `{channel}`: {', '.join(counts)}")
    return f"Runs with a collision, all columns together. {'; '.join(texts)}."


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
    for comparison in COMPARISONS:
        greater, smaller = by_arm[comparison.greater], by_arm[comparison.smaller]
        difference = comparison.measured(centers(smaller.episodes), centers(greater.episodes))
        paper = {
            name: TABLE_2[first.scenario, first.detector, name] for name in (comparison.greater, comparison.smaller)
        }
        means = [(value.sd if comparison.spread else value.mean) for value in paper.values()]
        yield {
            **column_fields(first.scenario, first.detector, first.planner, first.variant),
            "statement": comparison.statement,
            "difference": difference.mean,
            "low": finite(difference.low),
            "high": finite(difference.high),
            "holds": difference.mean > 0.0,
            "certain": difference.low > 0.0,
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
    order = [comparison.statement for comparison in COMPARISONS]
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
