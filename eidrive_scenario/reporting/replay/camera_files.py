"""Camera images of a run that a page refers to."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

from eidrive_scenario.recording.run_files import IMAGES

_NAME = re.compile(r"(?P<camera>.+)-(?P<tick>\d+)\.jpg")


def camera_files(run: Path, page: Path) -> dict[str, dict[str, Any]]:
    """Return the images in the folder of a run, by station and camera: their ticks in order, and the part of their
    address before the tick, relative to the folder `page` of the page.

    The result is empty without images.
    """
    found: dict[str, dict[str, Any]] = {}
    folder = run / IMAGES
    if not folder.is_dir():
        return found
    for station in sorted(path for path in folder.iterdir() if path.is_dir()):
        ticks: dict[str, list[int]] = {}
        for entry in os.scandir(station):
            match = _NAME.fullmatch(entry.name)
            if match is not None:
                ticks.setdefault(match["camera"], []).append(int(match["tick"]))
        if ticks:
            relative = quote(os.fsencode(Path(os.path.relpath(station, page)).as_posix()))
            found[unquote(station.name)] = {
                unquote(camera): {"address": f"{relative}/{quote(os.fsencode(camera))}-", "ticks": sorted(numbers)}
                for camera, numbers in sorted(ticks.items())
            }
    return found
