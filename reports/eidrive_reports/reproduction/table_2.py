"""Table II: minimum distance between the ego and an occluded car in scenarios 1 and 2.

The cells of the paper are those of four arms and two detectors in two scenarios. Each is run with both rules for the
channel and with two planners: the paper's, which brakes while an object is in the conflict area, and `behavior`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

from eidrive_reports.paper import ARMS, SCENARIOS, TABLE_2, VARIANTS, ModelVariant
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
    bounds,
    groups,
    plain,
    result_sections,
    scenario_title,
    where,
)
from eidrive_reports.reproduction.part import Case, Part, Runs, by_case
from eidrive_scenario.api.experiments import paired_difference, paired_spread
from eidrive_scenario.api.run import RunSettings

PAPERS_PLANNER = "conflict_area"
"""Planner with the rule of the paper."""
STACK = ("planner", "channel")
"""Fields of the planner and the rule for the channel, under each of which the table is repeated."""
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
    *map(plain, ("planner", "channel", "statement")),
    Column("holds", "{holds} of {columns}"),
    Column("95 % interval above 0", "{certain} of {columns}"),
    Column("paper", "{paper} of {columns}"),
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
    return tuple(
        {
            "planner": planner,
            "channel": channel,
            "statement": statement,
            "columns": len(some),
            "holds": len(where(some, holds=True)),
            "certain": len(where(some, certain=True)),
            "paper": sum(row["paper_difference"] > 0.0 for row in some),
        }
        for (planner, channel), mine in groups(compared, *STACK).items()
        for statement, some in groups(mine, "statement").items()
    )


def conclusions(rows: Sequence[Row], compared: Sequence[Row]) -> tuple[str, ...]:
    """Return the paragraphs about what agrees with the paper and what does not."""
    return (*_agreement(compared), *_means(rows), _spread(rows), _collisions(rows))


def _agreement(compared: Sequence[Row]) -> tuple[str, ...]:
    """Return the statements whose sign differs from the paper's with the planner of the paper, and likely reasons."""
    with_rule = where(compared, planner=PAPERS_PLANNER)
    apart = [row for row in with_rule if (row["paper_difference"] > 0.0) != row["holds"]]
    agree = len(with_rule) - len(apart)
    signs = f"With the planner of the paper, {agree} of {len(with_rule)} comparisons have the sign of the paper."
    if not apart:
        return (signs,)
    listed = "; ".join(
        f"{row['statement']} in {_column(row)} and `{row['channel']}` ({row['difference']:+.2f} m, paper "
        f"{row['paper_difference']:+.2f} m)"
        for row in apart
    )
    reasons = [f"{REASON} ({name}): {REASONS[name]}" for name in groups(apart, "statement") if name in REASONS]
    return (f"{signs} The others are: {listed}.", *reasons)


def _column(row: Row) -> str:
    return f"{scenario_title(row['scenario'])} with {row['detector']}"


def _means(rows: Sequence[Row]) -> tuple[str, ...]:
    texts = []
    for (planner, channel), mine in groups(rows, *STACK).items():
        mean = sum(abs(row["difference"]) for row in mine) / len(mine)
        farthest = max(mine, key=lambda row: abs(row["difference"]))
        texts.append(
            f"`{planner}`, `{channel}`: {mean:.2f} m from the {len(mine)} means of the paper on average "
            f"({'within' if mean <= AIM else 'beyond'} {AIM} m); farthest is {_column(farthest)} "
            f"and {farthest['arm']}: {farthest['mean']:.2f} m against {farthest['paper_mean']:.2f} m"
        )
    return (f"Mean absolute difference to the paper's means. {'; '.join(texts)}.", *_crashes(rows))


def _crashes(rows: Sequence[Row]) -> tuple[str, ...]:
    """Return a likely reason of the differences of the means, if there are runs with a crash."""
    least = [row["crash_least"] for row in rows if row["crash_least"] is not None]
    if not least:
        return ()
    return (
        f"{REASON} (differences of the means): the minimum of a run with a crash depends on the motion after the "
        "hit. Episodes of the paper with 1.8 to 2.0 m have the distance of two cars of 1.84 m width side by side, as "
        f"if they turned parallel after the hit. Here the least distance of a run with a crash is {min(least):.2f} m.",
    )


def _spread(rows: Sequence[Row]) -> str:
    """Return the mean standard deviation of the cells without latency and loss: how much the seeds differ."""
    mine = [row for row in where(rows, planner=PAPERS_PLANNER) if row["arm"] in ("none", "cooperation")]
    ours, paper = (sum(row[name] for row in mine) / len(mine) for name in ("sd", "paper_sd"))
    return (
        f"Standard deviation in the cells without latency and loss, with the planner of the paper: {ours:.3f} m on "
        f"average, in the paper {paper:.3f} m."
    )


def _collisions(rows: Sequence[Row]) -> str:
    texts = []
    for (planner, channel), mine in groups(rows, *STACK).items():
        counts = []
        for arm, some in groups(mine, "arm").items():
            hits, runs = (sum(row[name] for row in some) for name in ("collisions", "episodes"))
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


def column_rows(
    runs: Runs, planner: str, variant: ModelVariant, scenario: str, detector: str
) -> tuple[list[Row], list[Row]]:
    """Return the cells of a column of the paper under a planner and a rule for the channel, and the comparisons of its
    arms, each beside the values of the paper."""
    column = {"scenario": scenario, "detector": detector, "planner": planner, "channel": variant.name}
    episodes = {arm.name: runs[scenario, _arm(detector, planner, arm.channel(variant))] for arm in ARMS}
    cells, comparisons = list[Row](), list[Row]()
    for arm, mine in episodes.items():
        published, fields = TABLE_2[scenario, detector, arm], encounter_fields(mine)
        paper = {"paper_mean": published.mean, "paper_sd": published.sd}
        cells.append({**column, "arm": arm, **fields, **paper, "difference": fields["mean"] - published.mean})
    for comparison in COMPARISONS:
        arms = (comparison.smaller, comparison.greater)
        compare = paired_spread if comparison.spread else paired_difference
        difference = compare(*(centers(episodes[arm]) for arm in arms))
        smaller, greater = (TABLE_2[scenario, detector, arm] for arm in arms)
        comparisons.append(
            {
                **column,
                "statement": comparison.statement,
                "difference": difference.mean,
                **bounds(difference),
                "holds": difference.mean > 0.0,
                "certain": difference.low > 0.0,
                "paper_difference": greater.sd - smaller.sd if comparison.spread else greater.mean - smaller.mean,
            }
        )
    return cells, comparisons


CELL_COLUMNS = (
    *map(plain, ("scenario", "detector", "arm")),
    *DISTANCE_COLUMNS,
    Column("paper [m]", "{paper_mean:.2f} ± {paper_sd:.2f}"),
    Column("collisions", "{collisions} of {episodes} ({collision_low:.2f} to {collision_high:.2f})"),
    *GAP_COLUMNS,
)
COMPARISON_COLUMNS = (
    *map(plain, ("statement", "scenario", "detector", "planner", "channel")),
    Column("difference [m]", "{difference:+.2f}"),
    Column("95 %", "{low:+.2f} to {high:+.2f}"),
    Column("paper [m]", "{paper_difference:+.2f}"),
)


def report(episodes: Sequence[Episode], detectors: Sequence[str]) -> PartReport:
    """Return the report: what agrees with the paper, the cells, and the comparisons."""
    runs = by_case(episodes)
    columns = [column_rows(runs, *key) for key in product(PLANNERS, VARIANTS, SCENARIOS, detectors)]
    rows = [row for cells, _ in columns for row in cells]
    order = [comparison.statement for comparison in COMPARISONS]
    compared = [row for _, comparisons in columns for row in comparisons]
    compared.sort(key=lambda row: order.index(row["statement"]))
    sections = [
        Section("Set-up", setup(rows[0]["episodes"])),
        *result_sections(conclusions(rows, compared), DataTable("table2_summary", SUMMARY_COLUMNS, summary(compared))),
    ]
    for planner, variant in product(PLANNERS, VARIANTS):
        mine = tuple(where(rows, planner=planner, channel=variant.name))
        table = DataTable("table2", CELL_COLUMNS, mine)
        sections.append(Section(f"Planner `{planner}`, {variant.title}", (), table))
    sections.append(Section("Comparisons", (), DataTable("table2_comparisons", COMPARISON_COLUMNS, tuple(compared))))
    return PartReport(PART.title, tuple(sections))


PART = Part(
    "table2",
    "Table II: minimum distance to an occluded car",
    (
        "Does a car avoid a collision with a car that a parked truck hides, if a roadside unit (scenario 1) "
        "or a vehicle (scenario 2) sends what it detects? What do latency and loss of the messages change?"
    ),
    20,
    DETECTORS,
    cases,
    report,
    has_replays=True,
)
