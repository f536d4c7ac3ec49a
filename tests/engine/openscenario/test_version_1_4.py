"""Version 1.4: its new elements, attributes and literals, checked against the names of its schema."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TypeVar

import pytest
from openscenario_xml import catalog_xml, object_xml, scenario_xml
from storyboard_xml import private_xml, story_xml

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.extensions.library import library_path
from eidrive_scenario.openscenario import Scenario, load_scenario, model
from eidrive_scenario.simulation import RunSettings, run_file
from eidrive_scenario.traffic import TrafficMix
from eidrive_scenario.world.specs import SHAPE_BY_CATEGORY, actor_spec

Kind = TypeVar("Kind")

ROAD = f'<LogicFile filepath="{library_path() / "roads" / "four_lane_road.xodr"}"/>'
PLACE = '<Position><LanePosition roadId="1" laneId="{lane}" s="{s}" layer="{layer}"/></Position>'
PREFERRED = '<RoutingAction><PreferredLaneLayerAction layer="{layer}"/></RoutingAction>'
LANE_CHANGE = """<LateralAction><LaneChangeAction>
<LaneChangeActionDynamics dynamicsShape="cubic" dynamicsDimension="time" value="2"/>
<LaneChangeTarget><AbsoluteTargetLane value="-2" layer="{layer}"/></LaneChangeTarget>
</LaneChangeAction></LateralAction>"""
TRAJECTORY = """<RoutingAction><FollowTrajectoryAction><TimeReference>{reference}</TimeReference>
<TrajectoryFollowingMode followingMode="position"/><TrajectoryRef><Trajectory name="t" closed="false"><Shape><Polyline>
<Vertex time="0"><Position><WorldPosition x="0" y="0"/></Position><Motion speed_longitudinal="2"/></Vertex>
<Vertex time="4"><Position><WorldPosition x="8" y="0"/></Position>
<Motion speed_longitudinal="2" acceleration_longitudinal="0"/></Vertex>
<Interpolation/></Polyline></Shape></Trajectory></TrajectoryRef></FollowTrajectoryAction></RoutingAction>"""
TIMING = '<Timing domainAbsoluteRelative="relative" scale="1" offset="0"/>'
CONTROLLER = """<TrafficSignals><TrafficSignalController name="C"><Phase name="first" duration="2" semantics="stop"/>
<Phase name="second" duration="2" semantics="attention_go"/></TrafficSignalController></TrafficSignals>"""
KIND = """<TrafficDistributionEntry weight="{weight}" name="{name}"><EntityDistribution>
<EntityDistributionEntry weight="1"><ScenarioObjectTemplate>{vehicle}</ScenarioObjectTemplate>
</EntityDistributionEntry></EntityDistribution>{declarations}</TrafficDistributionEntry>"""
SWARM = """<GlobalAction><TrafficAction><TrafficSwarmAction innerRadius="5" numberOfVehicles="3" offset="0"
semiMajorAxis="50" semiMinorAxis="50"><CentralObject entityRef="Ego"/>
<TrafficDistribution>{parts}</TrafficDistribution></TrafficSwarmAction></TrafficAction></GlobalAction>"""
REFERENCE = '<CatalogReferences catalogName="kinds" entryName="{name}">{assigned}</CatalogReferences>'
HEAVY = """<ParameterAssignments><ParameterAssignment parameterRef="share" value="3"/></ParameterAssignments>"""


def only(scenario: Scenario, kind: type[Kind]) -> Kind:
    return next(one for one in scenario.document.walk() if isinstance(one, kind))


def vehicle_xml(name: str, category: str) -> str:
    """Return a vehicle of a category."""
    inside = object_xml("x").partition(">")[2].rpartition("</ScenarioObject>")[0]
    return inside.replace('name="car"', f'name="{name}"').replace('"car"', f'"{category}"')


def load(**parts: str) -> Scenario:
    return load_scenario(scenario_xml(minor=4, **parts))


def rejected(minor: int, **parts: str) -> str:
    with pytest.raises(ScenarioError) as error:
        load_scenario(scenario_xml(minor=minor, **parts))
    return str(error.value)


@pytest.mark.parametrize(
    ("category", "role", "body"),
    [
        ("heavyTruck", "fireBrigade", "truck"),
        ("motorcycle", "police", "motorbike"),
        ("semitractor", "other", "truck"),
        ("standupScooter", "none", "bicycle"),
        ("workMachine", "construction", "truck"),
        ("aircraft", "other", "bus"),
    ],
)
def test_categories_and_roles_of_vehicles(category: str, role: str, body: str) -> None:
    entity = object_xml("Ego").replace('vehicleCategory="car"', f'vehicleCategory="{category}" role="{role}"')
    scenario = load(entities=entity)
    assert scenario.warnings == ()
    vehicle = only(scenario, model.Vehicle)
    assert (vehicle.vehicle_category.value, vehicle.role) == (category, model.Role(role))
    assert actor_spec("Ego", vehicle).category == body
    assert "since 1.4" in rejected(3, entities=entity)


def test_every_category_has_a_body() -> None:
    assert set(SHAPE_BY_CATEGORY) == {category.value for category in model.VehicleCategory}


def test_names_before_1_4_are_deprecated() -> None:
    entity = object_xml("Ego").replace('vehicleCategory="car"', 'vehicleCategory="truck" role="fire"')
    assert [one.message for one in load(entities=entity).warnings] == [
        "'truck' of VehicleCategory is deprecated since OpenSCENARIO 1.4",
        "'fire' of Role is deprecated since OpenSCENARIO 1.4",
    ]
    assert load_scenario(scenario_xml(minor=3, entities=entity)).warnings == ()


@pytest.mark.parametrize(
    "action",
    [f"<TeleportAction>{PLACE.format(lane=-1, s=5, layer='{layer}')}</TeleportAction>", PREFERRED, LANE_CHANGE],
    ids=["position", "preference", "lane change"],
)
def test_temporary_lanes_are_an_error(action: str) -> None:
    init = f'<Private entityRef="Ego">{private_xml(action)}</Private>'
    assert load(init=init.format(layer="permanent")).warnings == ()
    assert "refers to the temporary lane layer" in rejected(4, init=init.format(layer="temporary"))
    assert "since 1.4" in rejected(3, init=init.format(layer="permanent"))


@pytest.mark.element("PreferredLaneLayerAction")
def test_preference_for_permanent_lanes_completes_at_once(tmp_path: Path) -> None:
    place = private_xml(f"<TeleportAction>{PLACE.format(lane=-1, s=20, layer='permanent')}</TeleportAction>")
    story = story_xml(action=PREFERRED.format(layer="permanent"))
    path = tmp_path / "work_zone.xosc"
    path.write_bytes(scenario_xml(minor=4, road=ROAD, init=f'<Private entityRef="Ego">{place}</Private>', story=story))
    collision = {"collision": {"of": "Ego"}}
    result = run_file(path, settings=RunSettings(time_limit=3.0, criteria=collision))
    assert result.end_reason == "storyboard complete"
    assert result.warnings == ()


@pytest.mark.parametrize(("reference", "warnings"), [(TIMING, 0), ("<None/>", 1)], ids=["times", "no times"])
def test_motion_on_a_trajectory_without_times_is_a_warning(tmp_path: Path, reference: str, warnings: int) -> None:
    action = private_xml(TRAJECTORY.format(reference=reference))
    path = tmp_path / "run.xosc"
    path.write_bytes(scenario_xml(minor=4, init=f'<Private entityRef="Ego">{action}</Private>'))
    result = run_file(path, settings=RunSettings(time_limit=1.0))
    assert len([text for text in result.warnings if "Motion has no effect" in text]) == warnings


def test_semantics_of_phases() -> None:
    phases = only(load(road=CONTROLLER), model.TrafficSignalController).phase
    assert [phase.semantics for phase in phases] == [
        model.TrafficSignalSemantics.STOP,
        model.TrafficSignalSemantics.ATTENTION_GO,
    ]


def write_kinds(folder: Path) -> str:
    """Write a catalog of kinds of traffic, and return its location."""
    declared = '<ParameterDeclarations><ParameterDeclaration name="share" parameterType="double" value="0"/>'
    entries = KIND.format(weight=1, name="cars", vehicle=vehicle_xml("sedan", "car"), declarations="")
    entries += KIND.format(
        weight="$share",
        name="trucks",
        vehicle=vehicle_xml("lorry", "heavyTruck"),
        declarations=f"{declared}</ParameterDeclarations>",
    )
    (folder / "kinds.xosc").write_bytes(catalog_xml("kinds", entries, minor=4))
    place = f'<Directory path="{folder}"/>'
    return f"<TrafficDistributionEntryCatalog>{place}</TrafficDistributionEntryCatalog>"


def mix_of(scenario: Scenario) -> Counter[str]:
    mix = TrafficMix(scenario, None, only(scenario, model.TrafficDistribution))
    return Counter(mix.draw(generator(1, "mix", number)).spec.name for number in range(400))


def test_kinds_of_traffic_with_weight_0_are_not_in_its_categories() -> None:
    parts = "".join(
        KIND.format(weight=weight, name=name, vehicle=vehicle_xml(name, name), declarations="")
        for name, weight in (("car", 1), ("bus", 0))
    )
    scenario = load(init=SWARM.format(parts=parts))
    assert TrafficMix(scenario, None, only(scenario, model.TrafficDistribution)).categories == {"car"}


def test_kinds_of_traffic_of_a_catalog(tmp_path: Path) -> None:
    """Cars and trucks of a catalog with weights 1 and 3, the latter by an assignment, and vans with weight 4."""
    catalogs = write_kinds(tmp_path)
    vans = KIND.format(weight=4, name="vans", vehicle=vehicle_xml("delivery", "van"), declarations="")
    references = REFERENCE.format(name="cars", assigned="") + REFERENCE.format(name="trucks", assigned=HEAVY)
    for parts in (references + vans, vans + references):
        found = mix_of(load(catalogs=catalogs, init=SWARM.format(parts=parts)))
        assert set(found) == {"sedan", "lorry", "delivery"}
        # Four standard deviations of a binomial distribution are at most 40
        assert found["sedan"] == pytest.approx(50, abs=27)
        assert found["lorry"] == pytest.approx(150, abs=39)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ("", "TrafficDistribution lacks"),
        (REFERENCE.format(name="buses", assigned=""), "catalog 'kinds' has no entry 'buses'"),
        (
            REFERENCE.format(name="cars", assigned="").replace("CatalogReferences", "CatalogReference"),
            "unknown element",
        ),
    ],
    ids=["empty", "missing", "misspelled"],
)
def test_invalid_kinds_of_traffic(tmp_path: Path, parts: str, message: str) -> None:
    assert message in rejected(4, catalogs=write_kinds(tmp_path), init=SWARM.format(parts=parts))


def test_reference_to_an_entry_of_another_kind_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "kinds.xosc").write_bytes(catalog_xml("kinds", vehicle_xml("sedan", "car"), minor=4))
    place = f'<TrafficDistributionEntryCatalog><Directory path="{tmp_path}"/></TrafficDistributionEntryCatalog>'
    parts = REFERENCE.format(name="sedan", assigned="")
    message = rejected(4, catalogs=place, init=SWARM.format(parts=parts))
    assert "is a Vehicle" in message
    assert "expected TrafficDistributionEntry" in message
