"""Reader of OpenSCENARIO XML 1.0 to 1.4: files to a frozen, validated Scenario, distributions to concrete runs."""

from typing import TYPE_CHECKING

from eidrive_scenario.base.imports import lazy_exports

if TYPE_CHECKING:
    from eidrive_scenario.openscenario.distributions.expansion import DistributionExpansion, load_distribution
    from eidrive_scenario.openscenario.loading import ConcreteRun
    from eidrive_scenario.openscenario.reading.document import read_document
    from eidrive_scenario.openscenario.reading.parsing import Source, text_of
    from eidrive_scenario.openscenario.scenario import EntityObject, Scenario, load_scenario
else:
    __getattr__ = lazy_exports(
        __name__,
        {
            "distributions.expansion": "DistributionExpansion load_distribution",
            "loading": "ConcreteRun",
            "reading.document": "read_document",
            "reading.parsing": "Source text_of",
            "scenario": "EntityObject Scenario load_scenario",
        },
    )

__all__ = [
    "ConcreteRun",
    "DistributionExpansion",
    "EntityObject",
    "Scenario",
    "Source",
    "load_distribution",
    "load_scenario",
    "read_document",
    "text_of",
]
