"""Commands of the documentation: those that are quick, and the list of all blocks."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
from document_commands import LIST, ROOT, PageCheck, Step, check_page, environment_of, pages, read_list, run_page

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


@pytest.mark.exhaustive
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


def test_claim_is_executed_after_the_blocks(tmp_path: Path) -> None:
    text = "Both fail: 2 of\n2 runs.\n\n```\necho block\n```\n"
    claim = {
        "claim": "2 of 2 runs",
        "setup": ["touch a"],
        "run": [{"command": "ls; false", "exit": 1, "lacks": ["^a"]}],
    }
    check = checked(tmp_path, text, claim, {"start": "echo block"})
    assert check.errors == []
    assert [step.command for step in check.steps] == ["echo block", "touch a", "ls; false"]
    errors = run_page(check, tmp_path, environment_of(Path(sys.executable)))
    assert [error.splitlines()[0] for error in errors] == ["ls; false: prints 'a'"]


def test_claim_that_is_gone_or_has_no_evidence_is_an_error(tmp_path: Path) -> None:
    claims = (
        {"claim": "all runs pass", "run": [{"command": "true", "print": ["a"]}]},
        {"claim": "Some runs fail"},
        {"claim": "Some runs", "test": "tests/test_document_commands.py::test_no_such_test"},
        {"claim": "runs fail", "test": "tests/test_document_commands.py::test_every_page_with_commands_is_listed"},
    )
    check = checked(tmp_path, "Some runs fail.\n", *claims)
    assert [error.partition(": ")[2] for error in check.errors] == [
        "all runs pass: unknown key 'print'",
        "the claim 'all runs pass' is not in the page",
        "the claim 'Some runs fail' has no command, test or reason",
        "no such test: tests/test_document_commands.py::test_no_such_test",
    ]


def test_rows_of_a_written_table_are_in_the_page(tmp_path: Path) -> None:
    text = "| a | b |\n|---|---|\n| x | 1 of 2 |\n| y | \u2013 |\n| w | 2 of 2 |\n"
    run = [
        {
            "command": "printf '| a | b |\\n|---|---|\\n| x |  1 of 2 |\\n| y | - |\\n| z | 0 of 2 |\\n' > t.md",
            "rows": ["t.md", "u.md"],
        }
    ]
    errors = run_page(
        checked(tmp_path, text, {"claim": "1 of 2", "run": run}), tmp_path, environment_of(Path(sys.executable))
    )
    assert [error.splitlines()[0].rpartition("t.md: ")[2] for error in errors] == [
        "does not write u.md",
        "t.md has the row | z | 0 of 2 |, which is not in the page",
    ]


MEASURED = re.compile(r"[Ss]eeds 1 to \d+|\b(six|\d+) seeds\b")
"""Texts about outcomes over seeds."""
NOT_EXECUTED = {"docs/first_scenario.md", "docs/reinforcement_learning.md"}
"""Pages that a separate test executes."""


@pytest.mark.parametrize("page", ["README.md", *sorted(f"docs/{path.name}" for path in (ROOT / "docs").glob("*.md"))])
def test_every_page_with_outcomes_over_seeds_has_claims(page: str) -> None:
    """A table of such outcomes is a claim, which is executed, or has a reason for which it is not."""
    if page in NOT_EXECUTED or not MEASURED.search((ROOT / page).read_text(encoding="utf-8")):
        return
    listed = LISTED.get(page, ())
    assert any("claim" in entry for entry in listed if not isinstance(entry, str)), f"{page}: add claims to {LIST.name}"
