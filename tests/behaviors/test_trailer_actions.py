"""Connection and disconnection of trailers: the hitch is 1 m behind the truck's axle, the drawbar 3 m long."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from storyboard_xml import by_entity_xml, global_xml, lane_position_xml, private_xml, speed_xml, teleport_xml
from street_scene import NOTHING, after, street
from whole_run import RecordedRun, Run

from eidrive_scenario.errors import InputError

BODY = """<BoundingBox><Center x="{middle}" y="0" z="1"/><Dimensions width="2" length="4" height="2"/></BoundingBox>
  <Performance maxSpeed="30" maxAcceleration="5" maxDeceleration="8"/>
  <Axles><FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.8" positionX="3" positionZ="0.3"/>
  <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.8" positionX="0" positionZ="0.3"/></Axles>"""
TRAIN = f"""<ScenarioObject name="Truck"><Vehicle name="truck" vehicleCategory="truck">{BODY.format(middle=1.5)}
    <TrailerHitch dx="-1"/></Vehicle></ScenarioObject>
  <ScenarioObject name="Trailer"><Vehicle name="trailer" vehicleCategory="trailer">{BODY.format(middle=0)}
    <TrailerCoupler dx="3"/></Vehicle></ScenarioObject>"""
PLACE = """<EntityAction entityRef="{}"><AddEntityAction><Position>
  <LanePosition roadId="1" laneId="-1" s="{}"/></Position></AddEntityAction></EntityAction>"""
COUPLE = private_xml('<TrailerAction><ConnectTrailerAction trailerRef="Trailer"/></TrailerAction>')
UNCOUPLE = private_xml("<TrailerAction><DisconnectTrailerAction/></TrailerAction>")
DRIVE = speed_xml(10)
ASIDE = private_xml("""<LateralAction><LaneChangeAction>
  <LaneChangeActionDynamics dynamicsShape="cubic" dynamicsDimension="time" value="3"/>
  <LaneChangeTarget><AbsoluteTargetLane value="-2"/></LaneChangeTarget></LaneChangeAction></LateralAction>""")


def couple(name: str) -> str:
    """Return the connection of a trailer."""
    return COUPLE.replace('Trailer"', f'{name}"')


def play(run: Run, end: float, *steps: tuple[str, ...], train: str = TRAIN) -> RecordedRun:
    placed = global_xml(PLACE.format("Truck", 200)) + global_xml(PLACE.format("Trailer", 196))
    return run(end, *steps, driven=False, ego=(1, 900.0, 0.0), more=train, globally=placed)


@pytest.mark.element("ConnectTrailerAction", "DisconnectTrailerAction")
def test_trailer_follows_from_connection_to_disconnection(run: Run) -> None:
    """The trailer's axle is 1 m + 3 m behind the truck's; at 10 m/s from 1 s, disconnected just after 3 s."""
    played = play(
        run, 4, ("Truck", COUPLE, after(0.5)), ("Truck", DRIVE, after(0.975)), ("Truck", UNCOUPLE, after(3.0))
    )
    truck, trailer = played.x("Truck"), played.x("Trailer")
    assert trailer[:21] == pytest.approx([196.0] * 21)
    assert [front - back for front, back in zip(truck, trailer, strict=True)][:61] == pytest.approx([4.0] * 61)
    assert truck[60] == pytest.approx(220.0)
    assert truck[-1] == pytest.approx(230.0)
    assert trailer[-1] == trailer[62] < 217.0
    assert played.of("Trailer", "speed")[-1] == 0.0


@pytest.mark.element("ConnectTrailerAction")
def test_connected_trailer_may_overlap_its_vehicle(run: Run) -> None:
    """With the coupler 1.2 m ahead of its center the trailer begins 0.3 m before the end of the truck."""
    overlapping = TRAIN.replace('TrailerCoupler dx="3"', 'TrailerCoupler dx="1.2"')
    played = play(run, 4, ("Truck", COUPLE), ("Truck", DRIVE), ("Truck", UNCOUPLE, after(3.0)), train=overlapping)
    assert played.x("Truck")[40] - played.x("Trailer")[40] == pytest.approx(2.2)
    assert not [contact for frame in played.frames for contact in frame.view.contacts]


@pytest.mark.element("ConnectTrailerAction")
def test_driven_vehicle_does_not_perceive_its_trailer(run: Run) -> None:
    """The trailer is connected at 0.5 s; until then it is an object. The car of the scene is out of range."""
    stack = """<ObjectController><Controller name="Stack"><Properties><Property name="module" value="eidrive"/>
      <Property name="range" value="50"/></Properties></Controller></ObjectController>"""
    driven = TRAIN.replace("</Vehicle></ScenarioObject>", f"</Vehicle>{stack}</ScenarioObject>", 1)
    played = play(run, 2, ("Truck", COUPLE, after(0.5)), train=driven)
    counts = [len(frame.steps["Truck"].detections) for frame in played.frames if "Truck" in frame.steps]
    assert counts[:9] == [1] * 9
    assert counts[13:] == [0] * len(counts[13:]) != []


@pytest.mark.element("ConnectTrailerAction")
def test_trailer_of_driven_vehicle_keeps_its_distance(run: Run) -> None:
    """The physics moves the truck by up to 0.4 m in a step; a change of its acceleration moves it by millimeters."""
    stack = """<ObjectController><Controller name="Stack"><Properties><Property name="module" value="eidrive"/>
      <Property name="planner" value="route"/><Property name="target_speed" value="8"/></Properties></Controller>
      </ObjectController>"""
    driven = TRAIN.replace("</Vehicle></ScenarioObject>", f"</Vehicle>{stack}</ScenarioObject>", 1)
    played = play(run, 6, ("Truck", COUPLE), train=driven)
    assert max(played.of("Truck", "speed")) > 6.0
    apart = [front - back for front, back in zip(played.x("Truck"), played.x("Trailer"), strict=True)]
    assert apart == pytest.approx([4.0] * len(apart), abs=0.01)


def test_unconnected_trailer_does_not_move(run: Run) -> None:
    played = play(run, 2, ("Truck", DRIVE))
    assert played.x("Trailer") == [196.0] * len(played.frames)


@pytest.mark.element("ConnectTrailerAction")
def test_trailer_coupler_coincides_with_the_hitch(run: Run) -> None:
    """Hitch and coupler coincide also in a lane change, and the trailer cuts the corner."""
    played = play(run, 5, ("Truck", COUPLE), ("Truck", DRIVE), ("Truck", ASIDE, after(0.5)))
    bent = 0.0
    for frame in played.frames[2:]:
        front, back = (frame.view.row(name) for name in ("Truck", "Trailer"))
        (x, y), yaw = frame.view.position[front, :2], frame.view.yaw[front]
        (u, v), turn = frame.view.position[back, :2], frame.view.yaw[back]
        assert x - math.cos(yaw) == pytest.approx(u + 3.0 * math.cos(turn), abs=1e-6)
        assert y - math.sin(yaw) == pytest.approx(v + 3.0 * math.sin(turn), abs=1e-6)
        bent = max(bent, abs(yaw - turn))
    assert bent > 0.05
    assert played.frames[-1].view.position[played.frames[-1].view.row("Trailer"), 1] == pytest.approx(-6.0, abs=0.05)


def link(name: str, trailer: str = "") -> str:
    """Return a vehicle with hitch and coupler."""
    drawn = f'<Trailer><TrailerRef entityRef="{trailer}"/></Trailer>' if trailer else ""
    return f"""<ScenarioObject name="{name}"><Vehicle name="{name}" vehicleCategory="trailer">{BODY.format(middle=1.5)}
      <TrailerHitch dx="-1"/><TrailerCoupler dx="3"/>{drawn}</Vehicle></ScenarioObject>"""


def test_trailer_of_itself_is_rejected(run: Run) -> None:
    """Front tows A, A tows B, and B tows A."""
    train = link("Front", "A") + link("A", "B") + link("B", "A")
    with pytest.raises(InputError) as caught:
        run(1, driven=False, more=train, globally=global_xml(PLACE.format("Front", 200)))
    messages = [diagnostic.message for diagnostic in caught.value.diagnostics]
    assert messages == ["entity 'A' is its own trailer", "entity 'B' is its own trailer"]


def test_trailer_of_two_vehicles_follows_the_first(run: Run) -> None:
    """This also holds after it tows the second one itself."""
    train = link("First", "A") + link("Second", "A") + link("A")
    placed = global_xml(PLACE.format("First", 200)) + global_xml(PLACE.format("Second", 192))
    played = run(1, ("A", couple("Second"), after(0.5)), driven=False, ego=(1, 900.0, 0.0), more=train, globally=placed)
    assert played.x("A") == pytest.approx([196.0] * len(played.frames))
    assert played.x("Second") == pytest.approx([192.0] * len(played.frames))


@pytest.mark.element("ConnectTrailerAction")
@pytest.mark.parametrize(
    ("elevation", "height"),
    [
        ('<elevation s="0" a="0" b="0.1" c="0" d="0"/>', lambda x: 0.1 * x),
        ('<elevation s="0" a="0" b="0" c="0" d="0"/><elevation s="210" a="0" b="0" c="0.004" d="0"/>',
         lambda x: 0.004 * max(x - 210.0, 0.0) ** 2),
    ],
)  # fmt: skip
def test_trailers_on_a_slope_stand_on_the_road(run: Run, elevation: str, height: Callable[[float], float]) -> None:
    placed = "".join(global_xml(PLACE.format(*place)) for place in (("Truck", 200), ("Trailer", 196), ("Last", 193)))
    played = run(
        5, ("Truck", COUPLE), ("Trailer", couple("Last")), ("Truck", DRIVE), driven=False, ego=(1, 900.0, 0.0),
        more=TRAIN + link("Last"), globally=placed,
        street=street(profiles=f"<elevationProfile>{elevation}</elevationProfile>"),
    )  # fmt: skip
    for frame in played.frames[1:]:
        for name in ("Truck", "Trailer", "Last"):
            row = frame.view.row(name)
            x, _, z = frame.view.position[row].tolist()
            assert z == pytest.approx(height(x), abs=1e-6)
            climb = (height(x + 1e-4) - height(x - 1e-4)) / 2e-4
            assert frame.view.pitch[row] == pytest.approx(-math.atan(climb), abs=1e-4)
    assert played.x("Trailer")[-1] > 240.0


DELETE = """<GlobalAction><EntityAction entityRef="{}"><DeleteEntityAction/></EntityAction></GlobalAction>"""


def test_deleted_trailer_leaves_its_vehicle(run: Run) -> None:
    played = play(run, 4, ("Truck", COUPLE), ("Truck", DRIVE), ("Truck", DELETE.format("Trailer"), after(2.0)))
    present = ["Trailer" in frame.view.names for frame in played.frames]
    assert present == [True] * 42 + [False] * (len(present) - 42)
    assert played.x("Truck")[-1] == pytest.approx(240.0, abs=0.6)


def test_trailer_of_a_deleted_vehicle_stops_at_its_position(run: Run) -> None:
    again = f"<GlobalAction>{PLACE.format('Truck', 400)}</GlobalAction>"
    steps = ("Truck", COUPLE), ("Truck", DRIVE), ("Ego", DELETE.format("Truck"), after(2.0)), ("Ego", again, after(3.0))
    played = play(run, 4, *steps)
    trailer = played.x("Trailer")
    assert trailer[-1] == trailer[43] == pytest.approx(216.0, abs=0.6)
    assert played.of("Trailer", "speed")[-1] == 0.0


@pytest.mark.element("DeleteEntityAction")
def test_deletion_of_an_absent_vehicle_keeps_its_trailer(run: Run) -> None:
    """The deletion has no effect, with a warning. The trailer enters the world with its vehicle, 4 m behind it."""
    declared = '<TrailerHitch dx="-1"/><Trailer><TrailerRef entityRef="Trailer"/></Trailer>'
    train = TRAIN.replace('<TrailerHitch dx="-1"/>', declared)
    add = global_xml(PLACE.format("Truck", 200))
    steps = ("Ego", DELETE.format("Truck"), after(0.2)), ("Ego", add, after(0.5))
    played = run(1, *steps, driven=False, more=train)
    view = played.frames[-1].view
    assert view.position[view.row("Trailer"), 0] == pytest.approx(196.0)
    assert any("no effect: entity 'Truck' is absent" in text for text in played.result.warnings)


@pytest.mark.element("ConnectTrailerAction", "DisconnectTrailerAction")
def test_frames_contain_couplings_of_their_time(run: Run) -> None:
    """The commands of a tick apply to the world of the next one."""
    played = play(run, 2, ("Truck", COUPLE, after(0.5)), ("Truck", UNCOUPLE, after(1.0)))
    times = [frame.view.time for frame in played.frames if frame.trailers]
    assert [times[0], times[-1]] == pytest.approx([0.6, 1.05])
    assert {tuple(frame.trailers.items()) for frame in played.frames} == {(), (("Truck", "Trailer"),)}


@pytest.mark.element("ConnectTrailerAction")
def test_replaced_trailer_stops_at_its_position(run: Run) -> None:
    """The connection just after 1 s applies to the step from 1.05 s on, in which the truck is at 210.5 m."""
    placed = "".join(global_xml(PLACE.format(*place)) for place in (("Truck", 200), ("Trailer", 196), ("Last", 206)))
    steps = ("Truck", COUPLE), ("Truck", DRIVE), ("Truck", couple("Last"), after(1.0))
    played = run(2, *steps, driven=False, ego=(1, 900.0, 0.0), more=TRAIN + link("Last"), globally=placed)
    assert played.x("Trailer")[22:] == pytest.approx([206.5] * 19)
    assert played.x("Last")[-1] == pytest.approx(played.x("Truck")[-1] - 4.0)


FAR = teleport_xml(lane_position_xml(-2, 400.0))


@pytest.mark.element("ConnectTrailerAction")
@pytest.mark.parametrize("moved", ["before the connection", "while it is connected"])
def test_distant_trailer_is_teleported_to_the_hitch(run: Run, moved: str) -> None:
    """From a place ahead it is aligned with its vehicle, and the distance of the teleport is not covered."""
    times = (0.2, 0.5) if moved == "before the connection" else (0.5, 0.2)
    covered = by_entity_xml('<TraveledDistanceCondition value="50"/>', "Trailer")
    played = play(
        run, 4, ("Truck", DRIVE), ("Trailer", FAR, after(times[0])), ("Truck", COUPLE, after(times[1])),
        ("Ego", NOTHING, covered),
    )  # fmt: skip
    assert played.x("Trailer")[20:] == pytest.approx([x - 4.0 for x in played.x("Truck")[20:]])
    assert played.of("Trailer", "yaw")[20:] == pytest.approx([0.0] * 61)
    assert played.begun("action 3") == []


@pytest.mark.element("ConnectTrailerAction", "DisconnectTrailerAction")
def test_actions_of_a_connected_trailer_have_no_effect(run: Run) -> None:
    """The first lane change is stopped by the connection, the second one does not start."""
    steps = ("Trailer", speed_xml(10)), ("Trailer", ASIDE), ("Truck", DRIVE), ("Truck", COUPLE, after(0.5))
    played = play(run, 4, *steps, ("Trailer", ASIDE, after(1.0)), ("Truck", UNCOUPLE, after(2.0)))
    rows = [frame.view.position[frame.view.row("Trailer")] for frame in played.frames]
    assert [float(y) for _, y, _ in rows[42:]] == pytest.approx([float(rows[42][1])] * 39)
    assert played.of("Trailer", "speed")[42:] == [0.0] * 39
    refused = "LaneChangeAction: not executed, as Trailer is a connected trailer, which its towing vehicle moves"
    assert sum(refused in text for text in played.result.warnings) == 1


@pytest.mark.element("ConnectTrailerAction")
def test_connection_of_the_own_train_has_no_effect(run: Run) -> None:
    played = run(
        1, ("A", DRIVE), ("A", couple("B")), ("B", couple("A"), after(0.5)), driven=False, ego=(1, 900.0, 0.0),
        more=link("A") + link("B"), globally=global_xml(PLACE.format("A", 200)),
    )  # fmt: skip
    assert played.frames[-1].trailers == {"A": "B"}
    assert any("ConnectTrailerAction: no effect: 'A' tows 'B'" in text for text in played.result.warnings)
    with pytest.raises(InputError, match="the reference entity is the actor itself"):
        run(1, ("A", couple("A")), driven=False, more=link("A"))


@pytest.mark.element("ConnectTrailerAction")
def test_connected_station_does_not_drive(run: Run) -> None:
    """Ego has no coupler: its reference point is at the hitch, 1 m behind that of the truck."""
    placed = global_xml(PLACE.format("Truck", 120))
    activate = private_xml(
        '<ControllerAction><ActivateControllerAction lateral="true" longitudinal="true"/></ControllerAction>'
    )
    steps = ("Truck", DRIVE), ("Truck", couple("Ego"), after(0.5)), ("Ego", activate, after(1.0))
    played = run(2, *steps, ego=(-1, 100.0, 8.0), more=TRAIN, globally=placed)
    assert played.x("Ego")[15:] == pytest.approx([x - 1.0 for x in played.x("Truck")[15:]])
    assert played.of("Ego", "speed")[15:] == [10.0] * 26


def test_speed_of_a_folded_trailer_refers_to_its_heading(run: Run) -> None:
    """A trailer that is pushed folds: at the end it points backwards, and moves forwards at the speed of its truck."""
    played = play(run, 12, ("Truck", COUPLE), ("Truck", speed_xml(-5)), ("Truck", ASIDE, after(0.5)))
    assert abs(played.of("Trailer", "yaw")[-1]) == pytest.approx(math.pi, abs=1e-3)
    assert played.of("Trailer", "speed")[-1] == pytest.approx(5.0, abs=1e-3)


OVERLAPPING = TRAIN.replace('TrailerCoupler dx="3"', 'TrailerCoupler dx="1.2"')
COLLISION = by_entity_xml('<CollisionCondition><ByType type="vehicle"/></CollisionCondition>', "Truck")
CLEAR = by_entity_xml(
    """<RelativeClearanceCondition oppositeLanes="false" distanceForward="5" distanceBackward="5" freeSpace="true">
    <RelativeLaneRange from="0" to="0"/></RelativeClearanceCondition>""",
    "Truck",
)


@pytest.mark.element("ConnectTrailerAction", "DisconnectTrailerAction")
def test_overlapping_trailer_is_no_collision_until_it_has_parted(run: Run) -> None:
    """The truck turns back at 204.1 m, and touches the trailer, which ends at 201.9 m, after 1.7 m or 0.85 s."""
    steps = ("Truck", COUPLE), ("Truck", speed_xml(2)), ("Truck", UNCOUPLE, after(1.0))
    played = play(run, 3, *steps, ("Truck", speed_xml(-2), after(2.0)), ("Ego", NOTHING, COLLISION), train=OVERLAPPING)
    assert played.begun("action 4") == pytest.approx([2.9])


def test_clearance_of_a_vehicle_excludes_its_trailer(run: Run) -> None:
    """Until the view after the connection the trailer, which begins 1.5 m behind the truck, is in the way."""
    played = play(run, 1, ("Truck", COUPLE, after(0.5)), ("Ego", NOTHING, CLEAR))
    assert played.begun("action 1") == pytest.approx([0.6])
