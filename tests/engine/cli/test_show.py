"""Commands `eidrive list`, `tree`, `view`, `report` and `--help`."""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any, get_args

import pytest
from command_fixtures import Eidrive
from lxml import html
from report_table import report_data

from eidrive_scenario.cli.show import Names
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.experiments.sweeps.store import ResultStore
from eidrive_scenario.extensions.library import library_path
from eidrive_scenario.extensions.project import GROUPS
from eidrive_scenario.extensions.registry import register, registry


def test_help_lists_commands_without_importing_engine() -> None:
    script = (
        "import sys; from eidrive_scenario.cli import app\n"
        "try:\n    app(['--help'])\nexcept SystemExit as end:\n    assert end.code == 0, end.code\n"
        "heavy = {'numpy', 'pybullet', 'pydantic', 'eidrive_scenario.simulation'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for command in ("run", "check", "list", "tree", "view", "judge", "report"):
        assert f" {command} " in done.stdout


def test_version_option_prints_version(eidrive: Eidrive) -> None:
    assert eidrive("--version").stdout.startswith("eidrive-scenario ")


@pytest.mark.parametrize(
    ("what", "expected"),
    [
        ("scenarios", "coop/scenario_1"),
        ("channels", "none"),
        ("weather", "foggy_morning"),
        ("catalogs", "vehicles"),
        ("criteria", "min_distance"),
        ("detectors", "oracle"),
        ("fusion", "average"),
        ("planners", "conflict_area"),
        ("controllers", "alks"),
        ("actions", "SpeedAction"),
        ("conditions", "SimulationTimeCondition"),
        ("rules", "unobserved-edge"),
        ("roads", "coop_1"),
        ("properties", "station"),
    ],
)
def test_list_prints_names_of_each_kind(eidrive: Eidrive, what: str, expected: str) -> None:
    result = eidrive("list", what)
    assert result.exit_code == 0
    assert expected in [line.split()[0] for line in result.stdout.splitlines()]


def test_list_has_every_group_of_extensions() -> None:
    assert set(GROUPS) <= set(get_args(Names))


def test_list_of_scenarios_shows_name_family_and_description(eidrive: Eidrive) -> None:
    lines = eidrive("list", "scenarios").stdout.splitlines()
    rows = {columns[0]: columns[1:] for columns in (re.split("  +", line) for line in lines)}
    assert rows["coop/scenario_1"] == ["coop", "Coop. scenario 1: collision avoidance with a roadside unit"]
    assert rows["ei/scenario_18"] == ["ei", "EI 18: jaywalking pedestrian"]


def test_list_without_argument_prints_scenarios(eidrive: Eidrive) -> None:
    assert eidrive("list").stdout == eidrive("list", "scenarios").stdout


def test_list_of_roads_shows_length_lanes_and_file(eidrive: Eidrive) -> None:
    """The road two_lane_road is 420 m long, with one driving lane in each direction."""
    rows = [re.split("  +", line) for line in eidrive("list", "roads").stdout.splitlines()]
    assert rows[0] == ["NAME", "LENGTH", "ROADS", "DRIVING LANES", "FILE"]
    (row,) = (row for row in rows if row[0] == "two_lane_road")
    assert row[1:4] == ["420 m", "1", "2"]
    assert Path(row[4]).is_file()


def test_list_of_properties_shows_type_default_and_unit(eidrive: Eidrive) -> None:
    """Types and defaults are those of the settings models, units those of their documentation."""
    lines = eidrive("list", "properties").stdout.splitlines()
    starts = [lines[0].index(name) for name in ("OWNER", "KEY", "TYPE", "DEFAULT", "UNIT", "TEXT")]
    cells = [[line[a:b].strip() for a, b in zip(starts, [*starts[1:], None], strict=True)] for line in lines[1:]]
    rows = {(owner, key): rest[:3] for owner, key, *rest in cells}
    assert rows["station", "message_rate"] == ["number | none", "none", "Hz"]
    assert rows["station", "generation"] == ["each_tick | rate | etsi | none", "none", ""]
    assert rows["station", "clock_drift"] == ["number", "0", "parts per million"]
    assert rows["planner behavior", "acceleration"] == ["number", "1.5", "m/s²"]
    assert rows["sensor lidar", "channels"] == ["integer", "32", ""]
    assert rows["sensor truth", "mount.yaw"] == ["number", "0", "degrees"]
    assert rows["channel composed", "delay.uniform.maximum"] == ["number", "required", "s"]
    assert rows["channel radio", "tx_power_dbm"][2] == "dBm"
    assert rows["criterion min_distance", "at_least"][2] == "m"
    assert rows["criterion comfort", "jerk"] == ["number", "8.37", "m/s³"]
    assert {key for owner, key in rows if owner == "station"} >= set(AgentSettings.model_fields)
    texts = {(owner, key): rest[-1] for owner, key, *rest in cells}
    assert texts["detector ssd", "device"].startswith("`cuda` executes .npz and .pt")
    assert all(re.match(r"[\w`.(]", text) and not text.endswith(",") for text in texts.values() if text)
    assert texts["sensor camera", "exposure_time"] == "None: automatic, within the maxima"
    assert texts["station", "false_objects.speed"] == "of its motion"
    assert texts["planner behavior", "time_gap"].startswith("parameters of the Intelligent Driver Model, by")
    assert rows["sensor camera", "max_gain"] == ["number", "36", "dB"]
    assert [rows["detector ssd", key][2] for key in ("classes", "input_size", "layout")] == ["", "px", ""]
    assert [rows["criterion actor_blocked", key][2] for key in ("at_most", "below")] == ["s", "m/s"]
    assert [rows["criterion in_route", key][2] for key in ("at_most", "beyond", "share")] == ["m", "m", ""]


def test_list_of_properties_names_extensions_that_do_not_load(eidrive: Eidrive) -> None:
    register("fusion", "broken", "nowhere:Nothing")
    try:
        result = eidrive("list", "properties")
    finally:
        registry("fusion")._points.pop("broken")
    assert result.exit_code == 0
    assert "warning: no keys of fusion method broken: fusion method 'broken' (nowhere:Nothing)" in result.stderr
    assert "fusion method average" not in result.stderr


@pytest.mark.parametrize("suffix", ["svg", "pdf", "png"])
def test_draw_writes_picture_of_scenario(eidrive: Eidrive, tmp_path: Path, suffix: str) -> None:
    out = tmp_path / f"picture.{suffix}"
    result = eidrive("draw", "coop/scenario_1", "--out", out, "--size", "85x60")
    assert (result.exit_code, result.stdout) == (0, f"{out}\n"), result.output
    assert out.read_bytes()[:5] in (b"<?xml", b"%PDF-", b"\x89PNG\r")


def test_draw_of_roads_has_no_stations(eidrive: Eidrive, tmp_path: Path) -> None:
    road = library_path() / "roads" / "coop_1.xodr"
    assert eidrive("draw", road, "-o", tmp_path / "roads.svg").exit_code == 0
    result = eidrive("draw", road, "--station", "Ego")
    assert (result.exit_code, "a road file has no station" in result.stderr) == (2, True)


def test_draw_does_not_overwrite_its_input(eidrive: Eidrive, tmp_path: Path) -> None:
    copy = tmp_path / "scenario.svg"
    copy.write_bytes((library_path() / "roads" / "coop_1.xodr").read_bytes())
    result = eidrive("draw", copy, "--out", copy)
    assert (result.exit_code, "--out would overwrite an input file" in result.stderr) == (2, True)


def test_view_writes_vector_figures(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    eidrive("run", passing_by, "--out", tmp_path)
    files = {suffix: tmp_path / f"a.{suffix}" for suffix in ("png", "svg", "pdf")}
    result = eidrive("view", tmp_path, *[word for suffix, file in files.items() for word in (f"--{suffix}", file)])
    assert result.stdout.split() == [str(file) for file in files.values()]
    assert [file.read_bytes()[:5] for file in files.values()] == [b"\x89PNG\r", b"<?xml", b"%PDF-"]
    for option, name in (("--png", "b.pdf"), ("--gif", "b.mp4"), ("--mp4", "b.gif")):
        result = eidrive("view", tmp_path, option, tmp_path / name)
        hint = f"give a file name in {option.replace('--', '.')}"
        assert (result.exit_code, result.stderr) == (
            2,
            f"{option}: unknown format (got {str(tmp_path / name)!r}); {hint}\n",
        )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["view", "RUN", "--size", "85x60"], "--size without a picture has no effect; add --png, --svg or --pdf FILE"),
        (["view", "RUN", "--at", "1"], "--at without a picture has no effect; add --png, --svg or --pdf FILE"),
        (["report", "RUN", "--size", "85x60"], "--size without --figures has no effect; add --figures DIR"),
    ],
)
def test_option_without_its_picture_is_refused(
    eidrive: Eidrive, passing_by: Path, tmp_path: Path, arguments: list[str], message: str
) -> None:
    eidrive("run", passing_by, "--out", tmp_path)
    result = eidrive(*[tmp_path if word == "RUN" else word for word in arguments])
    assert (result.exit_code, result.stderr) == (2, f"{message}\n")


def test_report_writes_curves_as_figures(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    """Two values of one parameter with two seeds each make one curve."""
    store = tmp_path / "sweep.db"
    eidrive("sweep", passing_by, "--vary", "OtherY=0,8", "--seeds", "1-2", "--store", store, "--workers", "1")
    result = eidrive("report", store, "--figures", tmp_path / "figures")
    assert result.exit_code == 0, result.output
    assert [path.name for path in sorted((tmp_path / "figures").iterdir())] == [
        "passing_by-OtherY.pdf",
        "passing_by-OtherY.svg",
    ]


def test_report_without_curve_warns(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    eidrive("run", passing_by, "--out", tmp_path / "run", "--no-record")
    result = eidrive("report", tmp_path / "run", "--figures", tmp_path / "figures")
    reason = "no number varies between its runs of sweeps (give their stores) and of distributions"
    assert (result.exit_code, reason in result.stderr) == (0, True)


def test_tree_prints_storyboard(eidrive: Eidrive, passing_by: Path) -> None:
    result = eidrive("tree", passing_by)
    assert result.exit_code == 0, result.output
    assert "3" in result.stdout


def test_view_writes_page_beside_recording(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    eidrive("run", passing_by, "--out", tmp_path)
    result = eidrive("view", tmp_path)
    assert result.exit_code == 0, result.output
    (page,) = tmp_path.rglob("recording.html")
    assert result.stdout.strip() == str(page)
    shown: Any = html.fromstring(page.read_bytes())
    verdict = shown.get_element_by_id("verdict").text_content()
    assert "Ego and Parked came within 5.00 m (center to center) at 2.00 s, boxes within 3.00 mlimit 3.00 m" in verdict


def test_view_of_parent_folder_requires_single_run(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    result = eidrive("view", tmp_path)
    assert result.exit_code == 2
    assert f"{tmp_path}: no recording.mcap in this folder; eidrive run … --out DIR writes a recording" in result.stderr
    eidrive("run", passing_by, "--out", tmp_path / "one")
    assert eidrive("view", tmp_path).exit_code == 0, "the only recording is selected"
    eidrive("run", passing_by, "--out", tmp_path / "one", "--seed", "2")
    result = eidrive("view", tmp_path)
    assert result.exit_code == 2
    assert f"{tmp_path}: 2 recordings are below this folder; give one of its folders: one/passing_by-" in result.stderr


def test_page_of_unwritable_path_is_invalid_input(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    eidrive("run", passing_by, "--out", tmp_path)
    (tmp_path / "file").touch()
    for arguments in (("view", tmp_path, "-o", tmp_path), ("report", tmp_path, "-o", tmp_path / "file")):
        result = eidrive(*arguments)
        assert result.exit_code == 2, result.output
        assert "cannot write" in result.stderr


def test_view_of_other_file_is_invalid_input(eidrive: Eidrive, passing_by: Path) -> None:
    result = eidrive("view", passing_by)
    assert result.exit_code == 2
    assert f"{passing_by}: not an MCAP file" in result.stderr


def test_report_of_runs_writes_page(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    eidrive("run", passing_by, "--out", tmp_path / "runs" / "far", "--no-record", "--repeat", "2")
    eidrive("run", passing_by, "--out", tmp_path / "runs" / "near", "--no-record", "--param", "OtherY=0")
    result = eidrive("report", tmp_path / "runs", "-o", tmp_path / "report")
    assert result.exit_code == 0, result.output
    page = Path(result.stdout.strip())
    assert page.is_relative_to(tmp_path / "report")
    assert "hit each other" in page.read_text(encoding="utf-8")
    beside = Path(eidrive("report", tmp_path / "runs").stdout.strip())
    assert beside == tmp_path / "runs" / "report.html"
    assert report_data(beside) == report_data(page)


def without_seed(file: Path) -> Path:
    content = json.loads(file.read_text())
    del content["seed"]
    file.write_text(json.dumps(content))
    return file


@pytest.mark.parametrize("text", ["", "[1]", '{"trace_hash": ""}'])
def test_view_of_damaged_result_shows_the_run_without_verdicts(
    eidrive: Eidrive, passing_by: Path, tmp_path: Path, text: str
) -> None:
    eidrive("run", passing_by, "--out", tmp_path)
    (file,) = tmp_path.glob("*/result.json")
    file.write_text(text)
    page, picture = tmp_path / "page.html", tmp_path / "picture.svg"
    for option, out in (("--out", page), ("--svg", picture)):
        result = eidrive("view", file.parent, option, out)
        assert result.exit_code == 0
        assert result.stderr.startswith(
            f"warning: {file.with_name('recording.mcap')}: the verdicts are not shown: {file}: "
        )
        assert out.stat().st_size
    assert "the verdicts are not shown" in page.read_text(encoding="utf-8")


def test_report_omits_damaged_results_with_warning(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    """Of four results one is cut off, one has no seed and one is empty; the page lists the three."""
    eidrive("run", passing_by, "--out", tmp_path, "--no-record", "--repeat", "4")
    cut, seedless, empty, _ = sorted(tmp_path.glob("*/result.json"))
    cut.write_bytes(cut.read_bytes()[:100])
    without_seed(seedless)
    empty.write_bytes(b"")
    result = eidrive("report", tmp_path)
    assert result.exit_code == 0, result.output
    warnings = result.stderr.splitlines()
    assert [line.split(": ")[:2] for line in warnings] == [["warning", str(one)] for one in (cut, seedless, empty)]
    assert warnings[1] == f"warning: {seedless}: result: 'seed': field required, the report omits it"
    page = Path(result.stdout.strip()).read_text(encoding="utf-8")
    assert "1 run:" in page
    assert "3 runs are omitted" in page
    assert all(str(one) in page for one in (cut, seedless, empty))


@pytest.mark.parametrize("others", [0, 1])
def test_report_of_given_damaged_file_is_invalid_input(
    eidrive: Eidrive, passing_by: Path, tmp_path: Path, others: int
) -> None:
    """A file that the command line names is never omitted, with and without other results."""
    eidrive("run", passing_by, "--out", tmp_path / "runs", "--no-record")
    (tmp_path / "result.json").write_text("{")
    result = eidrive("report", tmp_path / "result.json", *[tmp_path / "runs"] * others, "-o", tmp_path / "report")
    assert result.exit_code == 2
    assert result.stderr.startswith(f"{tmp_path / 'result.json'}: not JSON: ")
    assert not (tmp_path / "report").exists()


def test_report_of_damaged_results_only_is_invalid_input(eidrive: Eidrive, tmp_path: Path) -> None:
    (tmp_path / "result.json").write_text("{")
    result = eidrive("report", tmp_path, "-o", tmp_path / "report")
    assert result.exit_code == 2
    assert result.stderr.startswith(f"{tmp_path / 'result.json'}: not JSON: ")


def test_report_without_runs_is_invalid_input(eidrive: Eidrive, tmp_path: Path) -> None:
    result = eidrive("report", tmp_path, "-o", tmp_path / "report")
    assert result.exit_code == 2
    assert "no result.json in" in result.stderr


def test_report_of_store_without_runs_is_invalid_input(eidrive: Eidrive, tmp_path: Path) -> None:
    store = tmp_path / "sweep.db"
    with ResultStore.open(store, {}):
        pass
    result = eidrive("report", store, "-o", tmp_path / "report")
    assert result.exit_code == 2
    assert result.stderr.startswith(f"no run in {store}; ")
    result = eidrive("report", store, tmp_path, "-o", tmp_path / "report")
    assert result.stderr.startswith(f"no run in {store}, and no result.json in {tmp_path}; ")


def test_tree_with_svg_option_draws_diagram(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    diagram = tmp_path / "tree.svg"
    result = eidrive("tree", passing_by, "--svg", diagram)
    assert (result.exit_code, result.stdout.strip()) == (0, str(diagram))
    assert "simulation time ≥ 3 s" in diagram.read_text(encoding="utf-8")


def test_view_shows_verdicts_of_result_beside_recording(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    eidrive("run", passing_by, "--param", "OtherY=0", "--out", tmp_path)
    eidrive("view", tmp_path)
    (kept,) = tmp_path.rglob("result.json")
    page = kept.with_name("recording.html")
    assert "Ego and Parked hit each other" in page.read_text(encoding="utf-8")
    kept.unlink()
    eidrive("view", tmp_path)
    assert "<h3>Verdict" not in page.read_text(encoding="utf-8")


def test_view_of_two_runs_writes_page_with_both_verdicts(eidrive: Eidrive, passing_by: Path, tmp_path: Path) -> None:
    """The ego hits the parked car in the first run, and passes it in the second."""
    eidrive("run", passing_by, "--param", "OtherY=0", "--out", tmp_path / "a")
    eidrive("run", passing_by, "--out", tmp_path / "b")
    result = eidrive("view", tmp_path / "a", tmp_path / "b")
    assert result.exit_code == 0, result.output
    page = next((tmp_path / "a").rglob("two-runs.html"))
    assert result.stdout.strip() == str(page)
    text = page.read_text(encoding="utf-8")
    assert "Verdict of A" in text
    assert "Verdict of B" in text
    assert "Ego and Parked hit each other" in text
    assert "$OtherY" in text.split("Differences of the runs")[1].split("</dl>")[0]


def test_view_of_two_runs_makes_no_pictures_and_keeps_recordings(
    eidrive: Eidrive, passing_by: Path, tmp_path: Path
) -> None:
    eidrive("run", passing_by, "--out", tmp_path / "a")
    result = eidrive("view", tmp_path / "a", tmp_path / "a", "--png", tmp_path / "a.png")
    assert (result.exit_code, "show one recording" in result.stderr) == (2, True)
    (recording,) = (tmp_path / "a").rglob("recording.mcap")
    result = eidrive("view", tmp_path / "a", recording, "-o", recording)
    assert result.exit_code == 2
    assert eidrive("view", tmp_path / "a", tmp_path).exit_code == 0, "a run over itself"


@pytest.mark.parametrize("arguments", [["view"], ["report", "-o", "page"]])
def test_too_long_file_name_is_invalid_input(eidrive: Eidrive, arguments: list[str]) -> None:
    result = eidrive(*arguments, "x" * 300)
    assert result.exit_code == 2
    assert "cannot read: File name too long" in result.stderr
