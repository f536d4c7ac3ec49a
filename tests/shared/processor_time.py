"""Processor time in units of a known piece of work, so that bounds hold on slow and on busy machines."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from openscenario_xml import scenario_xml

from eidrive_scenario.openscenario import load_scenario

ELEMENTS = 10_000


def reading_time() -> float:
    """Return the processor time of reading a plain scenario of 10,000 parameters, in seconds."""
    declarations = "\n".join(
        f'<ParameterDeclaration name="P{number}" parameterType="double" value="{number}.5"/>'
        for number in range(ELEMENTS)
    )
    content = scenario_xml(minor=2, declarations=f"<ParameterDeclarations>{declarations}</ParameterDeclarations>")
    times = []
    for _ in range(2):
        began = time.process_time()
        load_scenario(content)
        times.append(time.process_time() - began)
    return min(times)


usual_reading_time = cache(reading_time)


@contextmanager
def work_within(readings: float) -> Iterator[None]:
    """Fail if the block takes more processor time than `readings` times the reading of 10,000 parameters."""
    unit = usual_reading_time()
    began = time.process_time()
    yield
    spent = time.process_time() - began
    if spent >= readings * unit:
        unit = max(unit, reading_time())  # the machine may have become slower since the first reading
    spent /= unit
    assert spent < readings, f"the block took {spent:.3g} times the reading of {ELEMENTS} parameters"
