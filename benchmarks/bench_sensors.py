"""Processor time of an image and a lidar reading on one core: `python benchmarks/bench_sensors.py`.

The street is that of the weather sheet: an intersection with 14 road users and eight buildings. It is measured for a
moving camera, which renders everything, and for a stationary one, which caches the scenery. The result is the minimum
processor time of many repetitions, to exclude the load of the machine. OpenCV has one thread, and so should matrix
products of numpy: `OPENBLAS_NUM_THREADS=1`.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import cv2
from eidrive_reports.street_view import look_at
from eidrive_reports.weather_sheet import street
from timing import minimum_time

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.extensions.library import names
from eidrive_scenario.rendering.renderer import Renderer
from eidrive_scenario.sensing.camera import ImageSensor
from eidrive_scenario.sensing.lidar import Lidar
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings
from eidrive_scenario.world.weather import load_weather

SIZES = ((320, 192), (512, 384), (640, 360), (800, 600))
REPEATS = 15


@contextmanager
def _without_cache() -> Iterator[None]:
    """Disable the cache of the scenery."""
    default = Renderer.MOST_KEPT
    Renderer.MOST_KEPT = 0
    try:
        yield
    finally:
        Renderer.MOST_KEPT = default


def main() -> None:
    """Print a table."""
    cv2.setNumThreads(1)
    pose = look_at((1.9, -0.2, 1.35), (22.0, 0.1, 1.15))
    with street() as world:
        view = world.view()
        print("camera, with noise: moving / stationary [ms]")
        print(f"{'':<18}" + "".join(f"{f'{width} x {height}':<16}" for width, height in SIZES))
        for weather in names("weather"):
            world.set_weather(load_weather(weather))
            row = []
            for width, height in SIZES:
                camera = ImageSensor(CameraSettings(width=width, height=height, fov=80.0))

                def capture(camera: ImageSensor = camera) -> object:
                    return camera.capture(world, pose, generator(1, "bench"), ignore=("Ego",))

                stationary = minimum_time(capture, REPEATS)
                with _without_cache():
                    row.append(f"{minimum_time(capture, REPEATS):.1f} / {stationary:.1f}")
            print(f"{weather:<18}" + "".join(f"{value:<16}" for value in row))
        print("\nlidar, 32 channels, 5760 rays per reading [ms]")
        for weather in ("sunny", "foggy_morning"):
            world.set_weather(load_weather(weather))
            settings = LidarSettings(points_per_second=32 * 180 * 20)

            def read_lidar(settings: LidarSettings = settings) -> object:
                return Lidar(settings, world.spec("Ego")).read(world, view, 0)

            print(f"{weather:<26}{minimum_time(read_lidar, REPEATS):.1f}")


if __name__ == "__main__":
    main()
