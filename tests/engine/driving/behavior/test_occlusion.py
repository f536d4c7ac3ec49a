"""Caution of the planner: where unseen traffic may be, the speed before it, and the effect of cooperation."""

from __future__ import annotations

import math
from functools import cache

import msgspec
import numpy as np
import pytest
from sample_car import CAR

from eidrive_scenario.api.run import RunResult, RunSettings, run_file
from eidrive_scenario.base.coverage import PerceptionRegion, ViewSector
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.planning.behavior.conflict_ways import ConflictWay
from eidrive_scenario.driving.planning.behavior.maneuvers import Situation
from eidrive_scenario.driving.planning.behavior.occlusion import CREEP, HiddenTraffic, Occluders, PossibleTraffic
from eidrive_scenario.driving.planning.behavior.prediction import Predictor
from eidrive_scenario.driving.planning.behavior.proposals import Body
from eidrive_scenario.driving.planning.behavior.reference import ReferenceLine
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.path import PlannedPath
from eidrive_scenario.extensions.library import from_library

NOTHING = Occluders.of_boxes(np.empty((0, 7)))
EVERYWHERE = ViewSector(0.0, 0.0, 1.5, 0.0, math.pi, 200.0)


def lane(length: float = 40.0, *, speed: float = 10.0, start: float = 20.0) -> ConflictWay:
    """Return a lane that comes from the left and meets the line at x = start + 1."""
    distance = np.arange(0.0, length, 2.0)
    points = np.column_stack([np.full(len(distance), start + 1.0), 2.0 + distance])
    return ConflictWay(
        "left", "lane", start, start + 2.0, points, distance, speed, 4.0, has_light=False, hold=start, look=start
    )


def hidden_traffic(**settings: float) -> HiddenTraffic:
    return HiddenTraffic(BehaviorSettings.model_validate(settings), NOTHING, Body.of(CAR), (), 200.0)


@pytest.mark.parametrize(
    ("braking", "distance", "speed"), [(3.0, 8.6, 5.84), (6.0, 8.6, 7.59), (3.0, 20.0, 9.56), (3.0, 0.0, CREEP)]
)
def test_safe_speed_has_the_closed_form(braking: float, distance: float, speed: float) -> None:
    """v t + v² / 2b is the distance, with t = 0.5 s."""
    found = float(hidden_traffic(comfortable_deceleration=braking).safe_speed(np.array([distance]))[0])
    assert found == pytest.approx(speed, abs=0.005)
    if distance:
        assert found * 0.5 + found**2 / (2.0 * braking) == pytest.approx(distance)


class TestOccluders:
    BOX = Occluders.of_boxes(np.array([[10.0, 0.0, 1.0, 2.0, 2.0, 2.0, 0.0]]))

    def blocked(self, eye: ViewSector, *places: tuple[float, float]) -> list[bool]:
        return [bool(hidden) for hidden in self.BOX.block(eye, np.array(places), 0.0)]

    def test_place_behind_a_box_is_hidden(self) -> None:
        # The shadow of the edges at x = 9, y = ±1 is bounded by y = x / 9.
        eye = ViewSector(0.0, 0.0, 1.0, 0.0, math.pi, 100.0)
        assert self.blocked(eye, (18.0, 1.9), (18.0, 2.1), (18.0, -1.9), (5.0, 0.0), (-18.0, 0.0)) == [
            True,
            False,
            True,
            False,
            False,
        ]

    def test_place_inside_a_box_is_occupied_and_not_hidden(self) -> None:
        assert self.blocked(ViewSector(0.0, 0.0, 1.0, 0.0, math.pi, 100.0), (10.0, 0.0), (10.9, 0.5)) == [False, False]

    def test_shadow_of_a_high_sensor_ends_behind_the_box(self) -> None:
        # From 5 m down to 1 m at R, the line is at 2 m above the far edge (x = 11) if 5 - 4 · 11 / R = 2: R = 14.67.
        mast = ViewSector(0.0, 0.0, 5.0, 0.0, math.pi, 100.0)
        assert self.blocked(mast, (14.0, 0.0), (15.3, 0.0), (30.0, 0.0)) == [True, False, False]

    def test_turned_box_hides_by_its_turned_outline(self) -> None:
        turned = Occluders.of_boxes(np.array([[10.0, 0.0, 1.0, 8.0, 0.2, 2.0, math.pi / 2]]))
        eye = ViewSector(0.0, 0.0, 1.0, 0.0, math.pi, 100.0)
        assert turned.block(eye, np.array([(20.0, 7.0), (20.0, 9.0)]), 0.0).tolist() == [True, False]

    def test_ground_height_moves_the_target_but_not_the_box(self) -> None:
        # On a bridge at 10 m the target is at 11 m, and the box with its top at 2 m is far below the line of sight.
        eye = ViewSector(0.0, 0.0, 11.0, 0.0, math.pi, 100.0)
        assert self.BOX.block(eye, np.array([(18.0, 0.0)]), 10.0).tolist() == [False]


class TestPossibleTraffic:
    def test_traffic_enters_a_seen_lane_at_its_end(self) -> None:
        way, traffic = lane(40.0, speed=10.0), PossibleTraffic()
        shown, hidden = np.ones(20, dtype=bool), np.zeros(20, dtype=bool)
        assert traffic.first(way, shown, 0.0) == math.inf
        for now, expected in ((1.0, 30.0), (2.0, 20.0), (3.0, 10.0), (4.0, 0.0), (9.0, 0.0)):
            # The end is 40 m away; places are 2 m apart.
            assert traffic.first(way, hidden, now) == pytest.approx(expected, abs=2.0), now

    def test_result_does_not_depend_on_the_number_of_steps(self) -> None:
        way, hidden = lane(40.0, speed=10.0), np.zeros(20, dtype=bool)
        for steps in (1, 7, 40):
            traffic = PossibleTraffic()
            traffic.first(way, ~hidden, 0.0)
            for step in range(steps):
                found = traffic.first(way, hidden, 2.0 * (step + 1) / steps)
            assert found == pytest.approx(20.0, abs=2.0), steps

    def test_gap_that_holds_no_vehicle_is_no_traffic(self) -> None:
        way, shown = lane(40.0), np.ones(20, dtype=bool)
        shown[5] = False
        assert PossibleTraffic().first(way, shown, 0.0) == math.inf
        shown[6] = False
        assert PossibleTraffic().first(way, shown, 0.0) == 10.0

    def test_unseen_lane_may_be_occupied_at_the_zone(self) -> None:
        assert PossibleTraffic().first(lane(), np.zeros(20, dtype=bool), 0.0) == 0.0

    def test_lane_of_another_length_keeps_what_was_seen(self) -> None:
        traffic = PossibleTraffic()
        traffic.first(lane(40.0), np.ones(20, dtype=bool), 0.0)
        assert traffic.first(lane(44.0), np.zeros(22, dtype=bool), 0.0) == 40.0

    @pytest.mark.parametrize(("moved", "expected"), [(4.0, 16.0), (-4.0, 0.0)])
    def test_what_was_seen_stays_where_it_was_if_the_zone_moves(self, moved: float, expected: float) -> None:
        """The first 20 m were free. A zone 4 m upstream has 16 m of them, one 4 m downstream begins with 4 m unseen."""
        traffic, way = PossibleTraffic(), lane(40.0)
        traffic.first(way, way.distance < 20.0, 0.0)
        other = way._replace(points=way.points + np.array([0.0, moved]))
        assert traffic.first(other, np.zeros(20, dtype=bool), 0.0) == expected


def limit_at(distance: float, regions: list[PerceptionRegion], way: ConflictWay, **settings: float) -> float:
    """Return the speed limit `distance` before the place at which the vehicle would wait; inf without one."""
    along = np.arange(0.0, 60.0, 1.0)
    found = hidden_traffic(**settings).limits(
        [way], along, (0.0, 8.0, 8.0), (0.0, 0.0, 0.0), regions, Detections(0.0), 0.0
    )
    stop = way.hold - CAR.offset[0] - CAR.size[0] / 2.0 - 1.5
    return math.inf if found is None else float(np.interp(stop - distance, along, found[0]))


def test_lane_in_no_region_is_approached_so_that_the_vehicle_can_stop() -> None:
    # -1 + √(1 + 2 · 2 · 10) m/s 10 m before the place at which it would wait
    assert limit_at(10.0, [], lane()) == pytest.approx(-1.0 + math.sqrt(41.0), abs=0.05)
    assert limit_at(10.0, [PerceptionRegion("Ego", 0.0, (EVERYWHERE,))], lane()) == math.inf


def test_view_of_a_sender_counts_less_with_its_age() -> None:
    # The vehicle needs 2.9 s to leave the zone; 40 m of view are 4 s of traffic at 10 m/s, minus the age.
    ages = [limit_at(10.0, [PerceptionRegion("RSU", -age, (EVERYWHERE,))], lane(40.0)) for age in (0.0, 0.5)]
    assert ages == [math.inf, math.inf], "traffic beyond the end of the lane is not assumed"
    near = ViewSector(21.0, 0.0, 5.0, 0.0, math.pi, 38.0)
    regions = [[PerceptionRegion("RSU", -age, (near,))] for age in (0.0, 1.0)]
    fresh, old = (limit_at(10.0, region, lane(100.0)) for region in regions)
    assert fresh == math.inf
    assert old < 8.0


def test_vehicle_whose_sensor_is_at_the_zone_drives_on() -> None:
    along, place = np.arange(0.0, 60.0, 1.0), (0.0, 0.0, 0.0)
    at_zone = 20.0 - CAR.offset[0] + 0.1
    traffic = hidden_traffic()
    assert traffic.limits([lane()], along, (at_zone, 1.0, 8.0), place, [], Detections(0.0), 0.0) is None
    assert traffic.limits([lane()], along, (at_zone - 0.2, 1.0, 8.0), place, [], Detections(0.0), 0.0) is not None


def test_way_that_the_line_meets_twice_counts_where_it_is_next() -> None:
    along, motion, place = np.arange(0.0, 90.0, 1.0), (0.0, 8.0, 8.0), (0.0, 0.0, 0.0)
    near = lane()
    later = near._replace(start=60.0, end=62.0, hold=60.0, look=60.0, points=near.points + np.array([40.0, 0.0]))
    limits, traffic = [], hidden_traffic()
    for ways in ([near], [near, later]):
        found = traffic.limits(ways, along, motion, place, [], Detections(0.0), 0.0)
        assert found is not None
        limits.append(found[0])
    np.testing.assert_array_equal(limits[0], limits[1])


def test_house_hides_the_far_end_of_a_lane() -> None:
    """From the zone 95 m ahead the lane leads on for 150 m; the house is 215 m ahead, at its first 120 m."""
    house = Occluders.of_boxes(np.array([[216.0, 0.0, 5.0, 2.0, 10.0, 10.0, 0.0]]))
    distance = np.arange(0.0, 150.0, 2.0)
    points = np.column_stack([96.0 + distance, np.zeros(len(distance))])
    way = lane(speed=30.0, start=95.0)._replace(points=points, distance=distance)
    region = PerceptionRegion("Ego", 0.0, (msgspec.structs.replace(EVERYWHERE, range=400.0),))
    for fixed, is_hidden in ((NOTHING, False), (house, True)):
        traffic = HiddenTraffic(BehaviorSettings(), fixed, Body.of(CAR), (), 400.0)
        found = traffic.limits(
            [way], np.arange(0.0, 110.0), (0.0, 8.0, 8.0), (0.0, 0.0, 0.0), [region], Detections(0.0), 0.0
        )
        assert (found is not None) is is_hidden


def test_reason_is_what_limits_the_speed() -> None:
    """A curve with 3 m/s is 50 m ahead, a hidden lane with 5 m/s until it is in sight 30 m ahead."""
    line = ReferenceLine(PlannedPath(np.array([[0.0, 0.0], [100.0, 0.0]]), ends=False), None)
    curve = np.sqrt(3.0**2 + 2.0 * 2.0 * np.maximum(50.0 - line.along, 0.0))
    caution = np.where(line.along < 30.0, np.sqrt(5.0**2 + 2.0 * 2.0 * (30.0 - np.minimum(line.along, 30.0))), math.inf)
    situation = Situation(
        settings=BehaviorSettings(),
        body=Body.of(CAR),
        line=line,
        limits=np.minimum(curve, caution),
        curve_limits=curve,
        s=0.0,
        d=0.0,
        steered=(0.0, 0.0, 0.0),
        speed=8.0,
        wanted=15.0,
        objects=[],
        prediction=Predictor(None, np.arange(0.0, 8.01, 0.25)).predict([]),
        window=(0, len(line.along)),
        stop=None,
        now=0.0,
        hidden="lane",
    )
    # At 20 m the curve allows √(9 + 4 · 30) = 11.4 m/s, the lane √(25 + 4 · 10) = 8.1 m/s.
    assert [situation.is_lowered_at(s) for s in (0.0, 20.0, 31.0, 60.0)] == [True, True, False, False]
    assert not msgspec.structs.replace(situation, limits=curve).is_lowered_at(20.0)


@cache
def drive(name: str, **parameters: str) -> RunResult:
    return run_file(from_library(name), settings=RunSettings(planner="behavior", parameters=parameters))


def duration(result: RunResult) -> float:
    return result.simulated_s


class TestInClosedLoop:
    CAR = "ncap/crossing_car"

    @pytest.mark.exhaustive
    def test_caution_avoids_the_collision_that_no_sensor_announces(self) -> None:
        blind = drive(self.CAR, Participants="none")
        careful = drive(self.CAR, Participants="none", Caution="true")
        assert not blind.passed
        assert blind.metrics["collision.impact_speed"] > 5.0
        assert careful.passed

    @pytest.mark.statistical
    def test_cooperation_shows_as_less_caution(self) -> None:
        alone = drive(self.CAR, Participants="none", Caution="true")
        together = drive(self.CAR, Participants="both", Caution="true")
        without = drive(self.CAR, Participants="both")
        assert alone.passed
        assert together.passed
        assert duration(together) < duration(alone) - 1.5
        assert duration(together) == pytest.approx(duration(without), abs=0.5)

    def test_old_messages_do_not_reduce_caution(self) -> None:
        fresh = drive(self.CAR, Participants="both", Caution="true")
        old = drive(self.CAR, Participants="both", Caution="true", Latency="0.9")
        assert duration(old) > duration(fresh) + 0.5

    @pytest.mark.exhaustive
    @pytest.mark.parametrize(("name", "participant"), [("coop/scenario_1", "rsu"), ("coop/scenario_2", "vehicle")])
    def test_caution_passes_the_scenarios_of_the_paper_with_and_without_messages(
        self, name: str, participant: str
    ) -> None:
        assert not drive(name, Participants="none").passed
        assert drive(name, Participants="none", Caution="true").passed
        assert drive(name, Participants=participant, Caution="true").passed
