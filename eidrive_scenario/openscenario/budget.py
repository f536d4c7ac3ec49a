"""Bounds on what a small file may expand to: text of parameters, and elements of catalogs."""

from __future__ import annotations

from dataclasses import dataclass

MAX_TEXT = 65_536
"""Characters of one value that an expression joins."""
MAX_JOINED = 16 * 2**20
"""Characters of all such values of a scenario."""
MAX_CATALOG_ELEMENTS = 300_000
"""Elements of all entries of catalogs that a scenario uses; an entry counts once for each reference to it."""
MAX_NESTED_REFERENCES = 50
"""Levels of entries of catalogs that refer to others."""


class BudgetError(Exception):
    """A bound is exceeded; the text of the error states which one."""


@dataclass
class Budget:
    """The share of the bounds that one scenario has used."""

    joined: int = 0
    catalog_elements: int = 0

    def join(self, length: int) -> None:
        """Count the characters of a joined text before it is made. Raise BudgetError if it is too long."""
        if length > MAX_TEXT:
            raise BudgetError(f"the text has more than {MAX_TEXT} characters")
        self.joined += length
        if self.joined > MAX_JOINED:
            raise BudgetError(f"the texts of all expressions have more than {MAX_JOINED} characters")

    def enter_catalog_element(self, count: int) -> None:
        """Count the elements of an entry before it is read. Raise BudgetError if they are too many."""
        self.catalog_elements += count
        if self.catalog_elements > MAX_CATALOG_ELEMENTS:
            raise BudgetError(f"the entries of catalogs have more than {MAX_CATALOG_ELEMENTS} elements in total")
