"""Environments for reinforcement learning over any scenario with a station.

`EidriveEnv` is an environment of Gymnasium, registered as `Scenario-v0`; `EidriveParallelEnv` is one of PettingZoo for
several stations. Both require the extra `gym`. See docs/reinforcement_learning.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from eidrive_scenario.base.imports import lazy_exports
from eidrive_scenario.gym.environment import EidriveEnv
from eidrive_scenario.gym.libraries import gymnasium
from eidrive_scenario.gym.settings import (
    ActionSettings,
    GridSettings,
    MetaSpeed,
    ObservationSettings,
    Pedals,
    RenderSettings,
    RouteSettings,
    SendMessages,
    ShareObjects,
    TableSettings,
    TargetSpeed,
)
from eidrive_scenario.gym.station_interface import RewardSettings

if TYPE_CHECKING:
    from eidrive_scenario.gym.parallel import EidriveParallelEnv

__all__ = [
    "ENVIRONMENT_ID",
    "ActionSettings",
    "EidriveEnv",
    "EidriveParallelEnv",
    "GridSettings",
    "MetaSpeed",
    "ObservationSettings",
    "Pedals",
    "RenderSettings",
    "RewardSettings",
    "RouteSettings",
    "SendMessages",
    "ShareObjects",
    "TableSettings",
    "TargetSpeed",
]

ENVIRONMENT_ID = "Scenario-v0"
"""Id of `EidriveEnv`: `gymnasium.make("eidrive_scenario.gym:Scenario-v0", scenario="coop/scenario_1")`."""

__getattr__ = lazy_exports(__name__, {"parallel": "EidriveParallelEnv"})

if ENVIRONMENT_ID not in gymnasium.registry:
    gymnasium.register(ENVIRONMENT_ID, entry_point="eidrive_scenario.gym.environment:EidriveEnv")
