"""A search comes to the same whatever multiplies its matrices and whatever processor the simulation is compiled for."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from typing import NamedTuple

import pytest

from workbench.fit.agreement import NEAR

BLAS = ("Haswell", "Zen", "SkylakeX")
"""Kernels of OpenBLAS; one that the processor cannot run some builds replace, others end by an illegal instruction."""
PRODUCT = """
import numpy as np
import scipy.linalg

square = np.ones((256, 256))
square @ square
np.linalg.lstsq(square[:, :8], square[0])
scipy.linalg.lstsq(square[:, :8], square[0])
"""
SEARCH = """
import json
from workbench.blind.hiding import hide
from workbench.fit.fitting import fit

hidden = hide(31013, duration_s=10.0)
found = fit(hidden.fit, hidden.base, effects=("area_variation",), workers=1, profile=False)
parameters = {name: (each.value, each.std) for name, each in found.parameters.items()}
print(json.dumps([found.cost, found.trusted, parameters]))
"""


class Found(NamedTuple):
    """Cost, whether it is trusted, and each parameter with its deviation."""

    cost: float
    trusted: bool
    parameters: Mapping[str, tuple[float, float]]


def runs_here(kernel: str) -> bool:
    """Whether the processor can run a kernel of OpenBLAS."""
    environment = os.environ | {"OPENBLAS_CORETYPE": kernel}
    return subprocess.run([sys.executable, "-c", PRODUCT], env=environment, check=False).returncode >= 0


def searched(**environment: str) -> Found:
    """Search in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-P", "-c", SEARCH],
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"} | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return Found(*json.loads(done.stdout))


@pytest.mark.timeout(240)
def test_the_last_bits_decide_nothing() -> None:
    kernels = [each for each in BLAS if runs_here(each)]
    assert kernels
    runs = [searched(OPENBLAS_CORETYPE=each) for each in kernels]
    runs.append(searched(OPENBLAS_CORETYPE=kernels[-1], NUMBA_CPU_NAME="generic"))
    for run in runs:
        assert run.trusted
        assert run.cost == pytest.approx(runs[0].cost, rel=0.01)
        for name, (value, std) in run.parameters.items():
            first, first_std = runs[0].parameters[name]
            assert abs(value - first) <= max(2.0 * std, 2.0 * first_std, NEAR * abs(first)), name
