"""Fixtures of roads: short OpenDRIVE texts and, if available, external corpora."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

RoadText = Callable[..., str]

DRIVING_BOTH = (
    '<left><lane id="1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></left>'
    '<center><lane id="0" type="none"/></center>'
    '<right><lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right>'
)


def road_text(
    number: str = "1",
    *,
    length: float = 100.0,
    geometry: str | None = None,
    lanes: str = f'<laneSection s="0">{DRIVING_BOTH}</laneSection>',
    link: str = "",
    junction: str = "-1",
    rule: str = "RHT",
    x: float = 0.0,
    y: float = 0.0,
    hdg: float = 0.0,
    extra: str = "",
) -> str:
    """Return one <road>, by default a line from x, y with heading hdg."""
    if geometry is None:
        geometry = f'<geometry s="0" x="{x!r}" y="{y!r}" hdg="{hdg!r}" length="{length!r}"><line/></geometry>'
    return (
        f'<road id="{number}" name="" length="{length!r}" junction="{junction}" rule="{rule}"><link>{link}</link>'
        f"<planView>{geometry}</planView><lanes>{lanes}</lanes>{extra}</road>"
    )


def map_text(*roads: str, rest: str = "") -> str:
    """Return an OpenDRIVE file with these roads and further elements."""
    return f'<OpenDRIVE><header revMajor="1" revMinor="7"/>{"".join(roads)}{rest}</OpenDRIVE>'


@pytest.fixture
def road() -> RoadText:
    return road_text


@pytest.fixture
def map_of() -> RoadText:
    return map_text


@pytest.fixture
def both_ways() -> str:
    """Content of a lane section with one lane per direction, 3.5 m wide."""
    return DRIVING_BOTH


@pytest.fixture(scope="session")
def corpora() -> Path:
    """External maps and scenarios, which are not part of the project."""
    folder = os.environ.get("EIDRIVE_CORPORA")
    if not folder:
        pytest.skip("EIDRIVE_CORPORA is not set")
    return Path(folder)


@pytest.fixture
def library() -> Path:
    """Folder of the library roads."""
    return Path(__file__).parents[3] / "xosc" / "roads"
