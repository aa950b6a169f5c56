"""A valve file as a unit for other simulators: a co-simulation FMU (FMI 2.0.4), `positioner export fmu`.

It runs the machine code that our own simulation runs; docs/decisions/0017-a-valve-as-an-fmu.md says why not C text.
Beside the files below, `slave.c` is the unit's side of the interface, compiled by the system's compiler.

Its files:

    fmu_file             the unit: description and library, zipped
    model_description    what it says of itself: variables, units, ranges
    kernel_object        the kernel as an object file
"""
