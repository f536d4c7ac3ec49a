"""Reads an OpenDRIVE file into the plain data of `roads.model`."""

from eidrive_scenario.roads.reading.document import read_road_map

__all__ = ["read_road_map"]
