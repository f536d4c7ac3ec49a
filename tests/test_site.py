"""Documentation site: it builds without a warning, and describes each public name once."""

from __future__ import annotations

import importlib
import inspect
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
from api_docstrings import to_rest

ROOT = Path(__file__).parents[1]


pytestmark = pytest.mark.timeout(600)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the site, built without the pages of source code."""
    folder = tmp_path_factory.mktemp("site")
    options = ("-W", "--keep-going", "-q", "-D", "extensions=myst_parser,sphinx.ext.autodoc")
    command = [sys.executable, "-m", "sphinx", *options, str(ROOT / "docs"), str(folder)]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return folder


@pytest.mark.process
def test_site_has_every_page_and_picture(site: Path) -> None:
    for page in (ROOT / "docs").glob("*.md"):
        assert (site / f"{page.stem}.html").is_file()
    library = (site / "library.html").read_text(encoding="utf-8")
    for picture in (ROOT / "docs" / "library").glob("*.png"):
        assert f'src="_images/{picture.name}"' in library
        assert (site / "_images" / picture.name).is_file()


@pytest.mark.process
def test_reference_describes_each_public_name_once(site: Path) -> None:
    modules = [path.stem for path in (ROOT / "eidrive_scenario" / "api").glob("*.py") if path.stem != "__init__"]
    described: Counter[str] = Counter()
    wanted: set[str] = set()
    for name in modules:
        text = (site / "api" / f"{name}.html").read_text(encoding="utf-8")
        ids = re.findall(r'<dt class="sig[^>]* id="([^"]+)"', text)
        described.update(found.removeprefix(f"eidrive_scenario.api.{name}.") for found in ids)
        module = importlib.import_module(f"eidrive_scenario.api.{name}")
        for entry in (name for name in vars(module) if name[0].isalpha()):
            thing = getattr(module, entry)
            if inspect.isclass(thing) or inspect.isroutine(thing):
                wanted.add(entry)
            assert entry in text
    assert {entry: described[entry] for entry in wanted} == dict.fromkeys(wanted, 1)


def test_tables_in_docstrings_become_definitions() -> None:
    lines = ["Return a path.", "", "x, y  (N,) places [m]; `None`", "      is the start", "*args  others", "", "More."]
    assert to_rest(lines) == [
        "Return a path.",
        "",
        "``x, y``",
        "    (N,) places [m]; ``None``",
        "    is the start",
        "``*args``",
        "    others",
        "",
        "More.",
    ]
