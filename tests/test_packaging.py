"""Contents of the wheel."""

from __future__ import annotations

import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_wheel_contains_the_library_without_scripts() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    included = settings["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]
    packaged = set()
    for source, target in included.items():
        place = ROOT / source
        for path in place.rglob("*") if place.is_dir() else [place]:
            if path.is_file():
                inside = Path(target, path.relative_to(place)) if place.is_dir() else Path(target)
                packaged.add(inside.relative_to("eidrive_scenario/library").as_posix())
    data = {
        path.relative_to(ROOT / "xosc").as_posix()
        for path in (ROOT / "xosc").rglob("*")
        if path.suffix in (".xosc", ".xodr", ".yaml")
    }
    assert packaged == data
