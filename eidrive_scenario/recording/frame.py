"""All that happened in one tick."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from eidrive_scenario.driving.step import AgentStep
from eidrive_scenario.storyboard.states import StateChange
from eidrive_scenario.v2x.message import LinkEvent
from eidrive_scenario.world.view import WorldView


@dataclass(frozen=True)
class Frame:
    """The truth, what each station did, what the storyboard did, and what became of the messages said before."""

    view: WorldView
    steps: Mapping[str, AgentStep] = field(default_factory=dict)
    changes: tuple[StateChange, ...] = ()
    links: tuple[LinkEvent, ...] = ()
