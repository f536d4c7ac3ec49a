"""Scenario files of one vehicle that drives a long random route through background traffic, for any OpenDRIVE map."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

import networkx as nx

from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.files.atomic import write_atomically
from eidrive_scenario.randomness import generator
from eidrive_scenario.roads import LaneLocation, RoadNetwork
from eidrive_scenario.roads.model.location import LaneKey

EGO = "Ego"
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
LONG = 100.0
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
    places = waypoints(roads, way)
    length = roads.route(places[0], places[-1], places[1:-1]).length
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
        start=_position(places[0]),
        end=_position(places[-1]),
        waypoints="\n".join(
            f'{" " * 18}<Waypoint routeStrategy="shortest"><Position>{_position(place)}</Position></Waypoint>'
            for place in places
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
    """Return places on each lane of a way that is outside of junctions and not left by a lane change.

    A long lane has two, so that a route can lead around a ring of one lane.
    """
    found = []
    for number, key in enumerate(way):
        following = way[number + 1] if number + 1 < len(way) else key
        if _is_open(roads, key) and (following == key or following[:2] != key[:2]):
            section = roads.roads[key.road].sections[key.section]
            shares = (1.0 / 3.0, 2.0 / 3.0) if section.length >= LONG else (0.5,)
            forward = roads.driving_direction(key.road, key.lane) > 0
            along = [section.length * (share if forward else 1.0 - share) for share in shares]
            found += [roads.location(key.road, key.lane, section.s + s) for s in along]
    return found


def _position(place: LaneLocation) -> str:
    return f'<LanePosition roadId={quoteattr(place.road)} laneId="{place.lane}" s="{place.s:.3f}"/>'


def _mix_entry(entry: str, weight: int) -> str:
    reference = f'<CatalogReference catalogName="vehicles" entryName="{entry}"/>'
    template = f"<ScenarioObjectTemplate>{reference}</ScenarioObjectTemplate>"
    return f'{" " * 30}<EntityDistributionEntry weight="{weight}">{template}</EntityDistributionEntry>'


def _signals(roads: RoadNetwork) -> str:
    """Return a signal controller per junction: the groups of its signals have green one after the other."""
    found = []
    for junction in roads.junctions.values():
        groups = [
            [signal for signal in roads.controllers[number].signals if roads.signals[signal].dynamic]
            for number in junction.controllers
            if number in roads.controllers
        ]
        groups = [list(dict.fromkeys(group)) for group in groups if group]
        if groups:
            found.append(_controller(f"Junction{junction.id}", groups))
    return f"\n      <TrafficSignals>\n{''.join(found)}      </TrafficSignals>" if found else ""


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
