"""Edges of lanes by their road marks; OpenDRIVE does not require a mark."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from written_recording import view, write_run

from eidrive_scenario.export.geometry import center_line, edge_line, lane_edges
from eidrive_scenario.export.tool_topics import write_with_topics
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.roads import RoadNetwork

ROAD = """<OpenDRIVE><header revMajor="1" revMinor="7"/><road id="1" length="100" junction="-1"><planView>
<geometry s="0" x="0" y="0" hdg="0" length="100">{shape}</geometry></planView><lanes><laneSection s="0"><center>
<lane id="0" type="none"/></center><right><lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/>
{marks}</lane></right></laneSection></lanes></road></OpenDRIVE>"""
MARK = '<roadMark sOffset="{0}" type="{1}" weight="standard" color="yellow" width="0.1"/>'


@pytest.mark.parametrize(
    ("marks", "edges"),
    [
        ((), [(0.0, 100.0, "NO_LINE")]),
        (((0.0, "solid"),), [(0.0, 100.0, "SOLID_LINE")]),
        (((40.0, "broken"),), [(0.0, 40.0, "NO_LINE"), (40.0, 100.0, "DASHED_LINE")]),
        (((0.0, "solid"), (60.0, "none")), [(0.0, 60.0, "SOLID_LINE"), (60.0, 100.0, "NO_LINE")]),
        (((100.0, "solid"),), [(0.0, 100.0, "NO_LINE")]),
    ],
)
def test_edges_of_lane_follow_its_road_marks(
    marks: tuple[tuple[float, str], ...], edges: list[tuple[float, float, str]], tmp_path: Path
) -> None:
    path = tmp_path / "road.xodr"
    path.write_text(ROAD.format(shape="<line/>", marks="".join(MARK.format(*mark) for mark in marks)))
    (section,) = RoadNetwork.load(path).roads["1"].sections
    assert [(edge.start, edge.end, edge.type) for edge in lane_edges(section, section.lanes[-1])] == edges
    assert list(lane_edges(section, None)) == []
    write_with_topics(write_run(tmp_path, [Frame(view({"A": {}}))], road=path), tmp_path / "all.mcap")
    assert read_recording(tmp_path / "all.mcap").damage == ()


def test_lines_of_a_tight_bend_deviate_by_at_most_5_cm() -> None:
    """`centerline` of osi_lane.proto; on 8 turns of 2 m radius, with the center and the edge of the lane outside."""
    roads = RoadNetwork.parse(ROAD.format(shape='<arc curvature="0.5"/>', marks="").encode(), "road.xodr")
    road = roads.roads["1"]
    (section,) = road.sections
    lane = section.lanes[-1]
    (edge,) = lane_edges(section, lane)
    center = center_line(roads, road, section, lane, 2.0)
    for line, radius in ((center, 3.75), (edge_line(roads, road, section, lane, edge, 2.0), 5.5)):
        points = np.array(line)[:, :2] - (0.0, 2.0)
        assert np.hypot(*points.T) == pytest.approx(radius)
        assert radius - np.hypot(*(0.5 * (points[1:] + points[:-1])).T).min() <= 0.05


def test_line_follows_an_s_that_crosses_its_chord_in_the_middle() -> None:
    """With the width 3.5 + 0.3 (x³ - 3 x² + 2 x) on the first 2 m, up to 0.115 m beside the chord."""
    width = '<width sOffset="0" a="3.5" b="0.6" c="-0.9" d="0.3"/><width sOffset="2" a="3.5" b="0" c="0" d="0"/>'
    text = ROAD.format(shape="<line/>", marks="").replace('<width sOffset="0" a="3.5" b="0" c="0" d="0"/>', width)
    roads = RoadNetwork.parse(text.encode(), "road.xodr")
    road = roads.roads["1"]
    (section,) = road.sections
    (edge,) = lane_edges(section, section.lanes[-1])
    x, y, _ = np.array(edge_line(roads, road, section, section.lanes[-1], edge, 2.0)).T
    at = np.linspace(0.0, 2.0, 201)
    assert np.abs(np.interp(at, x, -y) - np.polyval([0.3, -0.9, 0.6, 3.5], at)).max() <= 0.05
