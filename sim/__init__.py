"""The model side: the valve's physics, its effects, and the simulated slaves that serve them on a bus.

Its files:

    karnopp, first_order_lag             the equations, and how a step is taken
    told                                 the equations of a stem that is told when it moves
    quasi_static                         the same without inertia, for samples farther apart than a slide lasts
    effect, effects                      how an effect is written; those that come along
    own_effect                           the example of one of a person's own, and whether a search may try it
    kernel, kernel_source                the equations with effects in their places, compiled; how an effect fills them
    kernel_compiler                      the laws and each effect to bitcode, by numba
    kernel_linker, machine_code          these to a kernel's, and that to this processor's code, without numba
    interpreted                          the same uncompiled, for what asks a single place
    static_inverse                       what a controller must know of a valve file, worked out of its equations
    composition                          a valve file made ready: effects, parameters, kernel
    valve, open_loop, simulation         in virtual time; in one call, for fitting; as a recording
    parameter_changes, transmitter       friction that ages meanwhile; the position's noise and rounding
    slave                                the simulated device on a bus
    fmu                                  a valve as a unit for other simulators
"""
