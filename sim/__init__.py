"""The model side: the valve's physics, its effects, and the simulated slaves that serve them on a bus.

`sim.valve.Valve` is a valve in virtual time. `sim.open_loop.respond` is the same in one call, for fitting.
`sim.simulation.simulate` gives a recording of it, with the sensor's noise.
`sim.karnopp` holds the equations, `sim.effect` says how an effect is written, `sim.effects` has those that come along.
"""
