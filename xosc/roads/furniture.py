"""Objects and signals of the road files: crosswalks, stop lines, signs, traffic lights and houses."""

from __future__ import annotations

from collections.abc import Sequence

from xosc.roads.layout import Arm, Junction, Road, Tunnel
from xosc.roads.opendrive import Element, add

HOUSES = ((14.0, 10.0, 9.5), (11.0, 9.0, 6.5), (18.0, 12.0, 13.0))
"""Length along the street, depth and height of the houses of a row [m]."""
HOUSE_GAP, SETBACK = 5.0, 3.0
"""Gap between houses and distance from the sidewalk [m]."""
SIGNALS = {
    "light": ("1000001", "-1", "yes", 0.86, 0.3, "light"),
    "stop": ("206", "-1", "no", 0.75, 0.75, "stop"),
    "yield": ("205", "-1", "no", 0.9, 0.9, "yield"),
}
"""Type, subtype, whether it is dynamic, height, width [m] and name of the signal of a control."""
WALL_HEIGHT, WALL_WIDTH = 4.7, 0.4
"""Of the walls of a tunnel [m]; the clearance of German tunnels is 4.50 m (RABT)."""
CROSSWALK = (0.8, 3.8)
"""Distances of the edges of a crosswalk from the junction [m]."""
LINE_WIDTH, LINE_BEFORE_SIGNAL = 0.4, 0.6
"""Width of a stop line, and its distance before the signal at a crosswalk [m]."""
FLAT = {"hdg": 0.0, "pitch": 0.0, "roll": 0.0}


def write_objects_and_signals(road: Element, arms: Sequence[Arm], described: Road) -> None:
    """Add crosswalk, stop line and signal for the traffic that enters a junction at an end of the road, and houses."""
    objects = add(road, "objects")
    if described.tunnel is not None:
        _write_tunnel(objects, described, described.tunnel)
    for number, arm in enumerate(arms):
        _write_markings(objects, arm, 40 * number)
        if described.houses is not None:
            _write_houses(objects, arm, described.houses, 40 * number)
    if not len(objects):
        road.remove(objects)
    if any(arm.control for arm in arms):
        signals = add(road, "signals")
        for number, arm in enumerate(arms):
            if arm.control:
                _write_signal(signals, arm, f"{described.id}{number}")


def signal_ids(arms: Sequence[Arm], junction: Junction) -> list[str]:
    """Return the ids of the signals of one road at a junction."""
    return [f"{arm.road.id}{number}" for number, arm in enumerate(arms) if arm.control and arm in junction.arms]


def _object_id(road: Road, number: int) -> str:
    """Return the id of an object, unique in the file."""
    return f"{road.id}{number:02}"


def _edge(arm: Arm, side: int) -> float:
    """Return t of the edge of the last driving lane on one side, of the innermost lane 0 if there is none."""
    street = arm.street
    return arm.offset + (side * street.edge(side) if street.driving(side) else 0.0)


def _write_markings(objects: Element, arm: Arm, first: int) -> None:
    sign, street = arm.approach, arm.street
    back = -1.0 if arm.contact == "end" else 1.0
    if arm.crosswalk:
        curbs = [_edge(arm, side) + side * street.verge(side) for side in (-1, 1)]
        near, far = CROSSWALK
        number = _object_id(arm.road, first)
        _write_area(objects, number, "crosswalk", arm.s + back * near, arm.s + back * far, curbs[0], curbs[1])
    if arm.control:
        lane = street.driving(sign)[0]
        inner = arm.offset + street.center_of(lane) - sign * street.lane(lane).width / 2
        start = arm.line + (LINE_BEFORE_SIGNAL if arm.crosswalk else 0.0)
        s, s_end = arm.s + back * start, arm.s + back * (start + LINE_WIDTH)
        _write_area(objects, _object_id(arm.road, first + 1), "roadMark", s, s_end, inner, _edge(arm, sign))


def _write_signal(signals: Element, arm: Arm, number: str) -> None:
    sign, street = arm.approach, arm.street
    back = -1.0 if arm.contact == "end" else 1.0
    kind = SIGNALS[arm.control]
    signal = add(
        signals,
        "signal",
        s=arm.s + back * arm.line,
        t=_edge(arm, sign) + sign * (street.verge(sign) + 0.5),
        id=number,
        name=f"{kind[5]} {arm.name}",
        dynamic=kind[2],
        orientation="+" if sign < 0 else "-",
        zOffset=2.4,
        country="DE",
        type=kind[0],
        subtype=kind[1],
        height=kind[3],
        width=kind[4],
        hOffset=0.0,
        pitch=0.0,
        roll=0.0,
    )
    lanes = street.driving(sign)
    add(signal, "validity", fromLane=min(lanes), toLane=max(lanes))


def _write_houses(objects: Element, arm: Arm, clearance: float, first: int) -> None:
    """Add a row of houses on each side, set back from the sidewalk and away from the corners of the junction.

    A house beyond the end of the road is at this end.
    """
    for side in (-1, 1):
        curb = sum(spec.width for spec in arm.street.side(side))
        from_junction = clearance
        for number, (length, depth, height) in enumerate(HOUSES if side > 0 else reversed(HOUSES)):
            middle = min(from_junction + length / 2, arm.road.length)
            add(
                objects,
                "object",
                id=_object_id(arm.road, first + (20 if side > 0 else 30) + number),
                name=f"house {arm.name} {'left' if side > 0 else 'right'} {number + 1}",
                type="building",
                s=arm.s - middle if arm.contact == "end" else middle,
                t=arm.offset + side * (curb + SETBACK + depth / 2),
                zOffset=0.0,
                orientation="none",
                length=length,
                width=depth,
                height=height,
                **FLAT,
            )
            from_junction += length + HOUSE_GAP


def _write_tunnel(objects: Element, road: Road, tunnel: Tunnel) -> None:
    """Add the walls of a tunnel at the edges of the road, and the tunnel itself."""
    street = road.sections[0].street
    for side in (1, -1):
        t = side * (sum(spec.width for spec in street.side(side)) + WALL_WIDTH / 2)
        wall = add(
            objects,
            "object",
            id=_object_id(road, 80 if side > 0 else 90),
            name=f"tunnel wall {'left' if side > 0 else 'right'}",
            type="barrier",
            subtype="wall",
            s=tunnel.s,
            t=t,
            zOffset=0.0,
            orientation="none",
            length=tunnel.length,
            width=WALL_WIDTH,
            height=WALL_HEIGHT,
            **FLAT,
        )
        add(
            wall,
            "repeat",
            s=tunnel.s,
            length=tunnel.length,
            distance=0.0,
            tStart=t,
            tEnd=t,
            widthStart=WALL_WIDTH,
            widthEnd=WALL_WIDTH,
            heightStart=WALL_HEIGHT,
            heightEnd=WALL_HEIGHT,
            zOffsetStart=0.0,
            zOffsetEnd=0.0,
        )
    add(
        objects,
        "tunnel",
        s=tunnel.s,
        length=tunnel.length,
        id=_object_id(road, 95),
        name="tunnel",
        type="underpass",
        lighting=0.5,
        daylight=0.0,
    )


def _write_area(objects: Element, number: str, kind: str, s: float, s_end: float, t: float, t_end: float) -> None:
    """Add a painted area of the road between two s and two t."""
    item = add(
        objects,
        "object",
        id=number,
        name=kind,
        type=kind,
        s=(s + s_end) / 2,
        t=(t + t_end) / 2,
        zOffset=0.0,
        orientation="none",
        length=abs(s_end - s),
        width=abs(t_end - t),
        height=0.0,
        **FLAT,
    )
    outline = add(add(item, "outlines"), "outline", id=0, closed="true")
    for i, (corner_s, corner_t) in enumerate(((s, t), (s_end, t), (s_end, t_end), (s, t_end))):
        add(outline, "cornerRoad", id=i, s=corner_s, t=corner_t, dz=0.0, height=0.0)
