"""Commands of the documentation: those that are quick, and the list of all blocks."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from document_commands import LIST, PageCheck, Step, check_page, environment_of, pages, read_list, run_page

LISTED = read_list()
EXECUTED = sorted(page for page, listed in LISTED.items() if not isinstance(listed, str))


def checked(folder: Path, text: str, *entries: object) -> PageCheck:
    """Return the check of a page with this text, whose blocks have these entries."""
    (folder / "page.md").write_text(text, encoding="utf-8")
    return check_page(str(folder / "page.md"), list(entries), slow=True)


def test_every_page_with_commands_is_listed() -> None:
    assert [page for page in pages() if page not in LISTED] == [], f"add it to {LIST.name}"


@pytest.mark.parametrize("page", sorted(LISTED))
def test_every_block_of_a_page_is_listed(page: str) -> None:
    assert check_page(page, LISTED[page], slow=True).errors == []


@pytest.mark.timeout(900)
@pytest.mark.parametrize("page", [page for page in EXECUTED if check_page(page, LISTED[page], slow=False).steps])
def test_quick_commands_of_a_page_keep_their_promises(page: str, tmp_path: Path) -> None:
    errors = run_page(check_page(page, LISTED[page], slow=False), tmp_path, environment_of(Path(sys.executable)))
    assert not errors, "\n".join(errors)


def test_block_that_is_not_listed_is_an_error(tmp_path: Path) -> None:
    check = checked(tmp_path, "```\neidrive run x\n```\n\n```python\nx = 1\n```\n")
    assert len(check.errors) == 1
    assert "'eidrive run x' is not in document_commands.yaml" in check.errors[0]


def test_listed_block_or_command_that_is_gone_is_an_error(tmp_path: Path) -> None:
    text = "```\ntrue\n```\n"
    check = checked(tmp_path, text, {"start": "true", "lines": {"false": {"exit": 1}}}, {"start": "eidrive"})
    assert [error.partition(": ")[2] for error in check.errors] == [
        "the block with the first line 'eidrive' is not in the page",
        "no command of the block begins with 'false'",
    ]


def test_exit_code_of_the_page_is_a_promise(tmp_path: Path) -> None:
    check = checked(
        tmp_path,
        "```\nexit 1  # failed: exit code 1\nexit 0  # exit code 3\n```\n",
        {"start": "exit 1  # failed: exit code 1"},
    )
    errors = run_page(check, tmp_path, environment_of(Path(sys.executable)))
    assert errors == ["exit 0  # exit code 3: exit code 0 (expected 3)\n"]


def test_shown_lines_files_and_patterns_are_promises(tmp_path: Path) -> None:
    text = "```console\n$ echo one   two; touch a\none two\n$ echo three\n…\nfour\n```\n"
    lines = {"echo one": {"files": ["a", "b"], "prints": ["^one", "five"]}}
    check = checked(tmp_path, text, {"start": "$ echo one   two; touch a", "lines": lines})
    assert check.steps[1] == Step("echo three", shown=("four",))
    errors = run_page(check, tmp_path, environment_of(Path(sys.executable)))
    assert [error.splitlines()[0] for error in errors] == [
        "echo one   two; touch a: does not print 'five'",
        "echo one   two; touch a: does not write b",
        "echo three: does not print 'four'",
    ]


def test_skipped_slow_and_optional_blocks_state_their_reason(tmp_path: Path) -> None:
    text = "```\na\n```\n\n```\nb\n```\n"
    check = checked(tmp_path, text, {"start": "a", "skip": "network"}, {"start": "b", "needs": ["no_such_module"]})
    assert check.steps == []
    assert [line.split(": ", 1)[1] for line in check.skipped] == ["a: network", "b: no_such_module is not installed"]
