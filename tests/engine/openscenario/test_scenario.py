from pathlib import Path

import pytest
from openscenario_xml import scenario_xml
from storyboard_xml import story_xml

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import load_scenario, model, text_of

CONTROLLER = """<ObjectController><Controller name="driver"><Properties>
<Property name="module" value="eidrive"/></Properties></Controller></ObjectController>"""
BOX = '<BoundingBox><Center x="0" y="0" z="1"/><Dimensions length="1" width="1" height="2"/></BoundingBox>'


def state_condition(reference: str, kind: str = "event") -> str:
    return (
        f'<StoryboardElementStateCondition storyboardElementRef="{reference}" storyboardElementType="{kind}" '
        'state="endTransition"/>'
    )


def test_load_scenario_accepts_path_bytes_and_tree(tmp_path: Path) -> None:
    path = tmp_path / "crossing.xosc"
    path.write_bytes(scenario_xml())
    scenario = load_scenario(path)
    assert (scenario.name, scenario.path, scenario.version) == ("crossing", path, (1, 3))
    assert load_scenario(str(path)).document == scenario.document
    assert load_scenario(scenario_xml()).document == scenario.document
    assert load_scenario(scenario_xml()).name == "a test"


def test_load_scenario_missing_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"nowhere\.xosc: cannot read: No such file or directory"):
        load_scenario(tmp_path / "nowhere.xosc")


def test_scenario_has_entities_and_controllers() -> None:
    walker = f"""<ScenarioObject name="Walker"><Pedestrian name="p" mass="80" pedestrianCategory="pedestrian">{BOX}
    </Pedestrian></ScenarioObject>"""
    mast = f"""<ScenarioObject name="RSU"><MiscObject name="mast" mass="99" miscObjectCategory="pole">{BOX}</MiscObject>
    {CONTROLLER}</ScenarioObject>"""
    scenario = load_scenario(scenario_xml(entities=walker + mast))
    assert {name: type(one) for name, one in scenario.entities.items()} == {
        "Walker": model.Pedestrian,
        "RSU": model.MiscObject,
    }
    assert scenario.controllers["Walker"] == ()
    (driver,) = scenario.controllers["RSU"]
    assert driver.properties is not None
    assert driver.properties.property[0].value == "eidrive"
    assert driver.properties.property[0].line > driver.line


def test_trailers_are_entities() -> None:
    xml = scenario_xml().decode()
    start, end = xml.index("<Vehicle"), xml.index("</Vehicle>")
    trailer = f'<Trailer><Trailer name="Trailer">{xml[start:end]}</Vehicle></Trailer></Trailer>'
    scenario = load_scenario((xml[:end] + trailer + xml[end:]).encode())
    assert list(scenario.entities) == ["Ego", "Trailer"]


@pytest.mark.parametrize(
    ("reference", "kind"),
    [
        ("event", "event"),
        ("maneuver/event", "event"),
        ("story/act/group/maneuver/event", "event"),
        ("act::event", "event"),
        ("action", "action"),
        ("group", "maneuverGroup"),
        ("story", "story"),
    ],
)
def test_storyboard_elements_are_found_by_name_and_by_path(reference: str, kind: str) -> None:
    story = story_xml(condition=state_condition(reference, kind))
    assert load_scenario(scenario_xml(story=story)).warnings == ()


@pytest.mark.parametrize(
    ("reference", "kind", "message"),
    [
        ("evnet", "event", r"refers to event 'evnet', which does not exist; did you mean 'event'\?"),
        ("other/event", "event", r"refers to event 'other/event', which does not exist; did you mean 'event'\?"),
        ("act", "event", r"'act' is of the kind act, not event; write storyboardElementType='act'"),
    ],
)
def test_unknown_storyboard_references_are_errors(reference: str, kind: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        load_scenario(scenario_xml(story=story_xml(condition=state_condition(reference, kind))))


@pytest.mark.parametrize(
    ("condition", "message"),
    [
        ('<VariableCondition variableRef="v" rule="equalTo" value="1"/>', "refers to variable 'v'"),
        ('<ParameterCondition parameterRef="p" rule="equalTo" value="1"/>', "refers to parameter 'p'"),
        (
            '<TrafficSignalControllerCondition trafficSignalControllerRef="c" phase="go"/>',
            "refers to signal controller 'c'",
        ),
    ],
)
def test_unknown_references_are_errors(condition: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        load_scenario(scenario_xml(story=story_xml(condition=condition)))


def test_scenario_runner_criteria_need_no_parameter() -> None:
    stop = """<ConditionGroup><Condition name="criteria_CollisionTest" delay="0" conditionEdge="rising">
    <ByValueCondition><ParameterCondition parameterRef="" value="" rule="lessThan"/></ByValueCondition>
    </Condition></ConditionGroup>"""
    assert load_scenario(scenario_xml(stop=stop)).warnings == ()


def test_contradictory_values_are_errors() -> None:
    keep = """<LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" freespace="true" continuous="true"
    distance="10" timeGap="2"/></LongitudinalAction>"""
    with pytest.raises(ScenarioError, match="either distance or timeGap"):
        load_scenario(scenario_xml(story=story_xml(action=keep)))


def test_duplicate_sibling_names_are_a_warning() -> None:
    scenario = load_scenario(scenario_xml(story=story_xml() + story_xml()))
    assert scenario.warnings[0].message == "two elements of the kind story are named 'story'"


class TestRoadFile:
    LOGIC = '<LogicFile filepath="{}"/>'

    def test_road_file_is_found_in_scenario_folder(self, tmp_path: Path) -> None:
        (tmp_path / "roads").mkdir()
        (tmp_path / "roads" / "town.xodr").touch()
        path = tmp_path / "scene.xosc"
        path.write_bytes(scenario_xml(road=self.LOGIC.format("roads/town.xodr")))
        assert load_scenario(path).road_file == tmp_path / "roads" / "town.xodr"

    @pytest.mark.parametrize("name", ["Town01", "Town01.xodr", "../elsewhere/Town01.xodr", "C:\\maps\\Town01.xodr"])
    def test_road_file_is_found_in_map_folders(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
    ) -> None:
        (tmp_path / "Town01.xodr").touch()
        monkeypatch.setenv("EIDRIVE_MAPS", f"/nonexistent:{tmp_path}")
        assert load_scenario(scenario_xml(road=self.LOGIC.format(name))).road_file == tmp_path / "Town01.xodr"

    @pytest.mark.parametrize(
        ("name", "warns"),
        [
            ("town.xodr", False),
            ("./town", False),
            ("{folder}/town.xodr", False),
            ("C:\\maps\\town.xodr", True),
            ("../elsewhere/town", True),
            ("/home/town.xodr", True),
        ],
    )
    def test_road_file_of_another_folder_is_found_beside_the_scenario(
        self, tmp_path: Path, name: str, warns: bool
    ) -> None:
        (tmp_path / "town.xodr").touch()
        path = tmp_path / "scene.xosc"
        path.write_bytes(scenario_xml(road=self.LOGIC.format(name.format(folder=tmp_path))))
        scenario = load_scenario(path)
        assert scenario.road_file == tmp_path / "town.xodr"
        assert any("that beside the scenario is used" in text.message for text in scenario.warnings) is warns

    def test_missing_road_file_error_suggests_similar_name(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        (tmp_path / "Town01.xodr").touch()
        monkeypatch.setenv("EIDRIVE_MAPS", str(tmp_path))
        with pytest.raises(ScenarioError, match=r"road file 'Twon01\.xodr' is neither .* did you mean 'Town01'\?"):
            load_scenario(scenario_xml(road=self.LOGIC.format("Twon01.xodr")))

    def test_missing_road_file_suggestion_ignores_the_suffix(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        (tmp_path / "offset.xodr").touch()
        monkeypatch.setenv("EIDRIVE_MAPS", str(tmp_path))
        with pytest.raises(ScenarioError, match=r"road file 'maps\\nowhere\.xodr' is neither .* known: offset$"):
            load_scenario(scenario_xml(road=self.LOGIC.format("maps\\nowhere.xodr")))

    def test_scenario_without_road_file_has_none(self) -> None:
        assert load_scenario(scenario_xml()).road_file is None


def test_text_of_missing_file_raises_scenario_error(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"gone\.xosc: cannot read: No such file"):
        text_of(tmp_path / "gone.xosc")
    with pytest.raises(ScenarioError, match="cannot read: the path leads to a folder"):
        text_of(tmp_path)
