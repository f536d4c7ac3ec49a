"""Command `eidrive schema`: JSON schemas of YAML files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from eidrive_scenario.cli.options import check_output_paths
from eidrive_scenario.cli.output import echo, echo_path, print_warnings


def schema(
    kind: Annotated[Literal["stack", "channel", "criteria", "weather"], typer.Argument(help="Kind of the YAML files.")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE", help="File of the schema.", show_default="print it")
    ] = None,
) -> None:
    """Print the JSON schema of YAML files, for completion in editors.

    Example: eidrive schema stack --out stack.schema.json

    It has the settings of all extensions, those of the project included.
    """
    from eidrive_scenario.export.settings_schemas import settings_schema
    from eidrive_scenario.files.atomic import write_atomically

    check_output_paths({"--out": out}, [])
    warnings: list[str] = []
    text = json.dumps(settings_schema(kind, warnings.append), indent=1, allow_nan=False)
    print_warnings(warnings)
    if out is None:
        echo(text)
        return
    with write_atomically(out) as stream:
        stream.write(f"{text}\n".encode())
    echo_path(out)
