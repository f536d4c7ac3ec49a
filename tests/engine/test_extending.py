"""Execution of docs/extending.md: its files are written, its package is installed, its commands are run."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest
from command_fixtures import Eidrive, eidrive

from eidrive_scenario.extensions import registry
from eidrive_scenario.extensions.project import GROUPS

__all__ = ["eidrive"]

GUIDE = Path(__file__).parents[2] / "docs" / "extending.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
BLOCKS = BLOCK.findall(GUIDE.read_text(encoding="utf-8"))
NAMED = re.compile(r"\A(?:# (\S+\.py)|<!-- (\S+) -->)\n")
MAX_LINES = 30
"""Maximum number of lines of an example."""
GENERATED_FILES = ("red.onnx", "red.pt")
"""Files that the script of the page writes."""


def commands() -> list[tuple[str, tuple[str, ...]]]:
    """Return the commands of the page, each with the lines that its output must contain."""
    found: list[tuple[str, list[str]]] = []
    for kind, text in BLOCKS:
        if kind == "console":
            for line in text.splitlines():
                if line.startswith("$ "):
                    found.append((line[2:], []))
                else:
                    found[-1][1].append(line)
    return [(command, tuple(lines)) for command, lines in found]


def scripts() -> list[str]:
    """Return the commands that create files for later commands."""
    return [command for command, _ in commands() if command.startswith("python ")]


def files() -> dict[str, str]:
    """Return the files of the page by name; the parts of pyproject.toml are joined."""
    found = {"pyproject.toml": "\n".join(text for kind, text in BLOCKS if kind == "toml")}
    for kind, text in BLOCKS:
        name = NAMED.match(text)
        if name is not None:
            found[name[1] or name[2]] = text if kind == "python" else text[name.end() :]
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Write the files, and beside them the metadata that `pip install -e .` would create from pyproject.toml."""
    folder = tmp_path_factory.mktemp("acme")
    for name, text in files().items():
        (folder / name).write_text(text, encoding="utf-8")
    project = tomllib.loads((folder / "pyproject.toml").read_text())["project"]
    metadata = folder / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    points = [
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in entries.items())
        for group, entries in project["entry-points"].items()
    ]
    (metadata / "entry_points.txt").write_text("\n".join(points))
    registry._registries.clear()
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        yield folder
    registry._registries.clear()
    for path in folder.glob("*.py"):
        sys.modules.pop(path.stem, None)


@pytest.fixture(scope="module")
def made(folder: Path) -> Path:
    """Return the folder after its scripts have run; skip without the packages of their section."""
    if not all(map(find_spec, ("torch", "onnxscript"))):
        pytest.skip("needs the extras 'learned' and 'dev'")
    for script in scripts():
        command = [sys.executable, *shlex.split(script)[1:]]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_guide_has_an_example_of_every_kind_of_extension() -> None:
    project = tomllib.loads(files()["pyproject.toml"])
    points = project["project"]["entry-points"]
    assert {group.removeprefix("eidrive_scenario.") for group in points} == set(GROUPS)
    modules = [value.partition(":")[0] for entries in points.values() for value in entries.values()]
    assert len(modules) == len(set(modules)), "an extension is one module and one entry point"
    assert set(modules) == set(project["tool"]["setuptools"]["py-modules"])
    written = {name for name in files() if name.endswith(".py")} - {script.split()[1] for script in scripts()}
    assert {f"{module}.py" for module in modules} == written


@pytest.mark.parametrize("name", sorted(name for name in files() if name.endswith(".py")))
def test_guide_examples_are_short_and_import_the_api_only(name: str) -> None:
    lines = files()[name].splitlines()
    code = [line for line in lines[1:] if line.strip()]
    assert len(code) <= MAX_LINES
    ours = [line for line in lines if "eidrive" in line and "import" in line]
    assert all(line.startswith("from eidrive_scenario.api.") for line in ours)


@pytest.mark.process
@pytest.mark.parametrize(("command", "expected"), commands(), ids=[command for command, _ in commands()])
def test_guide_commands_print_the_expected_lines(
    folder: Path,
    command: str,
    expected: tuple[str, ...],
    eidrive: Eidrive,
    request: pytest.FixtureRequest,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A run with failed criteria exits with 1, an interrupted one with 3."""
    program, *arguments = shlex.split(command)
    if program == "pip":
        assert arguments[0] == "install"  # the package is installed by the fixture: tests have no network
        return
    if program == "python" or any(name in command for name in GENERATED_FILES):
        request.getfixturevalue("made")
    if program == "python":
        assert all((folder / name).is_file() for name in GENERATED_FILES)
        return
    assert program == "eidrive"
    monkeypatch.chdir(folder)
    done = eidrive(*arguments)
    shown = " ".join(expected)
    assert done.exit_code == (1 if "failed" in shown else 3 if "time limit" in shown else 0), done.output
    printed = " ".join(done.stdout.split())
    for line in expected:
        assert " ".join(line.split()) in printed
