"""Construction of the agent and the sensors of a station from its settings."""

from __future__ import annotations

import math
from functools import partial
from numbers import Real
from typing import Any

from eidrive_scenario.driving.agent import FIRST_NUMBERS, Agent, NextNumbers
from eidrive_scenario.driving.communication.message_generator import MessageGenerator
from eidrive_scenario.driving.communication.report_store import SensorDataSharing
from eidrive_scenario.driving.control.vehicle_controller import VehicleController
from eidrive_scenario.driving.planner_settings import DEFAULT_PLANNER, NO_PLANNER
from eidrive_scenario.driving.planning.route_planner import Planner
from eidrive_scenario.driving.settings import SELECTED, AgentSettings
from eidrive_scenario.errors import Diagnostic, InvalidResult, RegistryError, SettingError
from eidrive_scenario.extensions.registry import construct, registry
from eidrive_scenario.extensions.settings import Settings, parse_own_settings
from eidrive_scenario.fusion.method import FusionMethod
from eidrive_scenario.perception.detector import Detector, DetectorContext
from eidrive_scenario.perception.lidar.station import StationLidars, turning_each_step
from eidrive_scenario.perception.localization import Localizer, MotionNoise, PoseNoiseProcess
from eidrive_scenario.perception.pipeline import Perception
from eidrive_scenario.perception.result_checks import checked_range
from eidrive_scenario.perception.tracking.method import NO_TRACKER, TrackerSettings, TrackingMethod
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.sensor import view_sectors
from eidrive_scenario.sensing.settings import ImuSettings, SensorSettings
from eidrive_scenario.v2x.messages.asn1 import Asn1Encoder
from eidrive_scenario.world.actor import ActorSpec


def station_sensors(settings: AgentSettings) -> dict[str, SensorSettings]:
    """Return the sensors of a station by name. Raise SettingError if one that the detector needs is omitted."""
    kind: type[Detector] = registry("detectors").load(settings.detector, Detector)
    _check_needs(settings.detector, kind)
    return settings.rig_sensors(kind.needs, kind.default_sensors)


def _check_needs(name: str, kind: type[Detector]) -> None:
    """Raise RegistryError unless a detector declares needs that are kinds of sensors."""
    sensors = frozenset(registry("sensors"))
    if not isinstance(kind.needs, frozenset | set) or not kind.needs <= sensors:
        described = registry("detectors").describe(name)
        raise RegistryError(f"{described}: needs is {kind.needs!r} (expected a frozenset out of {sorted(sensors)})")


def selected_extension(
    settings: AgentSettings, part: str, base: type, *, source: str = "", line: int | None = None
) -> tuple[Any, tuple[Settings, ...]]:
    """Return the class that a property such as `detector` selects, and its own settings, an empty tuple without any.

    Raise SettingError with this location if they are invalid.
    """
    group, name, setting = SELECTED[part], getattr(settings, part), f"{part}_settings"
    kind, given = registry(group).load(name, base), getattr(settings, setting)
    own = parse_own_settings(group, name, kind, given, setting=setting, source=source, line=line)
    return kind, () if own is None else (own,)


def build_detector(settings: AgentSettings, *, source: str = "", line: int | None = None) -> Detector:
    """Build the detector of a station. Raise SettingError with this location if its settings are invalid."""
    kind, own = selected_extension(settings, "detector", Detector, source=source, line=line)
    _check_needs(settings.detector, kind)
    detector: Detector = construct(kind, *own)
    deviation: object = detector.velocity_deviation
    if deviation is not None and not (isinstance(deviation, Real) and 0.0 < float(deviation) < math.inf):
        described = registry("detectors").describe(settings.detector)
        raise RegistryError(f"{described}: velocity_deviation is {deviation!r} (expected a positive number or None)")
    return detector


def build_fusion(
    settings: AgentSettings, detector: Detector, *, source: str = "", line: int | None = None
) -> FusionMethod:
    """Build the fusion method of a station.

    Raise SettingError with this location if its settings are invalid, or if it shares sensor data that the detector
    does not have.
    """
    kind, own = selected_extension(settings, "fusion", FusionMethod, source=source, line=line)
    lacking = {
        "points": ("lidar" not in detector.needs, "does not read", "reads lidars, such as 'lidar'"),
        "features": (not detector.provides_features, "does not compute", "computes features, such as 'pillars'"),
    }
    is_lacking, lacks, suitable = lacking.get(kind.shares or "", (False, "", ""))
    if is_lacking:
        method = f"fusion method {settings.fusion!r}"
        message = f"{method} shares {kind.shares}, which detector {settings.detector!r} {lacks}"
        raise SettingError(Diagnostic(message, f"select a detector that {suitable}", source, line))
    fusion: FusionMethod = construct(kind, *own)
    longest: object = fusion.max_report_age
    if not isinstance(longest, Real) or not float(longest) >= 0.0:
        raise InvalidResult(fusion, "max_report_age", f"is {longest!r} (expected a number of at least 0 s)")
    if 0.0 < float(longest) <= settings.detector_latency:
        ages = f"(got {settings.detector_latency:g} s and {float(longest):.3g} s)"
        message = (
            f"detector_latency is not below the maximum age of reports of fusion method {settings.fusion!r} {ages}"
        )
        raise SettingError(Diagnostic(message, source=source, line=line))
    return fusion


def build_agent(
    settings: AgentSettings,
    spec: ActorSpec,
    roads: RoadNetwork | None,
    *,
    seed: int,
    dt: float,
    detector: Detector | None = None,
    encoder: Asn1Encoder | None = None,
    numbers: NextNumbers = FIRST_NUMBERS,
) -> Agent:
    """Build the agent of a station. `detector` is an instance that is built already.

    numbers  of its first message, object and track

    A vehicle without a planner in its settings has the default one. A station that does not drive receives messages
    only if its settings select senders. Raise SettingError if an actor without wheels has a planner.
    """
    planner = settings.planner or (DEFAULT_PLANNER if spec.has_wheels else NO_PLANNER)
    if planner != NO_PLANNER and not spec.has_wheels:
        raise SettingError(
            Diagnostic(f"{spec.name!r} has no wheels for planner {planner!r}", "remove the property 'planner'")
        )
    detector = detector or build_detector(settings)
    sensors = settings.rig_sensors(detector.needs, detector.default_sensors)
    installation = DetectorContext(spec, sensors, roads, seed)
    detector.setup(installation)
    fusion = build_fusion(settings, detector)
    used = [sensor for sensor in sensors.values() if sensor.kind in detector.needs]
    view = view_sectors(used, spec, partial(checked_range, detector))
    listens = planner != NO_PLANNER or settings.restricts_senders
    driver: Planner | None = None
    if planner != NO_PLANNER:
        driver = construct(registry("planners").load(planner, Planner), settings, spec, roads, dt=dt, seed=seed)
        driver.view = view or None
        driver.can_read_light = detector.can_read_light
    controller: VehicleController | None = None
    if spec.has_wheels:
        kind, own = selected_extension(settings, "vehicle_controller", VehicleController)
        controller = construct(kind, spec, dt, *own)
    noise, localizer = settings.pose_noise, None
    if settings.localization == "ekf":
        imu = next(sensor for sensor in sensors.values() if isinstance(sensor, ImuSettings))
        localizer = Localizer(spec.name, seed, noise=MotionNoise(imu))
    perception = Perception(
        detector,
        tracker=_tracker(settings, detector),
        localizer=localizer,
        latency=settings.detector_latency,
        pose_error=settings.pose_error,
        pose_noise=None if noise is None else PoseNoiseProcess(noise, spec.name, seed),
        false_objects=settings.false_objects,
        first_track=numbers.track,
    )
    sharing = None
    if fusion.shares is not None:
        fusion.setup(detector)
        joint = None
        if listens:  # perception of merged data: that of the station, without localization
            another = detector if fusion.shares == "features" else build_detector(settings)
            if another is not detector:
                another.setup(DetectorContext(spec, turning_each_step(sensors, dt), roads, seed))
            joint = Perception(
                another,
                tracker=_tracker(settings, another),
                latency=settings.detector_latency,
                false_objects=settings.false_objects,
            )
        limit = settings.mtu - settings.security_bytes
        sharing = SensorDataSharing(
            fusion, perception, joint, lidars=StationLidars(sensors), limit=limit, latency=settings.detector_latency
        )
    return Agent(
        spec,
        settings,
        perception=perception,
        fusion=fusion,
        planner=driver,
        controller=controller,
        message_generator=MessageGenerator(
            spec,
            settings,
            view=view,
            encoder=encoder,
            seed=seed,
            dt=dt,
            number=numbers.message,
            next_id=numbers.object,
        ),
        dt=dt,
        receives_messages=listens,
        sharing=sharing,
    )


def _tracker(settings: AgentSettings, detector: Detector) -> TrackingMethod | None:
    """Build the tracker that the settings select. By default detections without velocities are tracked."""
    if settings.tracker is None and detector.provides_velocity:
        return None
    chosen = settings.tracker or TrackerSettings()
    if chosen.kind == NO_TRACKER:
        return None
    return construct(registry("trackers").load(chosen.kind, TrackingMethod), chosen)  # type: ignore[no-any-return]
