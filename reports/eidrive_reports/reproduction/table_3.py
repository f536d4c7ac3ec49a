"""Table III: success rates in scenarios 5 to 8 with the vehicle, the roadside units, or both as senders."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

from eidrive_reports.paper import TABLE_3
from eidrive_reports.reproduction.encounters import (
    CRITERIA,
    DISTANCE_COLUMNS,
    GAP_COLUMNS,
    collided,
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
    groups,
    plain,
    result_sections,
    scenario_title,
    where,
)
from eidrive_reports.reproduction.part import Case, Part, Runs, by_case
from eidrive_scenario.api.experiments import PairedVerdicts, resolve_scenario, wilson
from eidrive_scenario.api.run import RunSettings, load_scenario, variations

SCENARIOS = tuple(f"coop/scenario_{number}" for number in range(5, 9))
SENDERS = ("both", "rsu", "vehicle")
"""Arms of the paper, as values of the parameter Participants."""
DETECTORS = ("oracle", "yolov5")
BUS_START, BUS_OFFSET = "BusStart", "BusOffset"
"""Parameters of the scenarios: start of the bus, and its variation [m]."""
TOLERANCE = 0.10
"""Difference of two rates that counts as agreement, unless the rate of the paper is in the interval."""
COMPARISONS = (("both", "rsu", True), ("rsu", "vehicle", False))
"""Senders whose rates are compared: those with the higher rate, the others, and whether equal rates agree."""


def cases(detectors: Sequence[str]) -> list[Case]:
    """Return the runs of all cells."""
    return [
        Case(scenario, f"{detector} {senders}", _settings(detector, senders))
        for scenario, detector, senders in product(SCENARIOS, detectors, SENDERS)
    ]


def _settings(detector: str, senders: str) -> RunSettings:
    return RunSettings(detector=detector, parameters={"Participants": senders}, criteria=CRITERIA)


def cell_row(episodes: Sequence[Episode], scenario: str, detector: str, senders: str) -> Row:
    """Return the fields of a cell beside those of the paper."""
    free = sum(not collided(episode) for episode in episodes)
    rate, published = wilson(free, len(episodes)), TABLE_3[scenario, senders]
    within = abs(rate.share - published.rate) <= TOLERANCE
    return {
        "scenario": scenario,
        "detector": detector,
        "senders": senders,
        **encounter_fields(episodes),
        "free": free,
        "rate": rate.share,
        "rate_low": rate.low,
        "rate_high": rate.high,
        "paper_rate": published.rate,
        "paper_rate_sd": published.rate_sd,
        "agrees": within or rate.low <= published.rate <= rate.high,
        "paper_mean": published.distance,
        "paper_sd": published.distance_sd,
    }


def compare(runs: Runs, scenario: str, detector: str) -> Iterator[Row]:
    """Yield the comparisons of the rates of a scenario, over pairs with equal seeds."""
    for higher, lower, equal in COMPARISONS:
        free = [
            [not collided(episode) for episode in runs[scenario, f"{detector} {senders}"]]
            for senders in (lower, higher)
        ]
        verdicts = PairedVerdicts.of(*free)
        low, high = verdicts.interval()
        yield {
            "scenario": scenario,
            "detector": detector,
            "statement": f"{higher} {'>=' if equal else '>'} {lower}",
            "difference": verdicts.difference,
            "low": low,
            "high": high,
            "holds": verdicts.difference >= 0.0 if equal else verdicts.difference > 0.0,
            "paper_difference": TABLE_3[scenario, higher].rate - TABLE_3[scenario, lower].rate,
        }


CELL_COLUMNS = (
    *map(plain, ("scenario", "senders")),
    Column("success", "{free} of {episodes} = {rate:.0%}"),
    Column("95 %", "{rate_low:.0%} to {rate_high:.0%}"),
    Column("paper", "{paper_rate:.0%} ± {paper_rate_sd:.0%}"),
    *DISTANCE_COLUMNS,
    Column("paper [m]", "{paper_mean:.2f} ± {paper_sd:.2f}"),
    *GAP_COLUMNS,
)
COMPARISON_COLUMNS = (
    *map(plain, ("statement", "scenario", "detector")),
    Column("difference", "{difference:+.0%}"),
    Column("95 %", "{low:+.0%} to {high:+.0%}"),
    Column("paper", "{paper_difference:+.0%}"),
)


def report(episodes: Sequence[Episode], detectors: Sequence[str]) -> PartReport:
    """Return the report: what agrees with the paper, the cells, and the comparisons."""
    runs = by_case(episodes)
    rows = [
        cell_row(runs[scenario, f"{detector} {senders}"], scenario, detector, senders)
        for detector, scenario, senders in product(detectors, SCENARIOS, SENDERS)
    ]
    compared = [
        row for detector, scenario in product(detectors, SCENARIOS) for row in compare(runs, scenario, detector)
    ]
    sections = [
        Section("Set-up", _setup(rows)),
        *result_sections([*(_finding(rows, compared, detector) for detector in detectors), *_reasons(rows)]),
    ]
    for detector, mine in groups(rows, "detector").items():
        sections.append(Section(f"Detector `{detector}`", (), DataTable("table3", CELL_COLUMNS, tuple(mine))))
    sections.append(Section("Comparisons", (), DataTable("table3_comparisons", COMPARISON_COLUMNS, tuple(compared))))
    return PartReport(PART.title, tuple(sections))


def _setup(rows: Sequence[Row]) -> tuple[str, ...]:
    return (
        f"Scenarios 5 to 8, {rows[0]['episodes']} episodes a cell with seeds from 1, without latency and loss. A "
        "success is a run in which the ego touches nothing. Positions, speeds, areas and the rule of the ego are those "
        "of EI-Drive.",
        "Free parameters, one value per scenario and equal in its three cells: the start of the hidden car (the "
        "nearest in steps of half a meter from which the cars collide without cooperation in seeds 1 to 20), and "
        "the traffic in front of the sending vehicle. EI-Drive draws 30 cars at random, and neither their motion nor "
        "their models are recorded; here buses drive at the head of these cars: one in 5 and 6, three in 7 and "
        "8, one in each lane. Acceleration is 3.5 m/s². No value differs between the cells of a scenario.",
        f"Start of the rear axle of the bus, y in the start frame of the ego, with its uniform variation between "
        f"seeds: {'; '.join(map(_bus_start, SCENARIOS))}. In 7 and 8 it is the middle of the values from which the "
        "buses hide the car from the sending vehicle in all of seeds 1 to 10. In 5 and 6 start and variation decide "
        f"in how many runs the vehicle sees the car in time: with the vehicle alone, {_misses(rows)} runs end in a "
        "collision. So the rates of the vehicle alone follow from the choice of the traffic: with "
        "one bus in 7 and 8, too, they are 10 % and 30 %, and with cars but no bus, at rest at first in and "
        "around EI-Drive's area of traffic, 80 % to 100 % (10 seeds, oracle).",
        "The paper does not state the number of its episodes; its rates fit three batches of 10 to 20 each. It does "
        "not state the detector either: its published configuration selects YOLOv5.",
    )


def _bus_start(scenario: str) -> str:
    """Return start and variation of the bus of a scenario, as its file specifies them."""
    specified = load_scenario(resolve_scenario(scenario))
    low, high = variations(specified)[BUS_OFFSET].uniform or (0.0, 0.0)
    return f"{scenario_title(scenario)} {float(specified.parameters[BUS_START]):g} m, {low:+g} to {high:+g} m"


def _misses(rows: Sequence[Row]) -> str:
    """Return the numbers of collisions with the vehicle as the only sender in the scenarios with one bus."""
    alone = [row for row in where(rows, senders="vehicle") if row["scenario"] in SCENARIOS[:2]]
    return " and ".join(f"{row['collisions']} of {row['episodes']} ({_label(row)}, {row['detector']})" for row in alone)


def _finding(rows: Sequence[Row], compared: Sequence[Row], detector: str) -> str:
    mine = where(rows, detector=detector)
    apart = "; ".join(
        f"{_label(row)}, {row['senders']}: {row['rate']:.0%} against {row['paper_rate']:.0%}"
        for row in where(mine, agrees=False)
    )
    orders = [
        f"{statement} in {len(where(some, holds=True))} of {len(some)} scenarios"
        for statement, some in groups(where(compared, detector=detector), "statement").items()
    ]
    agree = len(where(mine, agrees=True))
    return (
        f"`{detector}`: {agree} of {len(mine)} rates are within {100 * TOLERANCE:.0f} points of the paper's, or have "
        "it in their interval" + (f"; the others are {apart}" if apart else "") + f". {' and '.join(orders)}."
    )


def _reasons(rows: Sequence[Row]) -> tuple[str, ...]:
    """Return likely reasons of the departures that these rows have."""
    apart = {row["senders"] for row in where(rows, agrees=False)}
    texts = []
    if apart & {"both", "rsu"}:
        texts.append(
            f"{REASON} (roadside units): the units of 5 m height see over the traffic in every run, and the "
            "oracle misses nothing in their sight. The paper's failures with them, up to a fifth of the runs in "
            "scenario 6, need detections that are missed, or a collision with other traffic."
        )
    if "vehicle" in apart:
        texts.append(
            f"{REASON} (vehicle): its rate is the share of runs in which the traffic leaves a gap, so that "
            "it depends on the unknown motion of the paper's traffic more than on perception."
        )
    return tuple(texts)


def _label(row: Row) -> str:
    return str(row["scenario"]).removeprefix("coop/")


PART = Part(
    "table3",
    "Table III: success rates in heavy traffic",
    (
        "In heavy traffic, how often does cooperation with a vehicle, with roadside units, or with both avoid "
        "the collision?"
    ),
    40,
    DETECTORS,
    cases,
    report,
    default=DETECTORS[:1],
    has_replays=True,
)
