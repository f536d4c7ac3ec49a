"""Which traffic light of the map a box in a picture shows."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.library import library_path
from eidrive_scenario.perception.learned.image_network import ImageDetections
from eidrive_scenario.perception.learned.lights import LightsOnMap
from eidrive_scenario.perception.projection import pixels
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import CameraReading, SignalReading
from eidrive_scenario.world.camera import Pinhole


def camera_at(x: float, y: float) -> CameraReading:
    """At a height of 1.5 m, looking along x, 800 x 600 pixels, focal length 400 pixels."""
    pose = np.eye(4)
    pose[:3, :3] = [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    pose[:3, 3] = (x, y, 1.5)
    empty = np.zeros((600, 800), dtype=np.int32)
    lens = Pinhole(800, 600, 400.0, 400.0, 300.0)
    return CameraReading(
        np.zeros((600, 800, 3), dtype=np.uint8), empty.astype(np.float32), empty, lens.intrinsics, pose
    )


def test_boxes_are_matched_with_the_signals_that_are_there() -> None:
    roads = RoadNetwork.load(library_path() / "roads" / "coop_2.xodr")
    camera = camera_at(-10.0, 0.0)
    signal = roads.signals["10"]
    pose = roads.signal_pose(signal)
    place = np.array([[pose.x, pose.y, pose.z + signal.height / 2.0]])
    (u, v), depth = pixels(place, camera)[0][0], pixels(place, camera)[1][0]
    half = np.array([0.15, 0.43]) * 400.0 / depth
    shown = [u - half[0], v - half[1], u + half[0], v + half[1]]
    elsewhere = [10.0, 10.0, 20.0, 36.0]
    found = ImageDetections(
        np.array([shown, shown, elsewhere, shown]),
        np.array([0.9, 0.95, 0.8, 0.99]),
        ("traffic light red", "traffic light green", "traffic light red", "car"),
    )
    lights = LightsOnMap(roads)
    assert lights.read({"camera": found}, {"camera": camera}) == (SignalReading("10", "green"),)
    stop = ImageDetections(np.array([shown]), np.array([0.9]), ("stop sign",))
    assert lights.read({"camera": stop}, {"camera": camera}) == ()
    assert LightsOnMap(None).read({"camera": found}, {"camera": camera}) == ()


def test_a_stop_sign_is_matched_with_a_stop_sign() -> None:
    roads = RoadNetwork.load(library_path() / "roads" / "coop_1.xodr")
    camera = camera_at(-5.0, 0.0)
    signal = roads.signals["10"]
    pose = roads.signal_pose(signal)
    u, v = pixels(np.array([[pose.x, pose.y, pose.z + signal.height / 2.0]]), camera)[0][0]
    found = ImageDetections(np.array([[u - 6.0, v - 6.0, u + 6.0, v + 6.0]]), np.array([0.7]), ("stop sign",))
    assert LightsOnMap(roads).read({"camera": found}, {"camera": camera}) == (SignalReading("10", "stop"),)
