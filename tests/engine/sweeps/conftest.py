"""Fixtures of sweeps: a short scenario with one parameter, and a distribution over it."""

from __future__ import annotations

from pathlib import Path

import pytest

SCENARIO = """<?xml version="1.0"?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" author="test" description="a car"/>
  <ParameterDeclarations>
    <ParameterDeclaration name="Speed" parameterType="double" value="5">
      <ConstraintGroup><ValueConstraint rule="lessThan" value="40"/></ConstraintGroup>
    </ParameterDeclaration>
  </ParameterDeclarations>
  <CatalogLocations/>
  <RoadNetwork/>
  <Entities>
    <ScenarioObject name="Ego">
      <Vehicle name="car" vehicleCategory="car">
        <BoundingBox><Center x="1.4" y="0" z="0.75"/><Dimensions width="1.8" length="4.6" height="1.5"/></BoundingBox>
        <Performance maxSpeed="50" maxAcceleration="5" maxDeceleration="8"/>
        <Axles>
          <FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.6" positionX="2.8" positionZ="0.3"/>
          <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.6" positionX="0" positionZ="0.3"/>
        </Axles>
        <Properties/>
      </Vehicle>
    </ScenarioObject>
  </Entities>
  <Storyboard>
    <Init><Actions>
      <UserDefinedAction>
        <CustomCommandAction type="eidrive.criterion">{max_speed: {of: Ego, at_most: 20}}</CustomCommandAction>
      </UserDefinedAction>
      <Private entityRef="Ego">
        <PrivateAction><TeleportAction><Position>
          <WorldPosition x="0" y="0" z="0" h="0"/>
        </Position></TeleportAction></PrivateAction>
        <PrivateAction><LongitudinalAction><SpeedAction>
          <SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>
          <SpeedActionTarget><AbsoluteTargetSpeed value="$Speed"/></SpeedActionTarget>
        </SpeedAction></LongitudinalAction></PrivateAction>
      </Private>
    </Actions></Init>
    <StopTrigger><ConditionGroup><Condition name="end" delay="0" conditionEdge="none">
      <ByValueCondition><SimulationTimeCondition value="0.5" rule="greaterThan"/></ByValueCondition>
    </Condition></ConditionGroup></StopTrigger>
  </Storyboard>
</OpenSCENARIO>
"""
DISTRIBUTION = """<?xml version="1.0"?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" author="test" description="speeds"/>
  <ParameterValueDistribution>
    <ScenarioFile filepath="car.xosc"/>
    <Deterministic><DeterministicSingleParameterDistribution parameterName="Speed"><DistributionSet>
      <Element value="10"/><Element value="30"/><Element value="50"/>
    </DistributionSet></DeterministicSingleParameterDistribution></Deterministic>
  </ParameterValueDistribution>
</OpenSCENARIO>
"""


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """Return a scenario of half a second that fails from a parameter `Speed` of 20 on and excludes 40 and more."""
    path = tmp_path / "car.xosc"
    path.write_text(SCENARIO)
    return path


@pytest.fixture
def distribution(scenario: Path) -> Path:
    """Return a distribution over the speeds 10, 30 and 50."""
    path = scenario.with_name("speeds.xosc")
    path.write_text(DISTRIBUTION)
    return path
