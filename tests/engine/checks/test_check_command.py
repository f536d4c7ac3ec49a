"""Command `eidrive check` on scenarios, road files, catalogs and folders."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from command_fixtures import Eidrive
from opendrive_xml import lanes_xml, map_xml, road_xml, successor_xml
from openscenario_xml import catalog_xml

from eidrive_scenario.simulation import RunSettings


@pytest.fixture
def folder(tmp_path: Path, passing_by: Path) -> Callable[..., Path]:
    """Return a function that fills a folder with the scenario and with copies with one replaced text."""

    def fill(**replacements: tuple[str, str]) -> Path:
        text = passing_by.read_text(encoding="utf-8")
        (tmp_path / "right.xosc").write_text(text, encoding="utf-8")
        for name, (old, new) in replacements.items():
            assert old in text
            (tmp_path / f"{name}.xosc").write_text(text.replace(old, new, 1), encoding="utf-8")
        return tmp_path

    return fill


def test_check_valid_folder_reports_no_diagnostic(eidrive: Eidrive, folder: Callable[..., Path]) -> None:
    result = eidrive("check", folder())
    assert (result.exit_code, result.stdout) == (0, "1 file, 0 errors, 0 warnings\n")


def test_check_folder_reports_errors_of_all_files(eidrive: Eidrive, folder: Callable[..., Path]) -> None:
    place = folder(
        criterion=("min_distance: {of: Ego, to: Parked", "min_distance: {of: Ego, to: Parkd"),
        command=('type="eidrive.criterion"', 'type="eidrive.criterium"'),
        dynamics=('dynamicsShape="step"', 'dynamicsShape="stp"'),
    )
    result = eidrive("check", place)
    assert result.exit_code == 2, result.output
    lines = result.stdout.splitlines()
    assert any(line.startswith(f"{place}/criterion.xosc:47: ") and "did you mean 'Parked'?" in line for line in lines)
    assert any(line.startswith(f"{place}/command.xosc:45: ") and "'eidrive.criterion'?" in line for line in lines)
    assert any(line.startswith(f"{place}/dynamics.xosc:61: ") and "'step'?" in line for line in lines)
    assert lines[-1] == "4 files, 3 errors, 0 warnings"
    assert result.stderr == ""


def test_check_unsupported_criterion_is_a_warning(eidrive: Eidrive, folder: Callable[..., Path]) -> None:
    condition = (
        '<Condition name="criteria_ReachedRegionTest" delay="0" conditionEdge="rising"><ByValueCondition>'
        '<ParameterCondition parameterRef="" value="" rule="lessThan"/></ByValueCondition></Condition>'
    )
    place = folder(runner=("<ConditionGroup>", f"<ConditionGroup>{condition}"))
    result = eidrive("check", place / "runner.xosc")
    assert result.exit_code == 0, result.output
    assert "criterion 'ReachedRegionTest' is not evaluated" in result.stdout
    assert result.stdout.splitlines()[-1] == "1 file, 0 errors, 1 warning"


def test_check_missing_paths_continues_with_other_files(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    result = eidrive("check", tmp_path / "missing.xosc", tmp_path, passing_by)
    assert result.exit_code == 2
    first, second, count = result.stdout.splitlines()
    assert "missing.xosc': neither a file nor in the library" in first
    assert second.startswith("no .xosc or .xodr file in")
    assert count == "1 file, 2 errors, 0 warnings"


def test_check_folder_without_scenarios_is_an_error(eidrive: Eidrive, tmp_path: Path) -> None:
    result = eidrive("check", tmp_path)
    assert result.exit_code == 2
    assert "no .xosc or .xodr file in" in result.stdout


def write_road(path: Path, link: str = "", width: str = "3") -> None:
    path.write_text(map_xml("\n", road_xml(link=link, lanes="\n" + lanes_xml(0, 1, width))), encoding="utf-8")


def test_check_road_files_reports_errors_and_map_warnings(eidrive: Eidrive, tmp_path: Path) -> None:
    write_road(tmp_path / "sound.xodr")
    write_road(tmp_path / "doubtful.xodr", link=successor_xml(junction="4"))
    write_road(tmp_path / "wrong.xodr", width="wide")
    (tmp_path / "broken.xodr").write_text("<OpenDRIVE>\n<road></OpenDRIVE>", encoding="utf-8")
    result = eidrive("check", tmp_path)
    assert result.exit_code == 2
    broken, warned, wrong, count = result.stdout.splitlines()
    assert broken.startswith(f"{tmp_path}/broken.xodr:2: not well-formed XML: ")
    assert warned == (
        f"{tmp_path}/doubtful.xodr:2: road '1' links to junction '4', which does not exist; "
        "remove the link or add the junction (warning: road-link)"
    )
    assert wrong == f"{tmp_path}/wrong.xodr:3: <width> has a='wide'; give a finite number"
    assert count == "4 files, 2 errors, 1 warning"
    doubtful = tmp_path / "doubtful.xodr"
    assert eidrive("check", doubtful).exit_code == 0
    assert eidrive("check", "--strict", doubtful).exit_code == 2
    assert eidrive("check", "--strict", "--ignore", "road-link", doubtful).stdout == "1 file, 0 errors, 0 warnings\n"


UNUSED = (
    "<ParameterDeclarations>",
    '<ParameterDeclarations><ParameterDeclaration name="N" parameterType="int" value="1"/>',
)


def test_check_rule_violation_reports_the_rule_name(eidrive: Eidrive, folder: Callable[..., Path]) -> None:
    path = folder(unused=UNUSED) / "unused.xosc"
    result = eidrive("check", path)
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines() == [
        f"{path}:5: parameter 'N' is never used; remove it, or use its value as $N (warning: unused-parameter)",
        "1 file, 0 errors, 1 warning",
    ]


@pytest.mark.parametrize("named", ["late.yaml", "$Channel", "<!-- of the run -->$Channel"])
def test_check_parameter_in_channel_file_is_used(eidrive: Eidrive, folder: Callable[..., Path], named: str) -> None:
    """The file that an event may select, too; by its name, or by a parameter."""
    command = f'<CustomCommandAction type="eidrive.channel">{named}</CustomCommandAction></UserDefinedAction>'
    place = folder(
        late=("</UserDefinedAction>", f"</UserDefinedAction><UserDefinedAction>{command}"),
    )
    declared = "".join(
        f'<ParameterDeclaration name="{name}" parameterType="{kind}" value="{value}"/>'
        for name, kind, value in (("Late", "double", "0.1"), ("Channel", "string", "late.yaml"), ("Other", "int", "1"))
    )
    path = place / "late.xosc"
    path.write_text(path.read_text().replace(UNUSED[0], UNUSED[0] + declared, 1))
    (place / "late.yaml").write_text("delay: {kind: constant, seconds: '${$Late * 2}'}\n")
    unused = ["Other"] if "$Channel" in named else ["Channel", "Other"]
    shown = re.findall(r"parameter '(\w+)' is never used", eidrive("check", path).stdout)
    assert shown == unused


def test_check_names_in_options_are_used(eidrive: Eidrive, folder: Callable[..., Path]) -> None:
    """A parameter to which a criterion of the option or of its file refers, and one of a driving stack."""
    path = folder(unused=UNUSED) / "unused.xosc"
    limit = path.with_name("limit.yaml")
    limit.write_text("max_speed: {of: Ego, at_most: $N}\n")
    for option in (["--criterion", "{max_speed: {of: Ego, at_most: $N}}"], ["--criterion", str(limit)]):
        assert eidrive("check", path, *option).stdout == "1 file, 0 errors, 0 warnings\n"
    driven = eidrive("check", path, "--drive", "Ego={target_speed: $N}").stdout
    assert "parameter 'N' is never used" not in driven


def test_check_scenario_without_criterion_has_a_note(eidrive: Eidrive, folder: Callable[..., Path]) -> None:
    place = folder(bare=('type="eidrive.criterion"', 'type="other"'))
    done = eidrive("check", place / "bare.xosc", "--strict")
    assert done.exit_code == 0
    assert f"{place}/bare.xosc: the run is not judged: it has no criterion; add one to the scenario" in done.stdout
    assert done.stdout.splitlines()[-1] == "1 file, 0 errors, 0 warnings, 1 note"
    judged = eidrive("check", place / "bare.xosc", "--criterion", "{collision: {of: Ego}}")
    assert judged.stdout == "1 file, 0 errors, 0 warnings\n"


def test_check_strict_with_warning_exits_with_2(eidrive: Eidrive, folder: Callable[..., Path]) -> None:
    place = folder(unused=UNUSED)
    assert eidrive("check", "--strict", place).exit_code == 2
    assert eidrive("check", "--strict", place / "right.xosc").exit_code == 0


def test_check_ignored_rule_is_not_reported(eidrive: Eidrive, folder: Callable[..., Path]) -> None:
    path = folder(unused=UNUSED) / "unused.xosc"
    result = eidrive("check", "--strict", "--ignore", "unused-parameter", path)
    assert (result.exit_code, result.stdout) == (0, "1 file, 0 errors, 0 warnings\n")
    unknown = eidrive("check", "--ignore", "unused-parameters", path)
    assert unknown.exit_code == 2
    assert "did you mean 'unused-parameter'?" in unknown.stderr


def test_check_notes_are_counted_separately(eidrive: Eidrive, folder: Callable[..., Path]) -> None:
    catalog = '<CatalogLocations><RouteCatalog><Directory path="routes"/></RouteCatalog></CatalogLocations>'
    path = folder(noted=("<CatalogLocations/>", catalog)) / "noted.xosc"
    result = eidrive("check", "--strict", path)
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines()[0].endswith("(note: unused-catalog)")
    assert result.stdout.splitlines()[1] == "1 file, 0 errors, 0 warnings, 1 note"


def test_check_unknown_road_in_an_event_is_an_error(eidrive: Eidrive, tmp_path: Path) -> None:
    """The scenario is a library scenario with an event that teleports the Ego to an unknown road."""
    library = Path(__file__).parents[3] / "xosc"
    text = (library / "coop" / "scenario_1.xosc").read_text(encoding="utf-8").replace("../", f"{library}/")
    event = """<Story name="s"><Act name="a"><ManeuverGroup name="g" maximumExecutionCount="1">
        <Actors selectTriggeringEntities="false"><EntityRef entityRef="Ego"/></Actors><Maneuver name="m">
        <Event name="e" priority="parallel"><Action name="jump"><PrivateAction><TeleportAction><Position>
        <LanePosition roadId="nowhere" laneId="-1" s="1"/></Position></TeleportAction></PrivateAction></Action></Event>
        </Maneuver></ManeuverGroup><StartTrigger/></Act></Story>"""
    path = tmp_path / "jump.xosc"
    path.write_text(text.replace("<StopTrigger>", f"{event}<StopTrigger>"), encoding="utf-8")
    result = eidrive("check", path)
    assert result.exit_code == 2, result.output
    assert "LanePosition: unknown road 'nowhere'" in result.stdout
    assert "(error: unresolvable-position)" in result.stdout


def test_check_internal_error_continues_with_other_files(
    eidrive: Eidrive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from eidrive_scenario.checks import scenario_checks

    inspect = scenario_checks.check_scenario

    def raise_for_a(path: Path, ignored: tuple[str, ...], settings: RunSettings) -> object:
        if path.name == "a.xosc":
            raise ZeroDivisionError("division by zero")
        return inspect(path, ignored, settings)

    for name in ("a.xosc", "b.xosc"):
        (tmp_path / name).write_text("<OpenSCENARIO/>")
    monkeypatch.setattr(scenario_checks, "check_scenario", raise_for_a)
    result = eidrive("check", tmp_path)
    assert result.exit_code == 3
    assert f"{tmp_path / 'a.xosc'}: internal error: ZeroDivisionError: division by zero" in result.stderr
    assert f"{tmp_path / 'b.xosc'}:1: " in result.stdout


def test_check_evaluates_stacks_planners_and_criteria_of_options(
    eidrive: Eidrive, passing_by: Path, tmp_path: Path
) -> None:
    (tmp_path / "stack.yaml").write_text("detector: oracle\nspeed: 3\n")
    options = ("--drive", f"Ego={tmp_path}/stack.yaml", "--criterion", "{collision: {of: Egon}}", "--planner", "rout")
    result = eidrive("check", passing_by, *options)
    assert result.exit_code == 2, result.output
    assert "--planner: unknown planner 'rout'; did you mean 'route'?" in result.stdout
    result = eidrive("check", passing_by, *options[:4])
    assert f"{tmp_path}/stack.yaml:2: unknown setting 'speed'" in result.stdout
    assert "--criterion: criterion 'collision': unknown entity 'Egon'; did you mean 'Ego'?" in result.stdout
    assert result.stdout.splitlines()[-1] == "1 file, 2 errors, 0 warnings"


def test_check_warns_of_a_driven_vehicle_that_may_stand_still(
    eidrive: Eidrive, passing_by: Path, tmp_path: Path
) -> None:
    result = eidrive("check", passing_by, "--drive", "Ego", "--strict")
    assert result.exit_code == 2
    expected = f"{passing_by}: no criterion demands that Ego drives on: a vehicle that stands still passes; add one"
    assert result.stdout.startswith(expected)
    result = eidrive("check", passing_by, "--drive", "Ego", "--criterion", "{driven_distance: {of: Ego, at_least: 9}}")
    assert result.stdout == "1 file, 0 errors, 0 warnings\n"


def test_check_empty_path_is_not_the_current_folder(
    eidrive: Eidrive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.xosc").write_text("<OpenSCENARIO/>")
    result = eidrive("check", "")
    assert result.exit_code == 2
    assert result.stdout.splitlines()[-1] == "0 files, 1 error, 0 warnings"


def test_check_circular_selections_are_an_error(eidrive: Eidrive, folder: Callable[..., Path]) -> None:
    ring = '<EntitySelection name="{}"><Members><EntityRef entityRef="{}"/></Members></EntitySelection>'
    rings = ring.format("a", "b") + ring.format("b", "c") + ring.format("c", "a")
    broken = folder(ring=("</Entities>", f"{rings}</Entities>")) / "ring.xosc"
    broken.write_text(broken.read_text().replace('entityRef="Parked"', 'entityRef="a"', 1))
    result = eidrive("check", broken)
    assert result.exit_code == 2, result.output
    assert "selection 'a' is a member of itself" in result.stdout


ENTRY = """<MiscObject name="{name}" miscObjectCategory="obstacle" mass="10">{declared}
<BoundingBox><Center x="{x}" y="0" z="0"/><Dimensions length="1" width="1" height="1"/></BoundingBox></MiscObject>"""
DECLARED = """<ParameterDeclarations><ParameterDeclaration name="Limit" parameterType="{kind}" value="{value}"/>
</ParameterDeclarations>"""


@pytest.mark.parametrize(
    ("entries", "line", "message"),
    [
        ([("a", "", "1"), ("b", "", "1"), ("a", "", "1")], 7, "has a second entry 'a'; the first is at line 3"),
        ([("a", "", "$Limit")], 4, "unknown parameter .Limit"),
        ([("a", DECLARED.format(kind="double", value=""), "$Limit")], 5, "\\$Limit is '', which is not a number"),
        ([("a", DECLARED.format(kind="dbl", value="1"), "$Limit")], 3, "'dbl'"),
    ],
)
def test_check_catalog_without_scenario_reports_errors(
    eidrive: Eidrive, tmp_path: Path, entries: list[tuple[str, str, str]], line: int, message: str
) -> None:
    path = tmp_path / "boxes.xosc"
    text = "\n".join(ENTRY.format(name=name, declared=declared, x=x) for name, declared, x in entries)
    path.write_bytes(catalog_xml("boxes", text))
    result = eidrive("check", path)
    assert result.exit_code == 2, result.output
    assert re.search(rf"^{re.escape(str(path))}:{line}: .*({message})", result.stdout, re.MULTILINE), result.stdout


def test_check_valid_catalog_reports_no_diagnostic(eidrive: Eidrive, tmp_path: Path) -> None:
    path = tmp_path / "boxes.xosc"
    declared = DECLARED.format(kind="double", value="2")
    path.write_bytes(catalog_xml("boxes", ENTRY.format(name="a", declared=declared, x="$Limit")))
    result = eidrive("check", path)
    assert (result.exit_code, result.stdout) == (0, "1 file, 0 errors, 0 warnings\n")


def test_check_folders_named_like_files_are_not_read(eidrive: Eidrive, folder: Callable[..., Path]) -> None:
    place = folder()
    inner = place / "inner.xosc"
    inner.mkdir()
    (inner / "also.xosc").write_bytes((place / "right.xosc").read_bytes())
    (place / "gone").symlink_to(place / "no-such-folder")
    (place / "around").symlink_to(place)
    result = eidrive("check", place)
    assert (result.exit_code, result.stdout) == (0, "2 files, 0 errors, 0 warnings\n")
