"""Command `eidrive judge`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from eidrive_scenario.cli.error_output import print_warnings


def judge(
    recording: Annotated[Path, typer.Argument(help="A recording.mcap, or the folder of a run.")],
    criterion: Annotated[
        list[str] | None,
        typer.Option(
            metavar="YAML|FILE",
            help="Criteria instead of those of the run, such as '{collision: {of: Ego}}'; repeatable.",
        ),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object only.")] = False,
) -> None:
    """Judge a recorded run again, with its own criteria or with other ones.

    Example: eidrive judge reports/scenario_1 --criterion '{max_speed: {of: Ego, at_most: 10}}'

    Exit codes as for eidrive run; 3 also for an incomplete or damaged recording.
    """
    from eidrive_scenario.cli.streams import echo, has_all_characters
    from eidrive_scenario.experiments.judgement import judge_recording
    from eidrive_scenario.experiments.single_run import as_json_text

    judgement = judge_recording(recording, criterion or None)
    if json:
        echo(as_json_text(judgement, ascii_only=not has_all_characters()))
        print_warnings(judgement.warnings)
    else:
        from eidrive_scenario.cli.verdicts import show_judgement

        show_judgement(judgement)
    raise typer.Exit(judgement.exit_code)
