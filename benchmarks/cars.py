"""Cars of generated scenarios: their vehicle, and their start on a lane."""

from __future__ import annotations

VEHICLE = """<Vehicle name="car" vehicleCategory="car">
<BoundingBox><Center x="1.4" y="0" z="0.75"/><Dimensions width="1.8" length="4.5" height="1.5"/></BoundingBox>
<Performance maxSpeed="60" maxAcceleration="5" maxDeceleration="9"/>
<Axles><FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.6" positionX="2.8" positionZ="0.3"/>
<RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.6" positionX="0" positionZ="0.3"/></Axles>
<Properties/></Vehicle>"""
_START = """<Private entityRef="{name}"><PrivateAction><TeleportAction><Position>
<LanePosition roadId="{road}" laneId="{lane}" s="{s}"/></Position></TeleportAction></PrivateAction>
<PrivateAction><LongitudinalAction><SpeedAction>
<SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>
<SpeedActionTarget><AbsoluteTargetSpeed value="{speed}"/></SpeedActionTarget></SpeedAction></LongitudinalAction>
</PrivateAction>{controller}</Private>"""
_CONTROLLER = """<PrivateAction><ControllerAction><ActivateControllerAction lateral="{active}" longitudinal="{active}"/>
</ControllerAction></PrivateAction>"""


def start(name: str, road: str, lane: int, s: str, speed: str, *, active: str = "") -> str:
    """Return the initial actions of a car at a place of a lane [m] with a speed [m/s].

    active  `true` or `false`, whether its controller is active; empty for a car without a controller
    """
    controller = _CONTROLLER.format(active=active) if active else ""
    return _START.format(name=name, road=road, lane=lane, s=s, speed=speed, controller=controller)
