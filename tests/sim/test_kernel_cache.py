"""A kernel is compiled once for all processes, and never taken for another."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from config.valve_file import EffectTable, ValveFile, load_valve, shipped_valve
from sim import kernel as compiled
from sim import kernel_compiler
from sim.composition import Composition
from sim.effect import SHIPPED, read_effect
from sim.karnopp import read
from sim.machine_code import processor
from sim.valve import Valve

SEED = load_valve(shipped_valve("seed"))
ASYMMETRIC = ValveFile(
    valve=SEED.valve,
    effect=(EffectTable.model_validate({"name": "asymmetric_friction", "asymmetry": 0.2}),),
)
DIGEST = re.compile("[0-9a-f]{64}")
PROBE = """
import sys
from config.valve_file import load_valve, shipped_valve
from sim.composition import Composition
from sim.valve import Valve

composition = Composition.from_file(load_valve(shipped_valve("seed")))
valve = Valve(composition)
valve.advance(60e3, 0.02)
print("numba" in sys.modules, valve.position_m.hex())
"""


def probed(cache: Path, count: int = 1) -> list[tuple[str, str]]:
    """Begin so many processes at once; return of each whether it started numba, and where its stem came to."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache)}
    command = [sys.executable, "-c", PROBE]
    probes = [subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(count)]
    said = [process.communicate()[0].split() for process in probes]
    assert [process.returncode for process in probes] == [0] * count
    return [(numba, position) for numba, position in said]


class AtOnce(NamedTuple):
    """What processes say that were the first to need a kernel, all at once, and the cache that they left."""

    said: list[tuple[str, str]]
    cache: Path


@pytest.fixture(scope="module")
def at_once(tmp_path_factory: pytest.TempPathFactory) -> AtOnce:
    """To compile the laws takes some seconds: once."""
    cache = tmp_path_factory.mktemp("cache")
    return AtOnce(probed(cache, 3), cache)


@pytest.fixture
def filled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of this test's own in which the seed's kernel lies, and the laws that it is linked from."""
    compiled._compiled.cache_clear()
    digest = Composition.from_file(SEED).kernel.digest
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    there, here = (each / "positioner" / "kernels" for each in (home, tmp_path / "filled"))
    here.mkdir(parents=True, mode=0o700)
    for part in {digest, *DIGEST.findall((there / f"{digest}.py").read_text())}:
        for file in there.glob(f"{part}.*"):
            shutil.copy(file, here)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "filled"))
    compiled._compiled.cache_clear()
    return tmp_path / "filled"


@pytest.mark.long
def test_a_kernel_is_compiled_by_one_process_and_translated_again_for_another_processor(
    at_once: AtOnce, tmp_path: Path
) -> None:
    assert sorted(numba for numba, _ in at_once.said) == ["False", "False", "True"], "the others do not even start it"
    shutil.copytree(at_once.cache, tmp_path, dirs_exist_ok=True)
    (code,) = tmp_path.rglob("*.o")
    code.rename(code.with_suffix(".another.o"))
    ((numba, position),) = probed(tmp_path)
    assert numba == "False", "the bitcode is there"
    assert {position} == {each for _, each in at_once.said}


def test_the_laws_are_compiled_once_for_all_kernels(filled: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(kernel_compiler, "laws")
    valve = Valve(Composition.from_file(ASYMMETRIC))
    valve.advance(1.1 * SEED.valve.static_n / SEED.valve.diaphragm_area_m2, 0.01)
    assert valve.position_m == 0.0, "opening is the harder direction"
    valve.advance(1.3 * SEED.valve.static_n / SEED.valve.diaphragm_area_m2, 0.01)
    assert valve.position_m > 0.0


@pytest.mark.long
def test_an_effect_is_compiled_once_wherever_it_stands(filled: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Parameters and memories of effects lie elsewhere in each set of them."""
    asymmetric = {"name": "asymmetric_friction", "asymmetry": 0.2}
    lag, sensor = {"name": "ip_lag", "time_constant_s": 0.05}, {"name": "sensor_lag", "time_constant_s": 0.02}

    def answer_m(*tables: dict[str, object]) -> list[float]:
        file = ValveFile(valve=SEED.valve, effect=tuple(map(EffectTable.model_validate, tables)))
        return list(Valve(Composition.from_file(file)).run(np.full(50, 40e3), 0.01).position_m)

    together = answer_m(asymmetric, lag, sensor)
    monkeypatch.delattr(kernel_compiler, "effect")
    assert answer_m(sensor, lag, asymmetric) == together
    assert len({repr(each) for each in (together, answer_m(sensor, asymmetric), answer_m(lag, sensor))}) == 3


def test_an_edited_effect_is_another_kernel(tmp_path: Path) -> None:
    path = tmp_path / "asymmetric_friction.py"
    text = (SHIPPED / path.name).read_text()

    def moves() -> bool:
        composition = Composition.of(ASYMMETRIC, [read_effect(path)])
        digests.append(composition.kernel.digest)
        valve = Valve(composition)
        valve.advance(SEED.valve.static_n / SEED.valve.diaphragm_area_m2, 0.01)
        return valve.position_m > 0.0

    digests: list[str] = []
    path.write_text(text)
    assert not moves(), "opening is the harder direction"
    path.write_text(text.replace("1.0 + q.asymmetry", "1.0 - q.asymmetry"))
    assert moves(), "opening is the easier direction now"
    assert digests[0] != digests[1]
    assert digests[0] == Composition.from_file(ASYMMETRIC).kernel.digest, "the same text is the same kernel"


@pytest.mark.long
def test_edited_physics_is_another_kernel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = Composition.from_file(SEED).kernel.digest
    edited = tmp_path / "karnopp.py"
    edited.write_text(
        compiled.BASE.read_text().replace("direction * F_e - BREAKAWAY_FACTOR * F_s", "direction * F_e - 2.0 * F_s")
    )
    monkeypatch.setattr(compiled, "BASE", edited)
    composition = Composition.from_file(SEED)
    valve = Valve(composition)
    valve.advance(1.9 * SEED.valve.static_n / SEED.valve.diaphragm_area_m2, 0.01)
    assert composition.kernel.digest != before
    assert valve.position_m == 0.0


def test_a_torn_kernel_is_compiled_anew(filled: Path) -> None:
    digest = Composition.from_file(SEED).kernel.digest
    torn = compiled.kernel_file(digest, "another text").parent / f"{digest}.{processor()}.o"
    torn.write_bytes(b"torn")
    torn.with_name(f"{digest}{compiled.BITCODE}").write_bytes(b"")
    compiled._compiled.cache_clear()
    valve = Valve(Composition.from_file(SEED))
    valve.advance(2.0 * SEED.valve.static_n / SEED.valve.diaphragm_area_m2, 0.01)
    assert valve.position_m > 0.0
    assert len(torn.read_bytes()) > 1000


def test_without_a_writable_cache_the_text_lies_in_a_private_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home = tmp_path / "home"
    home.write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(home))
    path = compiled.kernel_file("digest", "text")
    assert path.read_text() == "text"
    assert not path.is_relative_to(tmp_path)
    assert path.parent.stat().st_mode & 0o077 == 0


def test_a_cache_that_others_may_write_to_is_made_private_and_somebody_elses_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What lies there runs as this user."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    kernels = tmp_path / "positioner" / "kernels"
    kernels.mkdir(parents=True)
    kernels.chmod(0o777)
    assert compiled.kernel_file("digest", "text").parent == kernels
    assert kernels.stat().st_mode & 0o777 == 0o700
    users = iter((os.getuid() + 1, os.getuid()))  # the temporary folder is this one's
    monkeypatch.setattr(os, "getuid", lambda: next(users))
    path = compiled.kernel_file("digest", "text")
    assert path.read_text() == "text"
    assert not path.is_relative_to(tmp_path)


def test_a_search_compiles_one_kernel_a_model(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stem that is told when it moves begins by its own kernel: the other costs a fresh installation a third more."""
    monkeypatch.setattr("sim.composition.kernel", lambda _: pytest.fail("the kernel of a free run is compiled"))
    composition = Composition.from_file(SEED)
    assert composition.told.tell
    state = composition.begin(composition.theta, 0.0, 0.01, 0.0, 5e4)
    assert read(state).x == 0.01
