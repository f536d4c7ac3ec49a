"""Bodies of a vehicle and its trailer overlap without a contact; other bodies collide."""

from __future__ import annotations

import pytest
from sample_car import CarFactory

from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Control, Placement
from eidrive_scenario.world.view import Contact

BEHIND = 4.0
"""Distance of the trailer behind its vehicle [m]; the boxes of 4.5 m overlap by half a meter."""
PAIR = frozenset({"Ego", "Trailer"})


def tow(world: World, ticks: int, control: Control) -> int:
    """Move the trailer with the driven vehicle; return the number of contacts."""
    count = 0
    for _ in range(ticks):
        view = world.view()
        row = view.rows["Ego"]
        x, speed = float(view.position[row, 0]), float(view.speed[row])
        world.step({"Trailer": Placement(x - BEHIND + speed * world.dt, 0.0, speed=speed)}, {"Ego": control})
        count += len(world.view().contacts)
    return count


def x_of(world: World, name: str) -> float:
    view = world.view()
    return float(view.position[view.rows[name], 0])


def test_vehicle_is_not_affected_by_its_trailer(world: World, car: CarFactory) -> None:
    throttle = Control(throttle=0.5)
    world.set_trailers([PAIR])
    world.add(car("Ego"), Placement(0.0, 0.0, speed=5.0), driven=True)
    world.add(car("Trailer"), Placement(-BEHIND, 0.0, speed=5.0))
    assert world.view().contacts == ()
    assert tow(world, 60, throttle) == 0
    with World() as alone:
        alone.add(car("Ego"), Placement(0.0, 0.0, speed=5.0), driven=True)
        for _ in range(60):
            alone.step({}, {"Ego": throttle})
        assert x_of(world, "Ego") == pytest.approx(x_of(alone, "Ego"), abs=1e-3)


def test_overlap_without_a_connection_is_a_contact(world: World, car: CarFactory) -> None:
    world.add(car("Ego"), Placement(0.0, 0.0, speed=5.0), driven=True)
    world.add(car("Trailer"), Placement(-BEHIND, 0.0, speed=5.0))
    assert len(world.view().contacts) == 1


def test_disconnected_trailer_collides_after_it_has_parted(world: World, car: CarFactory) -> None:
    world.set_trailers([PAIR])
    world.add(car("Ego"), Placement(0.0, 0.0, speed=5.0), driven=True)
    world.add(car("Trailer"), Placement(-BEHIND, 0.0, speed=5.0))
    assert tow(world, 10, Control()) == 0
    world.set_trailers([])
    for _ in range(40):
        world.step({}, {"Ego": Control()})
        assert world.view().contacts == (), "the trailer stands, and the vehicle moves on"
    stands = x_of(world, "Trailer")
    assert x_of(world, "Ego") - stands > 5.0
    found: list[Contact] = []
    for _ in range(300):
        world.step({}, {"Ego": Control(throttle=0.4, reverse=True)})
        found += world.view().contacts
    assert {(contact.first, contact.second) for contact in found} == {("Ego", "Trailer")}
    assert x_of(world, "Ego") - stands > 4.0, "it does not drive through the trailer"


def test_connection_applies_to_a_body_that_becomes_driven(world: World, car: CarFactory) -> None:
    world.set_trailers([PAIR])
    world.add(car("Ego"), Placement(0.0, 0.0, speed=5.0))
    world.add(car("Trailer"), Placement(-BEHIND, 0.0, speed=5.0))
    world.step({"Ego": Placement(0.25, 0.0, speed=5.0), "Trailer": Placement(0.25 - BEHIND, 0.0, speed=5.0)}, {})
    world.set_driven("Ego", True)
    before = x_of(world, "Ego")
    assert tow(world, 20, Control()) == 0
    assert x_of(world, "Ego") - before == pytest.approx(5.0, abs=0.5)
