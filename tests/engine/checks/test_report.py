"""Reports of `eidrive check`: order, limit and one registry for all kinds of files."""

from __future__ import annotations

from pathlib import Path

import pytest
from opendrive_xml import lanes_xml, map_xml, road_xml, successor_xml
from openscenario_xml import catalog_xml, road_file_xml, scenario_xml

from eidrive_scenario.checks.rule import CheckReport, Level
from eidrive_scenario.checks.scenario_checks import (
    ALL_RULES,
    DistributionCheckReport,
    check_catalog,
    check_road_file,
    check_scenario,
)
from eidrive_scenario.errors import MAX_DIAGNOSTICS, Diagnostic
from eidrive_scenario.roads.model.map_warnings import MapRule

TWO_LINES = (
    '<geometry s="0" x="0" y="0" hdg="0" length="50"><line/></geometry>\n'
    '<geometry s="50" x="52" y="0" hdg="0" length="50"><line/></geometry>'
)
ROADS = map_xml(road_xml(link=successor_xml(junction="4"), geometry=TWO_LINES, lanes=lanes_xml(0, 1, -3)))


def diagnostic(source: str, line: int | None, message: str = "message") -> Diagnostic:
    return Diagnostic(message, "", source, line)


@pytest.mark.parametrize("report_type", [CheckReport, DistributionCheckReport])
def test_report_collect_sorts_by_file_and_line_without_duplicates(report_type: type[CheckReport]) -> None:
    b2, a9, b1 = diagnostic("b", 2), diagnostic("a", 9), diagnostic("b", 1)
    report = report_type.collect([(Level.WARNING, one) for one in (b2, a9, b1, b2)])
    assert report.warnings == (b1, b2, a9)
    assert (report.errors, report.notes) == ((), ())


def test_report_collect_more_than_the_maximum_counts_the_others() -> None:
    found = [(Level.NOTE, diagnostic("a", line)) for line in range(1, MAX_DIAGNOSTICS + 4)]
    notes = CheckReport.collect(reversed(found)).notes
    assert [one.line for one in notes[:MAX_DIAGNOSTICS]] == list(range(1, MAX_DIAGNOSTICS + 1))
    assert [one.message for one in notes[MAX_DIAGNOSTICS:]] == ["3 more are not listed"]


def test_registry_defines_each_name_and_summary_once() -> None:
    assert len({rule.name for rule in ALL_RULES}) == len(ALL_RULES)
    assert len({rule.summary for rule in ALL_RULES}) == len(ALL_RULES)
    assert {rule.id for rule in MapRule} <= {rule.name for rule in ALL_RULES}


def test_check_of_road_file_and_of_scenario_report_the_same_map_warnings(tmp_path: Path) -> None:
    (tmp_path / "street.xodr").write_text(ROADS, encoding="utf-8")
    scenario = tmp_path / "scenario.xosc"
    scenario.write_bytes(scenario_xml(road=road_file_xml("street.xodr")))
    of_road_file = check_road_file(tmp_path / "street.xodr").warnings
    of_scenario = [one for one in check_scenario(scenario).warnings if one.source.endswith("street.xodr")]
    assert list(of_road_file) == of_scenario
    assert {one.rule for one in of_road_file} == {"road-link", "geometry-gap", "lane-width"}
    ignored = check_road_file(tmp_path / "street.xodr", ["geometry-gap"]).warnings
    assert {one.rule for one in ignored} == {"road-link", "lane-width"}


def test_check_catalog_with_many_warnings_counts_the_unlisted_ones(tmp_path: Path) -> None:
    """The category 'grafficIsland' is read as trafficIsland, with a warning."""
    entry = """<MiscObject name="{}" miscObjectCategory="grafficIsland" mass="10">
<BoundingBox><Center x="0" y="0" z="0"/><Dimensions length="1" width="1" height="1"/></BoundingBox></MiscObject>"""
    path = tmp_path / "boxes.xosc"
    entries = "\n".join(entry.format(number) for number in range(MAX_DIAGNOSTICS + 5))
    path.write_bytes(catalog_xml("boxes", entries))
    report = check_catalog(path)
    assert report.errors == ()
    assert len(report.warnings) == MAX_DIAGNOSTICS + 1
    assert report.warnings[-1].message == "5 more are not listed"
