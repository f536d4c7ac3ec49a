"""Traffic lights and signs of a GroundTruth message, from the OpenDRIVE map of the run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from eidrive_scenario.export.osi.schemas import Identifiers, Osi, set_orientation
from eidrive_scenario.roads import RoadNetwork, Signal
from eidrive_scenario.roads.model.signal_states import FLASHING, ON, lamp_colors, lamps
from eidrive_scenario.world.road_objects import SignalHead, signal_heads

_MODES = {ON: "MODE_CONSTANT", FLASHING: "MODE_FLASHING"}
_DEPTH = 0.1
"""Length of the box of a lamp along its direction [m]."""
_ICONS: Mapping[tuple[str, str], str] = {
    ("1000002", ""): "PEDESTRIAN",
    ("1000007", ""): "PEDESTRIAN_AND_BICYCLE",
    ("1000013", ""): "BICYCLE",
    ("1000010", "10"): "ARROW_LEFT",
    ("1000010", "20"): "ARROW_RIGHT",
    ("1000011", "10"): "ARROW_LEFT",
    ("1000011", "20"): "ARROW_RIGHT",
    ("1000011", "30"): "ARROW_STRAIGHT_AHEAD",
    ("1000011", "40"): "ARROW_STRAIGHT_AHEAD_LEFT",
    ("1000011", "50"): "ARROW_STRAIGHT_AHEAD_RIGHT",
}
"""Icons of lights by type, and subtype if it matters, of the OpenDRIVE signal catalog."""
_GERMAN = ("DE", "GERMANY", "OPENDRIVE", "")
"""Countries whose signs have the numbers of the German catalog."""
_SIGNS: Mapping[str, str] = {
    "101": "DANGER_SPOT", "102": "RIGHT_BEFORE_LEFT_NEXT_INTERSECTION", "108": "HILL_DOWNWARDS", "110": "HILL_UPWARDS",
    "112": "UNEVEN_ROAD", "114": "ROAD_SLIPPERY_WET_OR_DIRTY", "120": "ROAD_NARROWING", "123": "ROAD_WORKS",
    "124": "TRAFFIC_QUEUES", "125": "TWO_WAY_TRAFFIC", "131": "ATTENTION_TRAFFIC_LIGHT", "205": "GIVE_WAY",
    "206": "STOP", "208": "PRIORITY_TO_OPPOSITE_DIRECTION", "215": "ROUNDABOUT", "224": "BUS_STOP",
    "237": "BICYCLES_ONLY", "239": "PEDESTRIANS_ONLY", "240": "BICYCLES_PEDESTRIANS_SHARED_ONLY", "245": "BUS_LANE",
    "250": "ALL_PROHIBITED", "251": "MOTORIZED_MULTITRACK_PROHIBITED", "253": "TRUCKS_PROHIBITED",
    "254": "BICYCLES_PROHIBITED", "259": "PEDESTRIANS_PROHIBITED", "260": "MOTOR_VEHICLES_PROHIBITED",
    "267": "DO_NOT_ENTER", "274": "SPEED_LIMIT_BEGIN", "274.1": "SPEED_LIMIT_ZONE_BEGIN",
    "274.2": "SPEED_LIMIT_ZONE_END", "275": "MINIMUM_SPEED_BEGIN", "276": "OVERTAKING_BAN_BEGIN",
    "277": "OVERTAKING_BAN_FOR_TRUCKS_BEGIN", "278": "SPEED_LIMIT_END", "280": "OVERTAKING_BAN_END",
    "282": "ALL_RESTRICTIONS_END", "283": "NO_STOPPING", "286": "NO_PARKING",
    "301": "RIGHT_OF_WAY_NEXT_INTERSECTION", "306": "RIGHT_OF_WAY_BEGIN", "307": "RIGHT_OF_WAY_END",
    "308": "PRIORITY_OVER_OPPOSITE_DIRECTION", "310": "TOWN_BEGIN", "311": "TOWN_END", "314": "CAR_PARKING",
    "330.1": "HIGHWAY_BEGIN", "330.2": "HIGHWAY_END", "331.1": "EXPRESSWAY_BEGIN", "331.2": "EXPRESSWAY_END",
}  # fmt: skip
"""Types of signs by their numbers in the German catalog, as osi_trafficsign.proto defines them; OTHER for the rest."""
_UNITS: Mapping[str, str] = {
    "": "NO_UNIT", "km/h": "KILOMETER_PER_HOUR", "mph": "MILE_PER_HOUR", "m": "METER", "km": "KILOMETER", "ft": "FEET",
    "mile": "MILE", "t": "METRIC_TON", "%": "PERCENTAGE",
}  # fmt: skip
"""Units of values by those of OpenDRIVE; OTHER for the rest."""


class Signals:
    """Lamps of all traffic lights, and all signs of a map that are not painted. Without a map there are none."""

    def __init__(self, osi: Osi, roads: RoadNetwork | None, ids: Identifiers) -> None:
        self._osi = osi
        self._roads = roads
        self._ids = ids
        self._heads = [] if roads is None else signal_heads(roads)

    def add_lights(self, message: Any, states: Mapping[str, str]) -> None:
        """Add the lamps with their states, by the id of the signal. A light without a state is dark, as in images."""
        kinds = self._osi.traffic_light.Classification
        for number, head in enumerate(self._heads):
            signal = head.signal
            colors = lamp_colors(signal)
            if not colors:
                continue
            shown = lamps(states.get(signal.id, ""), colors)
            icon = _ICONS.get((signal.type, "")) or _ICONS.get((signal.type, signal.subtype), "NONE")
            for index, (color, mode) in enumerate(shown):
                lamp = message.traffic_light.add()
                lamp.id.value = self._ids.of("lamp", number, index)
                height = head.height / len(shown)
                _set_base(lamp.base, head, _DEPTH, height, (len(shown) - index - 0.5) * height)
                lamp.classification.color = kinds.Color.Value(f"COLOR_{color.upper()}")
                lamp.classification.icon = kinds.Icon.Value(f"ICON_{icon}")
                lamp.classification.mode = kinds.Mode.Value(_MODES.get(mode, "MODE_OFF"))
                self._complete(lamp, lamp.classification, signal)

    def add_signs(self, message: Any) -> None:
        """Add all signs."""
        kinds = self._osi.traffic_sign
        for number, head in enumerate(self._heads):
            signal = head.signal
            if lamp_colors(signal):
                continue
            sign = message.traffic_sign.add()
            sign.id.value = self._ids.of("sign", number)
            _set_base(sign.main_sign.base, head, 0.0, head.height, 0.5 * head.height)
            classification = sign.main_sign.classification
            classification.variability = kinds.Variability.Value("VARIABILITY_FIXED")
            name = _SIGNS.get(signal.type, "OTHER") if signal.country.upper() in _GERMAN else "OTHER"
            classification.type = kinds.MainSign.Classification.Type.Value(f"TYPE_{name}")
            classification.country, classification.code = signal.country, signal.type
            if signal.subtype not in ("", "-1", "none"):
                classification.sub_code = signal.subtype
            if signal.value is not None and signal.value >= 0.0:
                unit = f"UNIT_{_UNITS.get(signal.unit, 'OTHER')}"
                classification.value.value = signal.value
                classification.value.value_unit = self._osi.sign_value.Unit.Value(unit)
            if signal.text:
                classification.value.text = signal.text
            self._complete(sign, classification, signal)

    def _complete(self, message: Any, classification: Any, signal: Signal) -> None:
        """Add the lanes for which a signal is valid, and its source."""
        for number in dict.fromkeys(self._lanes(signal)):
            classification.assigned_lane_id.add().value = number
        message.source_reference.add(type="net.asam.opendrive", identifier=[signal.id])

    def _lanes(self, signal: Signal) -> Iterator[int]:
        assert self._roads is not None
        for place in (signal.place, *signal.references):
            for lane in self._roads.signal_lanes(place):
                section = self._roads.roads[place.road].section_at(place.s)
                yield self._ids.of("lane", place.road, section.index, lane)


def _set_base(base: Any, head: SignalHead, length: float, height: float, above: float) -> None:
    """Set the box of a lamp or plate, whose center is `above` the lower edge of the head [m]."""
    base.position.x, base.position.y, base.position.z = head.pose.x, head.pose.y, head.pose.z + above
    base.dimension.length, base.dimension.width, base.dimension.height = length, head.width, height
    set_orientation(base.orientation, head.pose.h)
