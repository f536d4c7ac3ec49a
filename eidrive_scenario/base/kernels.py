"""Kernels: loops over arrays, compiled by numba on the first call.

numba is imported by the first call: runs without kernels do not load it. Compiled code is stored in `__pycache__`
beside the module of the kernel, or below the folder that `NUMBA_CACHE_DIR` names. All processors compute equal bits, as
neither `fastmath` nor `parallel` is used: numba then keeps the order of operations, and rounds each of them.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from functools import cached_property, update_wrapper
from types import FunctionType
from typing import Any, Generic, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


class Kernel(Generic[P, R]):
    """Function that is compiled on its first call, for one signature."""

    def __init__(self, function: Callable[P, R], signature: str) -> None:
        self._signature = signature
        self.__wrapped__: Any = function
        update_wrapper(self, function)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        result: R = self.compiled(*args, **kwargs)
        return result

    @cached_property
    def compiled(self) -> Any:
        """Compiled function, loaded from the cache if it is there."""
        # numba only compiles calls of functions that it has compiled: the kernels that this one calls are replaced.
        names = self.__wrapped__.__globals__
        called = {
            name: names[name].compiled
            for name in self.__wrapped__.__code__.co_names
            if isinstance(names.get(name), Kernel)
        }
        return _compile(FunctionType(self.__wrapped__.__code__, names | called), self._signature)


def kernel(signature: str) -> Callable[[Callable[P, R]], Kernel[P, R]]:
    """Return the decorator of a kernel with this signature of numba, such as `f8(f4[:,::1], i8)`.

    A kernel reads its arguments, constants and kernels of the same module: numba does not compile it again if another
    module changes. Division by zero gives infinity or NaN, as in arrays of numpy.
    """
    return lambda function: Kernel(function, signature)


def _compile(function: FunctionType, signature: str) -> Any:
    import numba
    from numba.core import event

    listener = _announcement()
    with event.install_listener("numba:compile", listener):
        try:
            return numba.njit(signature, error_model="numpy", cache=True)(function)
        except (RuntimeError, OSError):  # No folder for the cache is writable, or it is full
            if "no cache" not in _noted:
                _noted.add("no cache")
                message = "kernels are compiled in each process: no folder for the cache of numba is writable"
                warnings.warn(f"{message} (set NUMBA_CACHE_DIR)", RuntimeWarning, stacklevel=4)
            return numba.njit(signature, error_model="numpy")(function)


_noted: set[str] = set()
"""Messages about the compilation that this process has printed."""


def _announcement() -> Any:
    """Return a listener of numba that prints on stderr that kernels are compiled."""
    from numba.core.event import Listener

    class Announcement(Listener):
        def on_start(self, _: object) -> None:
            if not _noted:
                _noted.add("compiling")
                sys.stderr.write("compiling kernels, once after installation\n")

        def on_end(self, _: object) -> None:
            """Do nothing."""

    return Announcement()
