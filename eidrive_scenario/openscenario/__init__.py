"""OpenSCENARIO XML 1.0 to 1.3: files into a frozen, checked Scenario."""

from eidrive_scenario.openscenario.document import read_document
from eidrive_scenario.openscenario.scenario import EntityObject, Scenario, load_scenario

__all__ = ["EntityObject", "Scenario", "load_scenario", "read_document"]
