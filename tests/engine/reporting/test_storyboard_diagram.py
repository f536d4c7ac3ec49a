"""Storyboard diagram: columns of elements, boxes without overlap, arrows to dependent elements."""

from itertools import combinations
from pathlib import Path

import pytest
from lxml import etree
from matplotlib.font_manager import findfont, get_font
from openscenario_xml import scenario_xml, variables_xml
from storyboard_xml import (
    act_xml,
    acts_xml,
    condition_xml,
    element_state_xml,
    event_xml,
    group_xml,
    groups_xml,
    maneuver_xml,
    time_xml,
    trigger_xml,
)

from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.reporting.storyboard_diagram.diagram import storyboard_diagram, write_storyboard_diagram
from eidrive_scenario.reporting.storyboard_diagram.layout import (
    BoxLine,
    DiagramLayout,
    Role,
    init_boxes,
    layout_diagram,
    stop_lines,
    story_boxes,
    width_of,
    wrap_text,
    wrapped_lines,
)
from eidrive_scenario.storyboard.storyboard import Storyboard

SET = '<GlobalAction><VariableAction variableRef="v"><SetAction value="1"/></VariableAction></GlobalAction>'
TIME = condition_xml(time_xml(3), "rising")


def after(name: str, kind: str = "event") -> str:
    return condition_xml(element_state_xml(kind, name, "endTransition"))


def event(name: str, *groups: str, count: int = 1) -> str:
    return event_xml(name, SET, trigger_xml(*groups), count=count)


def act(name: str, *maneuvers: str) -> str:
    inside = "".join(maneuver_xml(events, f"{name} m{n}") for n, events in enumerate(maneuvers))
    return act_xml(group_xml(inside, "", name=f"{name} group"), name=name)


def storyboard(*acts: str, stop: str = "") -> Storyboard:
    story = acts_xml(*acts, name="story &lt;1&gt;")
    text = scenario_xml(declarations=variables_xml(v=("integer", "0")), entities="", story=story, stop=stop)
    return Storyboard(load_scenario(text), None, dt=0.1)


CHAIN = act(
    "one",
    event("a", TIME)
    + event("b", after("a"))
    + event("c", after("a") + TIME, after("b"))
    + event("d", after("c action", "action")),
)


@pytest.fixture
def layout() -> DiagramLayout:
    """Return a layout of two acts; events of the first act depend on each other."""
    return layout_diagram(story_boxes(storyboard(CHAIN, act("two", event("x"), event("y", count=3)))), 10.0, 20.0)


def test_story_boxes_contain_triggers_and_actions() -> None:
    (story,) = story_boxes(storyboard(CHAIN))
    (one,) = story.children
    (group,) = one.children
    assert [(line.lead, line.text) for line in group.lines] == [("maneuver", "one m0")]
    c = group.children[2]
    assert [(line.role, line.lead, line.text) for line in c.lines] == [
        (Role.START, "when", "event a in endTransition"),
        (Role.START, "and", "simulation time > 3 s becomes true"),
        (Role.START, "or when", "event b in endTransition"),
    ]
    assert [child.title for child in c.children] == ["c action"]


def test_story_boxes_contain_dependencies() -> None:
    (story,) = story_boxes(storyboard(CHAIN))
    waits = {box.title: [path[-1] for path in box.waits_for] for box in story.walk() if box.kind == "event"}
    assert waits == {"a": [], "b": ["a"], "c": ["a", "b"], "d": ["c"]}


def test_story_boxes_contain_priority_and_limit() -> None:
    (story,) = story_boxes(storyboard(act("two", event("y", count=3))))
    assert [box.remark for box in story.walk() if box.kind == "event"] == ["parallel, up to 3 times"]


def test_layout_boxes_do_not_overlap(layout: DiagramLayout) -> None:
    boxes = [box for story in layout.stories for box in story.walk()]
    assert len(boxes) == 1 + 2 + 2 + 2 + 6 + 6
    for one, other in combinations(boxes, 2):
        beside = one.x + one.width < other.x or other.x + other.width < one.x
        assert beside or one.y + one.height < other.y or other.y + other.height < one.y, (one.path, other.path)
    assert max(box.x + box.width for box in boxes) == layout.width
    assert max(box.y + box.height for box in boxes) < layout.height


def test_layout_children_are_right_of_parents_at_equal_height(layout: DiagramLayout) -> None:
    for story in layout.stories:
        for box in story.walk():
            assert all(child.x > box.x + box.width for child in box.children)
            assert not box.children or box.children[0].y == box.y


def test_layout_parallel_arrows_have_separate_lanes(layout: DiagramLayout) -> None:
    pairs = [(arrow.source.title, arrow.target.title) for arrow in layout.arrows]
    assert sorted(pairs) == [("a", "b"), ("a", "c"), ("b", "c"), ("c", "d")]
    for one, other in combinations(layout.arrows, 2):
        if one.lane == other.lane:
            spans = sorted(sorted((arrow.source.y, arrow.target.y)) for arrow in (one, other))
            assert spans[0][1] < spans[1][0]
    events = layout.columns["event"]
    group = max(box.x + box.width for story in layout.stories for box in story.walk() if box.kind == "maneuver")
    assert all(group < arrow.lane < events for arrow in layout.arrows)


def test_layout_lines_fit_into_boxes(layout: DiagramLayout) -> None:
    for story in layout.stories:
        for box in story.walk():
            for line in box.text_lines:
                assert line.indent + width_of(line.text, 11.5) <= box.width - 20


def test_storyboard_diagram_is_well_formed_and_complete(tmp_path: Path) -> None:
    made = storyboard(CHAIN, stop=groups_xml(TIME))
    path = write_storyboard_diagram(made, tmp_path / "new" / "tree.svg")
    root = etree.parse(path).getroot()
    texts = [str(node.xpath("string()")) for node in root.iter("{*}text")]
    for name in ("story <1>", "one", "one group", "a", "b", "c", "d", "a action", "The run stops when"):
        assert name in texts
    assert len(root.findall(".//{*}g[@class='arrow']")) == 4
    assert storyboard_diagram(made) == storyboard_diagram(made)


def test_stop_lines_without_stop_trigger_state_end_of_stories() -> None:
    assert [(line.lead, line.text) for line in stop_lines(storyboard(CHAIN))] == [("when", "every story has ended")]


def test_init_boxes_contain_one_box_per_entity() -> None:
    path = Path(__file__).parents[2] / "data" / "passing_by.xosc"
    cards = init_boxes(Storyboard(load_scenario(path), None, dt=0.1))
    assert [card.title for card in cards] == ["global actions", "Ego", "Parked"]
    assert [line.text for line in cards[1].lines][1] == "speed to 10 m/s, at once"


@pytest.mark.parametrize("width", [20.0, 60.0, 400.0])
def test_wrap_text_keeps_letters_within_width(width: float) -> None:
    text = "Ego: time headway to TheVehicleThatCutsIn_2 ≥ 0.7 s becomes true"
    lines = wrap_text(text, width, 12)
    assert "".join(lines).replace(" ", "") == text.replace(" ", "")
    assert all(width_of(line, 12) <= width for line in lines)


@pytest.mark.parametrize("lead", ["The run stops when", "stops when", "maneuver", "or when", "when", "and"])
def test_wrapped_lines_indent_exceeds_width_of_bold_lead(lead: str) -> None:
    """The leading word is drawn bold; DejaVu Sans Bold is wider than Helvetica Bold."""
    font = get_font(findfont("DejaVu Sans:bold"))
    font.set_size(11.5, 72)
    font.set_text(lead)
    (line,) = wrapped_lines([BoxLine(Role.STOP, lead, "x")], 500.0)
    assert line.indent > font.get_width_height()[0] / 64.0


def test_wrap_text_splits_long_words_at_their_parts() -> None:
    assert wrap_text("CutInAndBrakeStory", 100, 13) == ["CutInAndBrake", "Story"]


def test_wrap_text_of_very_long_word_takes_linear_time() -> None:
    """All lines but the last of a word of 100 000 equal letters have the same length."""
    lines = wrap_text("x" * 100_000, 300.0, 12.0)
    assert "".join(lines) == "x" * 100_000
    assert {len(line) for line in lines[:-1]} == {int(300.0 / width_of("x", 12.0))}
