"""Traffic lights of a GroundTruth message: one entity per lamp."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from eidrive_scenario.export.osi.identifiers import Identifiers
from eidrive_scenario.export.osi.schemas import Osi, set_orientation
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.model.signal_states import FLASHING, ON, lamp_colors, lamps
from eidrive_scenario.world.road_objects import signal_heads

_DEPTH = 0.1
"""Length of the box of a lamp along its direction [m]."""


class TrafficLights:
    """Lamps of all traffic lights of a map. Without a map there are none."""

    def __init__(self, osi: Osi, roads: RoadNetwork | None, ids: Identifiers) -> None:
        self._osi = osi
        self._ids = ids
        heads = [] if roads is None else signal_heads(roads)
        self._heads = [(head, colors) for head in heads if (colors := lamp_colors(head.signal))]

    def add(self, message: Any, states: Mapping[str, str]) -> None:
        """Add the lamps with their states, by the id of the signal. A light without a state is dark, as in images."""
        kinds = self._osi.traffic_light.Classification
        for head, colors in self._heads:
            shown = lamps(states.get(head.signal.id, ""), colors)
            height = head.height / len(shown)
            for index, (color, mode) in enumerate(shown):
                lamp = message.traffic_light.add()
                lamp.id.value = self._ids.of("lamp", head.signal.id, index)
                base = lamp.base
                base.position.x, base.position.y = head.pose.x, head.pose.y
                base.position.z = head.pose.z + (len(shown) - index - 0.5) * height
                base.dimension.length, base.dimension.width, base.dimension.height = _DEPTH, head.width, height
                set_orientation(base.orientation, head.pose.h)
                lamp.classification.color = kinds.Color.Value(f"COLOR_{color.upper()}")
                lamp.classification.icon = kinds.Icon.Value("ICON_NONE")
                lamp.classification.mode = kinds.Mode.Value(_mode(mode))
                lamp.source_reference.add(type="net.asam.opendrive", identifier=[head.signal.id])


def _mode(mode: str) -> str:
    return {ON: "MODE_CONSTANT", FLASHING: "MODE_FLASHING"}.get(mode, "MODE_OFF")
