"""The kernel of a composition as an object file that needs neither Python nor numba.

The bitcode of `rest` and `respond` (`sim.machine_code`) under the names that `slave.c` calls, translated for any
processor of this kind and for a library that may lie anywhere in memory. Fused operations are not allowed to it there
either, so that the numbers are those of our own simulation.
"""

from llvmlite import binding

from sim.composition import Composition
from sim.machine_code import target_machine

NAMES = {"rest": "valve_rest", "respond": "valve_respond"}


def kernel_object(composition: Composition) -> bytes:
    """Return an object file (ELF) with `valve_rest` and `valve_respond`."""
    module = binding.parse_bitcode(composition.kernel.bitcode)
    for function in module.functions:
        function.name = NAMES.get(function.name, function.name)
    return bytes(target_machine().emit_object(module))
