"""Fixtures of traffic: straight streets and views of vehicles."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.view import WorldView

LENGTH, WIDTH, REAR_AXLE = 4.6, 1.9, 1.4


def lane_text(number: int, mark: str, kind: str = "driving", width: str = "3.5", link: str = "") -> str:
    return (
        f'<lane id="{number}" type="{kind}"><link>{link}</link><width sOffset="0" a="{width}" b="0" c="0" d="0"/>'
        f'<roadMark sOffset="0" type="broken" laneChange="{mark}"/></lane>'
    )


def street_text(
    left: int = 0, right: int = 2, *, length: float = 1000.0, mark: str = "both", rule: str = "RHT", extra: str = ""
) -> str:
    """Return one straight road along x from 0 with lanes of 3.5 m on both sides."""
    lefts = "".join(lane_text(n, mark) for n in range(left, 0, -1))
    rights = "".join(lane_text(-n, mark) for n in range(1, right + 1))
    return (
        f'<OpenDRIVE><header revMajor="1" revMinor="7"/><road id="1" length="{length}" junction="-1" rule="{rule}">'
        f'<planView><geometry s="0" x="0" y="0" hdg="0" length="{length}"><line/></geometry></planView><lanes>'
        f'<laneSection s="0">{f"<left>{lefts}</left>" if left else ""}<center><lane id="0"/></center>'
        f"{f'<right>{rights}</right>' if right else ''}</laneSection></lanes>{extra}</road></OpenDRIVE>"
    )


@pytest.fixture
def street() -> Callable[..., RoadNetwork]:
    """Straight street: `street(left, right, length=…, mark=…)`."""
    return lambda *lanes, **options: RoadNetwork.parse(street_text(*lanes, **options))


@pytest.fixture
def car() -> Callable[[str], ActorSpec]:
    return lambda name: ActorSpec(
        name, "car", "car", (LENGTH, WIDTH, 1.5), (REAR_AXLE, 0.0, 0.75), wheelbase=2.8, max_speed=60.0
    )


@pytest.fixture
def view_of() -> Callable[..., WorldView]:
    """View of cars at a time, by placements with names."""

    def view(placements: Mapping[str, Placement], time: float = 0.0, tick: int = 0) -> WorldView:
        rows = list(placements.values())
        count = len(rows)
        yaw, speed = np.array([p.yaw for p in rows]), np.array([p.speed for p in rows])
        return WorldView(
            time=time,
            tick=tick,
            names=tuple(placements),
            categories=("car",) * count,
            position=np.array([(p.x, p.y, p.z) for p in rows]).reshape(count, 3),
            yaw=yaw,
            pitch=np.zeros(count),
            roll=np.zeros(count),
            velocity=np.stack([speed * np.cos(yaw), speed * np.sin(yaw), 0.0 * yaw], axis=1).reshape(count, 3),
            acceleration=np.zeros((count, 3)),
            yaw_rate=np.zeros(count),
            speed=speed,
            size=np.tile((LENGTH, WIDTH, 1.5), (count, 1)),
            offset=np.tile((REAR_AXLE, 0.0, 0.75), (count, 1)),
        )

    return view


@pytest.fixture(scope="session")
def library_roads() -> RoadNetwork:
    """Crossing of scenario 2: a street of 2+2 lanes, a street of 1+1, and four lights."""
    return RoadNetwork.load(Path(__file__).parents[3] / "xosc" / "roads" / "coop_2.xodr")
