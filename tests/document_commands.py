"""Commands and claims of the documentation, executed in a clean environment: `python tests/document_commands.py …`.

`document_commands.yaml` lists the code blocks of each page in their order, with what is checked or why a block is not
executed, and its claims about outcomes: sentences and tables, each with the commands that show it, or with the test of
the suite that does. Exit codes beside a command ("# … exit code 1"), and the lines below it in a block with `$`, are
the promises of the page itself. By default the commands run in a new environment with a wheel of this checkout, whose
dependencies are those of this Python. The exit status is 1 if a promise is not kept, a block is not listed, or a listed
block, claim or test is gone.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import re
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from wheel_project import install

ROOT = Path(__file__).parents[1]
LIST = Path(__file__).with_suffix(".yaml")
LIMIT = 1800.0
"""Maximum duration of a command [s]."""
_FENCE = re.compile(r"^```([^\n`]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_EXIT_CODE = re.compile(r"#.*exit code (\d)")
_COMMANDS = ("", "console", "bash", "sh", "shell")
"""Languages of blocks that may be commands. Each of them is listed, as are all blocks that are executed."""
_KEYS = frozenset({"start", "skip", "output", "file", "before", "setup", "run", "lines", "slow", "needs", "python"})
_CLAIM_KEYS = frozenset({"claim", "skip", "test", "setup", "run", "slow", "needs"})
_LINE_KEYS = frozenset({"skip", "exit", "files", "prints", "lacks", "rows"})


@dataclass(frozen=True)
class Block:
    """Code block of a page: language and text."""

    kind: str
    text: str

    @property
    def start(self) -> str:
        """First line."""
        return self.text.partition("\n")[0].strip()


@dataclass(frozen=True)
class Step:
    """Command with its promises.

    exits   permitted exit codes
    shown   lines of the page that the output contains
    files   files that exist afterwards
    prints  regular expressions that the output matches
    lacks   regular expressions that it does not match
    rows    files with Markdown tables whose rows are in the page
    """

    command: str
    exits: tuple[int, ...] = (0,)
    shown: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    prints: tuple[str, ...] = ()
    lacks: tuple[str, ...] = ()
    rows: tuple[str, ...] = ()


@dataclass
class PageCheck:
    """Steps of a page, and the messages about blocks that are listed wrongly.

    text     text of the page
    files    texts that are written before the step with this index
    skipped  commands that are not executed, with reasons
    """

    text: str = ""
    steps: list[Step] = field(default_factory=list)
    files: dict[int, list[tuple[str, str]]] = field(default_factory=dict)
    skipped: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)


def blocks_of(page: Path) -> list[Block]:
    """Return all code blocks of a page."""
    return [Block(kind, text) for kind, text in _FENCE.findall(page.read_text(encoding="utf-8"))]


def read_list() -> dict[str, Any]:
    """Return the listed pages."""
    listed: dict[str, Any] = yaml.safe_load(LIST.read_text(encoding="utf-8"))
    return listed


def pages() -> list[str]:
    """Return the pages with blocks that may be commands."""
    found = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
    return [
        path.relative_to(ROOT).as_posix() for path in found if any(block.kind in _COMMANDS for block in blocks_of(path))
    ]


def check_page(page: str, listed: Any, *, slow: bool) -> PageCheck:
    """Return the steps of a page.

    listed  entry of the page: blocks, or the test that executes the page
    slow    whether blocks that take long are included
    """
    check = PageCheck((ROOT / page).read_text(encoding="utf-8"))
    if isinstance(listed, str):
        if not (ROOT / listed).is_file():
            check.errors.append(f"{page}: no such test: {listed}")
        check.skipped.append(f"{page}: executed by {listed}")
        return check
    claims = [entry for entry in listed if "claim" in entry]
    entries = {str(entry.get("start")): entry for entry in listed if "claim" not in entry}
    for entry in listed:
        unknown = sorted(set(entry) - (_CLAIM_KEYS if "claim" in entry else _KEYS))
        for given in (*entry.get("lines", {}).values(), *entry.get("run", ())):
            unknown += sorted(set(given) - _LINE_KEYS - {"command"})
        check.errors += [f"{page}: {_title(entry)}: unknown key {name!r}" for name in unknown]
    found = blocks_of(ROOT / page)
    check.errors += [
        f"{page}: the block with the first line {start!r} is not in the page"
        for start in entries
        if start not in {block.start for block in found}
    ]
    for block in found:
        entry = entries.get(block.start)
        if entry is not None:
            _add_block(check, page, block, entry, slow=slow)
        elif block.kind in _COMMANDS:
            check.errors.append(f"{page}: the block with the first line {block.start!r} is not in {LIST.name}")
    for entry in claims:
        _add_claim(check, page, entry, slow=slow)
    return check


def _title(entry: Mapping[str, Any]) -> str:
    return str(entry.get("claim", entry.get("start")))


def _add_claim(check: PageCheck, page: str, entry: Mapping[str, Any], *, slow: bool) -> None:
    claim, stated = _title(entry), entry["claim"]
    for text in stated if isinstance(stated, list) else [stated]:
        if _in_one_line(text) not in _in_one_line(check.text):
            check.errors.append(f"{page}: the claim {text!r} is not in the page")
    if "test" in entry:
        file, _, name = str(entry["test"]).partition("::")
        path = ROOT / file
        if not path.is_file() or f"def {name}(" not in path.read_text(encoding="utf-8"):
            check.errors.append(f"{page}: no such test: {entry['test']}")
    reason = f"executed by {entry['test']}" if "test" in entry else _reason(entry, slow=slow)
    if reason:
        check.skipped.append(f"{page}: {claim}: {reason}")
    elif not entry.get("run"):
        check.errors.append(f"{page}: the claim {claim!r} has no command, test or reason")
    else:
        check.steps += [Step(command) for command in entry.get("setup", ())]
        check.steps += [_promised(str(one["command"]), one, ()) for one in entry["run"]]


def _in_one_line(text: str) -> str:
    return " ".join(text.split())


def _reason(entry: Mapping[str, Any], *, slow: bool) -> str | None:
    """Return the reason for which an entry is not executed, or None."""
    missing = [name for name in entry.get("needs", ()) if not _is_installed(name)]
    if missing:
        return f"{', '.join(missing)} is not installed"
    if entry.get("slow") and not slow:
        return "slow"
    return entry.get("skip") or entry.get("output")


def _add_block(check: PageCheck, page: str, block: Block, entry: Mapping[str, Any], *, slow: bool) -> None:
    if reason := _reason(entry, slow=slow):
        check.skipped.append(f"{page}: {block.start}: {reason}")
        return
    if "file" in entry:
        written = (entry["file"], entry.get("before", "") + block.text)
        check.files.setdefault(len(check.steps), []).append(written)
    check.steps += [Step(command) for command in entry.get("setup", ())]
    lines: dict[str, Any] = entry.get("lines", {})
    if entry.get("python"):
        check.files.setdefault(len(check.steps), []).append(("block.py", block.text))
        check.steps.append(_promised("python block.py", lines, ()))
    elif block.kind in _COMMANDS:
        commands = [(line, ()) for line in block.text.splitlines() if line.strip()]
        for line, shown in _console(block.text) if "$ " in block.text else commands:
            rest: dict[str, Any] = next((given for start, given in lines.items() if line.startswith(start)), {})
            if "skip" in rest:
                check.skipped.append(f"{page}: {line}: {rest['skip']}")
            else:
                check.steps.append(_promised(line, rest, shown))
    check.errors += [
        f"{page}: no command of the block begins with {start!r}"
        for start in lines
        if not entry.get("python")
        and not any(line.removeprefix("$ ").startswith(start) for line in block.text.splitlines())
    ]
    check.steps += [_promised(str(one["command"]), one, ()) for one in entry.get("run", ())]


def _is_installed(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False


def _console(text: str) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield each command with the lines below it."""
    for entry in text.split("$ ")[1:]:
        command, *shown = entry.strip().splitlines()
        yield command, tuple(line for line in shown if line.strip() not in ("", "…"))


def _promised(line: str, given: Mapping[str, Any], shown: Sequence[str]) -> Step:
    written = _EXIT_CODE.search(line)
    exits = given.get("exit", int(written[1]) if written else 0)
    codes = tuple(exits) if isinstance(exits, list) else (exits,)
    listed = (tuple(given.get(key, ())) for key in ("files", "prints", "lacks", "rows"))
    return Step(line, codes, tuple(shown), *listed)


def run_page(check: PageCheck, folder: Path, environment: Mapping[str, str]) -> list[str]:
    """Execute the steps in a folder and return the promises that are not kept."""
    errors = list(check.errors)
    for number, step in enumerate(check.steps):
        for name, text in check.files.get(number, ()):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8")
        if step.command.startswith("cd "):
            folder /= step.command.removeprefix("cd ")
            continue
        print("$", step.command, flush=True)
        done = subprocess.run(
            ["bash", "-o", "pipefail", "-c", step.command],
            cwd=folder,
            env=dict(environment),
            capture_output=True,
            text=True,
            timeout=LIMIT,
            check=False,
        )
        errors += [
            f"{step.command}: {one}\n{done.stdout[-2000:]}{done.stderr[-2000:]}"
            for one in _broken(step, done, folder, check.text)
        ]
    return errors


def _broken(step: Step, done: subprocess.CompletedProcess[str], folder: Path, page: str) -> Iterator[str]:
    if done.returncode not in step.exits:
        yield f"exit code {done.returncode} (expected {' or '.join(map(str, step.exits))})"
    printed = " ".join(done.stdout.split())
    for line in step.shown:
        if " ".join(line.split()) not in printed:
            yield f"does not print {line!r}"
    for pattern in step.prints:
        if not re.search(pattern, done.stdout + done.stderr):
            yield f"does not print {pattern!r}"
    for pattern in step.lacks:
        if found := re.search(pattern, done.stdout + done.stderr):
            yield f"prints {found[0]!r}"
    for name in (*step.files, *step.rows):
        if not any(folder.glob(name)):
            yield f"does not write {name}"
    stated = set(_rows(page))
    for name in step.rows:
        for path in folder.glob(name):
            rows = list(_rows(path.read_text(encoding="utf-8")))
            yield from (f"{name} has the row {row}, which is not in the page" for row in rows if row not in stated)
            if not rows:
                yield f"{name} has no table"


def _rows(text: str) -> Iterator[str]:
    """Yield the rows of the Markdown tables of a text, without their rulers. Cells without a value have any dash."""
    lines = (line.replace("\u2013", "-") for line in text.splitlines() if line.startswith("|"))
    return (_in_one_line(line) for line in lines if not set(line) <= set("|-: "))


def environment_of(python: Path) -> dict[str, str]:
    """Return the variables of commands of the environment of a Python; CHECKOUT is the folder of this repository."""
    kept = {name: text for name, text in os.environ.items() if name not in ("PYTEST_ADDOPTS", "EIDRIVE_PROJECT")}
    # Fixed width, so that tables are not folded, and a browser that opens no page
    fixed = {"CHECKOUT": str(ROOT), "COLUMNS": "160", "BROWSER": "true"}
    return {**kept, **fixed, "PATH": f"{python.parent}{os.pathsep}{os.environ['PATH']}"}


def main() -> int:
    """Execute the commands of the given pages, or of all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("pages", nargs="*", help="pages such as docs/sweeps.md; all by default")
    parser.add_argument("--quick", action="store_true", help="omit blocks that are marked as slow")
    parser.add_argument(
        "--installed", action="store_true", help="use the environment of this Python instead of a wheel"
    )
    options = parser.parse_args()
    listed = read_list()
    errors = [f"{page} is not in {LIST.name}" for page in pages() if page not in listed]
    for error in errors:
        print("failed:", error, file=sys.stderr)
    with tempfile.TemporaryDirectory() as temporary:
        python = Path(sys.executable) if options.installed else _installed_wheel(Path(temporary))
        environment = environment_of(python)
        if not options.installed:
            environment.pop("PYTHONPATH", None)
        for number, page in enumerate(options.pages or listed):
            print(f"== {page}", flush=True)
            check = check_page(page, listed[page], slow=not options.quick)
            folder = Path(temporary, str(number))
            folder.mkdir()
            found = run_page(check, folder, environment)
            for line in check.skipped:
                print("not executed:", line, flush=True)
            for error in found:
                print("failed:", error, file=sys.stderr, flush=True)
            errors += found
    print(f"{len(errors)} promises are not kept")
    return 1 if errors else 0


def _installed_wheel(folder: Path) -> Path:
    """Install a wheel of this checkout into a new environment, and return its Python."""
    subprocess.run(
        [sys.executable, "-m", "build", "--wheel", "-o", folder / "dist", ROOT], check=True, stdout=subprocess.DEVNULL
    )
    (wheel,) = (folder / "dist").glob("*.whl")
    python = install(wheel, Path(sysconfig.get_path("purelib")), folder / "environment")
    site = next((folder / "environment" / "lib").glob("python*/site-packages"))
    others = [path for path in sys.path if Path(path).name == "site-packages"]  # of the environments that this one uses
    (site / "zz_other_dependencies.pth").write_text("\n".join(others), encoding="utf-8")
    script = python.with_name("pytest")
    script.write_text(f"#!{python}\nimport sys\nimport pytest\nsys.exit(pytest.console_main())\n", encoding="utf-8")
    script.chmod(0o755)
    return python


if __name__ == "__main__":
    sys.exit(main())
