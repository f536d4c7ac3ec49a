"""An OpenSCENARIO engine and test harness for cooperative perception."""

import os

__version__ = "0.3.0"


def _select_blas_kernel() -> None:
    """Let OpenBLAS compute as on a Haswell, so that a run has equal bits on all processors with AVX2.

    OpenBLAS reads the variable when NumPy is imported, and its kernels differ in rounding. A value of the user remains.
    """
    try:
        with open("/proc/cpuinfo", encoding="ascii", errors="replace") as file:
            first_processor = file.read(8192).partition("\n\n")[0]
    except OSError:
        return
    if {"avx2", "fma"} <= set(first_processor.split()):
        os.environ.setdefault("OPENBLAS_CORETYPE", "Haswell")


_select_blas_kernel()
