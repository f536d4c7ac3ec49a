"""Limits of the expansion of small files: texts of expressions, and elements of catalogs."""

from __future__ import annotations

from dataclasses import dataclass

MAX_TEXT = 65_536
"""Maximum number of characters of a text that an expression concatenates."""
MAX_JOINED = 16 * 2**20
"""Maximum number of characters of all such texts of a scenario."""
MAX_CATALOG_ELEMENTS = 300_000
"""Maximum number of elements of the used catalog entries; an entry counts once for each reference to it."""
MAX_NESTED_REFERENCES = 50
"""Maximum nesting depth of catalog entries that refer to others."""


class BudgetError(Exception):
    """Exceeded limit; the text of the error states which one."""


@dataclass
class Budget:
    """Usage of the limits by one scenario."""

    concatenated: int = 0
    catalog_elements: int = 0

    def join(self, length: int) -> None:
        """Count the characters of a text before its concatenation. Raise BudgetError if it is too long."""
        if length > MAX_TEXT:
            raise BudgetError(f"the text has more than {MAX_TEXT} characters")
        self.concatenated += length
        if self.concatenated > MAX_JOINED:
            raise BudgetError(f"the texts of all expressions have more than {MAX_JOINED} characters")

    def enter_catalog_element(self, count: int) -> None:
        """Count the elements of an entry before it is read. Raise BudgetError if there are too many."""
        self.catalog_elements += count
        if self.catalog_elements > MAX_CATALOG_ELEMENTS:
            raise BudgetError(f"the entries of catalogs have more than {MAX_CATALOG_ELEMENTS} elements in total")
