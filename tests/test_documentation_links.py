"""Documentation pages: their links, anchors and paths exist."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = sorted(
    ROOT / name
    for name in subprocess.run(
        ["git", "-C", str(ROOT), "ls-files", "*.md"], capture_output=True, text=True, check=True
    ).stdout.split()
)
FOLDERS = ("behaviors", "benchmarks", "criteria", "docs", "eidrive_scenario", "examples", "tests", "training", "xosc")
ENGINE = ROOT / "eidrive_scenario"
PACKAGES = tuple(sorted(path.parent.name for path in ENGINE.glob("*/__init__.py")))
GENERATED = ("training/data", "training/out", "eidrive_scenario/library")
"""Folders that scripts or the build of the wheel write."""


def prose(page: Path) -> str:
    """Return the text of a page without code blocks."""
    return re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


def anchors(page: Path) -> set[str]:
    """Return the anchors of the headings, as GitHub forms them."""
    titles = re.findall(r"^#+ (.+)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def broken_links(page: Path) -> Iterator[str]:
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if target.startswith("https://"):
            continue
        file, _, anchor = target.partition("#")
        other = (page.parent / file).resolve() if file else page
        if not other.exists() or (anchor and anchor not in anchors(other)):
            yield target


@pytest.mark.parametrize("page", PAGES, ids=[page.relative_to(ROOT).as_posix() for page in PAGES])
def test_links_and_anchors_resolve(page: Path) -> None:
    assert list(broken_links(page)) == []


@pytest.mark.parametrize("page", PAGES, ids=[page.relative_to(ROOT).as_posix() for page in PAGES])
def test_paths_exist(page: Path) -> None:
    named = re.findall(rf"`((?:{'|'.join((*FOLDERS, *PACKAGES))})/[\w./-]*)(?:::\w+)?`", prose(page))
    missing = [
        path
        for path in named
        if not path.startswith(GENERATED)
        and not any((base / path).exists() for base in (ROOT, ENGINE))
        and not (ROOT / "xosc" / f"{path}.xosc").is_file()  # the name of a scenario of the library
    ]
    assert missing == []
