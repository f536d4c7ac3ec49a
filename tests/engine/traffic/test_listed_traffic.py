"""Background traffic at listed positions, and the share of drivers that ignore traffic lights."""

from __future__ import annotations

import pytest

from eidrive_scenario.api.run import RunSettings, Simulation
from eidrive_scenario.errors import InputError

AREA = """<GlobalAction><TrafficAction trafficName="{name}">
<TrafficAreaAction continuous="false" numberOfEntities="1">
<TrafficDistribution><TrafficDistributionEntry weight="1"><EntityDistribution><EntityDistributionEntry weight="1">
<ScenarioObjectTemplate><CatalogReference catalogName="vehicles" entryName="seat_leon"/>
<ObjectController><Controller name="Driver"><Properties><Property name="module" value="eidrive.traffic"/>
<Property name="ignore_lights" value="{share}"/></Properties></Controller></ObjectController></ScenarioObjectTemplate>
</EntityDistributionEntry></EntityDistribution></TrafficDistributionEntry></TrafficDistribution>
<TrafficArea><RoadRange><RoadCursor roadId="{road}" s="{start}"><Lane id="{lane}"/></RoadCursor>
<RoadCursor roadId="{road}" s="{end}"><Lane id="{lane}"/></RoadCursor></RoadRange></TrafficArea>
</TrafficAreaAction></TrafficAction></GlobalAction>"""
RED = "".join(f'<TrafficSignalState trafficSignalId="{signal}" state="on;off;off"/>' for signal in (10, 20, 30, 40))
APPROACHES = [("1", -1, 60.0), ("1", -2, 60.0), ("2", 1, 46.0), ("2", 2, 46.0), ("3", 1, 46.0), ("3", 2, 46.0)]
"""Road, lane and s of places 46 m before the junction [m]."""


def scenario(places: list[tuple[str, int, float]], share: float = 0.0, duration: float = 30.0) -> bytes:
    areas = "".join(
        AREA.format(name=f"Car{n}", share=share, road=road, lane=lane, start=s, end=s + 1.0)
        for n, (road, lane, s) in enumerate(places)
    )
    return f"""<OpenSCENARIO><FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" author="" description=""/>
<CatalogLocations><VehicleCatalog><Directory path="eidrive_library/catalogs"/></VehicleCatalog></CatalogLocations>
<RoadNetwork><LogicFile filepath="eidrive_library/roads/four_way_signals.xodr"/><TrafficSignals>
<TrafficSignalController name="Lights"><Phase name="red" duration="600">{RED}</Phase></TrafficSignalController>
</TrafficSignals></RoadNetwork><Entities/><Storyboard><Init><Actions>{areas}</Actions></Init>
<StopTrigger><ConditionGroup><Condition name="End" delay="0" conditionEdge="none"><ByValueCondition>
<SimulationTimeCondition rule="greaterOrEqual" value="{duration}"/></ByValueCondition></Condition></ConditionGroup>
</StopTrigger></Storyboard></OpenSCENARIO>""".encode()


def play(source: bytes, seed: int) -> tuple[dict[str, tuple[float, float]], set[str]]:
    """Return the position of each car in the first frame, and the names of the cars that entered the junction."""
    first: dict[str, tuple[float, float]] = {}
    entered: set[str] = set()
    with Simulation(source, seed=seed, settings=RunSettings()) as simulation:
        end = None
        while end is None:
            frame, end = simulation.tick()
            for name, (x, y) in zip(frame.view.names, frame.view.position[:, :2].tolist(), strict=True):
                first.setdefault(name, (x, y))
                if 28.0 < x < 56.0 and -12.0 < y < 15.5:
                    entered.add(name)
    return first, entered


def test_each_car_starts_at_its_place() -> None:
    """Lane centers of road 1 are at y = 3.5, 0 and road 1 begins at x = -80; the second place is 35 m ahead."""
    first, _ = play(scenario([("1", -1, 42.0), ("1", -1, 77.0), ("1", -2, 44.5)], duration=0.2), seed=3)
    assert list(first) == ["Car0.0001", "Car1.0001", "Car2.0001"]
    for (x, y), (s, lane_center) in zip(first.values(), ((42.0, 0.0), (77.0, 0.0), (44.5, -3.5)), strict=True):
        assert s - 80.0 <= x <= s + 1.0 - 80.0 + 13.9 * 0.05  # one step at 50 km/h
        assert y == pytest.approx(lane_center, abs=1e-6)


@pytest.mark.exhaustive
@pytest.mark.parametrize(("share", "low", "high"), [(0.0, 0, 0), (0.3, 8, 28), (1.0, 60, 60)])
def test_share_of_drivers_ignores_red_lights(share: float, low: int, high: int) -> None:
    """Limits for 0.3 are three standard deviations of a binomial distribution of 60 drivers."""
    entered = 0
    for seed in range(1, 11):
        first, ignoring = play(scenario(APPROACHES, share), seed)
        assert len(first) == len(APPROACHES)
        entered += len(ignoring)
    assert low <= entered <= high


@pytest.mark.parametrize("share", ["-0.1", "1.1", "often"])
def test_invalid_share_is_an_error_with_its_line(share: str) -> None:
    source = scenario(APPROACHES[:1]).replace(
        b'"ignore_lights" value="0.0"', f'"ignore_lights" value="{share}"'.encode()
    )
    with pytest.raises(InputError, match=r"^.*:\d+: .*ignore_lights"), Simulation(source) as simulation:
        simulation.tick()
