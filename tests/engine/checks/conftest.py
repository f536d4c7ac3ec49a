"""Fixtures of the tests of `eidrive check`."""

from command_fixtures import eidrive, passing_by
from scenario_fixtures import parameters_xml, scenario_xml

__all__ = ["eidrive", "parameters_xml", "passing_by", "scenario_xml"]
