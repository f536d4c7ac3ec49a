"""Types of OpenSCENARIO XML 1.0 to 1.4 as frozen dataclasses with the names of the standard.

Attributes and children of an element are fields in snake_case; `element` describes the field definitions.
"""

from eidrive_scenario.openscenario.model.appearance import *
from eidrive_scenario.openscenario.model.conditions import *
from eidrive_scenario.openscenario.model.controllers import *
from eidrive_scenario.openscenario.model.declarations import *
from eidrive_scenario.openscenario.model.distributions import *
from eidrive_scenario.openscenario.model.document import *
from eidrive_scenario.openscenario.model.element import Element as Element
from eidrive_scenario.openscenario.model.element import Enumeration as Enumeration
from eidrive_scenario.openscenario.model.entities import *
from eidrive_scenario.openscenario.model.entity_enumerations import *
from eidrive_scenario.openscenario.model.enumerations import *
from eidrive_scenario.openscenario.model.global_actions import *
from eidrive_scenario.openscenario.model.positions import *
from eidrive_scenario.openscenario.model.private_actions import *
from eidrive_scenario.openscenario.model.routing import *
from eidrive_scenario.openscenario.model.storyboard import *
from eidrive_scenario.openscenario.model.traffic import *
