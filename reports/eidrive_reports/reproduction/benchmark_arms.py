"""Methods, channels and scenarios of the benchmark, and the texts that select them on the command line."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any

from eidrive_reports.paper import EGO
from eidrive_reports.studies import group_by
from eidrive_scenario.api.common import Diagnostic, SettingError, quoted, registry
from eidrive_scenario.api.experiments import describe_scenarios, resolve_scenario
from eidrive_scenario.api.run import RunSettings
from eidrive_scenario.api.v2x import load_profile

NO_COOPERATION = "none"
"""Name of the method, and of the channel, without messages."""
METHODS = (NO_COOPERATION, "covariance_intersection", "early", "attention", "where2comm")
"""Methods without an option: no, late and early fusion, features of all cells, and of the most confident ones."""
SUITABLE = {"early": ("lidar", "pillars"), **dict.fromkeys(("max", "attention", "where2comm"), ("pillars",))}
"""Detectors that a method can use. Other methods are run with each detector of `--detectors`."""


@dataclass(frozen=True)
class Method:
    """Fusion method and detector of all stations; the method `none` uses no messages."""

    fusion: str
    detector: str

    @property
    def name(self) -> str:
        """Name in the record and in tables, and text on the command line."""
        return f"{self.fusion}:{self.detector}"

    @property
    def cooperates(self) -> bool:
        """Whether stations use messages."""
        return self.fusion != NO_COOPERATION


def methods_of(texts: Sequence[str], detectors: Sequence[str]) -> tuple[Method, ...]:
    """Return the methods of texts `FUSION` or `FUSION:DETECTOR`, each once.

    A text without a detector stands for each of `detectors` that the method can use, or for the first that it can use.
    Raise SettingError for the name of an unknown method or detector.
    """
    methods: dict[Method, None] = {}
    for text in texts:
        fusion, _, detector = text.partition(":")
        if fusion != NO_COOPERATION and fusion not in registry("fusion"):
            unknown = registry("fusion").unknown(fusion, also=(NO_COOPERATION,))
            raise SettingError(Diagnostic(f"--fusion: {unknown.message}", unknown.hint))
        if ":" in text and detector not in registry("detectors"):
            unknown = registry("detectors").unknown(detector)
            raise SettingError(Diagnostic(f"--fusion: {unknown.message}", unknown.hint))
        suitable = SUITABLE.get(fusion, detectors)
        used = [detector] if detector else [name for name in detectors if name in suitable] or suitable[:1]
        methods |= dict.fromkeys(Method(fusion, name) for name in used)
    return tuple(methods)


RATE = 6
"""Data rate of all stations, the default of ITS-G5 [Mbit/s]."""
SENSED_ROAD = 584.15
"""Length of road from which a station senses 23 dBm, each meter weighted by the probability [m]: equation (34) of
Sepulcre et al., arXiv:2104.07923, divided by the load of one vehicle per meter."""
MOST_STATIONS = 350
"""Maximum number of stations on a shared channel; the channel busy ratio of the model is valid up to 385."""


def shared_channel(rate: float, stations: int) -> Mapping[str, Any]:
    """Return the profile of IEEE 802.11p in urban streets, shared with further stations.

    rate      mean rate at which a station may send [Mbit/s]: a share of the time at 6 Mbit/s, kept by congestion
              control. So the range is the same at all rates
    stations  number of stations that a station senses, with itself and one sender of the scenario. The others send 300
              bytes at 10 Hz, as in the profile `80211p_urban`, and are not simulated
    """
    profile: dict[str, Any] = {
        "model": "radio",
        "path_loss": {"kind": "tr37885", "environment": "urban"},
        "data_rate_mbps": RATE,
        "queue": {"discipline": "lcfs"},
    }
    if rate < RATE:
        share = round(rate / RATE, 4)
        profile["congestion"] = {"kind": "limeric", "share_min": share, "share_max": share, "interval_min": 0.0}
    if stations > 2:
        density = round((stations - 2) / SENSED_ROAD, 5)
        profile["background"] = {"kind": "80211p", "density": density, "rate": 10, "size": 300, "power_dbm": 23}
    return profile


@dataclass(frozen=True)
class BenchmarkChannel:
    """Channel of the benchmark.

    rate, stations  of a shared channel; None for a profile of the library or of a file
    """

    name: str
    profile: str | Mapping[str, Any] = field(hash=False)
    rate: float | None = None
    stations: int | None = None

    @property
    def title(self) -> str:
        """Title in tables."""
        return self.name if self.rate is None else f"{self.rate:g} Mbit/s, {self.stations} stations"


CHANNELS = tuple(f"{rate}mbit_{stations}" for stations in (2, 40, 80) for rate in (6, 3, 1))
"""Names of the channels without an option, from the emptiest to the fullest."""
SILENT = BenchmarkChannel(NO_COOPERATION, NO_COOPERATION)
"""Channel of runs without cooperation."""
_SHARED = re.compile(r"(\d+(?:\.\d+)?)mbit_(\d+)")


def channel_of(text: str) -> BenchmarkChannel:
    """Return the shared channel of a text such as `3mbit_40`, or the channel of a profile's name or file.

    Raise SettingError for an invalid profile, a rate above that of the channel or an invalid number of stations.
    """
    match = _SHARED.fullmatch(text)
    if match is None:
        load_profile(text, origin="--channels")
        return BenchmarkChannel(text, text)
    rate, stations = float(match[1]), int(match[2])
    if not 0.0 < rate <= RATE or not 2 <= stations <= MOST_STATIONS:
        hint = f"RATEmbit_STATIONS with a rate of at most {RATE} Mbit/s and 2 to {MOST_STATIONS} stations"
        raise SettingError(Diagnostic(f"--channels: invalid shared channel {quoted(text)}", hint))
    return BenchmarkChannel(text, shared_channel(rate, stations), rate, stations)


SCENARIOS = (
    *(f"coop/scenario_{number}" for number in (5, 6, 7, 8)),
    "corner_cases/pedestrian_parked_cars",
    "ncap/crossing_car",
    "ncap/crossing_child",
)
"""Scenarios without an option, in which correct CPMs of others avoid a collision of the ego with the oracle.

Others do not compare fusion of perception: senders transmit CAMs only (`emergency_vehicle`, `tunnel_breakdown`,
`jam_end`) or are faulty (`ghost`, `contradicting_senders`, `wrong_clock`, `jammer`), the ego passes without messages
(`cyclist_right_turn`), or all stations see too little (`wrong_way_driver`: with the range of `pillars`, 51.2 m, the ego
collides with the oracle and an ideal channel, too).
"""
PARTNERS = {
    "corner_cases/pedestrian_parked_cars": "Child",
    "corner_cases/wrong_way_driver": "WrongWay",
    "corner_cases/emergency_vehicle": "Ambulance",
    "corner_cases/tunnel_breakdown": "Truck",
    "corner_cases/cyclist_right_turn": "Cyclist",
    "corner_cases/jam_end": "Right1",
    "corner_cases/wrong_clock": "Crossing",
    "ncap/crossing_car": "Other",
    "ncap/crossing_child": "Walker",
}
"""Actor whose minimum distance to the ego is measured, where the scenario has no criterion for it."""
FIELD_OF_VIEW = {f"coop/scenario_{number}": 100 for number in (5, 6, 7, 8)}
"""Horizontal field of view that the stations of a scenario declare [degrees], where its outcome depends on it."""

SENDERS = dict.fromkeys(("coop/scenario_5", "coop/scenario_6"), "vehicle")
"""Value of `Participants` in scenarios where a roadside unit sees the whole conflict: with it the ego passes with the
oracle in all seeds, and with the parked car, which traffic hides in part, in 4 and 6 of seeds 1 to 10."""


def sensor_parameters(scenario: str, detector: str) -> dict[str, str]:
    """Return the parameter of a scenario that gives lidars the field of view that its stations declare.

    That property applies to the sensor of the oracle only, and default lidars see all around: with them the ego of
    scenarios 5 to 8 sees the car that overtakes it from behind, and needs no messages. Cameras have 100° by default.
    """
    detector_class = registry("detectors").load(detector)
    if scenario not in FIELD_OF_VIEW or detector_class.needs != {"lidar"}:
        return {}
    view = {"field_of_view": FIELD_OF_VIEW[scenario]}
    sensors = {
        name: {"kind": sensor.kind, **sensor.model_dump(exclude_unset=True), **view}
        for name, sensor in detector_class.default_sensors.items()
    }
    return {"Sensors": json.dumps(sensors or {"lidar": view})}


def scenarios_of(texts: Sequence[str]) -> tuple[str, ...]:
    """Return the scenarios of names, files, or families such as `ncap`, each once.

    Raise SettingError for an unknown one, or for a file that is not a scenario.
    """
    scenarios: dict[str, None] = {}
    families = group_by(describe_scenarios(), attrgetter("family"))
    for text in texts:
        if text not in families:
            resolve_scenario(text)
        scenarios |= dict.fromkeys(entry.name for entry in families[text]) if text in families else {text: None}
    return tuple(scenarios)


def settings_of(scenario: str, method: Method, channel: BenchmarkChannel) -> RunSettings:
    """Return the settings of the runs of a cell."""
    partner = PARTNERS.get(scenario)
    senders = {"Participants": SENDERS[scenario]} if scenario in SENDERS else {}
    return RunSettings(
        channel=channel.profile,
        detector=method.detector,
        fusion=method.fusion if method.cooperates else None,
        parameters={**senders, **sensor_parameters(scenario, method.detector)},
        criteria=None if partner is None else {"min_distance": {"of": EGO, "to": partner}},
    )
