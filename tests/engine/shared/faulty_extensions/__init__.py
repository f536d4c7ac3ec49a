"""A package of faulty extensions in a temporary folder, as a third party would install it, and a scenario with them."""

from faulty_extensions.package import BROKEN_MODULES, install, line_of
from faulty_extensions.scenario import write_scenario

__all__ = ["BROKEN_MODULES", "install", "line_of", "write_scenario"]
