"""Lines of elements beyond the 65,535 that libxml2 can count."""

from pathlib import Path
from typing import cast

import pytest
from lxml import etree

from eidrive_scenario.errors import RoadError, ScenarioError
from eidrive_scenario.files.untrusted_xml import parse_numbered
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.roads import RoadNetwork

FAR = "\n" * 70_000


def line(element: etree._Element) -> object:
    """Return the line of an element, to which lxml-stubs gives no type."""
    return element.sourceline


def lines(text: str) -> list[tuple[str, object]]:
    root = parse_numbered(text.encode(), etree.XMLParser(remove_comments=True))
    return [(str(element.tag), line(element)) for element in root.iter()]


@pytest.mark.parametrize("before", [3, 65_533, 65_534, 65_535, 200_000])
def test_each_element_has_the_line_where_it_begins(before: int) -> None:
    """With and without white space between the elements; libxml2 alone says 65535, or a line too many."""
    text = "<r>" + "\n" * before + "<a/><!-- a\ncomment --><b><c/></b>\n<d/>\n</r>"
    first = before + 1
    assert lines(text) == [("r", 1), ("a", first), ("b", first + 1), ("c", first + 1), ("d", first + 2)]


def test_elements_forgotten_and_found_again_keep_their_lines() -> None:
    root = parse_numbered(b"<r>" + b"\n" * 70_000 + b"<a><b/></a></r>", etree.XMLParser())
    for _ in range(2):
        assert [line(element) for element in cast("list[etree._Element]", root.xpath("//b"))] == [70_001]
    inner = root[0].find("b")
    assert inner is not None
    outer = inner.getparent()
    assert outer is not None
    assert line(outer) == 70_001


def test_messages_name_the_line_of_a_long_file(tmp_path: Path) -> None:
    path = tmp_path / "long.xosc"
    path.write_text(f'<OpenSCENARIO>{FAR}<FileHeader revMajor="1" revMinor="9"/></OpenSCENARIO>')
    with pytest.raises(ScenarioError, match=r"long\.xosc:70001: FileHeader has the version 1\.9"):
        load_scenario(path)
    with pytest.raises(RoadError, match=r"town:70001: road '1' has no <lanes>"):
        RoadNetwork.parse(f'<OpenDRIVE>{FAR}<road id="1" length="5"><planView/></road></OpenDRIVE>', "town")
