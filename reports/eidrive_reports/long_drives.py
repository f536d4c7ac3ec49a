"""Long drives of the planner `behavior` through background traffic: stops, contacts and completed routes.

python -m eidrive_reports.long_drives MAP.xodr… --vehicles 30 --minutes 10 --seeds 1

For each map and seed a scenario is written to `--out`/long_drives and run: a random route, background traffic on the
whole map, and traffic lights if the map has controllers for them. The output is the table long_drives.md, with all
stops of at least 20 s.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

import networkx as nx
from rich.console import Console

from eidrive_reports.driven_runs import CONTACT, Stop, observed_run
from eidrive_reports.paper import EGO
from eidrive_reports.studies import check_different, command, markdown_table, publish, study_options
from eidrive_scenario.api.common import (
    Diagnostic,
    LaneKey,
    LaneLocation,
    RoadNetwork,
    SettingError,
    generator,
    write_atomically,
)
from eidrive_scenario.api.experiments import Job, run_jobs
from eidrive_scenario.api.run import RunSettings

GREEN, YELLOW, ALL_RED = 10.0, 3.0, 2.0
"""Durations of the phases of a traffic light [s]."""
DEFAULT_SPEED = 50.0 / 3.6
"""Speed on roads without a stated limit [m/s]."""
FASTEST = 130.0 / 3.6
"""Maximum speed for the estimate of the time [m/s]."""
SHARE = 0.7
"""Mean speed between lights over the speed limit, for the estimate of the time."""
WAIT = 20.0
"""Mean delay at a junction with traffic lights, for the estimate of the time [s]."""
TURN = 8.0
"""Mean delay at a junction without traffic lights, for the estimate of the time [s]."""
LONG_SECTION = 100.0
"""Minimum length of a lane with two waypoints [m]."""
SHORTEST = 10.0
"""Minimum length of a lane with a waypoint [m]."""
START_LENGTH = 40.0
"""Minimum length of the lane of the start [m]."""
ARRIVAL = 10.0
"""Distance to the end of the route at which the run ends [m]."""
LAMPS = {"red": "on;off;off", "yellow": "off;on;off", "green": "off;off;on"}
"""State of a traffic light by its color."""
MIX = (("seat_leon", 4), ("tesla_model3", 4), ("van", 2), ("truck", 1), ("motorbike", 1))
"""Catalog entries of the background traffic with their weights."""

TEMPLATE = """<?xml version="1.0" encoding="UTF-8"?>
<!--
{vehicles} vehicles of background traffic on {name}; random route of the ego of about {seconds:.0f} s (seed {seed}).
-->
<OpenSCENARIO>
   <FileHeader revMajor="1" revMinor="3" date="2026-11-21T00:00:00" author="eidrive-scenario" description="{name}"/>
   <ParameterDeclarations>
      <ParameterDeclaration name="Planner" parameterType="string" value="behavior"/>
      <ParameterDeclaration name="Traffic" parameterType="unsignedInt" value="{vehicles}"/>
   </ParameterDeclarations>
   <CatalogLocations>
      <VehicleCatalog><Directory path="eidrive_library/catalogs"/></VehicleCatalog>
   </CatalogLocations>
   <RoadNetwork>
      <LogicFile filepath={map}/>{signals}
   </RoadNetwork>
   <Entities>
      <ScenarioObject name="{ego}">
         <CatalogReference catalogName="vehicles" entryName="lincoln_mkz"/>
         <ObjectController>
            <Controller name="EgoStack">
               <Properties>
                  <Property name="module" value="eidrive"/>
                  <Property name="detector" value="oracle"/>
                  <Property name="mount" value="roof"/>
                  <Property name="range" value="120"/>
                  <Property name="planner" value="$Planner"/>
                  <Property name="obey_signals" value="true"/>
                  <Property name="follow_speed_limit" value="true"/>
               </Properties>
            </Controller>
         </ObjectController>
      </ScenarioObject>
   </Entities>
   <Storyboard>
      <Init>
         <Actions>
            <GlobalAction>
               <TrafficAction trafficName="Traffic">
                  <TrafficAreaAction numberOfEntities="$Traffic" continuous="true">
                     <TrafficDistribution>
                        <TrafficDistributionEntry weight="1">
                           <EntityDistribution>
{mix}
                           </EntityDistribution>
                        </TrafficDistributionEntry>
                     </TrafficDistribution>
                     <TrafficArea>
                        <Polygon>
{corners}
                        </Polygon>
                     </TrafficArea>
                  </TrafficAreaAction>
               </TrafficAction>
            </GlobalAction>
            <UserDefinedAction>
               <CustomCommandAction type="eidrive.criterion">{criteria}</CustomCommandAction>
            </UserDefinedAction>
            <Private entityRef="{ego}">
               <PrivateAction><TeleportAction><Position>{start}</Position></TeleportAction></PrivateAction>
               <PrivateAction><RoutingAction><AssignRouteAction><Route name="RandomRoute" closed="false">
{waypoints}
               </Route></AssignRouteAction></RoutingAction></PrivateAction>
            </Private>
         </Actions>
      </Init>
      <StopTrigger>
         <ConditionGroup>
            <Condition name="Covered" delay="0" conditionEdge="none"><ByEntityCondition>
               <TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="{ego}"/></TriggeringEntities>
               <EntityCondition><TraveledDistanceCondition value="{covered:.1f}"/></EntityCondition>
            </ByEntityCondition></Condition>
            <Condition name="Arrived" delay="0" conditionEdge="none"><ByEntityCondition>
               <TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="{ego}"/></TriggeringEntities>
               <EntityCondition>
                  <DistanceCondition value="{arrival:g}" freespace="false" rule="lessThan" coordinateSystem="entity"
                     relativeDistanceType="euclidianDistance"><Position>{end}</Position></DistanceCondition>
               </EntityCondition>
            </ByEntityCondition></Condition>
         </ConditionGroup>
         <ConditionGroup>
            <Condition name="End" delay="0" conditionEdge="none">
               <ByValueCondition><SimulationTimeCondition rule="greaterOrEqual" value="{limit:g}"/></ByValueCondition>
            </Condition>
         </ConditionGroup>
      </StopTrigger>
   </Storyboard>
</OpenSCENARIO>
"""


def write_town_drive(
    roads: RoadNetwork, path: Path, *, road_map: Path, vehicles: int = 30, seed: int = 1, minutes: float = 10.0
) -> None:
    """Write a scenario in which the ego drives about `minutes` on a random route. Raise SettingError if none exists.

    The run ends at the end of the route, or after twice the time.
    """
    seconds = 60.0 * minutes
    way = draw_way(roads, seed, seconds)
    locations = waypoints(roads, way)
    length = roads.route(locations[0], locations[-1], locations[1:-1]).length
    criteria = (
        f"[{{collision: {{of: {EGO}, only_at_fault: true}}}}, {{route_completion: {{of: {EGO}, at_least: 0.95}}}}, "
        f"{{running_red_light: {{of: {EGO}}}}}, {{actor_blocked: {{of: {EGO}, at_most: 60}}}}]"
    )
    x0, y0, x1, y1 = roads.bounds()
    corners = ((x0 - 10, y0 - 10), (x1 + 10, y0 - 10), (x1 + 10, y1 + 10), (x0 - 10, y1 + 10))
    text = TEMPLATE.format(
        ego=EGO,
        vehicles=vehicles,
        name=re.sub(r"[^A-Za-z0-9_.]+", "_", road_map.stem),
        map=quoteattr(str(road_map.resolve())),
        seconds=seconds,
        seed=seed,
        signals=_signals(roads),
        criteria=criteria,
        mix="\n".join(_mix_entry(entry, weight) for entry, weight in MIX),
        corners="\n".join(f'{" " * 27}<Position><WorldPosition x="{x:g}" y="{y:g}"/></Position>' for x, y in corners),
        start=_position(locations[0]),
        end=_position(locations[-1]),
        waypoints="\n".join(
            f'{" " * 18}<Waypoint routeStrategy="shortest"><Position>{_position(location)}</Position></Waypoint>'
            for location in locations
        ),
        covered=max(length - 5.0 * ARRIVAL, 0.5 * length),
        arrival=ARRIVAL,
        limit=120.0 * minutes,
    )
    with write_atomically(path) as stream:
        stream.write(text.encode())


def draw_way(roads: RoadNetwork, seed: int, seconds: float) -> list[LaneKey]:
    """Return lanes of a random way that takes about this time in traffic, at least [s].

    It starts and ends on lanes outside of junctions, and changes lanes only where its lane has no successor. Lanes from
    which it could not return, such as dead ends, are left out. Raise SettingError if no lane is left.
    """
    graph = roads.graph
    drivable = graph.subgraph([key for key in graph if graph.nodes[key]["drivable"]])
    lanes = max(nx.strongly_connected_components(drivable), key=lambda group: (len(group), min(group)), default=set())
    starts = [key for key in sorted(lanes) if _is_open(roads, key) and graph.nodes[key]["length"] >= START_LENGTH]
    closed = any(edge["kind"] == "successor" for _, _, edge in graph.subgraph(lanes).edges(data=True))
    if not (closed and starts):
        message = "the map has no closed way over its lanes"
        raise SettingError(Diagnostic(message, "use a map on which a vehicle can drive without end"))
    rng = generator(seed, "town drive")
    way = [starts[int(rng.integers(len(starts)))]]
    time = 0.0
    while time < seconds or len(way) < 2 or not _is_open(roads, way[-1]):
        edges = [(key, edge["kind"]) for key, edge in sorted(graph[way[-1]].items()) if key in lanes]
        onward = [key for key, kind in edges if kind == "successor"]
        choices = onward or [key for key, kind in edges if key not in way[-2:]] or [key for key, _ in edges]
        way.append(choices[int(rng.integers(len(choices)))])
        if onward:
            section = roads.roads[way[-1].road].sections[way[-1].section]
            limit = roads.speed_limit(way[-1].road, section.s + 0.5 * section.length, way[-1].lane)
            time += graph.nodes[way[-1]]["length"] / (SHARE * min(limit or DEFAULT_SPEED, FASTEST))
            junction = roads.junctions.get(roads.roads[way[-1].road].junction_id or "")
            entered = junction is not None and roads.roads[way[-2].road].junction_id != junction.id
            if junction is not None and entered:
                time += WAIT if junction.controllers else TURN
    return way


def _is_open(roads: RoadNetwork, key: LaneKey) -> bool:
    """Whether a lane is outside of junctions and long enough for a waypoint."""
    return roads.roads[key.road].junction_id is None and roads.graph.nodes[key]["length"] >= SHORTEST


def waypoints(roads: RoadNetwork, way: Sequence[LaneKey]) -> list[LaneLocation]:
    """Return locations on each lane of a way that is outside of junctions and not left by a lane change.

    A long lane has two, so that a route can lead around a ring of one lane.
    """
    locations = []
    for number, key in enumerate(way):
        following = way[number + 1] if number + 1 < len(way) else key
        if _is_open(roads, key) and (following == key or following[:2] != key[:2]):
            section = roads.roads[key.road].sections[key.section]
            shares = (1.0 / 3.0, 2.0 / 3.0) if section.length >= LONG_SECTION else (0.5,)
            forward = roads.driving_direction(key.road, key.lane) > 0
            along = [section.length * (share if forward else 1.0 - share) for share in shares]
            locations += [roads.location(key.road, key.lane, section.s + s) for s in along]
    return locations


def _position(location: LaneLocation) -> str:
    return f'<LanePosition roadId={quoteattr(location.road)} laneId="{location.lane}" s="{location.s:.3f}"/>'


def _mix_entry(entry: str, weight: int) -> str:
    reference = f'<CatalogReference catalogName="vehicles" entryName="{entry}"/>'
    template = f"<ScenarioObjectTemplate>{reference}</ScenarioObjectTemplate>"
    return f'{" " * 30}<EntityDistributionEntry weight="{weight}">{template}</EntityDistributionEntry>'


def _signals(roads: RoadNetwork) -> str:
    """Return a signal controller per junction: the groups of its signals have green one after the other."""
    controllers = []
    for junction in roads.junctions.values():
        groups = [
            dict.fromkeys(signal for signal in roads.controllers[number].signals if roads.signals[signal].dynamic)
            for number in junction.controllers
            if number in roads.controllers
        ]
        if any(groups):
            controllers.append(_controller(f"Junction{junction.id}", [list(group) for group in groups if group]))
    return f"\n      <TrafficSignals>\n{''.join(controllers)}      </TrafficSignals>" if controllers else ""


def _controller(name: str, groups: Sequence[Sequence[str]]) -> str:
    phases = []
    for number in range(len(groups)):
        for color, duration in (("green", GREEN), ("yellow", YELLOW), ("red", ALL_RED)):
            states = "".join(
                f"<TrafficSignalState trafficSignalId={quoteattr(signal)} state={quoteattr(state)}/>"
                for other, group in enumerate(groups)
                for state in (LAMPS[color if other == number else "red"],)
                for signal in group
            )
            phases.append(f'{" " * 12}<Phase name="{color}{number}" duration="{duration:g}">{states}</Phase>\n')
    inside = "".join(phases)
    return f"{' ' * 9}<TrafficSignalController name={quoteattr(name)}>\n{inside}{' ' * 9}</TrafficSignalController>\n"


LONGEST = 600.0
"""Maximum duration of a drive [min]."""
LONG_STOP = 20.0
"""Minimum duration of a stop that the table lists [s]."""


@dataclass(frozen=True)
class LongDrive:
    """Outcome of a drive: simulated time [s], distance [m], contacts, completed share of the route, stops, and the
    number of hard brakings."""

    scenario: str
    seed: int
    duration: float
    distance: float
    collided: bool
    at_fault: bool
    completed: float
    red_lights: int
    stops: tuple[Stop, ...]
    hard_brakings: int

    @property
    def mean_speed(self) -> float:
        """Mean speed, with the stops [m/s]."""
        return self.distance / max(self.duration, 1.0)


def run_of(job: Job) -> LongDrive:
    """Run a job and return its outcome."""
    result, motion = observed_run(job.scenario, EGO, seed=job.seed, settings=job.settings)
    return LongDrive(
        Path(job.scenario).stem,
        job.seed,
        duration=result.simulated_s,
        distance=motion.distance,
        collided=motion.collided,
        at_fault=motion.at_fault,
        completed=result.metrics.get(f"route_completion.{EGO}", 0.0),
        red_lights=int(result.metrics.get("running_red_light.count", 0.0)),
        stops=tuple(motion.stops),
        hard_brakings=motion.hard_brakings,
    )


def table(drives: Sequence[LongDrive], free: Sequence[LongDrive]) -> str:
    """Return the drives as a Markdown table, and a list of their long stops with the reason of the plan.

    free  the same drives without background traffic
    """
    columns = (
        "drive",
        "simulated time [s]",
        "distance [m]",
        "mean speed [m/s]",
        "without traffic [m/s]",
        "hard brakings",
        "collisions",
        "by own fault",
        "red lights passed",
        "stops",
        "longest stop [s]",
        "completed route",
    )
    lines = []
    for drive, alone in zip(drives, free, strict=True):
        longest = max((stop.duration for stop in drive.stops), default=0.0)
        cells = (
            drive.scenario,
            f"{drive.duration:.0f}",
            f"{drive.distance:.0f}",
            f"{drive.mean_speed:.1f}",
            f"{alone.mean_speed:.1f}",
            drive.hard_brakings,
            int(drive.collided),
            int(drive.at_fault),
            drive.red_lights,
            len(drive.stops),
            f"{longest:.0f}",
            f"{100.0 * drive.completed:.1f} %",
        )
        lines.append(cells)
    listed = [
        f"- {drive.scenario}, {stop.time:.0f} s at ({stop.x:.0f}, {stop.y:.0f}) m: {stop.duration:.0f} s, {stop.reason}"
        for drive in drives
        for stop in drive.stops
        if stop.duration >= LONG_STOP
    ]
    text = markdown_table(columns, lines)
    return "\n".join([text, f"Stops of at least {LONG_STOP:g} s:", "", *listed, ""]) if listed else text


def minutes(text: str) -> float:
    """Return a duration of a drive from a text [min]. Raise ValueError if it is not positive, or too long."""
    value = float(text)
    if not 0.0 < value <= LONGEST:
        raise ValueError(text)
    return value


def _jobs(options: argparse.Namespace, folder: Path) -> list[Job]:
    """Write the scenario of each map and seed, and return its runs with and without background traffic."""
    jobs = []
    for road_map in options.maps:
        roads = RoadNetwork.load(road_map)
        for seed in range(1, options.seeds + 1):
            path = folder / f"{road_map.stem}_{seed}.xosc"
            size = {"vehicles": options.vehicles, "minutes": options.minutes}
            write_town_drive(roads, path, road_map=road_map, seed=seed, **size)
            for traffic in (options.vehicles, 0):
                settings = RunSettings(
                    parameters={"Planner": options.planner, "Traffic": str(traffic)},
                    criteria={"collision": {"of": EGO, "name": CONTACT}},
                    time_limit=max(180.0 * options.minutes, 60.0),
                )
                jobs.append(Job(str(path), f"{traffic} vehicles", seed, settings))
    return jobs


@command
def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("maps", type=Path, nargs="+", help="OpenDRIVE files with closed ways")
    parser.add_argument("--vehicles", type=int, default=30, help="number of vehicles of background traffic")
    parser.add_argument("--minutes", type=minutes, default=10.0, help="approximate duration of a drive")
    parser.add_argument("--planner", default="behavior")
    options = study_options(parser, arguments, seeds=1)
    check_different(parser, [road_map.stem for road_map in options.maps])
    jobs = _jobs(options, options.out / "long_drives")
    drives = run_jobs(jobs, run_of, workers=options.workers, console=Console(stderr=True), title="long drives")
    publish(table(drives[::2], drives[1::2]), options.out / "long_drives.md")


if __name__ == "__main__":
    sys.exit(main())
