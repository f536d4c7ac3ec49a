"""Settings of a station in the Properties of its controller, and their parser."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, SerializeAsAny, field_validator, model_validator

from eidrive_scenario.driving.planner_settings import (
    NO_PLANNER,
    PlannerSettings,
    split_planner_settings,
)
from eidrive_scenario.driving.step import MAX_TARGET_SPEED
from eidrive_scenario.errors import Diagnostic, SettingError, suggestion
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.extensions.settings import Settings, parse_settings
from eidrive_scenario.files.yaml_text import load_yaml
from eidrive_scenario.fusion.prediction import REPORT_LIFETIME
from eidrive_scenario.openscenario.conventions import property_entries
from eidrive_scenario.openscenario.model.controllers import Controller
from eidrive_scenario.openscenario.values.parameters import parameter_hints, resolve_references
from eidrive_scenario.perception.faults import MAX_FALSE_OBJECTS, FalseObject, PoseError
from eidrive_scenario.perception.localization import PoseNoise
from eidrive_scenario.perception.tracking.method import TrackerKind, tracker_setting
from eidrive_scenario.sensing.sensor import check_unique, default_sensor, parse_sensor
from eidrive_scenario.sensing.settings import MAX_RANGE, MountSetting, SensorSettings, TruthSettings
from eidrive_scenario.v2x.messages.message import StationClock

NAME_PROPERTIES = frozenset({"module", "detector", "fusion", "planner", "vehicle_controller"})
"""Properties whose values are names, not YAML."""

SELECTED = {
    "detector": "detectors",
    "fusion": "fusion",
    "planner": "planners",
    "vehicle_controller": "vehicle_controllers",
}
"""Registry of the extension that each of these properties names."""

LOCALIZING = ("gnss", "imu")
"""Kinds of sensors for localization."""

_OF_THE_TRUTH_SENSOR = ("range", "field_of_view", "visibility", "mount")

MAX_TIME = 1e4
"""Maximum latency, lifetime and clock error [s]."""


def _names(value: Any) -> Any:
    """Return names given as a list or as a text with commas; `all` is None, `none` is ()."""
    if value is None or value == "all":
        return None
    if isinstance(value, str):
        value = [] if value.strip() == "none" else value.split(",")
    if isinstance(value, Sequence):
        return tuple(str(name).strip() for name in value if str(name).strip())
    return value


def _sensors(value: Any) -> Any:
    """Return a mapping from names to settings of sensors, also from names of kinds; the name may be the kind."""
    if isinstance(value, str):
        value = [part.strip() for part in value.split(",") if part.strip()]
    if isinstance(value, Mapping):
        entries = value.items()
    elif isinstance(value, Sequence) and all(isinstance(name, str) for name in value):
        entries = dict.fromkeys(value).items()
    else:
        raise ValueError(f"name kinds, {', '.join(registry('sensors'))}, or write a mapping from names to settings")
    kinds = registry("sensors")
    sensors: dict[str, Any] = {}
    for name, given in entries:
        settings = dict(given) if isinstance(given, Mapping) else {} if given is None else given
        if isinstance(settings, dict) and "kind" not in settings:
            if name not in kinds:
                raise ValueError(f"sensor {name!r} needs a kind, or one for its name: {suggestion(str(name), kinds)}")
            settings["kind"] = name
        sensors[str(name)] = settings
    return sensors


_Listed = tuple[str, ...] | str
_MessageKind = Literal["cpm", "cam"]
_Sensor = Annotated[SerializeAsAny[SensorSettings], BeforeValidator(parse_sensor)]


class AgentSettings(Settings):
    """Settings of one station. Positions are in the world frame.

    detector, fusion, planner   names of extensions; planner `none` parks a vehicle. A mast has no other planner
    detector_settings  settings of the detector
    detector_latency   computing time of the detector: detections of time t are available from t + latency on [s]
    fusion_settings    settings of the fusion method
    tracker         `none`, `cv`, `ctrv`, or a mapping (see TrackerSettings); None tracks detections without velocities
    localization    `oracle`, or `ekf`: pose estimation by GNSS and IMU
    pose_error      constant error of the assumed pose, as by wrong calibration
    pose_noise      random error of the assumed pose, whose covariance the station states in its messages
    false_objects   objects that its detector reports, and that do not exist
    obey_signals    whether the vehicle stops at red traffic lights and stop signs
    sensors         kinds (`truth, camera`), or a mapping from names to settings; None uses the defaults of the detector
    range           of the truth sensor, unless `sensors` sets it [m]
    field_of_view   of the truth sensor, unless `sensors` sets it [degrees]
    mount, visibility  of the truth sensor, unless `sensors` sets them
    cooperates_with senders whose messages are received; None: all. A station that does not drive receives messages
                    only with this property
    message_rate    rate of CPMs; None: one in each tick [Hz]
    message_phase   time from the entry of the station to its first message or, with `etsi`, its first evaluation of the
                    rules; None: random, because stations are not synchronized [s]. Not used with a message in each tick
    report_timeout  maximum age of a report that is used; None: while its objects are predictable (REPORT_LIFETIME) [s]
    antenna_height  above the reference point; None: on the roof [m]
    messages        kinds of sent messages: `cpm` (perceived objects), `cam` (ego state)
    generation      `each_tick`, `rate` (message_rate), or `etsi`: by the rules of EN 302 637-2 and TS 103 324; None
                    selects one of the first two
    mtu             maximum size of a message by the ETSI rules [bytes]
    security_bytes  size of the security envelope of every CPM [bytes]
    clock_offset    lead of the station clock [s]
    clock_drift     rate error of the station clock [parts per million]
    asn1_files      ASN.1 modules that determine the sizes of messages, relative to the scenario file
    target_speed    speed without a request of the storyboard; None keeps the initial speed [m/s]
    follow_speed_limit  whether the speed limit, or usual speed, of the lane replaces the initial speed
    vehicle_controller  name of the controller that follows the trajectories of the planner
    vehicle_controller_settings  settings of the vehicle controller
    planner_settings  settings of the selected planner; a property with the name of a setting is accepted as well
    """

    module: Literal["eidrive"] = "eidrive"
    detector: str = "oracle"
    detector_settings: dict[str, Any] = Field(default_factory=dict)
    detector_latency: Annotated[float, Field(ge=0.0, le=MAX_TIME)] = 0.0
    tracker: Annotated[SerializeAsAny[TrackerKind] | None, BeforeValidator(tracker_setting)] = None
    localization: Literal["oracle", "ekf"] = "oracle"
    pose_error: PoseError | None = None
    pose_noise: PoseNoise | None = None
    false_objects: Annotated[tuple[FalseObject, ...], Field(max_length=MAX_FALSE_OBJECTS)] = ()
    obey_signals: bool = False
    fusion: str = "covariance_intersection"
    fusion_settings: dict[str, Any] = Field(default_factory=dict)
    planner: str | None = None
    vehicle_controller: str = "pid"
    vehicle_controller_settings: dict[str, Any] = Field(default_factory=dict)
    sensors: Annotated[dict[str, _Sensor], BeforeValidator(_sensors)] | None = None
    range: Annotated[float, Field(gt=0.0, le=MAX_RANGE)] | None = None
    field_of_view: Annotated[float, Field(gt=0.0, le=360.0)] | None = None
    visibility: Annotated[float, Field(gt=0.0, le=1.0)] | None = None
    mount: MountSetting = None
    cooperates_with: Annotated[tuple[str, ...] | None, BeforeValidator(_names, _Listed | None)] = None
    message_rate: Annotated[float, Field(ge=1e-3, le=10_000.0)] | None = None
    message_phase: Annotated[float, Field(ge=0.0, le=MAX_TIME)] | None = None
    report_timeout: Annotated[float, Field(gt=0.0, le=MAX_TIME)] | None = None
    antenna_height: Annotated[float, Field(gt=0.0, le=1000.0)] | None = None
    messages: Annotated[tuple[_MessageKind, ...], BeforeValidator(_names, tuple[_MessageKind, ...] | str)] = ("cpm",)
    generation: Literal["each_tick", "rate", "etsi"] | None = None
    mtu: Annotated[int, Field(ge=200, le=1_000_000)] = 1400
    security_bytes: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    clock_offset: Annotated[float, Field(ge=-MAX_TIME, le=MAX_TIME)] = 0.0
    clock_drift: Annotated[float, Field(ge=-1e5, le=1e5)] = 0.0
    asn1_files: Annotated[tuple[str, ...], BeforeValidator(_names, _Listed)] = ()
    target_speed: Annotated[float, Field(ge=0.0, le=MAX_TARGET_SPEED)] | None = None
    follow_speed_limit: bool = False
    planner_settings: SerializeAsAny[PlannerSettings] = PlannerSettings()

    @field_validator("sensors")
    @classmethod
    def _check_unique_sensors(cls, sensors: dict[str, SensorSettings] | None) -> dict[str, SensorSettings] | None:
        check_unique(sensors or {})
        return sensors

    @field_validator("messages")
    @classmethod
    def _check_unique_messages(cls, messages: tuple[str, ...]) -> tuple[str, ...]:
        if len(set(messages)) < len(messages):
            raise ValueError(f"a station sends each kind of message once (got {', '.join(messages)})")
        return messages

    @model_validator(mode="after")
    def _one_way_to_generate(self) -> AgentSettings:
        if self.generation == "rate" and self.message_rate is None:
            raise ValueError("generation 'rate' needs a message_rate")
        if self.generation in ("each_tick", "etsi") and self.message_rate is not None:
            raise ValueError(f"generation {self.generation!r} and a message_rate exclude each other")
        if self.message_phase is not None and self.generation != "etsi" and self.message_rate is None:
            raise ValueError("message_phase needs a message_rate or generation 'etsi'")
        if self.security_bytes >= self.mtu:
            raise ValueError(f"security_bytes is not below mtu (got {self.security_bytes} and {self.mtu} bytes)")
        return self

    @model_validator(mode="after")
    def _in_time(self) -> AgentSettings:
        if self.detector_latency >= self.report_lifetime:
            raise ValueError(
                f"detector_latency is not below report_timeout (got {self.detector_latency:g} s and "
                f"{self.report_lifetime:.3g} s)"
            )
        return self

    @property
    def restricts_senders(self) -> bool:
        """Whether the settings select senders, which may be all; driving stations receive from all by default."""
        return "cooperates_with" in self.model_fields_set and self.cooperates_with != ()

    @property
    def report_lifetime(self) -> float:
        """Maximum age of a report that the station uses [s]."""
        return REPORT_LIFETIME if self.report_timeout is None else self.report_timeout

    @property
    def clock(self) -> StationClock:
        """Clock of the station."""
        return StationClock(self.clock_offset, self.clock_drift * 1e-6)

    def rig_sensors(
        self, needs: frozenset[str], usual: Mapping[str, SensorSettings] = MappingProxyType({})
    ) -> dict[str, SensorSettings]:
        """Return the sensors of this station for a detector that reads these kinds, with those for localization.

        usual  default sensors of the detector; if empty, one sensor of each kind that it needs

        Raise SettingError if the settings omit a sensor that the detector needs.
        """
        sensors: dict[str, Any] = dict(usual) or {kind: default_sensor(kind) for kind in sorted(needs)}
        if self.sensors is not None:
            sensors = dict(self.sensors)
        present = {sensor.kind for sensor in sensors.values()}
        missing = needs - present
        if missing:
            message = f"detector {self.detector!r} needs a sensor of kind {', '.join(sorted(missing))}"
            raise SettingError(Diagnostic(message, "add it to the property 'sensors'"))
        sensors |= {
            kind: default_sensor(kind) for kind in LOCALIZING if self.localization == "ekf" and kind not in present
        }
        for name, sensor in sensors.items():
            if isinstance(sensor, TruthSettings):
                own = {key: getattr(self, key) for key in _OF_THE_TRUTH_SENSOR if key not in sensor.model_fields_set}
                sensors[name] = sensor.model_copy(update={key: v for key, v in own.items() if v is not None})
        return sensors


def agent_settings(controller: Controller) -> AgentSettings:
    """Return the settings in the Properties of a controller. Values other than names are YAML.

    Raise SettingError with file and line of each unknown, duplicate or invalid property.
    """
    source = controller.source
    data: dict[str, Any] = {}
    lines: dict[str, int] = {}
    origins: dict[str, str] = {}
    diagnostics: list[Diagnostic] = []
    for entry in property_entries(controller):
        if entry.name in data:
            message = f"property {entry.name!r} is given twice, first in line {lines[entry.name]}"
            diagnostics.append(Diagnostic(message, "keep one", source, entry.line))
            continue
        lines[entry.name] = entry.line
        try:
            value = entry.value if entry.name in NAME_PROPERTIES else load_yaml(entry.value, source=source)
        except SettingError as error:
            what = error.diagnostics[0].message
            message = f"property {entry.name!r} is {entry.value!r}, which is {what}"
            diagnostics.append(Diagnostic(message, "check brackets, commas and quotes", source, entry.line))
            continue
        origins |= parameter_hints(value, entry.scope, entry.name)
        try:
            data[entry.name] = resolve_references(value, entry.scope, source=source, line=entry.line, path=entry.name)
        except SettingError as error:
            diagnostics += error.diagnostics
    return parse_station_settings(
        data, source=source, line=controller.line, lines=lines, origins=origins, diagnostics=diagnostics
    )


def parse_station_settings(
    data: Mapping[str, Any],
    *,
    source: str = "",
    line: int | None = None,
    lines: Mapping[str, int] = MappingProxyType({}),
    origins: Mapping[str, str] = MappingProxyType({}),
    diagnostics: Sequence[Diagnostic] = (),
) -> AgentSettings:
    """Return the settings of a station and its planner from the properties of its controller.

    `lines` gives the line of each property, and `origins` is that of `parse_settings`. Raise SettingError with these
    diagnostics and those of invalid settings.
    """
    errors = list(diagnostics)
    for name, kind in SELECTED.items():
        also, selected = (NO_PLANNER,) if name == "planner" else (), data.get(name)
        if isinstance(selected, str) and selected not in (*registry(kind), *also):
            errors.append(registry(kind).unknown(selected, also=also, source=source, line=lines.get(name, line)))
    station, planner_settings = split_planner_settings(
        data, AgentSettings.model_fields, source=source, line=line, lines=lines, origins=origins, diagnostics=errors
    )
    try:
        settings = parse_settings(AgentSettings, station, source=source, line=line, lines=lines, origins=origins)
    except SettingError as error:
        raise SettingError([*errors, *error.diagnostics]) from error
    if errors:
        raise SettingError(errors)
    return settings.model_copy(update={"planner_settings": planner_settings})
