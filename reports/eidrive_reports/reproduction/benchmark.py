"""Benchmark: success in closed loop by fusion method, channel and scenario.

A cell is a method on a channel in a scenario. Equal seeds have equal starts and speeds in all cells of a scenario, so
methods are compared by pairs.
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from functools import partial
from itertools import product
from typing import Any

from eidrive_reports.reproduction.benchmark_arms import (
    CHANNELS,
    METHODS,
    NO_COOPERATION,
    SCENARIOS,
    SILENT,
    BenchmarkChannel,
    Method,
    channel_of,
    methods_of,
    scenarios_of,
    settings_of,
)
from eidrive_reports.reproduction.episodes import BUSY, BYTES, Episode, gaps
from eidrive_reports.reproduction.layout import (
    Column,
    DataTable,
    PartReport,
    Row,
    Section,
    bounds,
    groups,
    number,
    plain,
    where,
)
from eidrive_reports.reproduction.part import Case, Part, by_case
from eidrive_scenario.api.common import Diagnostic, SettingError, registry
from eidrive_scenario.api.experiments import (
    PairedVerdicts,
    command_of,
    mean_interval,
    sha256_of,
    wilson,
)

NAME = "benchmark"
"""Name of the part."""
RANKS, CELLS = "benchmark_ranks", "benchmark_cells"
"""Names of the tables: methods by channel, and all cells."""
DETECTORS = ("pillars",)
"""Detectors without an option: what a vehicle can have, and what early fusion needs."""
CELL_FOLDER = "reports/cell"
"""Folder of the results of the command of a cell, so that it replaces no other results."""

Plan = tuple[Sequence[Method], Sequence[BenchmarkChannel], Sequence[str]]
"""Methods, channels and scenarios."""


def arm_of(method: Method, channel: BenchmarkChannel) -> str:
    """Return the name of an arm in the record."""
    return f"{method.name} {channel.name}"


def cells_of(plan: Plan) -> list[tuple[str, Method, BenchmarkChannel]]:
    """Return all cells. A method without cooperation is run once, as no channel changes it."""
    methods, channels, scenarios = plan
    return [
        (scenario, method, channel)
        for scenario, method in product(scenarios, methods)
        for channel in (channels if method.cooperates else (SILENT,))
    ]


def cases(plan: Plan) -> list[Case]:
    """Return the runs of all cells."""
    return [
        Case(scenario, arm_of(method, channel), settings_of(scenario, method, channel))
        for scenario, method, channel in cells_of(plan)
    ]


def outcome(episodes: Sequence[Episode]) -> Row:
    """Return the measured values of some runs.

    passed, share, low, high  runs that pass all criteria, their share and its Wilson interval
    collisions     runs in which the ego touches anything
    distance, distance_low, distance_high  mean of the minimum distance between the bodies of the ego and its partner
                   [m], 0 after a contact, and its interval; None without a criterion, and limits None of one run
    bytes_per_s    mean of the bytes per second of messages that another station uses, lost ones included
    busy           mean of the largest channel busy ratio of the stations; None if the channel has none
    """
    passed = sum(episode.passed is True for episode in episodes)
    share = wilson(passed, len(episodes))
    nearest = [min(distances) for episode in episodes if (distances := gaps(episode))]
    interval = mean_interval(nearest) if nearest else None
    ends = bounds(interval)
    busy = [episode.metrics[BUSY] for episode in episodes if BUSY in episode.metrics]
    rates = [episode.metrics[BYTES] / episode.simulated_s for episode in episodes if episode.simulated_s > 0.0]
    return {
        "runs": len(episodes),
        "passed": passed,
        "share": share.share,
        **bounds(share),
        "collisions": sum(episode.metrics.get("collision.count", 0.0) > 0.0 for episode in episodes),
        "distance": None if interval is None else interval.mean,
        "distance_low": ends["low"],
        "distance_high": ends["high"],
        "bytes_per_s": sum(rates) / len(rates) if rates else None,
        "busy": sum(busy) / len(busy) if busy else None,
    }


def trace_digest(episodes: Sequence[Episode]) -> str:
    """Return the digest of the trace hashes of runs in the order of their seeds, one hash per line."""
    hashes = [episode.trace_hash for episode in sorted(episodes, key=lambda episode: episode.seed)]
    return sha256_of("\n".join(hashes).encode())[:16]


def cell_commands(scenario: str, method: Method, channel: BenchmarkChannel, runs: Sequence[Episode]) -> dict[str, str]:
    """Return the command of a cell, and that of its first run that did not pass, or of its first run.

    Both are valid in any folder, except for paths of the user.
    """
    chosen = next((run for run in runs if run.passed is not True), runs[0])
    settings = settings_of(scenario, method, channel)
    single = command_of(scenario, chosen.seed, settings)
    words = [*shlex.split(single.partition(" run ")[0]), "reproduce", NAME, "--fusion", method.name]
    words += ["--channels", channel.name] if method.cooperates else []
    words += ["--scenarios", scenario, "--episodes", str(len(runs)), "--out", CELL_FOLDER]
    return {"command": shlex.join(words), "run": single, "run_seed": str(chosen.seed)}


def cell_rows(episodes: Sequence[Episode], plan: Plan) -> list[Row]:
    """Return the outcome of each cell with its trace digest and commands.

    Raise SettingError for a scenario without criteria: it has no success.
    """
    runs = by_case(episodes)
    rows: list[Row] = []
    for scenario, method, channel in cells_of(plan):
        mine = runs[scenario, arm_of(method, channel)]
        if any(episode.passed is None for episode in mine):
            hint = "add a command `eidrive.criterion` to the file"
            raise SettingError(Diagnostic("no criterion judges the runs", hint, scenario))
        rows.append(
            {
                "scenario": scenario,
                "method": method.name,
                "channel": channel.name,
                **outcome(mine),
                "traces": trace_digest(mine),
                **cell_commands(scenario, method, channel, mine),
            }
        )
    return rows


def rank_rows(episodes: Sequence[Episode], plan: Plan) -> list[Row]:
    """Return the outcome of each method over all scenarios, by channel and rank.

    rank  1 + number of methods with a larger share of passed runs; equal shares are in the order of bytes
    gain, gain_low, gain_high  share minus that of no cooperation with the same detector, by pairs of equal scenario and
                  seed, with the score interval of Tango; None without such runs
    """
    methods, channels, scenarios = plan
    runs = by_case(episodes)
    rows: list[Row] = []
    for channel in channels:
        mine: dict[Method, list[Episode]] = {
            method: [
                episode
                for scenario in scenarios
                for episode in runs[scenario, arm_of(method, channel if method.cooperates else SILENT)]
            ]
            for method in methods
        }
        measured: list[dict[str, Any]] = []
        for method, own in mine.items():
            alone = mine.get(Method(NO_COOPERATION, method.detector), []) if method.cooperates else []
            key = {"channel": channel.name, "channel_title": channel.title, "method": method.name}
            shared = {"rate": channel.rate, "stations": channel.stations}
            measured.append({**key, **shared, **outcome(own), **_gain(alone, own)})
        for row in measured:
            row["rank"] = 1 + sum(other["share"] > row["share"] for other in measured)
        rows += sorted(measured, key=lambda row: (row["rank"], number(row, "bytes_per_s")))
    return rows


def _gain(alone: Sequence[Episode], own: Sequence[Episode]) -> Row:
    if not alone:
        return dict.fromkeys(("gain", "gain_low", "gain_high"))
    pairs = PairedVerdicts.of([run.passed is True for run in alone], [run.passed is True for run in own])
    low, high = pairs.interval()
    return {"gain": pairs.difference, "gain_low": low, "gain_high": high}


SUCCESS = (
    Column("success", "{passed} of {runs} = {share:.0%}"),
    Column("95 %", "{low:.0%} to {high:.0%}"),
)
MEASURED = (
    plain("min. distance [m]", "distance", ".2f"),
    plain("bytes/s", "bytes_per_s", ",.0f"),
    plain("channel busy", "busy", ".0%"),
)
RANK_COLUMNS = (
    plain("channel", "channel_title"),
    *map(plain, ("rank", "method")),
    *SUCCESS,
    Column("gain, 95 %", "{gain:+.0%} ({gain_low:+.0%} to {gain_high:+.0%})"),
    *MEASURED,
)
CELL_COLUMNS = (
    *map(plain, ("scenario", "channel", "method")),
    *SUCCESS,
    plain("collisions"),
    *MEASURED,
    plain("traces"),
)


def setup(episodes: Sequence[Episode], plan: Plan) -> tuple[str, ...]:
    """Return the paragraphs about the runs."""
    methods, channels, scenarios = plan
    runs = len({episode.seed for episode in episodes})
    shared = [channel for channel in channels if channel.rate is not None]
    texts = [
        f"{len(methods)} methods, {len(channels)} channels and {len(scenarios)} scenarios, {runs} runs a cell with "
        "seeds from 1. A run succeeds if it passes all criteria of its scenario. The detector is that of all stations, "
        "after the colon. `none` uses no messages. Intervals of shares are Wilson's. Gains are differences from `none` "
        "with the same detector, by pairs of equal scenario and seed, with Tango's intervals. Methods of equal rank "
        "have equal shares.",
        "The minimum distance is that between the bodies of the ego and the vehicle or person in its way, 0 after a "
        "contact. Bytes are those of the messages that another station uses, each once, lost ones included, and "
        "channel busy is the largest channel busy ratio that a station measures. The digest in the column traces is "
        "that of the trace hashes of all seeds: equal digests stand for runs that are equal to the bit.",
    ]
    if shared:
        texts.append(
            "Shared channels are IEEE 802.11p in urban streets by 3GPP TR 37.885 with rays between the antennas. All "
            "stations transmit at 6 Mbit/s, as in ITS-G5. The stated rate is the mean rate at which one station may "
            "send: congestion control keeps it off the channel for the rest of the time. So range and packet errors "
            "are equal on all of them, and 1 Mbit/s, which is no data rate of 802.11p, has a meaning. The number of "
            "stations counts those that a station senses, with itself and one sender of the scenario. The others send "
            "300 bytes at 10 Hz by the analytic model of Sepulcre et al. (2021), and are not simulated."
        )
    return tuple(texts)


def conclusions(ranks: Sequence[Row]) -> tuple[str, ...]:
    """Return the best methods of each channel."""
    listed = [
        f"{channel}: {', '.join('`' + row['method'] + '`' for row in rows)} ({rows[0]['share']:.0%})"
        for channel, rows in groups(where(ranks, rank=1), "channel_title").items()
    ]
    return (f"Best methods by channel. {'; '.join(listed)}.",)


def report(episodes: Sequence[Episode], detectors: Sequence[str], *, plan: Plan) -> PartReport:
    """Return the report: methods by channel and rank, and all cells."""
    ranks, cells = rank_rows(episodes, plan), cell_rows(episodes, plan)
    sections = (
        Section("Set-up", setup(episodes, plan)),
        Section("Ranks", conclusions(ranks), DataTable(RANKS, RANK_COLUMNS, tuple(ranks))),
        Section("Cells", (), DataTable(CELLS, CELL_COLUMNS, tuple(cells))),
    )
    return PartReport("Benchmark: fusion methods in closed loop", sections)


def benchmark_part(
    detectors: Sequence[str],
    fusion: Sequence[str] = METHODS,
    channels: Sequence[str] = CHANNELS,
    scenarios: Sequence[str] = SCENARIOS,
) -> Part:
    """Return the part of some methods, channels and scenarios, each selected by a text of the command line.

    Raise SettingError for an unknown name.
    """
    plan: Plan = (
        methods_of(fusion, detectors or DETECTORS),
        tuple(dict.fromkeys(map(channel_of, channels))),
        scenarios_of(scenarios),
    )
    return Part(
        NAME,
        "Benchmark of fusion methods",
        "Which fusion method avoids most failures on which channel, and at how many bytes?",
        5,
        tuple(registry("detectors")),
        lambda _: cases(plan),
        partial(report, plan=plan),
        default=tuple(detectors or DETECTORS),
    )
