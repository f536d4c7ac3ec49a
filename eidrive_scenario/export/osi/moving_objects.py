"""Moving objects of a GroundTruth message."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import rotation_matrix
from eidrive_scenario.export.osi.schemas import Identifiers, Osi, set_orientation, set_vector
from eidrive_scenario.export.recorded_run import RecordedRun
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation.recorded_outcome import AxleCenters
from eidrive_scenario.world.appearance import Appearance
from eidrive_scenario.world.view import WorldView

ACTOR = "actor"
"""Kind of the identifiers of actors."""
VEHICLES: Mapping[str, str] = {
    "car": "TYPE_CAR",
    "van": "TYPE_VAN",
    "truck": "TYPE_HEAVY_TRUCK",
    "bus": "TYPE_BUS",
    "motorbike": "TYPE_MOTORCYCLE",
    "bicycle": "TYPE_BICYCLE",
}
"""Types of vehicles by category."""
_TOWED: Mapping[str, str] = {"trailer": "TYPE_TRAILER", "semitrailer": "TYPE_SEMITRAILER"}
"""Types of trailers by the vehicle category of OpenSCENARIO."""
_ENTITIES: Mapping[str, str] = {"pedestrian": "Pedestrian", "misc": "MiscObject"}
"""Types of the entities of OpenSCENARIO that are no vehicles, by category."""
_GENERIC: Mapping[str, tuple[str, ...]] = {
    "head_light": ("lowBeam",),
    "high_beam": ("highBeam",),
    "front_fog_light": ("fogLightsFront", "fogLights"),
    "rear_fog_light": ("fogLightsRear", "fogLights"),
    "reversing_light": ("reversingLights",),
    "license_plate_illumination_rear": ("licensePlateIllumination",),
}
"""Lights with the states on and off, by their types of OpenSCENARIO; `fogLights` is in recordings of older versions."""
_ROLES: Mapping[str, str] = {
    "none": "CIVIL",
    "civil": "CIVIL",
    "ambulance": "AMBULANCE",
    "fire": "FIRE",
    "fireBrigade": "FIRE",
    "police": "POLICE",
    "publicTransport": "PUBLIC_TRANSPORT",
    "roadAssistance": "ROAD_ASSISTANCE",
    "roadsideAssistance": "ROAD_ASSISTANCE",
    "garbageCollection": "GARBAGE_COLLECTION",
    "construction": "ROAD_CONSTRUCTION",
    "military": "MILITARY",
}
"""Roles by those of OpenSCENARIO; OTHER for the rest."""
_EMERGENCY = ("AMBULANCE", "FIRE", "POLICE")
_SERVICE = ("ROAD_ASSISTANCE", "GARBAGE_COLLECTION", "ROAD_CONSTRUCTION")
"""Roles with blue and with amber special purpose lights. The color of the light determines it for others."""
_INDICATORS = (("warningLights", "WARNING"), ("indicatorLeft", "LEFT"), ("indicatorRight", "RIGHT"))


def object_type(category: str) -> str:
    """Return the OSI type of a category."""
    if category in VEHICLES:
        return "TYPE_VEHICLE"
    return "TYPE_PEDESTRIAN" if category == "pedestrian" else "TYPE_OTHER"


def add_moving_objects(
    osi: Osi, message: Any, frame: Frame, ids: Identifiers, lanes: Mapping[int, int], run: RecordedRun
) -> None:
    """Add all actors to a GroundTruth message.

    lanes  identifiers of lanes by the row of the actor
    """
    view = frame.view
    turns = rotation_matrix(view.yaw, view.pitch, view.roll)
    arms = np.einsum("nij,nj->ni", turns, view.offset)
    centers = view.position + arms
    velocity, acceleration = center_motion(view, arms)
    for row, (name, category) in enumerate(zip(view.names, view.categories, strict=True)):
        moving_object = message.moving_object.add()
        moving_object.id.value = ids.of(ACTOR, name)
        moving_object.type = osi.moving_object.Type.Value(object_type(category))
        base = moving_object.base
        base.dimension.length, base.dimension.width, base.dimension.height = view.size[row].tolist()
        set_vector(base.position, centers[row])
        set_orientation(base.orientation, view.yaw[row], view.pitch[row], view.roll[row])
        set_vector(base.velocity, velocity[row])
        set_vector(base.acceleration, acceleration[row])
        base.orientation_rate.yaw = float(view.yaw_rate[row])
        color = run.bodies[name].color if name in run.bodies else None
        if color is not None:
            rgb = moving_object.color_description.rgb
            rgb.red, rgb.green, rgb.blue = color
        entity = _ENTITIES.get(category, "Vehicle")
        moving_object.source_reference.add(type="net.asam.openscenario", identifier=[entity, name])
        if row in lanes:
            moving_object.assigned_lane_id.add().value = lanes[row]
            moving_object.moving_object_classification.assigned_lane_id.add().value = lanes[row]
        if category in VEHICLES:
            kind = osi.moving_object.VehicleClassification.Type
            classification = moving_object.vehicle_classification
            classification.type = kind.Value(_TOWED.get(run.towed.get(name, ""), VEHICLES[category]))
            classification.has_trailer = name in frame.trailers
            if classification.has_trailer:
                classification.trailer_id.value = ids.of(ACTOR, frame.trailers[name])
            _set_axles(moving_object.vehicle_attributes, view.offset[row], run.axles.get(name))
            role = _ROLES.get(run.roles[name], "OTHER") if name in run.roles else ""
            if role:
                classification.role = osi.moving_object.VehicleClassification.Role.Value(f"ROLE_{role}")
            _set_lights(osi, classification.light_state, frame.appearances.get(name), role)
        elif category == "pedestrian":
            set_vector(moving_object.pedestrian_attributes.bbcenter_to_root, -view.offset[row])


def _set_axles(attributes: Any, offset: Array, axles: AxleCenters | None) -> None:
    """Set the vectors from the center of the box to the centers of the axles, in the frame of the object.

    Of a vehicle with unknown axles, the rear one is the reference point, on the ground.
    """
    set_vector(attributes.bbcenter_to_rear, rear_axle(axles) - offset)
    if axles is not None and axles.front is not None:
        x, z = axles.front
        set_vector(attributes.bbcenter_to_front, np.array([x, 0.0, z]) - offset)
    for number, axle in enumerate(() if axles is None else axles.wheels):
        # OSI counts the wheels from the right to the left. Without a track width there is one, as of a bicycle
        for index, side in enumerate((-0.5, 0.5) if axle.track > 0.0 else (0.0,)):
            wheel = attributes.wheel_data.add(axle=number, index=index, wheel_radius=0.5 * axle.diameter)
            set_vector(wheel.position, np.array([axle.x, side * axle.track, axle.z]) - offset)
    if attributes.wheel_data:
        attributes.number_wheels = len(attributes.wheel_data)


def rear_axle(axles: AxleCenters | None) -> Array:
    """Return the center of the rear axle from the reference point (3,) [m], the origin of OSI's vehicle frame."""
    x, z = (0.0, 0.0) if axles is None else axles.rear
    return np.array([x, 0.0, z])


def center_motion(view: WorldView, arms: Array) -> tuple[Array, Array]:
    """Return velocity [m/s] and acceleration [m/s²] (N, 3) of the box centers.

    arms  (N, 3) from the reference points to the centers in the world frame [m]

    The share of the yaw acceleration, which views do not contain, is omitted.
    """
    rate = view.yaw_rate[:, None]
    turned = np.column_stack([-arms[:, 1], arms[:, 0], np.zeros(len(arms))])
    inward = np.column_stack([arms[:, :2], np.zeros(len(arms))])
    return view.velocity + rate * turned, view.acceleration - rate**2 * inward


def _set_lights(osi: Osi, state: Any, appearance: Appearance | None, role: str) -> None:
    """Set the lights that the scenario switches; the others have no state."""
    if appearance is None or not appearance.lights:
        return
    kinds = osi.moving_object.VehicleClassification.LightState
    modes = {name: light.mode != "off" for name, light in appearance.lights.items()}
    for field, names in _GENERIC.items():
        if (is_on := next((modes[name] for name in names if name in modes), None)) is not None:
            value = f"GENERIC_LIGHT_STATE_{'ON' if is_on else 'OFF'}"
            setattr(state, field, kinds.GenericLightState.Value(value))
    if any(name in modes for name, _ in _INDICATORS):
        shown = next((word for name, word in _INDICATORS if modes.get(name)), "OFF")
        state.indicator_state = kinds.IndicatorState.Value(f"INDICATOR_STATE_{shown}")
    if "brakeLights" in modes:
        word = "NORMAL" if modes["brakeLights"] else "OFF"
        state.brake_light_state = kinds.BrakeLightState.Value(f"BRAKE_LIGHT_STATE_{word}")
    light = appearance.lights.get("specialPurposeLights")
    if light is not None:
        is_amber = light.color is not None and light.color[0] > light.color[2]
        is_service = role in _SERVICE or (role not in _EMERGENCY and is_amber)
        field = "service_vehicle_illumination" if is_service else "emergency_vehicle_illumination"
        word = {"flashing": f"FLASHING_{'AMBER' if is_service else 'BLUE'}"}.get(light.mode, light.mode.upper())
        setattr(state, field, kinds.GenericLightState.Value(f"GENERIC_LIGHT_STATE_{word}"))
