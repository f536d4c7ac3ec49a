"""Fixtures of the tests of the OpenSCENARIO reader."""

from scenario_fixtures import parameters_xml, scenario_xml, story_xml

__all__ = ["parameters_xml", "scenario_xml", "story_xml"]
