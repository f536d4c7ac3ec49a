"""Random road networks for training: intersections like those of the library, and winding roads on hills.

None of them is in the library: widths, lanes, corners, signals and houses are drawn for each.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
from lxml import etree
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.rendering import picture_maker
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.model import curves
from eidrive_scenario.world import World
from xosc.roads import make_roads
from xosc.roads.crossings import Crossing
from xosc.roads.layout import LaneSpec, Street
from xosc.roads.opendrive import add, add_lane, add_mark, add_road
from xosc.roads.streets import LANE

Element = etree._Element
T = TypeVar("T")

LIGHT = ("1000001", "-1", 0.3, 0.86)
STOP = ("206", "-1", 0.75, 0.75)
OTHERS = (("274", "50", 0.6, 0.6), ("205", "-1", 0.9, 0.9), ("306", "-1", 0.6, 0.6), ("283", "-1", 0.6, 0.6))
_ROAD_OBJECTS = {
    "tree": ((4.0, 4.0, 7.0), 9.0),
    "vegetation": ((1.5, 1.5, 1.2), 3.0),
    "streetLamp": ((0.16, 0.16, 8.0), 28.0),
    "pole": ((0.12, 0.12, 4.0), 12.0),
    "barrier": ((2.0, 0.3, 0.9), 3.0),
}
"""Length, width and height of road objects, and their spacing [m]."""


LANE_KINDS = ("driving", "parking", "shoulder", "sidewalk")
"""Types of lanes with traffic; bidirectional ones are driving lanes."""
STEP = 1.5
"""Distance between lane positions along the road [m]."""


@dataclass(frozen=True)
class LanePositions:
    """Lane positions: x y z [m] and driving direction [rad] (N, 4), type of the lane, its width [m]."""

    poses: Array
    kinds: NDArray[np.str_]
    widths: Array

    @classmethod
    def of(cls, roads: RoadNetwork) -> LanePositions:
        """Return all positions on lanes with traffic that are wide enough."""
        poses, kinds, widths = [], [], []
        for road in roads.roads.values():
            for s in np.arange(STEP / 2, road.length, STEP).tolist():
                for lane in roads.lane_ids(road.id, s):
                    kind, width = roads.lane_type(road.id, lane, s), roads.lane_width(road.id, lane, s)
                    kind = "driving" if kind == "bidirectional" else kind
                    if kind in LANE_KINDS and width > (0.4 if kind == "shoulder" else 1.2):
                        pose = roads.lane_pose_at(road.id, lane, s)
                        turn = 0.0 if roads.driving_direction(road.id, lane) > 0 else math.pi
                        poses.append((pose.x, pose.y, pose.z, pose.h + turn))
                        kinds.append(kind)
                        widths.append(width)
        return cls(np.array(poses), np.array(kinds), np.array(widths))

    def draw(self, rng: np.random.Generator) -> tuple[float, float, float, float]:
        """Return x, y, z [m] and direction [rad] of a random position on a driving lane."""
        x, y, z, heading = self.poses[int(rng.choice(np.flatnonzero(self.kinds == "driving")))].tolist()
        return x, y, z, heading


@dataclass(frozen=True)
class House:
    """Box beside the road: center [m], length, width, height [m], heading [rad], color."""

    center: tuple[float, float, float]
    size: tuple[float, float, float]
    yaw: float
    color: tuple[float, float, float]


@dataclass(frozen=True)
class Place:
    """Road network, the positions on its lanes, and the houses along it."""

    roads: RoadNetwork
    positions: LanePositions
    houses: tuple[House, ...]

    @contextmanager
    def world(self) -> Iterator[World]:
        """Open a world of these roads and houses, which draws images."""
        with World(self.roads, picture_maker=picture_maker) as world:
            for number, house in enumerate(self.houses):
                world.add_building(f"house {number}", house.center, house.size, house.yaw, house.color)
            yield world


def random_place(rng: np.random.Generator) -> Place:
    """Return a place for this generator state."""
    with tempfile.TemporaryDirectory() as folder:
        roads = _random_roads(rng, Path(folder) / "place.xodr")
    return Place(roads, LanePositions.of(roads), tuple(random_houses(roads, rng)))


def map_worlds(
    images: Callable[[int, str, int], list[T]], seed: int, split: str, worlds: int, processes: int, first: int = 0
) -> Iterator[list[T]]:
    """Yield the images of successive worlds from number `first` on; equal for any number of processes."""
    # Each process renders one world: threads of OpenCV would only compete.
    with get_context("spawn").Pool(processes, cv2.setNumThreads, (1,)) as pool:
        yield from pool.imap(partial(images, seed, split), range(first, first + worlds))


def _random_roads(rng: np.random.Generator, path: Path) -> RoadNetwork:
    """Write random roads into an OpenDRIVE file and read it."""
    if rng.random() < 0.65:
        make_roads.write(random_crossing(rng).layout(), path)
        root = etree.parse(path).getroot()
        for building in root.iterfind(".//object[@type='building']"):
            holder = building.getparent()
            if holder is not None:
                holder.remove(building)
        vary_signals(root, rng)
    else:
        root = winding_road(rng)
    add_road_objects(root, rng)
    etree.ElementTree(root).write(str(path), xml_declaration=True, encoding="UTF-8")
    return RoadNetwork.load(path)


def random_crossing(rng: np.random.Generator) -> Crossing:
    """Return two streets of random lanes that cross at right angles."""
    first, second = random_street(rng), random_street(rng)
    x, y = rng.uniform(20.0, 60.0), rng.uniform(-6.0, 6.0)
    clearance = rng.uniform(3.0, 9.0, 4)
    near, far = x - _half_width(second, -1) - clearance[0], x + _half_width(second, 1) + clearance[1]
    right, left = y - _half_width(first, -1) - clearance[2], y + _half_width(first, 1) + clearance[3]
    ends = rng.uniform(70.0, 110.0, 4)
    return Crossing(
        name="training",
        ego_street=first,
        cross_street=second,
        y=y,
        x=x,
        box=(near, far, right, left),
        reach=(near - ends[0], far + ends[1], right - ends[2], left + ends[3]),
        control="light" if rng.random() < 0.6 else "stop",
    )


def random_street(rng: np.random.Generator) -> Street:
    """Return one to three lanes per direction, with optional center lane, parking, shoulder and sidewalk."""
    inner, outer = (LaneSpec("driving", LANE, (kind, "white")) for kind in ("broken", "solid"))
    count = int(rng.choice([1, 2, 3], p=[0.5, 0.35, 0.15]))
    side = [inner] * (count - 1) + [outer]
    if rng.random() < 0.45:
        side.append(LaneSpec("parking", float(rng.uniform(2.2, 3.6))))
    if rng.random() < 0.5:
        side.append(LaneSpec("shoulder", float(rng.uniform(0.5, 2.5))))
    side += [LaneSpec("shoulder", 0.63, ("curb", "standard")), LaneSpec("sidewalk", float(rng.uniform(1.5, 4.0)))]
    color = str(rng.choice(["white", "yellow"]))
    if rng.random() < 0.3:
        middle = LaneSpec("bidirectional", LANE, ("solid broken", color))
        return Street(left=(middle, *side), right=tuple(side), center=("broken solid", color))
    center = str(rng.choice(["solid", "solid solid", "broken"]))
    return Street(left=tuple(side), right=tuple(side), center=(center, color))


def _half_width(street: Street, sign: int) -> float:
    return sum(spec.width for spec in street.side(sign))


def vary_signals(root: Element, rng: np.random.Generator) -> None:
    """Vary heights and sizes of lights and signs beyond those of the library."""
    for signal in root.iterfind(".//signal"):
        signal.set("zOffset", f"{rng.uniform(1.9, 4.5):.3f}")
        scale = rng.uniform(0.85, 1.3)
        for key in ("width", "height"):
            signal.set(key, f"{float(signal.get(key, '0.5')) * scale:.3f}")
        signal.set("hOffset", f"{rng.normal(0.0, 0.12):.4f}")


def add_road_objects(root: Element, rng: np.random.Generator) -> None:
    """Add trees, lamps, poles, hedges and barriers along all roads outside junctions, or none."""
    if rng.random() < 0.15:
        return
    number = 1000
    for road in root.iterfind("road[@junction='-1']"):
        length = float(road.get("length", "0"))
        objects = road.find("objects")
        if objects is None:
            objects = etree.Element("objects")
            signals = road.find("signals")
            road.insert(len(road) if signals is None else road.index(signals), objects)
        for side in (-1, 1):
            edge = _edge(road, side)
            for kind in rng.permutation(list(_ROAD_OBJECTS))[: int(rng.integers(0, 3))].tolist():
                size, gap = _ROAD_OBJECTS[kind]
                scale = float(rng.uniform(0.7, 1.4))
                away = float(rng.uniform(0.3, 3.0))
                for s in np.arange(rng.uniform(2.0, 20.0), length - 2.0, gap * rng.uniform(0.8, 2.0)).tolist():
                    number += 1
                    object_scale = scale * float(rng.uniform(0.85, 1.15))
                    add(
                        objects,
                        "object",
                        id=str(number),
                        name=str(rng.choice(["fir", "tree"])) if kind == "tree" else kind,
                        type=kind,
                        s=s,
                        t=side * (edge + away + (size[0] * object_scale / 2 if kind == "tree" else 0.0)),
                        zOffset=0.0,
                        orientation="none",
                        length=size[0] * object_scale,
                        width=size[1] * object_scale,
                        height=size[2] * object_scale,
                        hdg=0.0,
                        pitch=0.0,
                        roll=0.0,
                    )


def _edge(road: Element, side: int) -> float:
    """Return the width of all lanes on one side."""
    lanes = road.iterfind(f"lanes/laneSection/{'left' if side > 0 else 'right'}/lane")
    return sum(float(width.get("a", "0")) for lane in lanes for width in lane.iterfind("width"))


def winding_road(rng: np.random.Generator) -> Element:
    """Return a road of lines, clothoids and arcs with slopes, lights and stop signs."""
    street = random_street(rng)
    line = winding_course(rng)
    length = sum(curve.length for curve in line)
    root = etree.Element("OpenDRIVE")
    add(root, "header", revMajor=1, revMinor=6, name="training", version="1.00")
    road, _, plan = add_road(root, "1", "winding", length, "-1")
    for curve in line:
        geometry = add(plan, "geometry", s=curve.s, x=curve.x, y=curve.y, hdg=curve.h, length=curve.length)
        if isinstance(curve, curves.Spiral):
            add(geometry, "spiral", curvStart=curve.curvature, curvEnd=curve.curvature + curve.rate * curve.length)
        elif isinstance(curve, curves.Arc) and curve.curvature:
            add(geometry, "arc", curvature=curve.curvature)
        else:
            add(geometry, "line")
    write_hills(road, length, rng)
    section = add(add(road, "lanes"), "laneSection", s=0.0)
    left = add(section, "left")
    for i in range(len(street.left), 0, -1):
        add_lane(left, i, street.left[i - 1])
    center = add(add(section, "center"), "lane", id=0, type="none", level="false")
    add(center, "link")
    add_mark(center, street.center)
    right = add(section, "right")
    for i, spec in enumerate(street.right, start=1):
        add_lane(right, -i, spec)
    signals = add(road, "signals")
    for number in range(int(rng.integers(2, 6))):
        sign = int(rng.choice([-1, 1]))
        draw = rng.random()
        kind, subtype, width, height = LIGHT if draw < 0.55 else STOP if draw < 0.85 else OTHERS[int(rng.integers(4))]
        add(
            signals,
            "signal",
            s=float(rng.uniform(0.1, 0.9) * length),
            t=sign * (street.edge(sign) + street.verge(sign) + rng.uniform(0.3, 1.0)),
            id=str(number + 1),
            name=f"signal {number + 1}",
            dynamic="yes" if kind == LIGHT[0] else "no",
            orientation="+" if sign < 0 else "-",
            zOffset=float(rng.uniform(1.9, 4.5)),
            country="DE",
            type=kind,
            subtype=subtype,
            height=height,
            width=width,
            hOffset=float(rng.normal(0.0, 0.12)),
            pitch=0.0,
            roll=0.0,
        )
    return root


def winding_course(rng: np.random.Generator) -> list[curves.Curve]:
    """Return lines and bends, each bend a clothoid, an arc and a clothoid."""
    course: list[curves.Curve] = []
    x, y, heading, s = 0.0, 0.0, float(rng.uniform(-math.pi, math.pi)), 0.0
    for _ in range(int(rng.integers(1, 4))):
        bend = float(rng.choice([-1, 1])) / rng.uniform(35.0, 250.0)
        clothoid, arc = float(rng.uniform(12.0, 30.0)), float(rng.uniform(8.0, 50.0))
        segments = (
            (float(rng.uniform(20.0, 70.0)), 0.0, 0.0),
            (clothoid, 0.0, bend),
            (arc, bend, bend),
            (clothoid, bend, 0.0),
        )
        for length, start, end in segments:
            curve = (
                curves.Arc(s, x, y, heading, length, start)
                if start == end
                else curves.spiral(s, x, y, heading, length, start, end)
            )
            course.append(curve)
            x, y, heading, *_ = curve.at(length)
            s += length
    return course


def write_hills(road: Element, length: float, rng: np.random.Generator) -> None:
    """Write a smooth elevation profile of cubic segments with continuous height and slope."""
    profile = road.find("elevationProfile")
    assert profile is not None
    profile.clear()
    height, slope, s = 0.0, 0.0, 0.0
    step = 40.0
    steep = float(rng.choice([0.0, 0.02, 0.06]))
    while s < length:
        target = float(rng.uniform(-steep, steep))
        # c and d change the slope from `slope` to `target` with zero curvature at the end
        c = (target - slope) / step
        d = -(target - slope) / (3.0 * step**2)
        add(profile, "elevation", s=s, a=height, b=slope, c=c, d=d)
        height += slope * step + c * step**2 + d * step**3
        slope = slope + 2.0 * c * step + 3.0 * d * step**2
        s += step


def random_houses(roads: RoadNetwork, rng: np.random.Generator) -> list[House]:
    """Return rows of houses along the roads outside junctions; none for some places."""
    houses: list[House] = []
    if rng.random() < 0.2:
        return houses
    setback, gap = rng.uniform(1.0, 10.0), rng.uniform(1.0, 25.0)
    for road in roads.roads.values():
        if road.junction_id is not None:
            continue
        for side in (-1, 1):
            lanes = roads.lane_ids(road.id, road.length / 2)
            edge = sum(roads.lane_width(road.id, lane, road.length / 2) for lane in lanes if lane * side > 0)
            s = rng.uniform(0.0, 15.0)
            while s < road.length - 12.0:
                length, depth, height = rng.uniform(6.0, 24.0), rng.uniform(6.0, 14.0), rng.uniform(3.5, 18.0)
                t = side * (edge + setback + depth / 2 + rng.uniform(0.0, 2.0))
                pose = roads.road_pose_at(road.id, min(s + length / 2, road.length), t)
                if _clear_of_roads(roads, pose.x, pose.y, pose.h, length, depth):
                    tone = rng.uniform(0.25, 0.9)
                    red, green, blue = (tone * rng.uniform(0.75, 1.1, 3)).clip(0.05, 0.95).tolist()
                    center = (pose.x, pose.y, pose.z + height / 2)
                    houses.append(House(center, (length, depth, height), pose.h, (red, green, blue)))
                s += length + gap + rng.uniform(0.0, 10.0)
    return houses


def _clear_of_roads(roads: RoadNetwork, x: float, y: float, heading: float, length: float, depth: float) -> bool:
    """Return whether a house overlaps no road."""
    along, across = np.meshgrid(np.linspace(-0.5, 0.5, 9) * length, np.linspace(-0.5, 0.5, 5) * depth)
    cos, sin = math.cos(heading), math.sin(heading)
    corners_x, corners_y = x + cos * along - sin * across, y + sin * along + cos * across
    lanes, _, _ = roads.overlapped_lanes(corners_x.ravel(), corners_y.ravel())
    return not len(lanes)
