"""Contact sheet of one street in every weather of the library, from the cameras of a car and of a roadside unit.

`python -m eidrive_reports.weather_sheet --out reports/weather.png`
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer
from numpy.typing import NDArray

from eidrive_reports.street_view import look_at
from eidrive_scenario.api.common import ActorSpec, InputError, Placement, RoadNetwork, generator, write_atomically
from eidrive_scenario.api.experiments import library_path
from eidrive_scenario.api.perception import CameraSettings, ImageSensor
from eidrive_scenario.api.run import Weather, World, load_weather, picture_maker

ROAD = "coop_1.xodr"
CAMERA = CameraSettings(width=640, height=360, fov=80.0, supersampling=2)
SPEED = (8.0, 0.0, 0.0)
"""Velocity of the car with the camera [m/s], which determines the apparent direction of rain."""
_BODIES: dict[str, tuple[str, tuple[float, float, float], float, float]] = {
    "car": ("car", (4.89, 1.84, 1.49), 2.85, 0.33),
    "firetruck": ("truck", (8.47, 2.89, 3.83), 4.6, 0.5),
    "bus": ("bus", (10.3, 2.8, 3.2), 5.6, 0.48),
    "van": ("van", (5.6, 2.0, 2.5), 3.4, 0.35),
    "truck": ("truck", (8.0, 2.5, 3.5), 4.5, 0.5),
    "motorbike": ("motorbike", (2.2, 0.8, 1.6), 1.5, 0.32),
    "bicycle": ("bicycle", (1.8, 0.6, 1.7), 1.1, 0.34),
    "pedestrian": ("pedestrian", (0.5, 0.5, 1.75), 0.0, 0.3),
}
"""Class, size (length, width, height) [m], wheelbase [m] and wheel radius [m] by shape."""
_STREET: tuple[tuple[str, str, float, float, float], ...] = (
    ("Ego", "car", 0.0, 0.0, 0.0),
    ("Leader", "car", 21.0, -0.1, 0.0),
    ("Van", "van", 39.0, 0.0, 0.0),
    ("Far", "car", 95.0, 0.0, 0.0),
    ("Oncoming", "car", 47.0, 3.6, math.pi),
    ("Rider", "motorbike", 15.5, 3.4, math.pi),
    ("Bus", "bus", 70.0, 3.4, math.pi),
    ("Fire engine", "firetruck", 25.4, 8.0, -math.pi / 2),
    ("Behind it", "car", 29.5, 21.0, -math.pi / 2),
    ("Truck", "truck", 33.0, -24.0, math.pi / 2),
    ("Cyclist", "bicycle", 13.5, -3.1, 0.1),
    ("Walker", "pedestrian", 13.2, -6.0, 1.3),
    ("Another", "pedestrian", 12.6, 5.2, -1.4),
    ("Third", "pedestrian", 36.5, -4.6, 2.0),
)
_VIEWS = (
    ("car", look_at((1.9, -0.2, 1.35), (22.0, 0.1, 1.15)), "Ego"),
    ("roadside unit, 6 m", look_at((42.5, -7.5, 6.0), (21.0, 2.0, 0.0)), ""),
)


def street() -> World:
    """Return the crossing of scenario 1 with traffic. The caller closes the world."""
    world = World(RoadNetwork.load(library_path() / "roads" / ROAD), picture_maker=picture_maker)
    for name, shape, x, y, yaw in _STREET:
        category, size, wheelbase, wheel = _BODIES[shape]
        offset = (wheelbase / 2.0, 0.0, size[2] / 2.0)
        spec = ActorSpec(name, shape, category, size, offset, wheelbase=wheelbase, wheel_radius=wheel)
        world.add(spec, Placement(x, y, 0.0, yaw))
    return world


def contact_sheet(weathers: list[Weather], camera: CameraSettings = CAMERA) -> NDArray[np.uint8]:
    """Return an image (H, W, 3) with one row per weather, one column per view, and captions."""
    sensor = ImageSensor(camera)
    rows = []
    with street() as world:
        for weather in weathers:
            world.set_weather(weather)
            row: list[NDArray[np.uint8]] = []
            for number, (view, pose, own) in enumerate(_VIEWS):
                reading = sensor.capture(
                    world,
                    pose,
                    generator(1, "weather sheet", number),
                    ignore=(own,) if own else (),
                    velocity=SPEED if own else (0.0, 0.0, 0.0),
                    lens=generator(1, "weather sheet", "lens") if own else None,
                )
                details = "" if row else _describe_weather(weather)
                row.append(_add_caption(reading.rgb, f"{weather.name.replace('_', ' ')}: {view}", details))
            rows.append(np.hstack(row))
    return np.vstack(rows)


def _describe_weather(weather: Weather) -> str:
    parts = [f"sun {weather.sun_elevation:.0f} deg", f"clouds {weather.cloud_cover:.0%}"]
    parts += [f"visual range {weather.visual_range:g} m"]
    if weather.precipitation != "none":
        parts.append(f"{weather.precipitation} {weather.precipitation_intensity:g} mm/h")
    if weather.wetness > 0.0:
        parts.append(f"wetness {weather.wetness:g}, grip {weather.friction_scale:.2f}")
    return ", ".join(parts)


def _add_caption(image: NDArray[np.uint8], title: str, details: str) -> NDArray[np.uint8]:
    bar = np.full((30, image.shape[1], 3), 245, dtype=np.uint8)
    cv2.putText(bar, title, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (20, 20, 20), 1, cv2.LINE_AA)
    available = image.shape[1] - cv2.getTextSize(title, cv2.FONT_HERSHEY_SIMPLEX, 0.5, 1)[0][0] - 32
    size = 0.38 * min(1.0, available / max(1, cv2.getTextSize(details, cv2.FONT_HERSHEY_SIMPLEX, 0.38, 1)[0][0]))
    width = cv2.getTextSize(details, cv2.FONT_HERSHEY_SIMPLEX, size, 1)[0][0]
    cv2.putText(
        bar, details, (image.shape[1] - width - 8, 20), cv2.FONT_HERSHEY_SIMPLEX, size, (90, 90, 90), 1, cv2.LINE_AA
    )
    framed = np.vstack([bar, image])
    framed[:, -2:] = 245
    return framed


def write(
    out: Annotated[Path, typer.Option(help="PNG file.")] = Path("reports/weather.png"),
    weather: Annotated[
        list[str] | None, typer.Option(help="Preset or file; repeatable.", show_default="all presets")
    ] = None,
) -> None:
    """Draw the contact sheet."""
    order = ("sunny", "foggy_morning", "storm", "midnight")
    presets = {path.stem for path in (library_path() / "weather").glob("*.yaml")}
    chosen = weather or [*(name for name in order if name in presets), *sorted(presets - {*order})]
    try:
        weathers = [load_weather(name, origin="--weather") for name in chosen]
        with write_atomically(out) as stream:
            stream.write(cv2.imencode(".png", cv2.cvtColor(contact_sheet(weathers), cv2.COLOR_RGB2BGR))[1].tobytes())
    except InputError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(2) from error
    typer.echo(f"wrote {out}")


if __name__ == "__main__":
    typer.run(write)
