"""Processor time in units of a known piece of work, so that bounds hold on slow and on busy machines."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from functools import cache
from itertools import count
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


@cache
def _first_reading() -> float:
    """Return the processor time of a reading, measured once per process after one that loads modules [s]."""
    return min(_reading() for _ in range(2))


def _reading() -> float:
    return processor_time(lambda: load_scenario(_content()))[1]


def _readings() -> Iterator[float]:
    """Yield processor times of readings [s]; only attempts after the first one need a reading beside them."""
    yield _first_reading()
    while True:
        yield _reading()


def within_readings(readings: float, work: Callable[[], Result]) -> Result:
    """Return the result of `work`; fail if it takes more than `readings` times the reading of 10,000 parameters."""
    return _within(readings, work, _readings(), f"the reading of {ELEMENTS} parameters")


def within_multiple(multiple: float, work: Callable[[], Result], part: Callable[[], object]) -> Result:
    """Return the result of `work`; fail if it takes more than `multiple` times its `part`."""
    return _within(multiple, work, (processor_time(part)[1] for _ in count()), "its part")


def _within(bound: float, work: Callable[[], Result], units: Iterator[float], name: str) -> Result:
    """Compare `work` with a unit measured beside it.

    Other processes slow down memory and caches, and not evenly: the least ratio of three attempts counts.
    """
    ratio = math.inf
    for _ in range(ATTEMPTS):
        unit = next(units)
        result, spent = processor_time(work)
        ratio = min(ratio, spent / unit)
        if ratio < bound:
            return result
    raise AssertionError(f"the work took {ratio:.3g} times {name}")
