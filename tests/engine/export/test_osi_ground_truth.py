"""OSI ground truth, read by osi-python: poses, identifiers, types, lights, lanes and environment."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from opendrive_xml import (
    elevation_xml,
    junction_xml,
    lane_links_xml,
    lane_xml,
    map_xml,
    predecessor_xml,
    road_xml,
    section_xml,
    successor_xml,
    superelevation_xml,
)
from openscenario_xml import object_xml, road_file_xml, scenario_xml, vehicle_xml
from osi3trace.osi_trace import OSITrace
from scipy.spatial.transform import Rotation
from storyboard_xml import end_xml, init_xml, lane_position_xml, teleport_xml, world_position_xml
from written_recording import Body, detected, step, view, write_run

from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.export.osi.trace import GROUND_TRUTH, write_osi
from eidrive_scenario.export.recorded_run import open_run
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.simulation import RunSettings
from eidrive_scenario.world.appearance import Appearance, LightState

ROADS = Path(__file__).parents[3] / "xosc" / "roads"
MILLIMETER = 1e-3
PAINT = '<Properties><Property name="eidrive.color" value="#ff8000"/></Properties>'


def messages(path: Path) -> list[Any]:
    trace = OSITrace(str(path), "GroundTruth", topic=GROUND_TRUTH if path.suffix == ".mcap" else None)
    found = list(trace)
    trace.close()
    return found


def exported(folder: Path, *frames: Frame, road: Path | None = None, name: str = "trace.mcap") -> list[Any]:
    write_osi(write_run(folder, frames, road=road), folder / name)
    return messages(folder / name)


def vector(found: Any) -> list[float]:
    return [found.x, found.y, found.z]


@pytest.fixture(scope="module")
def scenario_3(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return the recording and the trace of a run with traffic lights."""
    folder = tmp_path_factory.mktemp("osi")
    result = run_and_save("coop/scenario_3", settings=RunSettings(time_limit=6.0), out=folder)
    assert result.recording is not None
    write_osi(open_run(result.recording), folder / "trace.mcap")
    return result.recording, folder / "trace.mcap"


@pytest.mark.statistical
def test_positions_of_trace_equal_those_of_the_run(scenario_3: tuple[Path, Path]) -> None:
    """The box center, less its rotated offset, is the reference point of OpenSCENARIO."""
    frames = list(read_recording(scenario_3[0]).frames())
    truths = messages(scenario_3[1])
    assert len(truths) == len(frames) > 100
    for frame, truth in zip(frames, truths, strict=True):
        assert truth.timestamp.seconds + 1e-9 * truth.timestamp.nanos == pytest.approx(frame.view.time, abs=1e-9)
        assert len(truth.moving_object) == len(frame.view.names)
        for row, found in enumerate(truth.moving_object):
            angles = found.base.orientation
            turn = Rotation.from_euler("ZYX", [angles.yaw, angles.pitch, angles.roll])
            position = vector(found.base.position) - turn.apply(frame.view.offset[row])
            assert np.abs(position - frame.view.position[row]).max() < MILLIMETER


def test_axles_are_measured_from_the_box_center_on_any_slope(tmp_path: Path) -> None:
    """OSI: bbcenter_to_rear and bbcenter_to_front lead to the middle of the axles, in the frame of the object.

    The center is at (1.4, 0, 0.75). The axles of the car are at x of 2.8 and 0 m, the one of the trailer at -1.2 m, all
    0.3 m high. The road climbs by 10 % and is banked by 0.2 rad.
    """
    trailer = re.sub("<FrontAxle.*?/>", "", vehicle_xml().replace('positionX="0"', 'positionX="-1.2"'))
    walker = (
        '<Pedestrian name="p" mass="80" pedestrianCategory="pedestrian"><BoundingBox><Center x="0" y="0" z="0.9"/>'
        '<Dimensions width="0.5" length="0.5" height="1.8"/></BoundingBox><Properties/></Pedestrian>'
    )
    road = tmp_path / "slope.xodr"
    road.write_text(map_xml(road_xml(length=400.0, profiles=elevation_xml(slope=0.1) + superelevation_xml(0.2))))
    scenario = scenario_xml(
        entities=object_xml("Ego") + object_xml("Trailer", trailer) + object_xml("Walker", walker),
        init="".join(
            init_xml(name, teleport_xml(lane_position_xml(-1, s)))
            for name, s in (("Ego", 100), ("Trailer", 50), ("Walker", 150))
        ),
        stop=end_xml(0.1),
        road=road_file_xml(road),
    )
    result = run_and_save(scenario, out=tmp_path / "run")
    assert result.recording is not None
    write_osi(open_run(result.recording), tmp_path / "trace.mcap")
    car, towed, person = messages(tmp_path / "trace.mcap")[-1].moving_object
    assert car.base.orientation.pitch < -0.09
    assert vector(car.vehicle_attributes.bbcenter_to_rear) == pytest.approx([-1.4, 0.0, -0.45])
    assert vector(car.vehicle_attributes.bbcenter_to_front) == pytest.approx([1.4, 0.0, -0.45])
    assert vector(towed.vehicle_attributes.bbcenter_to_rear) == pytest.approx([-2.6, 0.0, -0.45])
    assert not towed.vehicle_attributes.HasField("bbcenter_to_front")
    assert not person.HasField("vehicle_attributes")


def test_wheels_are_counted_from_front_right_and_measured_from_the_box_center(tmp_path: Path) -> None:
    """OSI: axle 0 is the front-most one, and "the rear-right wheel would be (axle=1, index=0)" on a car.

    The center is at (1.4, 0, 0.75). The wheels of 0.6 m are at x of 2.8 and 0 m, y of 0.8 m to both sides, z of 0.3 m.
    The bicycle has no track width, so that it has one wheel on each axle.
    """
    car = vehicle_xml()
    bicycle = re.sub('trackWidth="[^"]*"', 'trackWidth="0"', car)
    init = "".join(init_xml(name, teleport_xml(world_position_xml(0))) for name in ("Car", "Bicycle"))
    entities = object_xml("Car", car) + object_xml("Bicycle", bicycle)
    result = run_and_save(scenario_xml(entities=entities, init=init, stop=end_xml(0.1)), out=tmp_path / "run")
    assert result.recording is not None
    write_osi(open_run(result.recording), tmp_path / "trace.mcap")
    four, two = (one.vehicle_attributes for one in messages(tmp_path / "trace.mcap")[0].moving_object)
    assert (four.number_wheels, two.number_wheels) == (4, 2)
    wheels = {(wheel.axle, wheel.index): vector(wheel.position) for wheel in four.wheel_data}
    assert wheels == {
        (0, 0): pytest.approx([1.4, -0.8, -0.45]),
        (0, 1): pytest.approx([1.4, 0.8, -0.45]),
        (1, 0): pytest.approx([-1.4, -0.8, -0.45]),
        (1, 1): pytest.approx([-1.4, 0.8, -0.45]),
    }
    assert {wheel.wheel_radius for wheel in four.wheel_data} == {0.3}
    assert [(wheel.axle, wheel.index, wheel.position.y) for wheel in two.wheel_data] == [(0, 0, 0.0), (1, 0, 0.0)]


def test_rear_axle_of_vehicle_with_unknown_axles_is_the_reference_point(tmp_path: Path) -> None:
    """As of background traffic, and of recordings that lack the axles."""
    (truth,) = exported(tmp_path, Frame(view({"A": {}})))
    attributes = truth.moving_object[0].vehicle_attributes
    assert vector(attributes.bbcenter_to_rear) == pytest.approx([-1.4, 0.0, -0.75])
    assert not attributes.HasField("bbcenter_to_front")


def test_identifiers_are_unique_and_stable(scenario_3: tuple[Path, Path]) -> None:
    by_name: dict[str, int] = {}
    for truth in messages(scenario_3[1]):
        kinds = (truth.moving_object, truth.traffic_light, truth.lane, truth.lane_boundary)
        numbers = [found.id.value for kind in kinds for found in kind]
        assert len(set(numbers)) == len(numbers)
        for found in truth.moving_object:
            name = found.source_reference[0].identifier[1]
            assert by_name.setdefault(name, found.id.value) == found.id.value
        assert truth.host_vehicle_id.value == by_name["Ego"]


def test_reentering_actor_keeps_its_identifier(tmp_path: Path) -> None:
    both: dict[str, Body] = {"A": {}, "B": {"position": (9.0, 0.0, 0.0)}}
    one: dict[str, Body] = {"A": {}}
    truths = exported(tmp_path, *(Frame(view(bodies, tick)) for tick, bodies in enumerate([both, one, both])))
    first, _, last = ([found.id.value for found in truth.moving_object] for truth in truths)
    assert first == last


def test_box_center_of_inclined_body_follows_all_angles(tmp_path: Path) -> None:
    """A body that stands on its tail (nose up by 90°) has its center 1.4 m above its reference point and behind it."""
    body = {"angles": (0.0, -np.pi / 2, 0.0), "position": (10.0, 5.0, 1.0)}
    (truth,) = exported(tmp_path, Frame(view({"A": body})))
    assert vector(truth.moving_object[0].base.position) == pytest.approx([10.0 - 0.75, 5.0, 1.0 + 1.4])


@pytest.mark.parametrize("angles", [(3 * np.pi / 2, 0.1, -0.2), (-7.0, 0.0, 4.0), (2 * np.pi, -6.2, 9.0)])
def test_angles_are_in_the_range_that_osi_prefers(tmp_path: Path, angles: tuple[float, float, float]) -> None:
    """Orientation3d: "The preferred angular range is (-pi, pi]"; scenarios may write other angles."""
    (truth,) = exported(tmp_path, Frame(view({"A": {"angles": angles}})))
    found = truth.moving_object[0].base.orientation
    written = [found.yaw, found.pitch, found.roll]
    assert np.abs(written).max() <= np.pi
    expected = Rotation.from_euler("ZYX", angles)
    assert (Rotation.from_euler("ZYX", written).inv() * expected).magnitude() < 1e-12


def test_velocity_of_turning_body_is_that_of_its_center(tmp_path: Path) -> None:
    """A body that turns in place with 0.5 rad/s moves its center, 1.4 m ahead, to the left and accelerates it back."""
    (truth,) = exported(tmp_path, Frame(view({"A": {"yaw_rate": 0.5}})))
    base = truth.moving_object[0].base
    assert vector(base.velocity) == pytest.approx([0.0, 0.7, 0.0])
    assert vector(base.acceleration) == pytest.approx([-0.35, 0.0, 0.0])
    assert base.orientation_rate.yaw == 0.5


@pytest.mark.parametrize(
    ("category", "kind", "entity", "vehicle"),
    [
        ("car", "TYPE_VEHICLE", "Vehicle", "TYPE_CAR"),
        ("bicycle", "TYPE_VEHICLE", "Vehicle", "TYPE_BICYCLE"),
        ("truck", "TYPE_VEHICLE", "Vehicle", "TYPE_HEAVY_TRUCK"),
        ("pedestrian", "TYPE_PEDESTRIAN", "Pedestrian", None),
        ("misc", "TYPE_OTHER", "MiscObject", None),
    ],
)
def test_category_selects_type_of_object(
    tmp_path: Path, category: str, kind: str, entity: str, vehicle: str | None
) -> None:
    (truth,) = exported(tmp_path, Frame(view({"A": {"category": category}})))
    (found,) = truth.moving_object
    assert type(found).Type.Name(found.type) == kind
    assert found.HasField("vehicle_classification") == (vehicle is not None)
    # osi_object.proto: pedestrian_attributes are mandatory for pedestrians; the root is the reference point.
    assert found.HasField("pedestrian_attributes") == (kind == "TYPE_PEDESTRIAN")
    if kind == "TYPE_PEDESTRIAN":
        assert vector(found.pedestrian_attributes.bbcenter_to_root) == pytest.approx([-1.4, 0.0, -0.75])
    assert found.source_reference[0].identifier == [entity, "A"]
    if vehicle is not None:
        assert type(found).VehicleClassification.Type.Name(found.vehicle_classification.type) == vehicle


def test_host_vehicle_is_first_driven_station(tmp_path: Path) -> None:
    bodies = {"Ego": {}, "Mast": {"category": "misc"}, "Driven": {}}
    steps = {"Mast": step(detected(0.0, []), drives=False), "Driven": step(detected(0.0, []))}
    (truth,) = exported(tmp_path, Frame(view(bodies), steps))
    host = next(found for found in truth.moving_object if found.id.value == truth.host_vehicle_id.value)
    assert host.source_reference[0].identifier == ["Vehicle", "Driven"]


def test_host_vehicle_may_enter_later(tmp_path: Path) -> None:
    """A station that drives is the host vehicle of the whole run, else an ego, else the first vehicle."""
    early, late = Frame(view({"Car": {}})), Frame(view({"Car": {}, "Ego": {}}, tick=1))
    driven = Frame(view({"Car": {}, "Ego": {}, "Driven": {}}, tick=2), {"Driven": step(detected(0.2, []))})
    for frames, host in (([early], "Car"), ([early, late], "Ego"), ([early, late, driven], "Driven")):
        truths = exported(tmp_path, *frames)
        last = {found.id.value: found.source_reference[0].identifier[1] for found in truths[-1].moving_object}
        assert [last[truth.host_vehicle_id.value] for truth in truths] == [host] * len(frames)


def test_run_without_vehicle_has_no_host(tmp_path: Path) -> None:
    (truth,) = exported(tmp_path, Frame(view({"Walker": {"category": "pedestrian"}})))
    assert not truth.HasField("host_vehicle_id")
    assert len(truth.moving_object) == 1


def test_switched_lights_are_states(tmp_path: Path) -> None:
    lights = {name: LightState(name, mode) for name, mode in (("indicatorLeft", "flashing"), ("lowBeam", "off"))}
    frame = Frame(view({"A": {}, "B": {}}), appearances={"A": Appearance(lights)})
    (truth,) = exported(tmp_path, frame)
    state, other = (found.vehicle_classification.light_state for found in truth.moving_object)
    assert type(state).IndicatorState.Name(state.indicator_state) == "INDICATOR_STATE_LEFT"
    assert type(state).GenericLightState.Name(state.head_light) == "GENERIC_LIGHT_STATE_OFF"
    assert not state.HasField("brake_light_state")
    assert not other.HasField("indicator_state")


@pytest.mark.parametrize(
    ("lights", "front", "rear"),
    [
        ({"fogLightsFront": "on", "fogLightsRear": "off"}, "ON", "OFF"),
        ({"fogLightsRear": "on"}, "UNKNOWN", "ON"),
        ({"fogLights": "on"}, "ON", "ON"),
    ],
)
def test_fog_lights_are_those_at_the_front_and_rear(
    tmp_path: Path, lights: dict[str, str], front: str, rear: str
) -> None:
    """`fogLights` comprises both. It is in recordings of older versions only."""
    states = {name: LightState(name, mode) for name, mode in lights.items()}
    (truth,) = exported(tmp_path, Frame(view({"A": {}}), appearances={"A": Appearance(states)}))
    lit = truth.moving_object[0].vehicle_classification.light_state
    named = [type(lit).GenericLightState.Name(value) for value in (lit.front_fog_light, lit.rear_fog_light)]
    assert named == [f"GENERIC_LIGHT_STATE_{state}" for state in (front, rear)]


@pytest.mark.parametrize(
    ("role", "color", "mode", "field", "state"),
    [
        ("police", None, "flashing", "emergency_vehicle_illumination", "FLASHING_BLUE"),
        ("police", (1.0, 0.5, 0.0), "flashing", "emergency_vehicle_illumination", "FLASHING_BLUE"),
        ("roadAssistance", None, "flashing", "service_vehicle_illumination", "FLASHING_AMBER"),
        ("civil", (1.0, 0.5, 0.0), "flashing", "service_vehicle_illumination", "FLASHING_AMBER"),
        ("civil", (0.0, 0.0, 1.0), "on", "emergency_vehicle_illumination", "ON"),
        ("garbageCollection", None, "off", "service_vehicle_illumination", "OFF"),
    ],
)
def test_special_purpose_lights_depend_on_role_and_color(
    tmp_path: Path, role: str, color: tuple[float, float, float] | None, mode: str, field: str, state: str
) -> None:
    """GenericLightState: flashing blue is "to be used for emergency vehicles", amber "for service vehicles"."""
    lights = {"specialPurposeLights": LightState("specialPurposeLights", mode, color=color)}
    run = write_run(
        tmp_path,
        [Frame(view({"A": {}}), appearances={"A": Appearance(lights)})],
        metadata={"roles": json.dumps({"A": role})},
    )
    write_osi(run, tmp_path / "trace.mcap")
    (truth,) = messages(tmp_path / "trace.mcap")
    lit = truth.moving_object[0].vehicle_classification.light_state
    (only,) = lit.ListFields()
    assert only[0].name == field
    assert type(lit).GenericLightState.Name(only[1]) == f"GENERIC_LIGHT_STATE_{state}"


def test_role_and_paint_are_those_of_the_scenario(tmp_path: Path) -> None:
    """The paint #ff8000 is 255, 128 and 0 of 255. Neither is set where the scenario omits it."""
    plain = vehicle_xml()
    painted = plain.replace("<Vehicle ", '<Vehicle role="fire" ', 1)
    painted = re.sub("<Properties */>|<Properties></Properties>", PAINT, painted)
    assert PAINT in painted
    result = run_and_save(
        scenario_xml(
            entities=object_xml("Ego", painted) + object_xml("Plain", plain),
            init="".join(init_xml(name, teleport_xml(world_position_xml(0))) for name in ("Ego", "Plain")),
            stop=end_xml(0.1),
        ),
        out=tmp_path / "run",
    )
    assert result.recording is not None
    write_osi(open_run(result.recording), tmp_path / "trace.mcap")
    (ego, other) = messages(tmp_path / "trace.mcap")[0].moving_object
    assert ego.vehicle_classification.role == ego.VehicleClassification.ROLE_FIRE
    rgb = ego.color_description.rgb
    assert (rgb.red, rgb.green, rgb.blue) == pytest.approx((1.0, 128 / 255, 0.0))
    assert not other.HasField("color_description")
    assert not other.vehicle_classification.HasField("role")


def test_traffic_lights_have_one_entity_per_lamp(scenario_3: tuple[Path, Path]) -> None:
    """Modes follow from the recorded states, which are lists of lamps from top to bottom or names of colors.

    osi_trafficlight.proto excludes MODE_UNKNOWN from ground truth; lights without a state are dark.
    """
    frames = list(read_recording(scenario_3[0]).frames())
    truths = messages(scenario_3[1])
    shown = set()
    for frame, truth in zip(frames, truths, strict=True):
        heads: dict[str, list[Any]] = {}
        for lamp in truth.traffic_light:
            heads.setdefault(lamp.source_reference[0].identifier[0], []).append(lamp)
        assert set(frame.signals) <= set(heads)
        for signal, lamps in heads.items():
            heights = [lamp.base.position.z for lamp in lamps]
            assert heights == sorted(heights, reverse=True)
            assert len(lamps) == 3
            kinds = type(lamps[0].classification)
            lit = [lamp for lamp in lamps if kinds.Mode.Name(lamp.classification.mode) == "MODE_CONSTANT"]
            modes_found = {kinds.Mode.Name(lamp.classification.mode) for lamp in lamps}
            state = frame.signals.get(signal)
            assert (state is None) == (not lit)
            assert modes_found == ({"MODE_OFF"} if state is None else {"MODE_OFF", "MODE_CONSTANT"})
            if state is not None:
                colors = {kinds.Color.Name(lamp.classification.color).removeprefix("COLOR_").lower() for lamp in lit}
                modes = dict(zip(("red", "yellow", "green"), state.split(";"), strict=True))
                assert colors == {color for color, mode in modes.items() if mode == "on"}
                shown |= colors
    assert shown


def test_lanes_have_boundaries_on_both_sides(tmp_path: Path) -> None:
    """The center line lies on the lane of the map, and half a width between the boundaries left and right of it."""
    road = ROADS / "coop_1.xodr"
    first, second = exported(tmp_path, *(Frame(view({"A": {}}, tick)) for tick in range(2)), road=road)
    assert len(second.lane) == len(second.lane_boundary) == 0
    network = RoadNetwork.load(road)
    lanes = {found.id.value: found for found in first.lane}
    lines = {
        found.id.value: np.array([vector(point.position) for point in found.boundary_line])
        for found in first.lane_boundary
    }
    checked = 0
    for lane in first.lane:
        name, start, number = lane.source_reference[0].identifier
        data = lane.classification
        center = np.array([vector(point) for point in data.centerline])
        pose = network.lane_pose_at(name, int(number), float(start))
        assert center[0] == pytest.approx([pose.x, pose.y, pose.z], abs=1e-6)
        along = (center[1] - center[0])[:2]
        for ids, sign in ((data.left_lane_boundary_id, 1.0), (data.right_lane_boundary_id, -1.0)):
            edge = lines[ids[0].value][0] - center[0]
            assert abs(edge[2]) < 0.2
            beside = along[0] * edge[1] - along[1] * edge[0]
            assert sign * beside >= 0.0
            width = network.lane_width(name, int(number), float(start))
            assert np.hypot(edge[0], edge[1]) == pytest.approx(width / 2, abs=1e-6)
            checked += 1
        for neighbor in data.left_adjacent_lane_id:
            assert lane.id.value in [one.value for one in lanes[neighbor.value].classification.right_adjacent_lane_id]
        assert data.centerline_is_driving_direction == (network.driving_direction(name, int(number)) == 1)
        for pairing in data.lane_pairing:
            if pairing.HasField("successor_lane_id"):
                after = lanes[pairing.successor_lane_id.value].classification
                ends = [vector(after.centerline[0]), vector(after.centerline[-1])]
                assert min(np.linalg.norm(center[-1] - end) for end in ends) < 0.05
    assert checked > 10


def test_lane_pairings_are_the_ways_over_a_lane(tmp_path: Path) -> None:
    """OSI: "There can be multiple pairings with the same antecessor and different successor lanes and vice versa."

    Road 1 leads to road 2, and this to the roads 3 and 4 of a junction. Their lanes 1 run against s, and have no links.
    """
    straight = section_xml(lane_xml(1), lane_xml(-1, link=lane_links_xml(-1, -1)))
    connecting = section_xml("", lane_xml(-1, link=lane_links_xml(before=-1)))
    road = tmp_path / "fork.xodr"
    road.write_text(
        map_xml(
            road_xml("1", link=successor_xml("2"), lanes=straight),
            road_xml("2", x=100.0, link=predecessor_xml("1") + successor_xml(junction="9"), lanes=straight),
            *(road_xml(name, x=200.0, link=predecessor_xml("2"), lanes=connecting, junction="9") for name in "34"),
            rest=junction_xml("9", "2", {"3": -1, "4": -1}),
        )
    )
    (truth,) = exported(tmp_path, Frame(view({"A": {}})), road=road)
    names = {lane.id.value: "/".join(lane.source_reference[0].identifier[::2]) for lane in truth.lane}
    pairs = {
        names[lane.id.value]: [
            (names.get(pair.antecessor_lane_id.value), names.get(pair.successor_lane_id.value))
            for pair in lane.classification.lane_pairing
        ]
        for lane in truth.lane
    }
    assert pairs == {
        "1/1": [],
        "1/-1": [(None, "2/-1")],
        "2/1": [],
        "2/-1": [("1/-1", "3/-1"), ("1/-1", "4/-1")],
        "3/-1": [("2/-1", None)],
        "4/-1": [("2/-1", None)],
    }


def test_actor_is_assigned_to_its_lane(tmp_path: Path) -> None:
    road = ROADS / "coop_1.xodr"
    network = RoadNetwork.load(road)
    lane = next(one for one in network.roads["1"].sections[0].lanes.values() if one.drivable)
    pose = network.lane_pose_at("1", lane.id, 20.0)
    body = {"position": (pose.x, pose.y, pose.z), "offset": (0.0, 0.0, 0.75)}
    off = {"position": (pose.x, pose.y + 500.0, 0.0)}
    (truth,) = exported(tmp_path, Frame(view({"A": body, "Off": off})), road=road)
    on_road, off_road = truth.moving_object
    (assigned,) = on_road.assigned_lane_id
    found = next(one for one in truth.lane if one.id.value == assigned.value)
    assert found.source_reference[0].identifier == ["1", "0.0", str(lane.id)]
    assert not off_road.assigned_lane_id


def test_single_channel_trace_contains_the_same_messages(scenario_3: tuple[Path, Path], tmp_path: Path) -> None:
    write_osi(open_run(scenario_3[0]), tmp_path / "trace.osi")
    assert [one.SerializeToString() for one in messages(tmp_path / "trace.osi")] == [
        one.SerializeToString() for one in messages(scenario_3[1])
    ]


def test_trailers_have_their_types_and_identifiers(tmp_path: Path) -> None:
    """Per OSI, trailer_id is that of the towed object. A trailer is no host, even as the first vehicle."""
    bodies: dict[str, Body] = {name: {"category": "truck"} for name in ("Trailer", "Truck", "Dolly")}
    frames = [Frame(view(bodies), trailers={"Truck": "Dolly", "Dolly": "Trailer"}), Frame(view(bodies, 1))]
    metadata = {"trailers": '{"Dolly": "trailer", "Trailer": "semitrailer"}'}
    run = write_run(tmp_path, frames, metadata=metadata)
    assert [dict(frame.trailers) for frame in run.frames()] == [dict(frame.trailers) for frame in frames]
    write_osi(run, tmp_path / "trace.mcap")
    coupled, apart = messages(tmp_path / "trace.mcap")
    trailer, truck, dolly = (found.id.value for found in coupled.moving_object)
    kinds = type(coupled.moving_object[0].vehicle_classification)
    assert coupled.host_vehicle_id.value == truck
    data = [found.vehicle_classification for found in coupled.moving_object]
    assert [one.type for one in data] == [kinds.TYPE_SEMITRAILER, kinds.TYPE_HEAVY_TRUCK, kinds.TYPE_TRAILER]
    assert [(one.has_trailer, one.trailer_id.value) for one in data] == [(False, 0), (True, dolly), (True, trailer)]
    assert not any(found.vehicle_classification.has_trailer for found in apart.moving_object)
