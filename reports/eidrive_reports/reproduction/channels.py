"""Success over latency, loss and load of the channel in scenarios 1 and 5, which the paper lacks.

The channel acts on links only. Success is a run without a collision, as in Table III. Starts and speeds vary between
seeds as in the tables of the paper.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise, product
from statistics import median
from typing import Any

from eidrive_reports.paper import EGO
from eidrive_reports.reproduction.encounters import collided
from eidrive_reports.reproduction.episodes import Episode
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
    scenario_title,
    where,
)
from eidrive_reports.reproduction.part import Case, Part, by_case
from eidrive_reports.reproduction.sensitivity import delay
from eidrive_scenario.api.experiments import wilson
from eidrive_scenario.api.run import RunSettings


def setup(runs: Mapping[tuple[str, str], int], loaded: int) -> tuple[str, ...]:
    """Return the paragraphs about the runs.

    runs    runs per arm by scenario and planner;  loaded  runs per arm with added stations
    """
    listed = "; ".join(
        f"{scenario_title(scenario)}, `{planner}`: {count}" for (scenario, planner), count in runs.items()
    )
    return (
        f"Success is a run without a collision. Runs per arm: {listed}. The channel acts on links only. Starts and "
        "speeds vary between seeds as in the tables of the paper, equally in all arms.",
        "Latencies are constant. Losses are independent, or bursts of ten messages on average (Gilbert and Elliott) at "
        "the same rate. Radio by geometry is IEEE 802.11p in urban streets by 3GPP TR 37.885 with rays between the "
        "antennas; its transmission power is reduced until messages are lost. Losses then depend on distance and "
        "obstacles, and one shadowing value holds for many messages.",
        f"Load: {loaded} runs per arm of scenario 1 with `conflict_area`, with up to 198 added stations within 200 m "
        "of the crossing that send CAM at 10 Hz. The roadside unit sends at 20 Hz. All lines of sight are clear, so "
        "that losses are caused by medium access. Messages are ready at random times within 50 ms, as stations are not "
        "synchronized. With both sidelinks the reservation interval of 100 ms admits every second message of the "
        "roadside unit; the newer one replaces the older one in the queue.",
    )


def conclusions(faults: Sequence[Row], loads: Sequence[Row]) -> tuple[str, ...]:
    """Return per scenario and planner the effect of latency, loss and radio, and the effect of the load."""
    texts = []
    for (scenario, planner), mine in groups(faults, "scenario", "planner").items():
        texts.append(f"{scenario_title(scenario)}, `{planner}`. {_latency(mine)} {_bursts(mine)} {_radio(mine)}")
    return (*texts, *map(_load, groups(loads, "access").values()))


def _latency(rows: Sequence[Row]) -> str:
    (without,) = where(rows, fault="none")
    line = where(rows, fault="latency")
    before, after = min(pairwise(line), key=lambda pair: pair[1]["share"] - pair[0]["share"])
    text = (
        f"Success is {without['share']:.0%} without cooperation, {line[0]['share']:.0%} without latency and "
        f"{line[-1]['share']:.0%} at {line[-1]['value']:g} s"
    )
    if after["share"] >= before["share"]:
        return f"{text}; it nowhere decreases with the latency."
    return (
        f"{text}; the largest step is from {before['share']:.0%} at {before['value']:g} s to {after['share']:.0%} at "
        f"{after['value']:g} s."
    )


def _bursts(rows: Sequence[Row]) -> str:
    listed = [
        f"{single['value']:.0%} lost: {single['share']:.0%} and {bursty['share']:.0%}"
        for single, bursty in zip(where(rows, fault="independent"), where(rows, fault="bursty"), strict=True)
    ]
    return f"Success with independent and with bursty losses: {'; '.join(listed)}."


def _radio(rows: Sequence[Row]) -> str:
    """Return the success of the radio beside that of independent losses at the nearest share of received messages."""
    single = where(rows, fault="independent")
    listed = []
    for row in where(rows, fault="radio"):
        received = number(row, "reception")
        if received >= 0.95:
            continue
        nearest = min(single, key=lambda row: abs(number(row, "reception") - received))
        listed.append(
            f"{row['share']:.0%} with {received:.0%} received ({nearest['share']:.0%} with independent losses and "
            f"{nearest['reception']:.0%})"
        )
    if not listed:
        return "The radio receives at least 95 % of the messages at all powers."
    return f"Success of the radio by geometry: {'; '.join(listed)}."


def _load(rows: Sequence[Row]) -> str:
    first, last = rows[0], rows[-1]
    return (
        f"{first['access']}: from {first['stations']} to {last['stations']} stations the channel busy ratio rises from "
        f"{first['busy']:.0%} to {last['busy']:.0%}, the received share of the messages of the roadside unit changes "
        f"from {first['reception']:.0%} to {last['reception']:.0%}, the mean age of information from "
        f"{_age(first)} to {_age(last)}, and success from {first['share']:.0%} to {last['share']:.0%}."
    )


def _age(row: Row) -> str:
    """Return the mean age of information as text; it is infinite if most runs receive no message."""
    return "infinity" if row["age"] is None else f"{row['age']:.3f} s"


BLOCKS: Mapping[tuple[str, str], int] = {
    ("coop/scenario_1", "conflict_area"): 2,
    ("coop/scenario_1", "behavior"): 2,
    ("coop/scenario_5", "conflict_area"): 1,
}
"""Runs per episode by scenario and planner; scenario 5 has heavy traffic and takes longer."""
LOADED = ("coop/scenario_1", "conflict_area")
"""Scenario and planner of the runs with added stations."""
LATENCIES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0)
"""Constant latencies [s]."""
LOSSES = (0.1, 0.3, 0.5, 0.7, 0.8, 0.9)
"""Shares of lost messages."""
BURST = 10
"""Mean length of loss bursts [messages], as in the profile `bursty`: half a second at 20 Hz."""
POWERS = (23.0, 0.0, -4.0, -7.0, -10.0, -13.0, -16.0)
"""Transmission powers of the radio by geometry [dBm]. The least ones are far below those of products, and stand for any
loss of signal that depends on the places of the stations."""
STATIONS = (2, 25, 50, 100, 200)
"""Numbers of stations on the loaded channel, with the ego and the roadside unit."""
ACCESS: Mapping[str, Mapping[str, Any]] = {
    "802.11p": {"technology": "80211p"},
    "C-V2X Mode 4": {"technology": "cv2x_mode4", "sidelink": {"interval": 0.1, "subchannels": 4}},
    "NR-V2X Mode 2": {"technology": "nr_v2x_mode2", "nr_sidelink": {"interval": 0.1}},
}
"""Medium access of the loaded channel."""
URBAN = {"model": "radio", "path_loss": {"kind": "tr37885", "environment": "urban"}, "queue": {"discipline": "lcfs"}}
"""Settings of all radio channels."""
DURATIONS = {"coop/scenario_1": 9.0, "coop/scenario_5": 18.0}
"""End of a run by scenario [s]; the cars are nearest before 7 s and 14 s."""
DETECTORS = ("oracle",)


def losses(kind: str, share: float) -> Mapping[str, Any]:
    """Return the channel profile of a share of lost messages, `independent` or `bursty`."""
    if kind == "bursty":
        return {"model": "composed", "loss": {"kind": "gilbert_elliott", "probability": share, "burst": BURST}}
    return {"model": "composed", "loss": {"kind": "bernoulli", "probability": share}}


def radio(power: float) -> Mapping[str, Any]:
    """Return the profile of 802.11p with rays between the antennas and a transmission power [dBm]."""
    return {**URBAN, "tx_power_dbm": power}


def loaded(access: str) -> Mapping[str, Any]:
    """Return the profile of the loaded channel.

    All lines of sight are clear, so that losses are caused by medium access. Messages are ready at random times of the
    tick, because stations are not synchronized.
    """
    return {**URBAN, **ACCESS[access], "line_of_sight": "clear", "jitter": 0.05}


FAULTS: Mapping[tuple[str, float | None], str | Mapping[str, Any]] = {
    ("none", None): "none",
    **{("latency", latency): delay(latency) for latency in LATENCIES},
    **{(kind, share): losses(kind, share) for kind in ("independent", "bursty") for share in LOSSES},
    **{("radio", power): radio(power) for power in POWERS},
}
"""Channel by fault and its value, without added stations."""


def arm_of(detector: str, planner: str, fault: str, value: float | None, block: int) -> str:
    """Return the name of an arm without added stations."""
    return f"{detector} {planner} {fault if value is None else f'{fault} {value}'} {block}"


def cases(detectors: Sequence[str]) -> list[Case]:
    """Return the runs of all arms."""
    runs = []
    for detector, ((scenario, planner), blocks) in product(detectors, BLOCKS.items()):
        for ((fault, value), channel), block in product(FAULTS.items(), range(blocks)):
            name = arm_of(detector, planner, fault, value, block)
            settings = _settings(scenario, detector, planner, channel)
            runs.append(Case(scenario, name, settings, block=block, blocks=blocks))
    for detector, access, stations in product(detectors, ACCESS, STATIONS):
        settings = _settings(LOADED[0], detector, LOADED[1], loaded(access), sender="RSU")
        runs.append(Case(LOADED[0], f"{detector} {access} {stations}", settings, load=stations - 2))
    return runs


def _settings(
    scenario: str, detector: str, planner: str, channel: str | Mapping[str, Any], sender: str | None = None
) -> RunSettings:
    """Return the settings of a run, which measures the links to the ego; those of one sender also the busy ratio."""
    links = {"receiver": EGO} if sender is None else {"receiver": EGO, "sender": sender}
    criteria: dict[str, Any] = {}
    if channel != "none":
        criteria = {"age_of_information": links, "packet_reception_ratio": links}
    if sender is not None:
        criteria["channel_busy_ratio"] = {"of": EGO}
    limit = DURATIONS[scenario]
    return RunSettings(detector=detector, planner=planner, channel=channel, criteria=criteria or None, time_limit=limit)


def outcome(episodes: Sequence[Episode]) -> Row:
    """Return the measured values of an arm.

    free, share, low, high   runs without a collision, their share and its Wilson interval
    reception                mean share of messages to the ego that arrive; None without messages
    age                      median of the mean age of information of the runs [s]; None if infinite or without messages
    """
    free = sum(not collided(episode) for episode in episodes)
    collision_free = wilson(free, len(episodes))
    ratios = [episode.metrics.get("packet_reception_ratio") for episode in episodes]
    received = [ratio for ratio in ratios if ratio is not None]
    return {
        "episodes": len(episodes),
        "free": free,
        "share": collision_free.share,
        **bounds(collision_free),
        "reception": sum(received) / len(received) if received else None,
        "age": _median(episodes, "age_of_information.mean"),
    }


def _median(episodes: Sequence[Episode], name: str) -> float | None:
    """Return the median of a metric; runs in which it is infinite lack it."""
    value = median(episode.metrics.get(name, math.inf) for episode in episodes)
    return value if math.isfinite(value) else None


def fault_rows(episodes: Sequence[Episode], detectors: Sequence[str]) -> Iterator[Row]:
    """Yield the arms of fixed latencies, fixed losses and radio by geometry."""
    runs = by_case(episodes)
    for detector, ((scenario, planner), blocks) in product(detectors, BLOCKS.items()):
        for fault, value in FAULTS:
            arms = [arm_of(detector, planner, fault, value, block) for block in range(blocks)]
            mine = [episode for arm in arms for episode in runs[scenario, arm]]
            key = {"detector": detector, "scenario": scenario, "planner": planner}
            yield {**key, "fault": fault, "value": value, **outcome(mine)}


def load_rows(episodes: Sequence[Episode], detectors: Sequence[str]) -> Iterator[Row]:
    """Yield the arms with added stations."""
    runs = by_case(episodes)
    for detector, access, stations in product(detectors, ACCESS, STATIONS):
        mine = runs[LOADED[0], f"{detector} {access} {stations}"]
        yield {
            "detector": detector,
            "access": access,
            "stations": stations,
            **outcome(mine),
            "p95_age": _median(mine, "age_of_information.p95"),
            "busy": _median(mine, f"channel_busy_ratio.{EGO}"),
        }


SUCCESS = (
    Column("success", "{free} of {episodes} = {share:.0%}"),
    Column("95 %", "{low:.0%} to {high:.0%}"),
    plain("received", "reception", ".0%"),
    plain("mean age [s]", "age", ".3f"),
)
FAULT_COLUMNS = (
    *map(plain, ("scenario", "planner", "fault")),
    plain("value", "value", "g"),
    *SUCCESS,
)
LOAD_COLUMNS = (
    plain("medium access", "access"),
    plain("stations"),
    plain("busy", "busy", ".0%"),
    *SUCCESS,
    plain("95 % of the time below [s]", "p95_age", ".3f"),
)


def report(episodes: Sequence[Episode], detectors: Sequence[str]) -> PartReport:
    """Return the report: success over latency, loss and load."""
    faults, loads = tuple(fault_rows(episodes, detectors)), tuple(load_rows(episodes, detectors))
    runs = {(row["scenario"], row["planner"]): row["episodes"] for row in faults}
    sections = (
        Section("Set-up", setup(runs, loads[0]["episodes"])),
        Section("Result", conclusions(faults, loads)),
        Section("Latency, loss and radio", (), DataTable("channels", FAULT_COLUMNS, faults)),
        Section("Load", (), DataTable("channels_load", LOAD_COLUMNS, loads)),
    )
    return PartReport(PART.title, sections)


PART = Part(
    "channels",
    "Latency, loss and load of the channel",
    (
        "How do latency, loss, bursts of losses, radio by geometry and load of the channel change the success "
        "of cooperation?"
    ),
    10,
    DETECTORS,
    cases,
    report,
)
