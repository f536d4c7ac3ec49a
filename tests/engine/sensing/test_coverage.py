"""Sectors in which sensors detect objects."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.base.coverage import ViewSector
from eidrive_scenario.driving.agent_factory import build_detector
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.sensing.sensor import view_sectors
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings, Mount, SensorSettings, TruthSettings
from eidrive_scenario.world.actor import ActorSpec

CAR = ActorSpec("Ego", "vehicle", "car", size=(4.9, 1.8, 1.5), offset=(1.4, 0.0, 0.75), wheelbase=2.9)


def contains(sector: ViewSector, *discs: tuple[float, float, float]) -> list[bool]:
    x, y, radius = np.array(discs).T
    return [bool(inside) for inside in sector.contains(x, y, radius)]


def test_disc_is_inside_up_to_the_tangent_of_the_edge() -> None:
    # The edge is at 45°: a disc of 1 m on the axis at x touches it at x·sin(45°) = 1.
    sector = ViewSector(0.0, 0.0, 1.5, 0.0, math.pi / 4, 50.0)
    touching = math.sqrt(2.0)
    assert contains(sector, (touching + 0.01, 0.0, 1.0), (touching - 0.01, 0.0, 1.0)) == [True, False]
    assert contains(sector, (20.0, 0.0, 1.0), (10.0, 9.9, 0.0), (10.0, 10.1, 0.0), (-20.0, 0.0, 0.1)) == [
        True,
        True,
        False,
        False,
    ]


def test_disc_is_inside_up_to_the_range() -> None:
    sector = ViewSector(2.0, 0.0, 1.5, 0.0, math.pi, 50.0)
    assert contains(sector, (51.0, 0.0, 1.0), (51.1, 0.0, 1.0), (-47.0, 0.0, 1.0), (-47.1, 0.0, 1.0)) == [
        True,
        False,
        True,
        False,
    ]


def test_sector_to_the_rear_contains_what_is_behind() -> None:
    sector = ViewSector(-2.0, 0.0, 1.5, math.pi, math.radians(50.0), math.inf)
    assert contains(sector, (-12.0, 3.0, 1.0), (-12.0, -3.0, 1.0), (12.0, 0.0, 1.0)) == [True, True, False]


def test_sectors_are_those_of_the_settings() -> None:
    mount = Mount(x=1.0, y=-0.5, z=1.0, yaw=90.0, pitch=0.0)
    camera, lidar, truth = view_sectors(
        [CameraSettings(fov=80.0), LidarSettings(range=60.0), TruthSettings(mount=mount, field_of_view=120.0)], CAR
    )
    # The front camera is 2.5 m ahead of the center of a car of 4.892 m.
    assert camera.x == pytest.approx(1.4 + 4.9 / 2 + 0.054)
    assert (camera.half_angle, camera.range) == (math.radians(40.0), math.inf)
    assert (lidar.half_angle, lidar.range) == (math.pi, 60.0)
    assert truth == ViewSector(1.0, -0.5, 1.0, math.pi / 2, math.radians(60.0), 50.0)


@pytest.mark.parametrize("angles", [(0.0, 0.0), (360.0, -60.0), (180.0, 180.0), (-180.0, 100.0)])
def test_sector_of_mount_to_the_front_is_ahead(angles: tuple[float, float]) -> None:
    """A sensor turned and pitched by 180 degrees is upside down and looks ahead: its x axis is that of the body."""
    mount = Mount(x=0.0, y=0.0, z=2.0, yaw=angles[0], pitch=angles[1])
    (sector,) = view_sectors([LidarSettings(mount=mount)], CAR)
    assert sector.yaw == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("detector", "sensor", "expected"),
    [
        ("oracle", TruthSettings(range=70.0), 70.0),
        # Columns at 1 and rings at 2 degrees: at 20 m 1.8 m x 0.8 m have 5.16 x 1.15 points, and 3 at 28.1 m.
        ("lidar", LidarSettings(channels=11, lower_fov=-10.0, points_per_second=79200), 28.1),
        ("lidar", LidarSettings(channels=11, lower_fov=-10.0, points_per_second=79200, range=25.0), 25.0),
        ("pillars", LidarSettings(points_per_second=10_000_000, range=200.0), 51.2),
        # A focal length of 400 px, 256 px in the network input of 512 x 384: 1.5 m are 8 px high at 48 m.
        ("yolov5", CameraSettings(width=800, height=600, fov=90.0), 48.0),
        ("ssd", CameraSettings(width=400, height=300, fov=90.0), 37.5),
    ],
)
def test_range_of_a_detector_follows_from_the_resolution(
    detector: str, sensor: SensorSettings, expected: float
) -> None:
    assert build_detector(AgentSettings(detector=detector)).range_of(sensor) == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize("distortion", [0.1, -0.1])
def test_sector_of_a_distorted_camera_ends_at_the_edge_of_its_image(distortion: float) -> None:
    """A ray at 45 degrees, x = 1, is at x (1 + k x²) in the image: at the edge for a fov of 2 atan(1 + k)."""
    fov = 2.0 * math.degrees(math.atan(1.0 + distortion))
    camera = CameraSettings(width=400, height=100, fov=fov, distortion=(distortion, 0.0, 0.0, 0.0, 0.0))
    (sector,) = view_sectors([camera], CAR)
    assert math.degrees(sector.half_angle) == pytest.approx(45.0)
