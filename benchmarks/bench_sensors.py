"""How long a picture and a sweep take on one core: `python benchmarks/bench_sensors.py`.

The street is that of the weather sheet: a crossing with 14 road users and eight houses. CPU time of the process, the
best of many, so that other programs on the machine count little. OpenCV gets one thread, and so should numpy's matrix
products: `OPENBLAS_NUM_THREADS=1`.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import cv2

from eidrive_scenario.library import names
from eidrive_scenario.randomness import generator
from eidrive_scenario.reporting.street_view import look_at
from eidrive_scenario.reporting.weather_sheet import street
from eidrive_scenario.sensing.camera import Photographer
from eidrive_scenario.sensing.lidar import Lidar
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings
from eidrive_scenario.world.weather import load_weather

SIZES = ((320, 192), (640, 360), (800, 600))
REPEATS = 15


def best(task: Callable[[], object]) -> float:
    """The least CPU time of a task [ms]."""
    task()
    times = []
    for _ in range(REPEATS):
        start = time.process_time()
        task()
        times.append(time.process_time() - start)
    return 1e3 * min(times)


def main() -> None:
    """Print a table."""
    cv2.setNumThreads(1)
    pose = look_at((1.9, -0.2, 1.35), (22.0, 0.1, 1.15))
    with street() as world:
        view = world.view()
        print("camera, with noise [ms]   " + "".join(f"{width} x {height:<8}" for width, height in SIZES))
        for weather in names("weather"):
            world.set_weather(load_weather(weather))
            row = []
            for width, height in SIZES:
                camera = Photographer(CameraSettings(width=width, height=height, fov=80.0))
                row.append(best(lambda camera=camera: camera.take(world, pose, generator(1, "bench"), ignore=("Ego",))))
            print(f"{weather:<26}" + "".join(f"{value:<14.1f}" for value in row))
        print("\nLiDAR, 32 channels, 5760 rays a sweep [ms]")
        for weather in ("sunny", "foggy_morning"):
            world.set_weather(load_weather(weather))
            settings = LidarSettings(points_per_second=32 * 180 * 20)
            value = best(lambda settings=settings: Lidar(settings, world.spec("Ego")).read(world, view, 0))
            print(f"{weather:<26}{value:.1f}")


if __name__ == "__main__":
    main()
