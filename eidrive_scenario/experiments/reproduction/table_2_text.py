"""Texts of the report on Table II, from its numbers."""

from __future__ import annotations

from collections.abc import Sequence

from eidrive_scenario.experiments.reproduction.layout import REASON, Column, Row, plain

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
