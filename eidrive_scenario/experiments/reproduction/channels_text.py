"""Texts of the report on the channel, from its numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

from eidrive_scenario.experiments.reproduction.layout import Row
from eidrive_scenario.experiments.reproduction.rows import distinct, number, scenario_title


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
        "synchronized. With C-V2X Mode 4 the reservation interval of 100 ms admits every second message of the "
        "roadside unit; the newer one replaces the older one in the queue.",
    )


def conclusions(faults: Sequence[Row], loads: Sequence[Row]) -> tuple[str, ...]:
    """Return per scenario and planner the effect of latency, loss and radio, and the effect of the load."""
    texts = []
    for key in dict.fromkeys((row["scenario"], row["planner"]) for row in faults):
        mine = [row for row in faults if (row["scenario"], row["planner"]) == key]
        texts.append(f"{scenario_title(str(key[0]))}, `{key[1]}`. {_latency(mine)} {_bursts(mine)} {_radio(mine)}")
    texts += [_load([row for row in loads if row["access"] == access]) for access in distinct(loads, "access")]
    return tuple(texts)


def _latency(rows: Sequence[Row]) -> str:
    (without,) = (row for row in rows if row["fault"] == "none")
    line = [row for row in rows if row["fault"] == "latency"]
    before, after = min(pairwise(line), key=lambda pair: number(pair[1], "share") - number(pair[0], "share"))
    text = (
        f"Success is {without['share']:.0%} without cooperation, {line[0]['share']:.0%} without latency and "
        f"{line[-1]['share']:.0%} at {line[-1]['value']:g} s"
    )
    if number(after, "share") >= number(before, "share"):
        return f"{text}; it nowhere decreases with the latency."
    return (
        f"{text}; the largest step is from {before['share']:.0%} at {before['value']:g} s to {after['share']:.0%} at "
        f"{after['value']:g} s."
    )


def _bursts(rows: Sequence[Row]) -> str:
    single = {row["value"]: row for row in rows if row["fault"] == "independent"}
    bursts = {row["value"]: row for row in rows if row["fault"] == "bursty"}
    listed = [
        f"{loss:.0%} lost: {single[loss]['share']:.0%} and {bursts[loss]['share']:.0%}"
        for loss in single
        if loss is not None
    ]
    return f"Success with independent and with bursty losses: {'; '.join(listed)}."


def _radio(rows: Sequence[Row]) -> str:
    """Return the success of the radio beside that of independent losses at the nearest share of received messages."""
    single = [row for row in rows if row["fault"] == "independent"]
    listed = []
    for row in (row for row in rows if row["fault"] == "radio" and number(row, "reception") < 0.95):
        received = number(row, "reception")
        nearest = min(single, key=lambda one: abs(number(one, "reception") - received))
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
        f"{first['age']:.3f} s to {last['age']:.3f} s, and success from {first['share']:.0%} to {last['share']:.0%}."
    )
