"""Processor time in units of a known piece of work, so that bounds hold on slow and on busy machines."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import cache
from typing import TypeVar

from openscenario_xml import scenario_xml

from eidrive_scenario.openscenario import load_scenario

ELEMENTS = 10_000
ATTEMPTS = 3
Result = TypeVar("Result")


@cache
def _content() -> bytes:
    declarations = "\n".join(
        f'<ParameterDeclaration name="P{number}" parameterType="double" value="{number}.5"/>'
        for number in range(ELEMENTS)
    )
    return scenario_xml(minor=2, declarations=f"<ParameterDeclarations>{declarations}</ParameterDeclarations>")


def processor_time(work: Callable[[], Result]) -> tuple[Result, float]:
    """Return the result of `work` and the processor time of this process that it took, in seconds."""
    began = time.process_time()
    result = work()
    return result, time.process_time() - began


def within_readings(readings: float, work: Callable[[], Result]) -> Result:
    """Return the result of `work`; fail if it takes more than `readings` times the reading of 10,000 parameters.

    Other processes slow down memory and caches, and not evenly: the least ratio of three attempts counts.
    """
    ratio = math.inf
    for _ in range(ATTEMPTS):
        _, unit = processor_time(lambda: load_scenario(_content()))
        result, spent = processor_time(work)
        ratio = min(ratio, spent / unit)
        if ratio < readings:
            return result
    raise AssertionError(f"the work took {ratio:.3g} times the reading of {ELEMENTS} parameters")
