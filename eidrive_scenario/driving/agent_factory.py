"""Construction of the agent and the sensors of a station from its settings."""

from __future__ import annotations

from collections.abc import Mapping

from eidrive_scenario.driving.agent import Agent
from eidrive_scenario.driving.communication.message_generator import MessageGenerator
from eidrive_scenario.driving.communication.shared_points import PointCloudSharing
from eidrive_scenario.driving.control.vehicle_controller import VehicleController
from eidrive_scenario.driving.planner_settings import DEFAULT_PLANNER, NO_PLANNER
from eidrive_scenario.driving.planning.planner import Planner
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.errors import Diagnostic, RegistryError, SettingError
from eidrive_scenario.fusion.method import FusionMethod
from eidrive_scenario.perception.detector import Detector, DetectorContext
from eidrive_scenario.perception.localization import Localizer, motion_noise
from eidrive_scenario.perception.pipeline import Perception
from eidrive_scenario.perception.tracking.method import TrackingMethod
from eidrive_scenario.perception.tracking.settings import NO_TRACKER, TrackerSettings
from eidrive_scenario.registry import construct, registry
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.sensing.settings import ImuSettings, SensorSettings
from eidrive_scenario.settings import Settings, parse_settings
from eidrive_scenario.v2x.messages.asn1 import Asn1Encoder
from eidrive_scenario.world.actor import ActorSpec


def build_rig(settings: AgentSettings, spec: ActorSpec, *, seed: int = 0) -> Rig:
    """Return the sensors of a station. Raise SettingError if the settings omit a sensor that the detector needs."""
    kind: type[Detector] = _detector_class(settings.detector)
    return Rig(spec, settings.rig_sensors(kind.needs, kind.default_sensors), seed=seed)


def _detector_class(name: str) -> type[Detector]:
    """Return the class of a detector. Raise RegistryError if its declarations are invalid."""
    kind: type[Detector] = registry("detectors").load(name, Detector)
    sensors = frozenset(registry("sensors"))
    if not isinstance(kind.needs, frozenset | set) or not kind.needs <= sensors:
        described = registry("detectors").describe(name)
        raise RegistryError(f"{described}: needs is {kind.needs!r} (expected a frozenset out of {sorted(sensors)})")
    _check_settings_type("detectors", name, kind.settings_type)
    return kind


def _check_settings_type(kind: str, name: str, settings_type: object) -> None:
    if settings_type is not None and not (isinstance(settings_type, type) and issubclass(settings_type, Settings)):
        described = registry(kind).describe(name)
        raise RegistryError(f"{described}: settings_type is {settings_type!r} (expected a class derived from Settings)")


def build_detector(settings: AgentSettings, *, source: str = "", line: int | None = None) -> Detector:
    """Build the detector of a station. Raise SettingError with this location if its settings are invalid."""
    kind: type[Detector] = _detector_class(settings.detector)
    given = settings.detector_settings
    if kind.settings_type is not None:
        own = parse_settings(kind.settings_type, given, source=source, line=line)
        return construct(kind, own)  # type: ignore[no-any-return]
    if given:
        message = f"detector {settings.detector!r} has no settings"
        raise SettingError(Diagnostic(message, "remove the property 'detector_settings'", source, line))
    return construct(kind)  # type: ignore[no-any-return]


def build_fusion(
    settings: AgentSettings, detector: Detector, *, source: str = "", line: int | None = None
) -> FusionMethod:
    """Build the fusion method of a station.

    Raise SettingError with this location if its settings are invalid, or if it shares points that the detector does not
    read.
    """
    kind: type[FusionMethod] = registry("fusion").load(settings.fusion, FusionMethod)
    _check_settings_type("fusion", settings.fusion, kind.settings_type)
    given = settings.fusion_settings
    if given and kind.settings_type is None:
        message = f"fusion {settings.fusion!r} has no settings"
        raise SettingError(Diagnostic(message, "remove the property 'fusion_settings'", source, line))
    if kind.shares_points and "lidar" not in detector.needs:
        message = f"fusion {settings.fusion!r} shares points, which detector {settings.detector!r} does not read"
        raise SettingError(Diagnostic(message, "give it a detector for LiDAR: lidar", source, line))
    if kind.settings_type is None:
        return construct(kind)  # type: ignore[no-any-return]
    own = parse_settings(kind.settings_type, given, source=source, line=line)
    return construct(kind, own)  # type: ignore[no-any-return]


def vehicle_controller_settings(
    settings: AgentSettings, *, source: str = "", line: int | None = None
) -> Settings | None:
    """Return the own settings of the vehicle controller; None if it has none.

    Raise SettingError with this location if they are invalid.
    """
    name, given = settings.vehicle_controller, settings.vehicle_controller_settings
    kind: type[VehicleController] = registry("vehicle_controllers").load(name, VehicleController)
    _check_settings_type("vehicle_controllers", name, kind.settings_type)
    if kind.settings_type is not None:
        return parse_settings(kind.settings_type, given, source=source, line=line)
    if given:
        message = f"vehicle controller {name!r} has no settings"
        raise SettingError(Diagnostic(message, "remove the property 'vehicle_controller_settings'", source, line))
    return None


def build_agent(
    settings: AgentSettings,
    spec: ActorSpec,
    roads: RoadNetwork | None,
    *,
    seed: int,
    dt: float,
    detector: Detector | None = None,
    encoder: Asn1Encoder | None = None,
) -> Agent:
    """Build the agent of a station. `detector` is an instance that is built already.

    A vehicle without a planner in its settings follows a route. A station that does not drive receives messages only if
    its settings select senders. Raise SettingError if an actor without wheels has a planner.
    """
    wheels = spec.wheelbase > 0.0
    planner = settings.planner or (DEFAULT_PLANNER if wheels else NO_PLANNER)
    if planner != NO_PLANNER and not wheels:
        raise SettingError(Diagnostic(f"{spec.name!r} has no wheels for planner {planner!r}", "remove the property"))
    detector = detector or build_detector(settings)
    sensors = settings.rig_sensors(detector.needs, detector.default_sensors)
    installation = DetectorContext(spec, sensors, roads, seed)
    detector.setup(installation)
    fusion = build_fusion(settings, detector)
    points = None
    listens = planner != NO_PLANNER or settings.restricts_senders
    if fusion.shares_points:
        points = PointCloudSharing(fusion, _joint(settings, installation) if listens else None)
    return Agent(
        spec,
        settings,
        perception=Perception(
            detector,
            tracker=_tracker(settings, detector),
            localizer=_localizer(spec.name, seed, sensors) if settings.localization == "ekf" else None,
            latency=settings.detector_latency,
        ),
        fusion=fusion,
        planner=None
        if planner == NO_PLANNER
        else construct(registry("planners").load(planner, Planner), settings, spec, roads, dt=dt, seed=seed),
        controller=_vehicle_controller(settings, spec, dt) if wheels else None,
        speaker=MessageGenerator(spec, settings, sensors=len(sensors), encoder=encoder),
        dt=dt,
        receives_messages=listens,
        points=points,
    )


def _vehicle_controller(settings: AgentSettings, spec: ActorSpec, dt: float) -> VehicleController:
    kind = registry("vehicle_controllers").load(settings.vehicle_controller, VehicleController)
    own = vehicle_controller_settings(settings)
    return construct(kind, spec, dt, *(() if own is None else (own,)))  # type: ignore[no-any-return]


def _joint(settings: AgentSettings, installation: DetectorContext) -> Perception:
    """Build the perception of merged points: that of the station, without localization."""
    detector = build_detector(settings)
    detector.setup(installation)
    return Perception(detector, tracker=_tracker(settings, detector), latency=settings.detector_latency)


def _tracker(settings: AgentSettings, detector: Detector) -> TrackingMethod | None:
    """Build the tracker that the settings select. By default detections without velocities are tracked."""
    if settings.tracker is None and detector.provides_velocity:
        return None
    chosen = settings.tracker or TrackerSettings()
    if chosen.kind == NO_TRACKER:
        return None
    return construct(registry("trackers").load(chosen.kind, TrackingMethod), chosen)  # type: ignore[no-any-return]


def _localizer(name: str, seed: int, sensors: Mapping[str, SensorSettings]) -> Localizer:
    """Build the localization filter with the noise of the IMU of the station."""
    units = [sensor for sensor in sensors.values() if isinstance(sensor, ImuSettings)]
    return Localizer(name, seed, noise=motion_noise(units[0]))
