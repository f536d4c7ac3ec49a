"""Traffic of SUMO beside the world: its road users become actors, and all other actors obstacles in SUMO."""

from __future__ import annotations

import math
import weakref
from collections.abc import Iterator, Mapping
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol

from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.errors import SimulationError
from eidrive_scenario.openscenario.model.entity_enumerations import Role
from eidrive_scenario.roads import LaneLocation, Pose, RoadNetwork
from eidrive_scenario.roads.model.signal_states import GREEN, OFF, ON, RED, YELLOW, lamps
from eidrive_scenario.traffic.spawning.bodies import library_bodies
from eidrive_scenario.traffic.spawning.population import Changes
from eidrive_scenario.traffic.sumo.files import SumoFiles
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.view import WorldView

NAME, MIRRORED = "sumo", "eidrive"
"""Prefixes of the names of its road users in the world, and of all other actors in SUMO."""
LANE_CHANGE = 3.0
"""Duration of a lane change [s]; by default SUMO changes lanes in one step."""
LARGEST = 1000.0
"""Maximum plausible length, width and height of a road user [m]; the longest trains have this length."""
BODIES = {
    "pedestrian": "pedestrian",
    "wheelchair": "pedestrian",
    "bicycle": "bicycle",
    "scooter": "bicycle",
    "moped": "motorbike",
    "motorcycle": "motorbike",
    "bus": "bus",
    "coach": "bus",
    "tram": "bus",
    "delivery": "van",
    "emergency": "van",
    "truck": "truck",
    "trailer": "truck",
}
"""Category of the body of a class of SUMO; all other classes have that of a car."""
_PEDESTRIAN = ActorSpec("", "pedestrian", "pedestrian", (0.5, 0.5, 1.7), (0.0, 0.0, 0.85))
_STATES = {"r": RED, "s": RED, "u": f"{RED} {YELLOW}", "y": YELLOW, "g": GREEN, "G": GREEN, "o": f"flashing {YELLOW}"}
"""State of a signal by the letter of SUMO, the most restrictive first; off for all others."""
_LEAST_RESTRICTIVE_FIRST = "".join(reversed(_STATES))


class SignalStates(Protocol):
    """States of the signals of the scenario by id."""

    states: Mapping[str, str]

    def set_state(self, name: str, state: str) -> None:
        """Set the state of a signal."""


class TrafficLight:
    """Traffic light of SUMO and its signals: those of its links by the parameters that `netconvert` writes."""

    def __init__(self, lights: Any, name: str, signals: SignalStates) -> None:
        self._lights, self._name, self._signals = lights, name, signals
        links = range(len(lights.getRedYellowGreenState(name)))
        phases = [phase.state for program in lights.getAllProgramLogics(name) for phase in program.phases]
        self._green = ["g" if any(state[link : link + 1] == "g" for state in phases) else "G" for link in links]
        """Letter for green of each link: g yields to others."""
        named = (lights.getParameter(name, f"linkSignalID:{link}") for link in links)
        self._links = {link: signal for link, signal in enumerate(named) if signal}
        self._published: dict[str, str] = {}
        self._is_led = False

    def exchange(self) -> None:
        """Take over the states of the signals if the scenario has set one of them, otherwise set them.

        A signal of several links has the state of the most restrictive one.
        """
        states = self._signals.states
        own = {signal: states[signal] for signal in self._links.values() if signal in states}
        if own != self._published:
            self._is_led = True
        shown = self._lights.getRedYellowGreenState(self._name)
        if self._is_led:
            wanted = list(shown)
            for link, signal in self._links.items():
                if signal in own:
                    wanted[link] = _letter(own[signal], self._green[link])
            if "".join(wanted) != shown:
                self._lights.setRedYellowGreenState(self._name, "".join(wanted))
            return
        by_restriction = sorted(self._links, key=lambda link: _LEAST_RESTRICTIVE_FIRST.find(shown[link]))
        published = {self._links[link]: _STATES.get(shown[link], OFF) for link in by_restriction}
        for signal, state in published.items():
            if self._published.get(signal) != state:
                self._signals.set_state(signal, state)
        self._published = published


def _letter(state: str, green: str) -> str:
    """Return the letter of SUMO for the state of a signal."""
    shown = dict(lamps(state))
    if shown.get(RED, OFF) != OFF:
        return "u" if shown.get(YELLOW, OFF) == ON else "r"
    if shown.get(GREEN, OFF) != OFF:
        return green
    if shown.get(YELLOW, OFF) != OFF:
        return "y" if shown[YELLOW] == ON else "o"
    return "O" if green == "G" else "o"


def _end(libsumo: Any, folder: TemporaryDirectory[str]) -> None:
    libsumo.close()
    folder.cleanup()


class SumoTraffic:
    """Simulation of SUMO that runs with the world; only one can run in a process.

    Its time 0 is that of its creation. A traffic light of which the scenario has set a signal follows the scenario;
    the signals of all others follow the programs of SUMO.

    step   time step of the run [s]
    taken  names of entities of the scenario
    """

    def __init__(
        self,
        files: SumoFiles,
        roads: RoadNetwork,
        signals: SignalStates,
        *,
        step: float,
        seed: int,
        taken: frozenset[str],
    ) -> None:
        with redirect_stdout(StringIO()):  # of a notice about the version of pyarrow, whose functions are not used
            import libsumo

        self._sumo: Any = libsumo
        self._errors = libsumo.libsumo.TraCIException, libsumo.libsumo.FatalTraCIError
        self._roads = roads
        self._offset = files.offset
        self._taken = taken
        self._specs: dict[str, ActorSpec] = {}
        self._locations: dict[str, LaneLocation | None] = {}
        self._mirrored: set[str] = set()
        """Names of the mirrored actors in SUMO."""
        if libsumo.simulation.isLoaded():
            raise SimulationError("SUMO runs in this process already; run the scenarios in separate processes")
        folder = TemporaryDirectory(prefix="eidrive-sumo-")  # of copies, as SUMO reads routes during the run
        names = ["network.net.xml", *(f"{number}.rou.xml" for number in range(len(files.routes)))]
        for name, content in zip(names, (files.network, *files.routes), strict=True):
            (Path(folder.name) / name).write_bytes(content)
        network, *routes = (str(Path(folder.name) / name) for name in names)
        options = {
            "--net-file": network,
            "--route-files": ",".join(routes),
            "--step-length": f"{step:.3f}",
            "--seed": str(seed % 2**31),
            "--lanechange.duration": f"{LANE_CHANGE:g}",
            "--collision.action": "warn",
            "--time-to-teleport": "-1",
            "--xml-validation": "never",
            "--xml-validation.net": "never",
            "--xml-validation.routes": "never",
            "--no-step-log": "true",
            "--no-warnings": "true",
        }
        self.close = weakref.finalize(self, _end, libsumo, folder)
        """End the simulation; also done when the object is dropped."""
        try:
            libsumo.start(["sumo", *(part for option in options.items() for part in option)])
            edges = [edge for edge in libsumo.edge.getIDList() if not edge.startswith(":")]
            libsumo.route.add(MIRRORED, edges[:1])
        except self._errors as error:
            self.close()
            raise SimulationError(f"SUMO: {error}") from error
        self._lights = [TrafficLight(libsumo.trafficlight, name, signals) for name in libsumo.trafficlight.getIDList()]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its road users in the world."""
        return tuple(self._specs)

    def step(self, view: WorldView, dt: float) -> Changes:
        """Move the other actors to their poses in SUMO, simulate one step, and return the changes of the world."""
        changes = Changes()
        if dt == 0.0:
            return changes
        try:
            self._advance(view, changes)
        except self._errors as error:
            raise SimulationError(f"SUMO: {error}") from error
        return changes

    def _advance(self, view: WorldView, changes: Changes) -> None:
        for light in self._lights:
            light.exchange()
        self._mirror(view)
        self._sumo.simulationStep()
        present = set()
        for users, user in self._users():
            name = f"{NAME}.{user}"
            present.add(name)
            if name in self._specs:
                changes.placements[name] = self._placement(users, user, name)
                continue
            if name in self._taken:
                raise SimulationError(f"SUMO: an entity of the scenario has the name {name!r} of a road user of SUMO")
            spec = self._specs[name] = self._spec(users, user, name)
            changes.additions[name] = (spec, self._placement(users, user, name))
        for name in [name for name in self._specs if name not in present]:
            del self._specs[name]
            self._locations.pop(name, None)
            changes.removals.add(name)

    def _mirror(self, view: WorldView) -> None:
        """Move the mirrored actors to their poses: SUMO moves the front of a vehicle, clockwise from north [deg]."""
        vehicles = self._sumo.vehicle
        present = set()
        for name, (x, y, _, length, width, height, yaw) in zip(view.names, view.boxes.tolist(), strict=True):
            if name in self._specs:
                continue
            vehicle = f"{MIRRORED}.{name}"
            present.add(vehicle)
            if vehicle not in self._mirrored:
                types = self._sumo.vehicletype
                if vehicle not in types.getIDList():  # SUMO keeps that of an actor that has left
                    types.copy("DEFAULT_VEHTYPE", vehicle)
                for key, value in (("Length", length), ("Width", width), ("Height", height)):
                    getattr(types, f"set{key}")(vehicle, max(value, 0.1))
                types.setVehicleClass(vehicle, "ignoring")  # on every lane
                types.setSpeedDeviation(vehicle, 0.0)  # without a draw from the generator of the pedestrians
                vehicles.add(vehicle, MIRRORED, vehicle)
                vehicles.setSpeedMode(vehicle, 0)
                vehicles.setLaneChangeMode(vehicle, 0)
                self._mirrored.add(vehicle)
            front_x, front_y = x + 0.5 * length * math.cos(yaw), y + 0.5 * length * math.sin(yaw)
            east, north = front_x + self._offset[0], front_y + self._offset[1]
            vehicles.moveToXY(vehicle, "", -1, east, north, 90.0 - math.degrees(yaw), 2)
        for vehicle in sorted(self._mirrored - present):
            self._mirrored.remove(vehicle)
            vehicles.remove(vehicle)

    def _users(self) -> Iterator[tuple[Any, str]]:
        """Yield the road users of SUMO, each with the interface of its kind."""
        vehicles, persons = self._sumo.vehicle, self._sumo.person
        yield from ((vehicles, name) for name in vehicles.getIDList() if name not in self._mirrored)
        yield from ((persons, name) for name in persons.getIDList() if not persons.getVehicle(name))

    def _spec(self, users: Any, user: str, name: str) -> ActorSpec:
        """Return the body of a road user: that of the library by its class, in its size."""
        kind = users.getVehicleClass(user)
        category = BODIES.get(kind, "car")
        role = Role.AMBULANCE if kind == "emergency" else Role.NONE
        bodies = () if category == "pedestrian" else library_bodies(category)
        body = next((body for body, own in bodies if own is role), _PEDESTRIAN)
        size = (users.getLength(user), users.getWidth(user), users.getHeight(user))
        if not all(0.0 < measure <= LARGEST for measure in size):
            raise SimulationError(f"SUMO: {user!r} has a size of {size} m (expected up to {LARGEST:g} m)")
        scale = size[0] / body.size[0]
        offset = (body.offset[0] * scale, 0.0, 0.5 * size[2])
        return replace(body, name=name, size=size, offset=offset, wheelbase=body.wheelbase * scale)

    def _placement(self, users: Any, user: str, name: str) -> Placement:
        """Return the placement of a road user, on the surface of the roads."""
        east, north, height = users.getPosition3D(user)
        yaw = wrap_angle(0.5 * math.pi - math.radians(users.getAngle(user)))
        spec, speed = self._specs[name], users.getSpeed(user)
        back = spec.offset[0] + 0.5 * spec.size[0]
        x, y = east - self._offset[0] - back * math.cos(yaw), north - self._offset[1] - back * math.sin(yaw)
        if self._roads.is_flat:
            return Placement(x, y, 0.0, yaw, speed=speed)
        location = self._locations[name] = self._roads.locate_at(x, y, self._locations.get(name), height)
        if location is None:
            return Placement(x, y, height, yaw, speed=speed)
        laid = self._roads.laid(Pose(x, y, height, yaw, 0.0, 0.0), location)
        return Placement(*laid, speed)
