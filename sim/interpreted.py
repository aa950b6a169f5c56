"""The valve's laws with its effects in their places, as plain Python functions.

What `sim.kernel` compiles for whole runs, for those who ask a single place a few times: the forces where a stem rests.
"""

from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from sim import karnopp
from sim.effect import Effect, execute
from sim.kernel_source import kernel_source

BASE = Path(karnopp.__file__)


def interpreted(effects: Sequence[Effect]) -> Any:
    """Return a module like `sim.karnopp` whose empty places are filled with these effects.

    Its functions take what the kernel gives them: `q = parameters(theta)`, `z = memories(state)`, a `Stem`.
    """
    module = ModuleType("interpreted_valve")
    exec(compile(BASE.read_text(encoding="utf-8"), str(BASE), "exec", dont_inherit=True), module.__dict__)
    exec(compile(kernel_source(effects), "kernel source", "exec", dont_inherit=True), module.__dict__)
    for i, effect in enumerate(effects):
        part = ModuleType(effect.name)
        execute(effect.source, effect.path, part.__dict__)
        module.__dict__.update({f"{name}_{i}": value for name, value in part.__dict__.items() if name[0] != "_"})
    return module
