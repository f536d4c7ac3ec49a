"""Equivariance of runs under rotation, translation and mirroring of the world.

Physics and message generation do not depend on the direction of north or on the side of the road. Map and scenario of
the library are rotated by 217.3 degrees and translated, or mirrored at the x axis (with lanes, traffic rule, areas and
headings). The runs differ only by rounding, about 1e-12 m in the rotated world.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from mirrored_scenario import mirror_areas, mirror_positions, mirror_road

from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunResult, RunSettings, run_file

pytestmark = pytest.mark.process

TURN, EAST, NORTH = math.radians(217.3), 310.0, -85.0
ROUNDING = 1e-9
"""Tolerance of positions [m], headings [rad] and path loss [dB]; a decision one tick later would change 0.4 m."""

Node = etree._Element


@dataclass
class RunTrace:
    """Poses of all actors, fused objects of the ego, and link events, per tick."""

    places: list[np.ndarray] = field(default_factory=list)
    known: list[np.ndarray] = field(default_factory=list)
    links: list[tuple[tuple[object, ...], ...]] = field(default_factory=list)
    losses: list[tuple[float, ...]] = field(default_factory=list)

    def observe(self, frame: Frame) -> None:
        view = frame.view
        self.places.append(np.column_stack([view.position[:, :2], view.yaw]))
        self.known.append(frame.steps["Ego"].fused.boxes[:, [0, 1, 6]])
        self.links.append(tuple((e.sender, e.number, e.outcome, e.reason, e.los, e.blockers) for e in frame.links))
        self.losses.append(tuple(e.path_loss_db or 0.0 for e in frame.links))

    def close(self) -> None:
        """Do nothing."""


def rotate(x: float, y: float) -> tuple[float, float]:
    cos, sin = math.cos(TURN), math.sin(TURN)
    return EAST + cos * x - sin * y, NORTH + sin * x + cos * y


def rotate_road(road: Node) -> None:
    for geometry in road.iter("geometry"):
        x, y = rotate(float(geometry.attrib["x"]), float(geometry.attrib["y"]))
        geometry.set("x", repr(x))
        geometry.set("y", repr(y))
        geometry.set("hdg", repr(float(geometry.attrib["hdg"]) + TURN))


def rotate_scenario(text: str) -> str:
    def place(found: re.Match[str]) -> str:
        x, y = rotate(float(found[1]), float(found[2]))
        return f'<WorldPosition x="{x!r}" y="{y!r}" z="0" h="{float(found[3]) + TURN!r}"/>'

    def area(found: re.Match[str]) -> str:
        x0, x1, y0, y1 = map(float, found[1].split(","))
        return f'"conflict_area" value="{[list(rotate(x, y)) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]}"'

    return re.sub(AREA, area, re.sub(PLACE, place, text))


PLACE = r'<WorldPosition x="([-\d.]+)" y="([-\d.]+)" z="0" h="([-\d.]+)"/>'
AREA = r'"conflict_area" value="\[([^\]]*)\]"'


def mirror_scenario(text: str) -> str:
    root = etree.fromstring(text.encode())
    mirror_positions(root)
    mirror_areas(root)
    return etree.tostring(root, encoding="unicode")


def rotate_poses(poses: np.ndarray) -> np.ndarray:
    cos, sin = math.cos(TURN), math.sin(TURN)
    x, y, yaw = poses.T
    return np.column_stack([EAST + cos * x - sin * y, NORTH + sin * x + cos * y, yaw + TURN])


def mirror_poses(poses: np.ndarray) -> np.ndarray:
    return poses * [1.0, -1.0, -1.0]


Roads = Callable[[Node], None]
Scenario = Callable[[str], str]
Poses = Callable[[np.ndarray], np.ndarray]
CHANGES: dict[str, tuple[Roads, Scenario, Poses]] = {
    "rotated": (rotate_road, rotate_scenario, rotate_poses),
    "mirrored": (mirror_road, mirror_scenario, mirror_poses),
}


def keep_roads(root: Node) -> None:
    """Keep the roads unchanged."""


def write_scenario(folder: Path, name: str, fusion: str, roads: Roads = keep_roads, scenario: Scenario = str) -> Path:
    """Write the scenario in a transformed world, with this fusion method and the catalogs of the library."""
    folder.mkdir()
    source = resolve_scenario(name)
    text = source.read_text().replace('x="${40.0 + $CenterAhead}"', 'x="41.384"')
    text = text.replace('name="fusion" value="average"', f'name="fusion" value="{fusion}"')
    (map_name,) = re.findall(r'LogicFile filepath="([^"]*)"', text)
    tree = etree.parse(source.parent / map_name)
    roads(tree.getroot())
    tree.write(folder / "roads.xodr", xml_declaration=True, encoding="UTF-8")
    assert len(re.findall("<WorldPosition", text)) == len(re.findall(PLACE, text))
    text = scenario(text).replace(map_name, "roads.xodr")
    path = folder / "changed.xosc"
    path.write_text(text.replace('"../', f'"{source.parent.parent}/'))
    return path


def simulate(source: Path, channel: str, seed: int) -> tuple[RunTrace, RunResult]:
    trace = RunTrace()
    return trace, run_file(source, seed=seed, settings=RunSettings(channel=channel), observers=[trace])


def maximum_difference(found: np.ndarray, expected: np.ndarray) -> float:
    """Return the maximum difference of poses (N, 3) [m, rad]."""
    difference = np.abs(found - expected)
    difference[:, 2] = np.abs((found[:, 2] - expected[:, 2] + math.pi) % (2.0 * math.pi) - math.pi)
    return float(difference.max(initial=0.0))


@pytest.fixture(
    scope="module",
    params=[
        ("coop/scenario_1", "average", "80211p_urban", 2),
        ("coop/scenario_1", "average", "latency_300ms", 3),
        ("coop/scenario_1", "covariance_intersection", "latency_300ms", 1),
        ("coop/scenario_2", "average", "bursty", 1),
        ("coop/scenario_2", "covariance_intersection", "cv2x_highway", 2),
        ("coop/scenario_2", "average", "none", 3),
    ],
    ids=lambda values: "-".join(map(str, values)),
)
def original(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[tuple[str, str, str, int], RunTrace, RunResult]:
    """Return name, fusion, channel and seed of a run in the world as it is, with its trace and result."""
    name, fusion, channel, seed = request.param
    path = write_scenario(tmp_path_factory.mktemp("world") / "original", name, fusion)
    return request.param, *simulate(path, channel, seed)


@pytest.mark.parametrize("change", CHANGES)
def test_run_in_transformed_world_is_the_transformed_run(
    original: tuple[tuple[str, str, str, int], RunTrace, RunResult], tmp_path: Path, change: str
) -> None:
    roads, scenario, poses = CHANGES[change]
    (name, fusion, channel, seed), expected, before = original
    other, after = simulate(write_scenario(tmp_path / "other", name, fusion, roads, scenario), channel, seed)
    assert len(other.places) == len(expected.places) > 100
    assert (after.passed, after.end_reason) == (before.passed, before.end_reason)
    assert other.links == expected.links
    for tick, (there, here) in enumerate(zip(other.places, expected.places, strict=True)):
        assert maximum_difference(there, poses(here)) < ROUNDING, tick
    for tick, (there, here) in enumerate(zip(other.known, expected.known, strict=True)):
        assert there.shape == here.shape, tick
        assert maximum_difference(there, poses(here)) < ROUNDING, tick
    assert [loss for tick in other.losses for loss in tick] == pytest.approx(
        [loss for tick in expected.losses for loss in tick], abs=ROUNDING
    )
