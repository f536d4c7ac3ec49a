"""Association of image boxes with traffic lights of the map, and lamp states."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.extensions.library import library_path
from eidrive_scenario.perception.detector import DetectorContext, ImageDetections
from eidrive_scenario.perception.geometry.projection import pixels
from eidrive_scenario.perception.learned.detector import YoloDetector
from eidrive_scenario.perception.learned.lights import (
    NONE,
    SHOWN,
    WEIGHTS,
    LightsOnMap,
    LightStates,
    crops,
    lamp_network,
    signal_kinds,
)
from eidrive_scenario.perception.learned.settings import LearnedSettings
from eidrive_scenario.rendering import picture_maker
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.camera import ImageSensor
from eidrive_scenario.sensing.readings import CameraReading, EgoState, Readings, SignalReading
from eidrive_scenario.sensing.settings import CameraSettings, Mount
from eidrive_scenario.sensing.signals import SIGNAL_KINDS
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.road_objects import signal_heads
from eidrive_scenario.world.weather import Weather

ONNX = Path(__file__).parents[2] / "data" / "red_boxes.onnx"
NIGHT = Weather(sun_elevation=-20.0, street_lighting=8.0)
RAIN = Weather(cloud_cover=1.0, visual_range=3000.0, precipitation="rain", precipitation_intensity=10.0, wetness=0.6)
CROSSING = RoadNetwork.load(library_path() / "roads" / "coop_2.xodr")
STOPPING = RoadNetwork.load(library_path() / "roads" / "coop_1.xodr")
TRUCK = ActorSpec("Truck", "truck", "truck", (8.3, 2.5, 3.55), (2.5, 0.0, 1.78), wheelbase=5.0, wheel_radius=0.5)


def before(roads: RoadNetwork, signal: str, distance: float, aside: float = 0.0) -> np.ndarray:
    """Return the pose of a camera at a distance before a signal, 1.5 m above the road, that faces the signal."""
    head = next(head for head in signal_heads(roads) if head.signal.id == signal)
    heading, pose = head.pose.h + math.pi, np.eye(4)
    cos, sin = math.cos(heading), math.sin(heading)
    pose[:3, :3] = np.array([[sin, 0.0, cos], [-cos, 0.0, sin], [0.0, -1.0, 0.0]])
    pose[:3, 3] = head.pose.x - distance * cos - aside * sin, head.pose.y - distance * sin + aside * cos, 1.5
    return pose


def take_image(
    roads: RoadNetwork,
    pose: np.ndarray,
    states: dict[str, str],
    weather: Weather | None = None,
    others: Sequence[tuple[ActorSpec, Placement]] = (),
) -> CameraReading:
    with World(roads, picture_maker=picture_maker) as world:
        for spec, placement in others:
            world.add(spec, placement)
        if weather is not None:
            world.set_weather(weather)
        world.set_display_state(states, {})
        return ImageSensor(CameraSettings(width=800, height=600, fov=80.0)).capture(world, pose, generator(3, "lights"))


def box_around(roads: RoadNetwork, signal: str, camera: CameraReading) -> list[float]:
    head = next(head for head in signal_heads(roads) if head.signal.id == signal)
    x, y, z = head.pose[:3]
    (u, low), (_, high) = pixels(np.array([[x, y, z], [x, y, z + head.height]]), camera)[0].tolist()
    half = (low - high) * head.width / head.height / 2.0
    return [u - half, high, u + half, low]


def found(boxes: Sequence[Sequence[float]], scores: Sequence[float], classes: tuple[str, ...]) -> ImageDetections:
    return ImageDetections(np.array(boxes, dtype=float).reshape(-1, 4), np.array(scores, dtype=float), classes)


NOTHING = found([], [], ())


@pytest.mark.exhaustive
@pytest.mark.parametrize("weather", [None, NIGHT, RAIN], ids=["day", "night", "rain"])
@pytest.mark.parametrize("state", ["red", "redYellow", "yellow", "green"])
def test_read_without_boxes_returns_lamp_states_at_map_positions(state: str, weather: Weather | None) -> None:
    """No network box indicates the light. The roads of the library are not in the training images."""
    camera = take_image(CROSSING, before(CROSSING, "10", 18.0, aside=2.0), {"10": state}, weather)
    assert SignalReading("10", state) in LightsOnMap(CROSSING).read({"camera": NOTHING}, {"camera": camera})


def test_read_dark_light_is_off_and_hidden_light_is_missing() -> None:
    pose = before(CROSSING, "10", 16.0)
    free = take_image(CROSSING, pose, {"10": ""})
    assert SignalReading("10", "off") in LightsOnMap(CROSSING).read({"camera": NOTHING}, {"camera": free})
    x, y = (pose[:2, 3] + 9.0 * pose[:2, 2]).tolist()
    across = Placement(x, y, yaw=math.atan2(pose[1, 0], pose[0, 0]))
    for state in ("red", "green"):
        hidden = take_image(CROSSING, pose, {"10": state}, others=[(TRUCK, across)])
        features = LightsOnMap(CROSSING).read({"camera": NOTHING}, {"camera": hidden})
        assert "10" not in {reading.id for reading in features}


def test_in_view_excludes_lights_from_behind_and_outside_image() -> None:
    lights = LightsOnMap(CROSSING)
    pose = before(CROSSING, "10", 18.0)
    assert "10" in {view.id for view in lights.in_view(take_image(CROSSING, pose, {}))}
    away = pose.copy()
    away[:3, 0], away[:3, 2] = -pose[:3, 0], -pose[:3, 2]
    assert "10" not in {view.id for view in lights.in_view(take_image(CROSSING, away, {}))}
    past = before(CROSSING, "10", -18.0)
    past[:3, 0], past[:3, 2] = -past[:3, 0], -past[:3, 2]
    assert "10" not in {view.id for view in lights.in_view(take_image(CROSSING, past, {}))}


def test_read_in_box_prefers_lamps_to_network_class() -> None:
    camera = take_image(CROSSING, before(CROSSING, "10", 15.0), {"10": "green"})
    box = box_around(CROSSING, "10", camera)
    lights = LightsOnMap(CROSSING)
    for name in ("traffic light red", "traffic light off", "traffic light"):
        features = lights.read({"camera": found([box], [0.95], (name,))}, {"camera": camera})
        assert SignalReading("10", "green") in features


def test_read_small_light_uses_network_class() -> None:
    """At 95 m a light is 5 pixels high."""
    camera = take_image(CROSSING, before(CROSSING, "10", 95.0), {"10": "red"})
    u = box_around(CROSSING, "10", camera)
    lights = LightsOnMap(CROSSING)
    assert "10" not in {view.id for view in lights.in_view(camera)}
    boxes = found(
        [u, u, [10.0, 10.0, 20.0, 36.0], u],
        [0.8, 0.9, 0.7, 0.99],
        ("traffic light red", "traffic light green", "traffic light red", "car"),
    )
    readings = {reading.id: reading.state for reading in lights.read({"camera": boxes}, {"camera": camera})}
    assert readings["10"] == "green"
    stop = found([u], [0.9], ("stop sign",))
    assert "10" not in {reading.id for reading in lights.read({"camera": stop}, {"camera": camera})}
    assert LightsOnMap(None).read({"camera": boxes}, {"camera": camera}) == ()


def test_read_stop_sign_box_returns_stop_sign_of_map() -> None:
    camera = take_image(STOPPING, before(STOPPING, "10", 15.0), {})
    boxes = found([box_around(STOPPING, "10", camera)], [0.7], ("stop sign",))
    assert LightsOnMap(STOPPING).read({"camera": boxes}, {"camera": camera}) == (SignalReading("10", "stop"),)
    assert LightsOnMap(STOPPING).read({"camera": NOTHING}, {"camera": camera}) == ()


def test_detectable_signals_follow_network_classes() -> None:
    assert signal_kinds(("car", "stop sign")) == SIGNAL_KINDS
    assert signal_kinds(("car", "traffic light")) == {"light"}
    settings = LearnedSettings(weights=str(ONNX), classes=("truck", "car"), input_size=(96, 64))
    detector = YoloDetector(settings)
    detector.load_weights()
    assert detector.detectable_signals == {"light"}
    detector.setup(DetectorContext(TRUCK, {}, CROSSING))
    camera = take_image(CROSSING, before(CROSSING, "10", 15.0), {"10": "red"})
    x, y, _ = camera.pose[:3, 3].tolist()
    detector.detect(Readings(0.0, EgoState(0.0, np.array([x, y, 0.0]), 0, 0, 0, 0, 0, 0), cameras={"camera": camera}))
    assert SignalReading("10", "red") in detector.signals()


@pytest.mark.parametrize(("distance", "aside", "readable"), [(6.2, 6.0, True), (5.8, 6.0, False), (40.0, 0.0, True)])
def test_light_is_readable_inside_the_image(distance: float, aside: float, readable: bool) -> None:
    """With a field of view of 90° the image ends where a light is as far aside as ahead of the camera."""
    settings = LearnedSettings(weights=str(ONNX), classes=("truck", "car"), input_size=(96, 64))
    detector = YoloDetector(settings)
    detector.load_weights()
    camera = CameraSettings(width=640, height=480, fov=90.0, mount=Mount(x=2.0, y=0.0, z=1.5))
    detector.setup(DetectorContext(TRUCK, {"camera": camera}, CROSSING))
    pose = before(CROSSING, "10", distance + 2.0, aside)
    x, y, _ = pose[:3, 3].tolist()
    assert detector.can_read_light("10", x, y, 0.0, math.atan2(pose[1, 2], pose[0, 2])) == readable


@pytest.mark.parametrize(
    ("readings", "confirmed"),
    [
        ("R G G R", "R R G R"),  # green is the second in succession, red the first one
        ("- G - G", "- - - G"),
        ("G Y R", "- Y R"),
        ("R o R o o R", "R R R R R R"),  # single misread images
        ("o o o R", "- - o R"),
        ("R" + 10 * " o", "R" + 9 * " R" + " o"),
        ("Y o Y o R", "Y Y F F R"),
    ],
)
def test_light_states_are_confirmed_by_further_images(readings: str, confirmed: str) -> None:
    """One image per second."""
    names = {"R": "red", "G": "green", "Y": "yellow", "o": "off", "F": "yellow flashing"}
    states, reported = LightStates(), []
    last = "-"
    for time, letter in enumerate(readings.split()):
        read = [SignalReading("10", names[letter])] if letter in names else []
        result = {reading.id: reading.state for reading in states.confirm(read, float(time))}
        last = next((key for key, name in names.items() if name == result.get("10")), "-")
        reported.append(last)
    assert " ".join(reported) == confirmed


def test_flashing_yellow_is_recognized_within_two_periods() -> None:
    """At 10 images per second, half a second lit and half a second dark; then steady yellow and red."""
    states, reported = LightStates(), []
    for number in range(100):
        time = number / 10.0
        shown = "red" if time >= 8.0 else "yellow" if time >= 4.0 or time % 1.0 < 0.5 else "off"
        (reading,) = states.confirm([SignalReading("10", shown)], time)
        reported.append(reading.state)
    assert set(reported[20:40]) == {"yellow flashing"}
    assert set(reported[70:80]) == {"yellow"}
    assert set(reported[80:]) == {"red"}


def test_class_without_state_does_not_replace_lamps() -> None:
    """A second camera, or a network with the class `traffic light` only, does not know the state."""
    camera = take_image(CROSSING, before(CROSSING, "10", 95.0), {"10": "red"})
    box = box_around(CROSSING, "10", camera)
    detected = {"a": found([box], [0.6], ("traffic light red",)), "b": found([box], [0.9], ("traffic light",))}
    assert SignalReading("10", "red") in LightsOnMap(CROSSING).read(detected, {"a": camera, "b": camera})


def test_lamp_network_equals_torch_implementation() -> None:
    torch = pytest.importorskip("torch", reason="needs the extra 'learned'")
    with np.load(WEIGHTS) as stored:
        weights = {name: torch.from_numpy(stored[name].astype(np.float32)) for name in stored.files}
    regions = np.random.default_rng(1).random((5, 3, 32, 16), dtype=np.float32)
    features = torch.from_numpy(regions)
    for number in range(3):
        features = torch.nn.functional.conv2d(features, weights[f"w{number}"], weights[f"b{number}"], padding=1).relu()
        features = torch.nn.functional.max_pool2d(features, 2) if number < 2 else features
    expected = torch.nn.functional.linear(features.flatten(1), weights["w3"], weights["b3"]).softmax(dim=1)
    np.testing.assert_allclose(lamp_network().probabilities(regions), expected.numpy(), atol=1e-5)
    assert lamp_network().probabilities(regions[:0]).shape == (0, len(SHOWN))
    metadata = json.loads(WEIGHTS.with_suffix(".json").read_text())
    assert metadata["shown"] == list(SHOWN)
    assert SHOWN[-1] == NONE


def test_crops_keep_position_and_aspect_ratio() -> None:
    """A light of 32 pixels has a margin of 16 pixels above and below; outside the image the border pixels repeat."""
    image = np.zeros((100, 200, 3), dtype=np.uint8)
    image[40:72, 92:100] = (200, 0, 0)
    region = crops(image, np.array([[100.0, 56.0]]), np.array([32.0]))[0]
    assert region.shape == (3, 32, 16)
    np.testing.assert_allclose(region[0, 8:24, 4:8], 1.0)
    assert region[0].sum() == pytest.approx(16 * 4)
    assert not region[1:].any()
    corner = crops(np.full((20, 20, 3), 99, dtype=np.uint8), np.array([[0.0, 0.0]]), np.array([300.0]))
    np.testing.assert_allclose(corner, 1.0)
