"""Files of the library compared with ASAM's schemas."""

from __future__ import annotations

from pathlib import Path

import pytest
from corpora import corpora_folder
from lxml import etree

LIBRARY = Path(__file__).parents[2] / "xosc"
FILES = sorted(LIBRARY.rglob("*.xosc"))
SCHEMAS = {"0": "v1.0", "1": "v1.1.1", "2": "v1.2", "3": "v1.3.1"}


@pytest.mark.parametrize("file", FILES, ids=[file.relative_to(LIBRARY).as_posix() for file in FILES])
def test_library_file_is_valid(file: Path) -> None:
    document = etree.parse(file)
    header = document.find("FileHeader")
    assert header is not None
    name = f"OpenSCENARIO{SCHEMAS[header.get('revMinor', '')]}.xsd"
    schema = etree.XMLSchema(file=str(corpora_folder() / "schema" / name))
    assert schema.validate(document), schema.error_log
