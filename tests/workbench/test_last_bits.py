"""A search comes to the same whatever multiplies its matrices and whatever processor the simulation is compiled for."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import pytest

from config.valve_file_writer import write_valve
from workbench.blind.hiding import hide

NEAR = 0.01
"""Relative change of a parameter that is the same."""
BLAS = ("Haswell", "Zen", "SkylakeX")
"""Kernels of OpenBLAS; one that the processor cannot run some builds replace, others end by an illegal instruction."""
SEARCH = """
import json
import sys
from pathlib import Path
from config.recording import Recording
from config.valve_file import load_valve
from workbench.fit.fitting import fit

recording, valve = Recording.read(sys.argv[1]), load_valve(Path(sys.argv[2]))
found = fit(recording, valve, effects=("area_variation",), workers=1)
parameters = {name: (each.value, each.std) for name, each in found.parameters.items()}
print(json.dumps([found.cost, found.trusted, parameters]))
"""


class Found(NamedTuple):
    """Cost, whether it is trusted, and each parameter with its deviation."""

    cost: float
    trusted: bool
    parameters: Mapping[str, tuple[float, float]]


def searched(folder: Path, **environment: str) -> Found | None:
    """Search in a process of its own; None where the processor cannot run a kernel of OpenBLAS."""
    done = subprocess.run(
        [sys.executable, "-P", "-c", SEARCH, str(folder / "fit.csv"), str(folder / "valve.toml")],
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"} | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode == -signal.SIGILL:
        return None
    assert done.returncode == 0, done.stderr
    return Found(*json.loads(done.stdout))


@pytest.mark.long
@pytest.mark.timeout(240)
def test_the_last_bits_decide_nothing(tmp_path: Path) -> None:
    hidden = hide(31013, duration_s=10.0)
    hidden.fit.write(tmp_path / "fit.csv")
    write_valve(tmp_path / "valve.toml", hidden.base)
    by_kernel = {each: searched(tmp_path, OPENBLAS_CORETYPE=each) for each in BLAS}
    last = [each for each, found in by_kernel.items() if found][-1]
    by_processor = searched(tmp_path, OPENBLAS_CORETYPE=last, NUMBA_CPU_NAME="generic")
    runs = [each for each in (*by_kernel.values(), by_processor) if each]
    assert by_processor is not None
    for run in runs:
        assert run.trusted
        assert run.cost == pytest.approx(runs[0].cost, rel=0.01)
        for name, (value, std) in run.parameters.items():
            first, first_std = runs[0].parameters[name]
            assert abs(value - first) <= max(2.0 * std, 2.0 * first_std, NEAR * abs(first)), name
