"""Worlds whose scripted bodies move together in arrays, compared with those whose bodies move one by one."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator

import pytest
from msgspec.structs import replace
from sample_car import CarFactory

from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Control, Placement
from eidrive_scenario.world.physics import body_group

HALF = 40.0
"""Half the length of the square with the actors [m]."""


@pytest.mark.parametrize("driven", [0, 2])
@pytest.mark.parametrize("count", [2, 5, 25, 60])
def test_batch_gives_the_same_bits_as_single_bodies(
    car: CarFactory, monkeypatch: pytest.MonkeyPatch, count: int, driven: int
) -> None:
    found = []
    for many in (1, 10**9):
        monkeypatch.setattr(body_group, "MANY", many)
        found.append(list(_observations(car, count, driven, ticks=40)))
    assert found[0] == found[1]
    assert count < 25 or any("Contact" in text for text in found[0])


def test_batch_begins_with_many_scripted_bodies_and_ends_with_few(
    world: World, car: CarFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The velocities of the last step continue across the change."""
    monkeypatch.setattr(body_group, "MANY", 3)
    for number in range(3):
        world.add(car(f"A{number}"), Placement(0.0, 10.0 * number, speed=10.0))
        world.step({f"A{row}": Placement(0.5 * (number + 1), 10.0 * row, speed=10.0) for row in range(number + 1)}, {})
    world.remove("A1")
    world.step(
        {name: Placement(2.1, world.view().position[row, 1], speed=12.0) for row, name in enumerate(world.names)}, {}
    )
    assert world.view().acceleration[:, 0] == pytest.approx([40.0, 40.0])


def test_bodies_of_a_batch_stay_where_pybullet_and_distances_expect_them(
    world: World, car: CarFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(body_group, "MANY", 1)
    world.add(car("A"), Placement(0.0, 0.0))
    world.add(car("B"), Placement(20.0, 0.0))
    for x in (1.0, 2.0, 3.0):
        world.step({"A": Placement(x, 0.0, speed=20.0)}, {})
    assert world.distance("A", "B") == pytest.approx(20.0 - 3.0 - 4.5)
    hits = world.raycast([[3.0 + 1.35, -5.0, 0.7]], [[3.0 + 1.35, 5.0, 0.7]])
    assert hits.rows.tolist() == [0]
    assert hits.fraction == pytest.approx([0.41])


def _observations(car: CarFactory, count: int, driven: int, ticks: int) -> Iterator[str]:
    """Yield what is observed in a world of random motion as text, with all digits and the signs of zeros.

    Actors stand, move, turn, jump, tilt, appear and leave, and are driven and scripted in turn.
    """
    draw = random.Random(count + driven)
    with World(dt=0.05) as world:
        places: dict[str, Placement] = {}
        for number in range(count):
            places[f"A{number}"] = _somewhere(draw)
            world.add(car(f"A{number}"), places[f"A{number}"], driven=number < driven)
        pedals = {f"A{number}" for number in range(driven)}
        for tick in range(ticks):
            requested = {name: place for name in world.names if (place := _next(places[name], draw)) is not None}
            requested = {name: place for name, place in requested.items() if name not in pedals}
            world.step(requested, {name: Control(throttle=0.3, steering=0.1) for name in sorted(pedals)})
            view = world.view()
            yield repr((view.states, view.contacts, view.kinematics.tolist(), view.boxes.tolist()))
            places = {
                name: Placement(*state[:6], state.speed) for name, state in zip(view.names, view.states, strict=True)
            }
            name, other = draw.sample(world.names, 2)
            match draw.randrange(8):
                case 0:
                    world.add(car(f"B{tick}"), places.setdefault(f"B{tick}", _somewhere(draw)))
                case 1 if len(places) > 2:
                    world.remove(name)
                    pedals.discard(name)
                case 2:
                    world.set_driven(name, name not in pedals)
                    pedals ^= {name}
                case 3:
                    yield repr(world.distance(name, other))
                case 4:
                    world.set_trailers([frozenset({name, other})])
                case 5 | 6:
                    ends = [[draw.uniform(-HALF, HALF), draw.uniform(-HALF, HALF), 0.7] for _ in range(40)]
                    hits = world.raycast(ends[:20], ends[20:])
                    yield repr((hits.rows.tolist(), hits.fraction.tolist(), world.first_hit(ends[:1], ends[1:2])))


def _somewhere(draw: random.Random) -> Placement:
    return Placement(draw.uniform(-HALF, HALF), draw.uniform(-HALF, HALF), yaw=draw.uniform(-3.1, 3.1), speed=5.0)


def _next(now: Placement, draw: random.Random) -> Placement | None:
    """Return a random next placement; None for an actor that stands without one."""
    ahead = now.x + 0.3 * math.cos(now.yaw), now.y + 0.3 * math.sin(now.yaw)
    match draw.randrange(8):
        case 0:
            return None
        case 1:
            return Placement(now.x, now.y, now.z, now.yaw, now.pitch, now.roll, across=draw.choice([True, False]))
        case 2:
            return replace(_somewhere(draw), speed=draw.choice([0.0, -3.0]), teleport=True)
        case 3:
            return Placement(*ahead, now.z, now.yaw + 0.2 if now.yaw < 2.9 else -3.1, speed=6.0)
        case 4:
            pitch, roll = draw.choice([0.0, 0.1, -0.2]), draw.choice([-0.0, 0.1])
            return Placement(*ahead, now.z + 0.1, now.yaw, pitch, roll, draw.choice([0.0, -0.0, 2.0]))
        case _:
            return Placement(*ahead, now.z, now.yaw, now.pitch, now.roll, 6.0, across=draw.choice([True, False]))
