"""Small OpenDRIVE texts, and the corpora of others where they are at hand."""

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
    """One <road>; without a geometry it is a line from x, y along hdg."""
    if geometry is None:
        geometry = f'<geometry s="0" x="{x!r}" y="{y!r}" hdg="{hdg!r}" length="{length!r}"><line/></geometry>'
    return (
        f'<road id="{number}" name="" length="{length!r}" junction="{junction}" rule="{rule}"><link>{link}</link>'
        f"<planView>{geometry}</planView><lanes>{lanes}</lanes>{extra}</road>"
    )


def map_text(*roads: str, rest: str = "") -> str:
    """An OpenDRIVE file of roads and whatever else."""
    return f'<OpenDRIVE><header revMajor="1" revMinor="7"/>{"".join(roads)}{rest}</OpenDRIVE>'


@pytest.fixture
def road() -> RoadText:
    return road_text


@pytest.fixture
def map_of() -> RoadText:
    return map_text


@pytest.fixture
def both_ways() -> str:
    """The inside of a lane section with one lane each way, 3.5 m wide."""
    return DRIVING_BOTH


@pytest.fixture(scope="session")
def corpora() -> Path:
    """Maps and scenarios of others; they are no part of the project."""
    folder = os.environ.get("EIDRIVE_CORPORA")
    if not folder:
        pytest.skip("EIDRIVE_CORPORA is not set")
    return Path(folder)


@pytest.fixture
def library() -> Path:
    """The roads of the scenario library."""
    return Path(__file__).parents[3] / "xosc" / "roads"
