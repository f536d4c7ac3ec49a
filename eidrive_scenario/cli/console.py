"""Output with colors and tables: verdicts of runs and recordings, and the tree of a storyboard."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console, ConsoleOptions, ConsoleRenderable, RenderHook, RenderResult
from rich.table import Table
from rich.text import Text
from rich.tree import Tree

from eidrive_scenario.cli.output import print_warnings
from eidrive_scenario.errors import ABORTED, FAILED, NOT_JUDGED, PASSED
from eidrive_scenario.evaluation import Verdict
from eidrive_scenario.experiments.commands import reproduction_lines
from eidrive_scenario.files.encodable import printable
from eidrive_scenario.recording.run_files import RECORDING
from eidrive_scenario.recording.text.run_log import describe_kind
from eidrive_scenario.reporting.storyboard_diagram.layout import remark_of
from eidrive_scenario.simulation import RunResult
from eidrive_scenario.simulation.result import quantity_text
from eidrive_scenario.simulation.run_outcome import TIME_LIMIT
from eidrive_scenario.storyboard.context.behaviour import ActionBehaviour
from eidrive_scenario.storyboard.storyboard import Storyboard
from eidrive_scenario.storyboard.tree.elements import StoryElement
from eidrive_scenario.storyboard.tree.events import ActionElement

if TYPE_CHECKING:
    from eidrive_scenario.experiments.judgement import FailedJudgement, Judgement


_OUTCOMES = {
    PASSED: ("passed", "bold green"),
    FAILED: ("failed", "bold red"),
    ABORTED: ("time limit", "bold red"),
    NOT_JUDGED: ("not judged", "bold yellow"),
}


class _Output(Console):
    """Console whose texts are neither markup nor control sequences, as names of files may contain both."""

    def __init__(self, **options: Any) -> None:
        super().__init__(highlight=False, markup=False, emoji=False, **options)
        self.push_render_hook(_EscapeControls())

    def on_broken_pipe(self) -> None:
        """Raise BrokenPipeError for the command line: rich would end with the exit code of a failed criterion."""
        raise BrokenPipeError


class _EscapeControls(RenderHook):
    """Escape control characters in all output except those that rich adds for styles and positions."""

    def process_renderables(self, renderables: list[ConsoleRenderable]) -> list[ConsoleRenderable]:
        """Return the same output with escapes."""
        return [_Escaped(renderable) for renderable in renderables]


class _Escaped:
    def __init__(self, renderable: ConsoleRenderable) -> None:
        self._renderable = renderable

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for segment in console.render(self._renderable, options):
            yield segment if segment.control else segment._replace(text=printable(segment.text))


def console(*, stderr: bool = False) -> Console:
    """Return a console of the terminal width; for a file, wide enough for a reason on one line."""
    plain = _Output(stderr=stderr)
    if plain.is_terminal or "COLUMNS" in os.environ:
        return plain
    return _Output(stderr=stderr, width=180)


def show(result: RunResult, varied: str = "") -> None:
    """Print verdicts, end reason, trace hash and speed; for a run of a distribution, with its varied parameters."""
    out = console()
    word, style = _OUTCOMES[result.exit_code]
    run = "" if result.run is None else f"  run {result.run} ({varied})"
    title = Text.assemble(
        (result.scenario, "bold"), f"{run}  seed {result.seed}  channel {result.channel}  ", (word, style)
    )
    out.print(title)
    _print_table(out, result.criteria)
    pace = result.simulated_s / result.wall_s if result.wall_s > 0 else 0.0
    speed = f", {pace:.{0 if pace >= 10 else 1 if pace >= 1 else 2}f} times real time" if pace else ""
    out.print(Text(f"end: {result.end_reason} at {result.simulated_s:.2f} s ({result.wall_s:.2f} s wall{speed})"))
    out.print(Text(f"trace {result.trace_hash}", style="dim"), soft_wrap=True)
    for line in reproduction_lines(result):
        out.print(Text(line), soft_wrap=True)
    print_warnings(result.warnings)


def show_judgement(judgement: Judgement) -> None:
    """Print the verdicts on a recording, and its warnings."""
    out = console()
    title = f"  seed {judgement.seed}  recorded  "
    out.print(Text.assemble((judgement.scenario, "bold"), title, _outcome_of(judgement)))
    _print_table(out, judgement.criteria)
    out.print(Text(f"end: {judgement.end_reason} at {judgement.simulated_s:.2f} s"))
    print_warnings(judgement.warnings)


def show_judgements(judgements: Sequence[Judgement | FailedJudgement]) -> None:
    """Print the verdicts on several recordings as a table with a column of each criterion, and counts of outcomes."""
    from eidrive_scenario.experiments.judgement import Judgement

    out = console()
    complete = [judgement for judgement in judgements if isinstance(judgement, Judgement)]
    names = list(dict.fromkeys(verdict.name for judgement in complete for verdict in judgement.criteria))
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in ("recording", "scenario", "seed", "", *names):
        table.add_column(Text(heading), no_wrap=heading == "seed")
    outcomes = []
    for judgement in judgements:
        path = judgement.recording
        folder = Text(str(path.parent if path.name == RECORDING else path))
        if isinstance(judgement, Judgement):
            outcomes.append(_outcome_of(judgement))
            cells = {verdict.name: Text.assemble(_mark(verdict), _value_of(verdict)) for verdict in judgement.criteria}
            run = (folder, Text(judgement.scenario), str(judgement.seed), outcomes[-1])
            table.add_row(*run, *(cells.get(name, "") for name in names))
        else:
            outcomes.append(Text("aborted" if judgement.exit_code == ABORTED else "invalid input", "bold red"))
            table.add_row(folder, "", "", outcomes[-1])
    out.print(table)
    counts = Counter(outcome.plain for outcome in outcomes)
    out.print(f"{len(judgements)} recordings: {', '.join(f'{count} {word}' for word, count in counts.items())}")


def _outcome_of(judgement: Judgement) -> Text:
    word, style = _OUTCOMES[judgement.exit_code]
    is_complete = judgement.exit_code != ABORTED or judgement.end_reason == TIME_LIMIT
    return Text(word if is_complete else "incomplete or damaged", style)


def _mark(verdict: Verdict) -> Text:
    return Text("passed", style="green") if verdict.passed else Text("failed", style="red")


def _value_of(verdict: Verdict) -> str:
    return "" if verdict.value is None else f" {quantity_text(verdict.value, verdict.unit)}"


def _print_table(out: Console, criteria: Sequence[Verdict]) -> None:
    if not criteria:
        out.print("no criterion: nothing was evaluated", style="yellow")
        return
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in ("criterion", "", "value", "limit", "reason"):
        table.add_column(
            heading, justify="right" if heading in ("value", "limit") else "left", no_wrap=heading != "reason"
        )
    for verdict in criteria:
        quantities = [Text(quantity_text(number, verdict.unit)) for number in (verdict.value, verdict.limit)]
        table.add_row(Text(verdict.name), _mark(verdict), *quantities, Text(verdict.reason))
    out.print(table)
    for verdict in criteria:
        if verdict.violation_state:
            title, *lines = verdict.violation_state
            out.print(Text(f"{verdict.name}: {title}"))
            for line in lines:
                out.print(Text(f"  {line}"))


def storyboard_tree(storyboard: Storyboard) -> Tree:
    """Return the storyboard as a tree, with the actions of Init first."""
    root = Tree(Text(storyboard.scenario.name, style="bold"), guide_style="dim")
    init = root.add(_heading("init", "", ""))
    for behavior in storyboard.init.children:
        init.add(_action(behavior))
    _add(root, storyboard.root)
    return root


def _add(branch: Tree, element: StoryElement) -> None:
    name = "" if element.kind == "storyboard" else element.name
    node = branch.add(_heading(describe_kind(element.kind), name, remark_of(element)))
    for verb, leaf in (("starts", element.start_leaf), ("stops", element.stop_leaf)):
        if leaf is not None:
            node.add(Text.assemble((f"{verb} when ", "cyan"), leaf.trigger.describe() or "criteria end the run"))
    if isinstance(element, ActionElement):
        for behavior in element.children:
            node.add(_action(behavior))
    for child in element.elements:
        _add(node, child)


def _heading(kind: str, name: str, remarks: str) -> Text:
    parts = [(kind, "green"), (f" {name}" if name else "", "bold"), (f" ({remarks})" if remarks else "", "dim")]
    return Text.assemble(*parts)


def _action(behavior: object) -> Text:
    if not isinstance(behavior, ActionBehaviour):
        return Text(str(behavior))
    actor = f"{behavior.actor_name}: " if behavior.actor_name else ""
    return Text(f"{actor}{behavior.describe()}")
