"""A run that is stepped by hand."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from eidrive_scenario.errors import ExtensionError, SimulationError
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import RunSettings, Simulation, run_file

ONE = "coop/scenario_1"


def test_result_of_stepped_run_is_that_of_a_run_in_one_go() -> None:
    with Simulation(ONE) as simulation:
        end = None
        while end is None:
            _, end = simulation.tick()
        stepped = simulation.result()
    whole = run_file(ONE)
    assert stepped.trace_hash == whole.trace_hash
    assert (stepped.metrics, stepped.criteria, stepped.warnings) == (whole.metrics, whole.criteria, whole.warnings)
    assert simulation.result().trace_hash == whole.trace_hash


def test_run_goes_on_from_where_it_was_stepped_to() -> None:
    simulation = Simulation(ONE)
    for _ in range(10):
        simulation.tick()
    assert simulation.run().trace_hash == run_file(ONE).trace_hash


def test_result_before_the_end_is_an_error() -> None:
    with Simulation(ONE) as simulation:
        simulation.tick()
        with pytest.raises(SimulationError, match="the run has not ended; call tick until"):
            simulation.result()


class Closings:
    """Counts how often it is closed."""

    def __init__(self) -> None:
        self.count = 0

    def observe(self, frame: Frame) -> None: ...

    def close(self) -> None:
        self.count += 1


def test_observer_of_run_within_with_is_closed_once() -> None:
    early, late = Closings(), Closings()
    with Simulation(ONE, settings=RunSettings(time_limit=0.1), observers=[early]) as simulation:
        simulation.add_observer(late)
        simulation.run()
    assert (early.count, late.count) == (1, 1)


class Beginnings(Closings):
    """Records the simulations that it begins to observe, and the ticks of its frames."""

    def __init__(self) -> None:
        super().__init__()
        self.calls: list[object] = []

    def begin(self, simulation: Simulation) -> None:
        self.calls.append(simulation)

    def observe(self, frame: Frame) -> None:
        self.calls.append(frame.view.tick)


def test_observer_begins_once_before_its_first_frame() -> None:
    early, late = Beginnings(), Beginnings()
    with Simulation(ONE, settings=RunSettings(time_limit=0.15), observers=[early]) as simulation:
        simulation.tick()
        simulation.add_observer(late)
        simulation.begin_tick()
        simulation.run()
    assert early.calls == [simulation, 0, 1, 2, 3]
    assert late.calls == [simulation, 1, 2, 3]


def test_error_in_begin_of_observer_names_the_observer() -> None:
    class Breaks(Beginnings):
        def begin(self, simulation: Simulation) -> None:
            raise RuntimeError("full disk")

    watch = Breaks()
    message = r"observer 'Breaks' at t = 0\.000 s: RuntimeError: full disk"
    with pytest.raises(ExtensionError, match=message):
        run_file(ONE, observers=[watch])
    assert watch.count == 1
    for step in (Simulation.tick, Simulation.begin_tick, Simulation.run):
        with Simulation(ONE, observers=[Breaks()]) as simulation, pytest.raises(ExtensionError, match=message):
            step(simulation)


def test_tick_of_closed_simulation_is_an_error() -> None:
    with Simulation(ONE) as simulation:
        simulation.tick()
    for step in (simulation.tick, simulation.run):
        with pytest.raises(SimulationError, match="the simulation is closed; a second run needs a second Simulation"):
            step()
    with pytest.raises(SimulationError, match="the simulation is closed; an observer of it would see no frame"):
        simulation.add_observer(Closings())


def test_tick_after_the_end_is_an_error() -> None:
    with Simulation(ONE, settings=RunSettings(time_limit=0.1)) as simulation:
        while simulation.tick()[1] is None:
            pass
        with pytest.raises(SimulationError, match="the run has ended; a second run needs a second Simulation"):
            simulation.tick()
        assert simulation.result().end_reason == "time limit"


@pytest.mark.parametrize("step", [Simulation.tick, Simulation.begin_tick])
def test_tick_after_an_aborted_tick_is_an_error(
    step: Callable[[Simulation], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise ZeroDivisionError("physics")

    with Simulation(ONE) as simulation:
        simulation.tick()
        with monkeypatch.context() as patch:
            patch.setattr(type(simulation.storyboard), "tick", fail)
            with pytest.raises(ZeroDivisionError):
                step(simulation)
        for again in (simulation.tick, simulation.begin_tick):
            with pytest.raises(SimulationError, match="the run was aborted within a tick; a second run needs"):
                again()
