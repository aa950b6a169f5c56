"""A kernel is called with addresses: nothing that does not fit comes so far, and what fails inside is said."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from config.errors import InputError
from config.valve_file import EffectTable, ValveFile, load_valve, shipped_valve
from sim.composition import Composition
from sim.effect import read_effect
from sim.karnopp import TOLERANCE
from sim.kernel import ENTRIES
from sim.machine_code import loaded, translated
from sim.valve import Valve

SEED = load_valve(shipped_valve("seed"))
AGAIN = """
import sys
from pathlib import Path
from config.valve_file import EffectTable, ValveFile, load_valve, shipped_valve
from sim.composition import Composition
from sim.effect import read_effect
from sim.valve import Valve
effect = EffectTable.model_validate({"name": "own"})
file = ValveFile(valve=load_valve(shipped_valve("seed")).valve, effect=(effect,))
valve = Valve(Composition.of(file, [read_effect(Path(sys.argv[1]))]))
valve.advance(float(sys.argv[2]), 0.01)
print(valve.position_m.hex())
"""


@pytest.mark.parametrize(
    "path",
    [
        np.zeros((5, 2), np.float32),
        np.zeros((5, 4))[:, ::2],
        np.zeros(10),
    ],
    ids=["of another type", "not contiguous", "of other dimensions"],
)
def test_an_array_that_does_not_fit_is_refused(path: npt.NDArray[np.float64]) -> None:
    composition = Composition.from_file(SEED)
    state = np.zeros(composition.state_size)
    composition.rest(composition.theta, state, 0.0, 0.0, 0.0)
    with pytest.raises(TypeError, match="respond takes contiguous float64"):
        composition.kernel.respond(composition.theta, state, np.zeros(1), np.ones(1), 1e-3, TOLERANCE, path)


def own(folder: Path, force: str) -> tuple[Path, Composition]:
    path = folder / "own.py"
    path.write_text(f'"""An effect of a person\'s own."""\n\nimport numpy as np\n\n\ndef force(x):\n    {force}\n')
    file = ValveFile(valve=SEED.valve, effect=(EffectTable.model_validate({"name": "own"}),))
    return path, Composition.of(file, [read_effect(path)])


def test_what_fails_in_an_effect_is_an_error(tmp_path: Path) -> None:
    _, composition = own(tmp_path, "if x > 1e-4:\n        raise ValueError\n    return 0.0")
    valve = Valve(composition)
    valve.advance(0.0, 0.01)
    with pytest.raises(InputError, match="an effect of the valve file: raised an exception in respond"):
        valve.advance(150e3, 1.0)


def test_an_effect_that_reaches_beyond_its_memory_is_an_error(tmp_path: Path) -> None:
    """Unchecked it wrote over the memory of others, or ended the process."""
    path = tmp_path / "own.py"
    path.write_text(
        "MEMORY = 1\n\n\ndef start(t, z):\n    z[0] = 0.0\n\n\ndef advance(x, z):\n    z[9] = x\n\n\n"
        "def force(x, z):\n    return z[0]\n"
    )
    file = ValveFile(valve=SEED.valve, effect=(EffectTable.model_validate({"name": "own"}),))
    valve = Valve(Composition.of(file, [read_effect(path)]))
    with pytest.raises(InputError, match="raised an exception"):
        valve.advance(150e3, 1.0)


def test_an_effect_that_makes_arrays_runs_where_it_was_compiled_and_where_it_is_only_loaded(tmp_path: Path) -> None:
    breaks_loose_pa = 1.2 * SEED.valve.static_n / SEED.valve.diaphragm_area_m2
    path, composition = own(tmp_path, "return -np.array([1.0, x]).sum()")
    valve = Valve(composition)
    valve.advance(breaks_loose_pa, 0.01)
    assert valve.position_m > 0.0
    again = subprocess.run(
        [sys.executable, "-c", AGAIN, str(path), repr(breaks_loose_pa)], capture_output=True, text=True, check=False
    )
    assert again.stdout.strip() == valve.position_m.hex(), again.stderr


@pytest.mark.parametrize("part", [0.0, 0.01, 0.5, 0.99])
def test_what_is_torn_is_an_error_and_not_the_end_of_the_process(part: float) -> None:
    bitcode = Composition.from_file(SEED).kernel.bitcode
    code = translated(bitcode, ENTRIES)
    with pytest.raises(RuntimeError):
        translated(bitcode[: round(part * len(bitcode))], ENTRIES)
    with pytest.raises(RuntimeError):
        loaded(code[: round(part * len(code))], ENTRIES)
