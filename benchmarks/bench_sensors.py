"""How long a picture and a sweep take on one core: `python benchmarks/bench_sensors.py`.

The street is that of the weather sheet: a crossing with 14 road users and eight houses. Once all is drawn anew, as for
a moving camera, and once for one that stands still, which keeps its scenery. CPU time of the process, the best of many,
so that other programs on the machine count little. OpenCV gets one thread, and so should numpy's matrix products:
`OPENBLAS_NUM_THREADS=1`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import cv2

from eidrive_scenario.library import names
from eidrive_scenario.randomness import generator
from eidrive_scenario.reporting.drawing.street_view import look_at
from eidrive_scenario.reporting.weather_sheet import street
from eidrive_scenario.sensing.camera import ImageSensor
from eidrive_scenario.sensing.lidar import Lidar
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings
from eidrive_scenario.world.render.renderer import Renderer
from eidrive_scenario.world.weather import load_weather

SIZES = ((320, 192), (512, 384), (640, 360), (800, 600))
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


@contextmanager
def _nothing_kept() -> Iterator[None]:
    """All scenery is drawn anew."""
    usual = Renderer.MOST_KEPT
    Renderer.MOST_KEPT = 0
    try:
        yield
    finally:
        Renderer.MOST_KEPT = usual


def main() -> None:
    """Print a table."""
    cv2.setNumThreads(1)
    pose = look_at((1.9, -0.2, 1.35), (22.0, 0.1, 1.15))
    with street() as world:
        view = world.view()
        print("camera, with noise: moving / standing [ms]")
        print(f"{'':<18}" + "".join(f"{f'{width} x {height}':<16}" for width, height in SIZES))
        for weather in names("weather"):
            world.set_weather(load_weather(weather))
            row = []
            for width, height in SIZES:
                camera = ImageSensor(CameraSettings(width=width, height=height, fov=80.0))

                def take(camera: ImageSensor = camera) -> object:
                    return camera.capture(world, pose, generator(1, "bench"), ignore=("Ego",))

                standing = best(take)
                with _nothing_kept():
                    row.append(f"{best(take):.1f} / {standing:.1f}")
            print(f"{weather:<18}" + "".join(f"{value:<16}" for value in row))
        print("\nLiDAR, 32 channels, 5760 rays a sweep [ms]")
        for weather in ("sunny", "foggy_morning"):
            world.set_weather(load_weather(weather))
            settings = LidarSettings(points_per_second=32 * 180 * 20)
            value = best(lambda settings=settings: Lidar(settings, world.spec("Ego")).read(world, view, 0))
            print(f"{weather:<26}{value:.1f}")


if __name__ == "__main__":
    main()
