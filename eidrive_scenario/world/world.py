"""World of one run: state of the actors and its simulation by time steps."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.base.geometry import box_distance
from eidrive_scenario.errors import SimulationError, suggestion
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.world.actor import ActorSpec, Control, Placement, Vector3
from eidrive_scenario.world.appearance import Appearance, hidden_actors
from eidrive_scenario.world.camera import (
    FIRST_SIGNAL_LABEL,
    PictureMaker,
    Pinhole,
    Radiance,
    UndrawnImage,
    VisibleState,
)
from eidrive_scenario.world.physics.bodies import Body, DrivenBody, GroundUnder, ScriptedBody
from eidrive_scenario.world.physics.body_group import group_bodies
from eidrive_scenario.world.physics.bullet import connect, disconnect
from eidrive_scenario.world.physics.contacts import ContactTracker, Couplings
from eidrive_scenario.world.physics.engine import Physics, substeps_per_tick
from eidrive_scenario.world.physics.free_space import FreeSpace
from eidrive_scenario.world.physics.rays import Crossings, cast_rays, find_crossings, first_hits
from eidrive_scenario.world.physics.scenery import Scenery
from eidrive_scenario.world.road_objects import Building, signal_heads
from eidrive_scenario.world.surfaces import Surfaces
from eidrive_scenario.world.view import GROUND, NOTHING, ActorColumns, Contact, RayHits, WorldView
from eidrive_scenario.world.weather import Weather


class ActorTable:
    """Data of the actors that is constant while no actor is added or removed.

    columns        names, categories, sizes and offsets of the boxes
    row_of_handle  row of the actor by the number of its body in pybullet, GROUND for other bodies; the last entry, for
                   handle -1, is NOTHING
    row_in_list    the same as a list
    """

    def __init__(self, bodies: Mapping[str, Body], highest_handle: int, dt: float) -> None:
        order = tuple(bodies.values())
        size = np.array([body.spec.size for body in order], dtype=float).reshape(-1, 3)
        offset = np.array([body.spec.offset for body in order], dtype=float).reshape(-1, 3)
        size.flags.writeable = offset.flags.writeable = False
        categories = tuple(body.spec.category for body in order)
        rows = {name: row for row, name in enumerate(bodies)}
        self.columns = ActorColumns(tuple(bodies), categories, size, offset, rows)
        self.bodies = group_bodies(order, dt)
        self.row_of_handle: Integers = np.full(
            max([highest_handle, *(body.handle for body in order)]) + 2, GROUND, dtype=np.int64
        )
        self.row_of_handle[-1] = NOTHING
        for row, body in enumerate(order):
            self.row_of_handle[body.handle] = row
        self.row_in_list: list[int] = self.row_of_handle.tolist()


class World:
    """Actors on roads, in one pybullet client without a window.

    `step` moves scripted actors exactly to their placements, and driven ones by their controls in physics steps of 1 /
    `physics_rate` seconds. All results are deterministic. Close the world after use, or use it in a `with` statement;
    otherwise its client is freed by garbage collection.

    entities       ids of road objects that are actors, and thus no part of the scenery
    picture_maker  maker of the images of cameras in a world with this scenery, called for the first image
    """

    def __init__(
        self,
        roads: RoadNetwork | None = None,
        *,
        dt: float = 0.05,
        physics_rate: float = 200.0,
        entities: Collection[str] = (),
        picture_maker: Callable[[Scenery], PictureMaker] | None = None,
    ) -> None:
        self.dt = dt
        self.tick = 0
        substeps = substeps_per_tick(dt, physics_rate)
        self._client = connect()
        self._release = weakref.finalize(self, disconnect, self._client)
        self._roads = roads
        self._bodies: dict[str, Body] = {}
        self._driven: dict[str, DrivenBody] = {}
        self._weather = Weather()
        self._signals: Mapping[str, str] = {}
        self._appearances: Mapping[str, Appearance] = {}
        self._hidden = hidden_actors({})
        self._friction = 1.0
        self._couplings = Couplings(self._client)
        self._contacts = ContactTracker(self._couplings)
        self._view: WorldView | None = None
        self._table: ActorTable | None = None
        self._scenery = Scenery(self._client, roads, entities)
        self._free_space = FreeSpace(self._scenery)
        self._physics = Physics(self._client, self._scenery, dt, substeps)
        self._picture_maker = picture_maker
        self._pictures: PictureMaker | None = None
        self._changed()

    def __enter__(self) -> World:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the pybullet client. The world is unusable afterwards."""
        self._pictures = None
        self._client = -1
        self._release()

    @property
    def time(self) -> float:
        """Current time [s]."""
        return self.tick * self.dt

    @property
    def names(self) -> tuple[str, ...]:
        """Actors in the order of addition."""
        return tuple(self._bodies)

    def spec(self, name: str) -> ActorSpec:
        """Return the specification of an actor. Raise SimulationError if it is not present."""
        return self._body(name).spec

    def motion(self, name: str) -> str:
        """Return the motion of a pedestrian by the standard; empty if it is not specified."""
        appearance = self._appearances.get(name)
        return appearance.motion if appearance is not None else ""

    def add(self, spec: ActorSpec, placement: Placement, *, driven: bool = False) -> None:
        """Add an actor. Raise SimulationError if an actor with this name is present."""
        if spec.name in self._bodies:
            raise SimulationError(f"actor {spec.name!r} is already in the world")
        self._enter(spec, placement, driven)
        self._contacts.note_addition()

    def remove(self, name: str) -> None:
        """Remove an actor. Raise SimulationError if it is not present."""
        self._contacts.find_added(self._bodies)
        self._body(name).remove()
        del self._bodies[name]
        self._driven.pop(name, None)
        self._contacts.forget(name)
        self._changed()

    def set_driven(self, name: str, driven: bool) -> None:
        """Move the actor by controls or by placements from the next step on. Its speed is kept."""
        body = self._body(name)
        if driven == (name in self._driven):
            return
        self._contacts.find_added(self._bodies)
        self._update_attributes()
        placement = Placement(body.x, body.y, body.z, body.yaw, body.pitch, body.roll, body.speed)
        body.remove()
        acceleration, yaw_rate, velocity = body.acceleration, body.yaw_rate, body.velocity
        self._driven.pop(name, None)
        self._enter(body.spec, placement, driven)
        entered = self._bodies[name]
        entered.acceleration, entered.yaw_rate, entered.velocity = acceleration, yaw_rate, velocity

    def set_trailers(self, pairs: Collection[frozenset[str]]) -> None:
        """Set the pairs of a vehicle and its trailer, which may overlap; actors may be absent."""
        self._contacts.find_added(self._bodies)
        self._couplings.set_pairs(frozenset(pairs))

    def attached(self, name: str) -> tuple[str, ...]:
        """Return the present trailers of a vehicle, or all other bodies of the road train of a trailer."""
        attached = self._couplings.attached(name)
        return tuple(other for other in self._bodies if other in attached) if attached else ()

    @property
    def weather(self) -> Weather:
        """Current weather."""
        return self._weather

    def set_weather(self, weather: Weather) -> None:
        """Set the weather, including its effect on the grip of tires."""
        self._weather = weather
        self._friction = weather.friction_scale

    def set_display_state(self, signals: Mapping[str, str], appearances: Mapping[str, Appearance]) -> None:
        """Set the states of traffic signals by id, and the appearances of actors that differ from the default."""
        self._signals = signals
        if appearances is not self._appearances:
            self._appearances = appearances
            self._hidden = hidden_actors(appearances)
            self._view = None

    @property
    def signal_labels(self) -> Mapping[int, str]:
        """Labels of the heads of traffic signals in segmentation images, with the ids of the signals."""
        heads = signal_heads(self._roads) if self._roads is not None else ()
        return {FIRST_SIGNAL_LABEL - row: head.signal.id for row, head in enumerate(heads)}

    def add_building(
        self, name: str, center: Vector3, size: Vector3, yaw: float = 0.0, color: Vector3 | None = None
    ) -> None:
        """Add a building, a box around `center` [m] of length, width, height [m] that blocks vehicles and rays."""
        self._scenery.add_buildings([Building(name, center, size, yaw, color)])
        self._changed()

    def step(self, placements: Mapping[str, Placement], controls: Mapping[str, Control]) -> None:
        """Simulate one tick. A scripted actor without placement stands, and a driven one without control coasts.

        A placement of a driven actor is a teleport. Raise SimulationError if a name is not present.
        """
        present = self._bodies.keys()
        if not (placements.keys() <= present and controls.keys() <= present):
            self._body(min({*placements, *controls} - present))
        self._contacts.find_added(self._bodies)
        bodies = self._actors.bodies
        bodies.place(placements)
        for name, driven in self._driven.items():
            if name in placements:
                driven.teleport(placements[name])
        if not self._couplings.is_complete:
            self._update_attributes()
            self._couplings.update(self._bodies)
        touches = self._physics.tick(bodies, self._driven, controls, self._friction)
        self.tick += 1
        self._view = None
        self._contacts.step(bodies, touches, partial(self._physics.is_near_object, bodies))

    def view(self) -> WorldView:
        """Return the current view, the same object until a change."""
        self._contacts.find_added(self._bodies)
        if self._view is None:
            self._view = self._view_now(self._contacts.viewed())
        return self._view

    def poses(self) -> WorldView:
        """Return the current view without its contacts, of which actors at one place have one for each pair."""
        return self._view or self._view_now(())

    def distance(self, first: str, second: str) -> float:
        """Return the distance between the boxes of two actors [m], 0 in contact. Raise SimulationError."""
        self._update_attributes()
        return box_distance(self._body(first).box, self._body(second).box)

    def raycast(
        self, origins: ArrayLike, targets: ArrayLike, ignore: Iterable[str] = (), *, sensor: str = ""
    ) -> RayHits:
        """Return the first hits of rays (M, 3) to (M, 3) except on actors in `ignore` and actors hidden from a sensor.

        `sensor` is its name. Without a sensor, the visibility for sensors in general is used.
        """
        self._refresh()
        passed = [*map(self.view().row, ignore), *self.view().hidden_rows(sensor)]
        return cast_rays(self._client, origins, targets, self._actors.row_of_handle, passed)

    def surfaces(self) -> Surfaces:
        """Return the surfaces of the ground and of all static objects."""
        return self._scenery.surfaces

    def first_hit(self, origins: Sequence[Sequence[float]], targets: Sequence[Sequence[float]]) -> list[int]:
        """Return the rows of the first hits of rays as `raycast` does, but faster for up to a thousand rays."""
        self._refresh()
        if self._hidden[0]:
            return list(self.raycast(origins, targets).rows.tolist())
        return first_hits(self._client, origins, targets, self._actors.row_in_list)

    def is_free(self, own: int, origin: Vector3, target: int) -> bool:
        """Return True if certainly nothing is between a point of an actor and the box of another, by their rows."""
        return self._free_space.is_free(self.view(), own, origin, target)

    def crossings(self, begins: Array, ends: Array, most: int) -> Crossings:
        """Return the first `most` actors, and the scenery, that lines from points (M, 3) to points (M, 3) cross."""
        self._refresh()
        return find_crossings(self._client, self._scenery, self.view(), begins, ends, most)

    def radiance(self, pose: Array, pinhole: Pinhole, *, ignore: Iterable[str] = ()) -> Radiance:
        """Return the light that a camera at this pose (4, 4) receives now, with depth and labels."""
        return self.image(pose, pinhole, ignore=ignore).draw()

    def image(self, pose: Array, pinhole: Pinhole, *, ignore: Iterable[str] = ()) -> UndrawnImage:
        """Return the same image before it is drawn. It shows the current time, also if it is drawn later.

        pose (4, 4) camera to world, x right, y down, z forward; actors in `ignore` are not drawn. Raise SimulationError
        if the world has no picture maker.
        """
        if self._picture_maker is None:
            raise SimulationError("the world makes no images: it was built without a picture maker")
        if self._pictures is None:
            self._pictures = self._picture_maker(self._scenery)
        self._update_attributes()
        actors = [(body.spec, body.state) for body in self._bodies.values()]
        state = VisibleState(self.time, self._weather, actors, self._signals, self._appearances)
        return self._pictures.image(state, np.array(pose, dtype=float), pinhole, frozenset(ignore))

    def _view_now(self, contacts: tuple[Contact, ...]) -> WorldView:
        """Return the view of the current poses and motion."""
        actors = self._actors
        states, table = actors.bodies.states()
        return WorldView.of_states(self.time, self.tick, actors.columns, states, table, contacts, self._hidden)

    def _body(self, name: str) -> Body:
        body = self._bodies.get(name)
        if body is None:
            raise SimulationError(f"actor {name!r} is not in the world; {suggestion(name, self._bodies)}")
        return body

    def _enter(self, spec: ActorSpec, placement: Placement, driven: bool) -> None:
        if driven:
            self._scenery.raise_obstacles()
            ground = GroundUnder(None if self._scenery.level else self._roads)
            body = DrivenBody(self._client, spec, placement, self.dt, self._physics.step, ground)
            self._driven[spec.name] = body
            self._bodies[spec.name] = body
        else:
            self._bodies[spec.name] = ScriptedBody(self._client, spec, placement, self.dt)
        self._changed()

    def _changed(self) -> None:
        """Reset caches after a change of actors or scenery."""
        self._view = None
        self._couplings.note_change()
        self._physics.changed()
        self._physics.scenery_changed()
        self._free_space.scenery_changed()
        self._update_attributes()
        self._table = None

    def _update_attributes(self) -> None:
        """Update the attributes of bodies that move together, before those of single bodies are used."""
        if self._table is not None:
            self._table.bodies.current()

    @property
    def _actors(self) -> ActorTable:
        if self._table is None:
            self._table = ActorTable(self._bodies, self._scenery.highest_handle, self.dt)
        return self._table

    def _refresh(self) -> None:
        """Create the bodies for rays, and move those of actors to their current poses."""
        if self._scenery.raise_ground() | self._scenery.raise_obstacles():
            self._changed()
        self._physics.refresh(self._actors.bodies)
