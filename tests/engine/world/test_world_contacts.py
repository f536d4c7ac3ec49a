"""Tests of collisions: reports, and effects on driven cars."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from sample_car import CarFactory

from eidrive_scenario.base.geometry import footprint_distance
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Control, Placement
from eidrive_scenario.world.view import Contact


def approach(world: World, ticks: int, speed: float, start: float) -> list[tuple[int, Contact]]:
    """Move the scripted A along x and return (tick, contact) of all contacts."""
    found = []
    for tick in range(1, ticks + 1):
        world.step({"A": Placement(start + tick * speed * 0.05, 0.0, speed=speed)}, {})
        found += [(tick, contact) for contact in world.view().contacts]
    return found


def test_contact_of_scripted_boxes_is_reported_once(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(0.0, 0.0, speed=10.0))
    world.add(car("B"), Placement(20.0, 0.5))
    found = approach(world, 60, 10.0, 0.0)
    # The gap of 15.5 m decreases by half a meter per tick.
    assert len(found) == 1
    tick, contact = found[0]
    assert tick in (31, 32)
    assert (contact.first, contact.second) == ("A", "B")
    assert contact.impact_speed == pytest.approx(10.0, rel=0.01)
    assert contact.position[0] == pytest.approx(19.1, abs=0.3)
    assert contact.position[1] == pytest.approx(0.25, abs=0.7)
    assert contact.position[2] == pytest.approx(0.75)


def test_gap_of_ten_centimeters_is_no_contact(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(0.0, 0.0, speed=10.0))
    world.add(car("B"), Placement(20.0, 1.9))
    assert approach(world, 80, 10.0, 0.0) == []


def test_actor_on_a_bridge_above_is_no_contact(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(0.0, 0.0, speed=10.0))
    world.add(car("B"), Placement(20.0, 0.0, 5.0))
    assert approach(world, 80, 10.0, 0.0) == []


def test_second_contact_after_separation_is_reported(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(0.0, 0.0))
    world.add(car("B"), Placement(5.0, 0.0))
    counts = []
    for x in (0.6, 0.7, 0.0, 0.6):
        world.step({"A": Placement(x, 0.0)}, {})
        counts.append(len(world.view().contacts))
    assert counts == [1, 0, 0, 1]


def test_resting_contact_is_reported_once(world: World, car: CarFactory) -> None:
    """The bodies stand still for a while, and then one moves on inside the other."""
    world.add(car("A"), Placement(0.0, 0.0, speed=10.0))
    world.add(car("B"), Placement(20.0, 0.0))
    assert len(approach(world, 33, 10.0, 0.0)) == 1
    here = world.view().position[0, 0]
    for step in (0.0, 0.0, 0.1, 0.0, 0.2):
        world.step({"A": Placement(here + step, 0.0)}, {})
        assert world.view().contacts == ()


def test_contacts_of_many_actors_equal_pairwise_search(world: World, car: CarFactory) -> None:
    for index in range(40):
        world.add(car(f"P{index}"), Placement(8.0 * index, 0.0))
    world.add(car("A"), Placement(8.0 * 17, -6.0))
    seen = []
    for tick in range(40):
        world.step({"A": Placement(8.0 * 17, -6.0 + 0.2 * tick, speed=0.0)}, {})
        seen += [(contact.first, contact.second) for contact in world.view().contacts]
    assert seen == [("P17", "A")]


def test_standing_car_is_pushed_by_a_scripted_one(world: World, car: CarFactory) -> None:
    """The scripted car keeps its speed, so that the other leaves at this speed plus an effect of restitution."""
    world.add(car("A"), Placement(-10.0, 0.0, speed=8.0))
    world.add(car("B"), Placement(0.0, 0.0), driven=True)
    contacts: list[Contact] = []
    fastest = 0.0
    for tick in range(1, 40):
        world.step({"A": Placement(-10.0 + 0.4 * tick, 0.0, speed=8.0)}, {"B": Control()})
        view = world.view()
        contacts += view.contacts
        fastest = max(fastest, float(view.speed[1]))
    assert [(contact.first, contact.second) for contact in contacts] == [("A", "B")]
    assert contacts[0].impact_speed == pytest.approx(8.0, rel=0.02)
    assert 8.0 <= fastest <= 8.0 * 1.2


def test_two_driven_cars_share_the_momentum(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(-10.0, 0.0, speed=10.0), driven=True)
    world.add(car("B"), Placement(0.0, 0.0), driven=True)
    touched = None
    for _ in range(30):
        before = world.view()
        world.step({}, {})
        view = world.view()
        if view.contacts:
            touched = (before, view)
            break
    assert touched is not None
    before, after = touched
    assert after.speed.sum() == pytest.approx(before.speed.sum(), rel=0.02)
    # Equal masses and a restitution of 0.3² leave 45 % and 55 % of the speed.
    assert after.speed[1] == pytest.approx(0.545 * before.speed[0], rel=0.05)
    assert after.contacts[0].impact_speed == pytest.approx(before.speed[0], rel=0.02)


def test_off_center_impact_spins_the_car(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(3.2, -12.0, yaw=math.pi / 2, speed=12.0))
    world.add(car("B"), Placement(0.0, 0.0), driven=True)
    for tick in range(1, 30):
        world.step({"A": Placement(3.2, -12.0 + 0.6 * tick, yaw=math.pi / 2, speed=12.0)}, {"B": Control(brake=1.0)})
        if abs(world.view().yaw_rate[1]) > 0.5:
            break
    last = tick
    view = world.view()
    # An impact at the front from the right turns the car to the left and pushes it to the left.
    assert view.yaw_rate[1] > 0.5
    assert view.velocity[1, 1] > 0.5
    for tick in range(last + 1, last + 120):
        world.step({"A": Placement(3.2, -12.0 + 0.6 * tick, yaw=math.pi / 2, speed=12.0)}, {"B": Control(brake=1.0)})
    settled = world.view()
    assert abs(settled.speed[1]) < 0.01
    assert abs(settled.yaw_rate[1]) < 0.01
    assert settled.position[1, 2] == 0.0
    assert (settled.pitch[1], settled.roll[1]) == (0.0, 0.0)


def test_car_passes_buildings_and_collides_with_the_last_one(world: World, car: CarFactory) -> None:
    """The car is near to walls and far from them in turn. A building that is added on the way has effect at once."""
    for x in (30.0, 60.0, 90.0):
        world.add_building(f"Row {x:g}", (x, 9.0, 5.0), (12.0, 12.0, 10.0))
    world.add(car("Ego"), Placement(0.0, 0.0, speed=20.0), driven=True)
    met: list[str] = []
    while world.time < 8.0:
        if abs(world.time - 5.0) < 1e-6:
            world.add_building("Barrier", (125.0, 0.0, 1.0), (2.0, 20.0, 2.0))
        world.step({}, {"Ego": Control(throttle=0.1)})
        met += [contact.second for contact in world.view().contacts]
    assert met == ["Barrier"]
    assert world.view().position[0, 0] < 124.0


def test_building_stops_a_car(world: World, car: CarFactory) -> None:
    world.add_building("Town hall", (25.0, 0.0, 5.0), (10.0, 20.0, 10.0))
    world.add(car("Ego"), Placement(0.0, 0.0, speed=10.0), driven=True)
    contacts: list[Contact] = []
    for _ in range(60):
        world.step({}, {"Ego": Control()})
        contacts += world.view().contacts
    assert [(contact.first, contact.second) for contact in contacts] == [("Ego", "Town hall")]
    assert contacts[0].impact_speed == pytest.approx(10.0, rel=0.05)
    # The front, 3.6 m ahead of the rear axle, does not pass the wall at 20 m.
    assert world.view().position[0, 0] + 3.6 <= 20.05


@pytest.mark.parametrize("enter", [(), (30,), tuple(range(20, 60, 5))])
def test_actors_that_enter_do_not_restart_a_contact_with_a_wall(
    world: World, car: CarFactory, enter: tuple[int, ...]
) -> None:
    """The car scrapes along the wall from tick 6 on, while actors enter 500 m beside it."""
    world.add_building("Wall", (100.0, 2.5, 1.5), (400.0, 1.0, 3.0))
    world.add(car("Ego"), Placement(0.0, 0.0, yaw=0.15, speed=12.0), driven=True)
    ticks = []
    for tick in range(80):
        world.step({}, {"Ego": Control(throttle=0.5, steering=0.1)})
        if tick in enter:
            world.add(car(f"Far {tick}"), Placement(10.0 * tick, -500.0))
        ticks += [tick for _ in world.view().contacts]
    assert ticks
    assert max(ticks) < 20


def test_scrape_along_a_wall_is_one_contact_until_a_gap(world: World, car: CarFactory) -> None:
    """A car that steers to the wall and off it is at most 2 cm from it; then it leaves and returns."""
    wall = (200.0, 2.5, 0.0, 400.0, 1.0, 3.0, 0.0)
    world.add_building("Wall", (200.0, 2.5, 1.5), (400.0, 1.0, 3.0))
    world.add(car("Ego"), Placement(0.0, 0.0, yaw=0.1, speed=12.0), driven=True)
    contacts, gaps = [], []
    for tick in range(300):
        steering = (-0.2 if tick < 175 else 0.2) if 160 <= tick < 200 else (0.05, -0.02)[tick // 4 % 2]
        world.step({}, {"Ego": Control(throttle=0.3, steering=steering)})
        contacts += [(tick, contact.second) for contact in world.view().contacts]
        gaps.append(footprint_distance(world.view().plain_boxes[0], wall))
    assert max(gaps[40:160]) < 0.02
    assert [tick < 160 for tick, _ in contacts] == [True] + [False] * (len(contacts) - 1)
    assert len(contacts) > 1
    assert {name for _, name in contacts} == {"Wall"}
    assert all(max(gaps[former:later]) > 0.05 for (former, _), (later, _) in pairwise(contacts))


@pytest.mark.parametrize("driven", [False, True], ids=["scripted", "driven"])
def test_contact_of_an_actor_that_is_added_inside_of_a_standing_one(
    world: World, car: CarFactory, driven: bool
) -> None:
    """A view of the tick exists already, as in a run; the next one has the contact."""
    world.add(car("A"), Placement(0.0, 0.0))
    world.step({}, {})
    assert world.view().contacts == ()
    world.add(car("B"), Placement(1.0, 0.0), driven=driven)
    world.step({}, {})
    (contact,) = world.view().contacts
    assert (contact.first, contact.second) == ("A", "B")
    assert contact.impact_speed == 0.0
    world.step({}, {})
    assert not [one for one in world.view().contacts if {one.first, one.second} == {"A", "B"}], "reported once"


def test_view_has_the_contacts_of_actors_added_before_it(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(0.0, 0.0))
    world.add(car("B"), Placement(1.0, 0.0))
    assert len(world.view().contacts) == 1
    world.step({}, {})
    assert world.view().contacts == ()


def test_contact_of_an_added_actor_ends_with_its_removal(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(0.0, 0.0))
    world.view()
    world.add(car("B"), Placement(1.0, 0.0))
    world.remove("B")
    world.step({}, {})
    assert world.view().contacts == ()
    world.add(car("B"), Placement(1.0, 0.0))
    world.step({}, {})
    assert len(world.view().contacts) == 1


@pytest.mark.parametrize("is_viewed", [False, True])
def test_contacts_of_actors_added_at_once_are_in_order_of_addition(car: CarFactory, is_viewed: bool) -> None:
    """The same contacts are found as by a search after each addition."""
    found = []
    for each in (False, True):
        rng = np.random.default_rng(4)
        with World() as world:
            world.add(car("first"), Placement(0.0, 0.0))
            if is_viewed:
                world.view()
            for number in range(30):
                x, y, yaw = rng.uniform(-12.0, 12.0), rng.uniform(-12.0, 12.0), rng.uniform(-3.0, 3.0)
                world.add(car(f"{number}"), Placement(x, y, yaw=yaw), driven=number % 7 == 0)
                if each:
                    world._contacts.find_added(world._bodies)
                if number == 20:
                    world.remove("11")
            before = () if is_viewed else world.view().contacts
            world.step({}, {})
            found.append((before, world.view().contacts))
    assert found[0] == found[1]
    assert sum(map(len, found[0])) > 20
