"""All that happened in one tick."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from eidrive_scenario.driving.step import AgentStep
from eidrive_scenario.records import fast_frozen
from eidrive_scenario.storyboard.state.states import StateChange
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.world.appearance import Appearance
from eidrive_scenario.world.environment import Environment
from eidrive_scenario.world.view import WorldView


@fast_frozen
@dataclass(frozen=True)
class Frame:
    """The truth, what each station did, what the storyboard did, and what became of the messages said before.

    links        fates of messages that became known in the last tick, in the order of the channel; where it keeps them
                 in arrays (LinkEvents), events are made at the first look
    signals      what each traffic signal shows, by its id; those that nobody has set are missing
    appearances  lights, animations and visibility of the actors where they differ from the usual
    environment  time of day, weather and road; None until the scenario says something of them
    monitors     the scenario's monitors by name
    """

    view: WorldView
    steps: Mapping[str, AgentStep] = field(default_factory=dict)
    changes: tuple[StateChange, ...] = ()
    links: Sequence[LinkEvent] = ()
    signals: Mapping[str, str] = field(default_factory=dict)
    appearances: Mapping[str, Appearance] = field(default_factory=dict)
    environment: Environment | None = None
    monitors: Mapping[str, bool] = field(default_factory=dict)
