"""docs/architecture.md: agreement of its picture and tables with the packages of the engine."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
ENGINE = ROOT / "eidrive_scenario"
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
ENTRY = ("__init__", "__main__")


def section(title: str) -> str:
    """Return the text of a section."""
    return PAGE.split(f"\n## {title}\n")[1].split("\n## ")[0]


def rows(title: str) -> Iterator[list[str]]:
    """Yield the cells of the rows of the table of a section."""
    for line in section(title).splitlines():
        if line.startswith("| ") and "---" not in line:
            yield [cell.strip() for cell in line.strip("|").split("|")]


def subpackages(package: Path) -> set[str]:
    return {path.parent.name for path in package.glob("*/__init__.py")}


def test_picture_shows_every_package_of_the_engine() -> None:
    shown = set(re.findall(r"\w+", section("Layers of the engine").split("```")[1]))
    modules = {path.stem for path in ENGINE.glob("*.py")} - set(ENTRY)
    assert (subpackages(ENGINE) | modules) - shown == set()


def test_package_table_lists_the_subpackages() -> None:
    listed = {}
    for names, inner, _ in [row for row in rows("Packages") if row[0] != "package"]:
        for name in re.findall(r"`(\w+)`", names):
            listed[name] = set(re.findall(r"`(\w+)`", inner))
    found = {name: subpackages(ENGINE / name) for name in subpackages(ENGINE)}
    assert {name: listed.get(name, set()) for name in found} == found


def test_places_of_changes_exist() -> None:
    places = [
        place
        for _, cell in rows("Where do I put …")
        for place in re.findall(r"`([a-z_/.]+)`", cell)
        if not any((base / place).exists() for base in (ENGINE, ROOT))
    ]
    assert places == []
