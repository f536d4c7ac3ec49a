"""Reader of OpenDRIVE files into the plain data of `roads.model`."""

from eidrive_scenario.roads.reading.document import parse_road_map, read_road_text

__all__ = ["parse_road_map", "read_road_text"]
