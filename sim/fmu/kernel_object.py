"""The kernel of a composition as an object file that needs neither Python nor numba.

The bitcode of `rest` and `respond` (`sim.machine_code`) under the names that `slave.c` calls, translated for any
processor of this kind and for a library that may lie anywhere in memory. Fused operations are not allowed to it there
either, so that the numbers are those of our own simulation.
"""

from llvmlite import binding

from sim.composition import Composition

NAMES = {"rest": "valve_rest", "respond": "valve_respond"}


def kernel_object(composition: Composition) -> bytes:
    """Return an object file (ELF) with `valve_rest` and `valve_respond`."""
    bitcode = composition.kernel.bitcode  # whose making has told LLVM of this machine
    module = binding.parse_bitcode(bitcode)
    for function in module.functions:
        function.name = NAMES.get(function.name, function.name)
    target = binding.Target.from_triple(binding.get_process_triple())
    machine = target.create_target_machine(cpu="", opt=3, reloc="pic", codemodel="default")
    return bytes(machine.emit_object(module))
