"""Settings of the planner `behavior`."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, PositiveFloat

from eidrive_scenario.driving.planner_settings import PlannerSettings

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Deceleration = Annotated[float, Field(gt=0.0, le=12.0)]


class BehaviorSettings(PlannerSettings):
    """Settings of the planner `behavior`.

    time_gap, standstill_gap, acceleration  [s], [m], [m/s²] parameters of the Intelligent Driver Model, by default
                            those that its author advises (Treiber, movsim/traffic-simulation-de)
    comfortable_deceleration  its comfortable deceleration [m/s²]
    passing_gap             additional gap behind what stands, from which the vehicle can pass it [m]
    hard_deceleration       maximum braking without an emergency; nuPlan's limit of comfort is 4.05 [m/s²]
    emergency_deceleration  braking in an emergency, at most that of the vehicle [m/s²]
    lateral_acceleration    maximum in curves and lane changes [m/s²]
    lateral_margin          minimum distance beside vehicles [m]
    pedestrian_margin       minimum distance beside pedestrians and cyclists [m]
    crossing_time           minimum time between the vehicle and crossing traffic at a place that both pass [s]
    horizon                 time for which proposals are rolled out; PDM-Closed plans 8 s [s]
    period                  time between two decisions [s]
    lane_changes            whether the vehicle may leave the lane of its route to pass slower traffic and obstacles
    uncertainty             multiple of the standard deviation of its position by which an object is enlarged; 1.645
                            covers 95 % on one side
    possible_existence      existence probability from which an object reduces the speed comfortably; hard braking
                            needs `min_existence`
    caution                 whether lanes and crosswalks that neither the own sensors nor those of a sender show are
                            treated as possibly occupied: the vehicle approaches them so that it can stop
    memory                  time for which a lost object is kept; `lost_detection_timeout` of Autoware [s]
    """

    time_gap: PositiveFloat = 1.2
    standstill_gap: PositiveFloat = 2.0
    passing_gap: Annotated[float, Field(ge=0.0, le=50.0)] = 6.0
    acceleration: PositiveFloat = 1.5
    comfortable_deceleration: Deceleration = 2.0
    hard_deceleration: Deceleration = 4.0
    emergency_deceleration: Deceleration = 8.0
    lateral_acceleration: PositiveFloat = 2.0
    lateral_margin: Annotated[float, Field(ge=0.0, le=3.0)] = 0.4
    pedestrian_margin: Annotated[float, Field(ge=0.0, le=3.0)] = 0.8
    crossing_time: Annotated[float, Field(ge=0.0, le=5.0)] = 0.75
    horizon: Annotated[float, Field(ge=3.0, le=15.0)] = 8.0
    period: Annotated[float, Field(gt=0.0, le=1.0)] = 0.1
    lane_changes: bool = True
    uncertainty: Annotated[float, Field(ge=0.0, le=5.0)] = 1.645
    possible_existence: Share = 0.3
    caution: bool = False
    memory: Annotated[float, Field(ge=0.0, le=10.0)] = 1.0
