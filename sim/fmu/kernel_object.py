"""The kernel of a composition as an object file that needs neither Python nor numba.

numba's own functions take (result, exception, arguments) and return a status, 0 if all is well. The LLVM text that it
made of `rest` and `respond` is given the names that `slave.c` calls and translated once more, for any processor of this
kind and for a library that may lie anywhere in memory. Fused operations are not allowed to it there either, so that the
numbers are those of our own simulation.
"""

from typing import Any

import numba
from llvmlite import binding

from sim.composition import Composition
from sim.kernel import INNER
from sim.open_loop import PATH_ROWS

carray: Any = numba.carray  # type: ignore[attr-defined]
POINTER, NUMBER = "CPointer(f8)", "f8"
REST = (POINTER, POINTER, NUMBER, NUMBER, NUMBER)
RESPOND = (POINTER, POINTER, POINTER, POINTER, NUMBER, NUMBER, POINTER)


def kernel_object(composition: Composition) -> bytes:
    """Return an object file (ELF) with `valve_rest` and `valve_respond`, for arrays of this composition's sizes."""
    module = binding.parse_assembly(_entry(_rest(composition), "valve_rest", REST))
    module.link_in(binding.parse_assembly(_entry(_respond(composition), "valve_respond", RESPOND)))
    target = binding.Target.from_triple(binding.get_process_triple())
    machine = target.create_target_machine(cpu="", opt=3, reloc="pic", codemodel="default")
    return bytes(machine.emit_object(module))


def _rest(composition: Composition) -> Any:
    at_rest, parameters, size = composition.kernel.rest, composition.theta.size, composition.state_size

    def valve_rest(theta: Any, state: Any, time: float, position: float, command: float) -> None:
        at_rest(carray(theta, parameters), carray(state, size), time, position, command)

    return valve_rest


def _respond(composition: Composition) -> Any:
    respond, parameters, size = composition.kernel.respond, composition.theta.size, composition.state_size

    def valve_respond(
        theta: Any, state: Any, command: Any, period: Any, longest_step: float, tolerance: float, path: Any
    ) -> None:
        respond(
            carray(theta, parameters),
            carray(state, size),
            carray(command, 1),
            carray(period, 1),
            longest_step,
            tolerance,
            carray(path, (PATH_ROWS, 2)),
        )

    return valve_respond


def _entry(function: Any, name: str, signature: tuple[str, ...]) -> str:
    """Return the LLVM text of a function compiled for pointers, under a plain name."""
    dispatcher: Any = numba.njit(f"void({','.join(signature)})", **INNER)(function)
    (compiled,) = dispatcher.overloads.values()
    text: str = compiled.library.get_llvm_str()
    return text.replace(compiled.fndesc.llvm_func_name, name)
