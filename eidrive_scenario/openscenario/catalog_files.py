"""Comparison of the files and folders of catalogs with those of an earlier reading."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import msgspec

from eidrive_scenario.files.bounded import read_regular_file
from eidrive_scenario.openscenario.reading.parsing import LIMITS
from eidrive_scenario.resolved_settings import sha256_of

Listing = tuple[str, ...] | bool
"""Sorted names in a folder; whether anything is at a path that is no folder."""


class CatalogFiles(msgspec.Struct, frozen=True):
    """Files and folders that were read to find the catalog entries of a scenario.

    folders  locations of catalogs with their listings, when reading began
    digests  SHA-256 of each file that was read, as hexadecimal digits
    """

    folders: Mapping[Path, Listing]
    digests: Mapping[Path, str]

    def are_current(self, folders: Mapping[Path, Listing]) -> bool:
        """Return whether the folders have these listings and all files their content."""
        return self.folders == folders and all(_digest(path) == digest for path, digest in self.digests.items())


def listing_of(place: Path) -> Listing:
    """Return what is at the location of catalogs."""
    try:
        return tuple(sorted(os.listdir(place)))
    except OSError:
        return os.path.lexists(place)


def _digest(path: Path) -> str:
    """Return the SHA-256 of a file; an empty text if it cannot be read."""
    try:
        return sha256_of(read_regular_file(path, LIMITS.max_bytes))
    except OSError:
        return ""
