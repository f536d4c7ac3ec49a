"""docs/python_api.md: its files are written, its blocks executed in their order, their outputs compared."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "python_api.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
BLOCKS = BLOCK.findall(PAGE.read_text(encoding="utf-8"))
FILE = re.compile(r"<!-- (\S+) -->\n")


def test_page_has_no_other_blocks() -> None:
    assert {kind for kind, _ in BLOCKS} == {"python", "text", "xml"}


@pytest.mark.statistical
def test_blocks_of_the_page_run_and_print_the_stated_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    expected = ""
    skipped = False
    for number, (kind, text) in enumerate(BLOCKS):
        if kind == "xml":
            name = FILE.match(text)
            assert name is not None, text
            Path(name[1]).write_text(text[name.end() :], encoding="utf-8")
        elif kind == "python":
            skipped = _lacks_pandas(text)
            if not skipped:
                exec(compile(text, f"{PAGE.name} block {number}", "exec"), names)
            expected = (
                BLOCKS[number + 1][1] if BLOCKS[number + 1 : number + 2] and BLOCKS[number + 1][0] == "text" else ""
            )
            printed = "".join(f"{line.rstrip()}\n" for line in capsys.readouterr().out.splitlines())
            wanted = "".join(f"{line.rstrip()}\n" for line in expected.splitlines())
            assert skipped or printed == wanted, text


def _lacks_pandas(text: str) -> bool:
    """Whether a block needs pandas where it is not installed: it is no part of the project."""
    if "import pandas" not in text:
        return False
    try:
        import pandas  # noqa: F401
    except ImportError:
        return True
    return False
