"""JSON documents of users."""

from __future__ import annotations

from eidrive_scenario.files.bounded import load_json


def test_json_with_byte_order_mark_has_its_values() -> None:
    """RFC 8259, 8.1: parsers may ignore a byte-order mark."""
    assert load_json('{"größe": [1, 2]}'.encode("utf-8-sig")) == {"größe": [1, 2]}
