"""Loads what takes a simulated slave the longest, its kernel, for a process that others are forked off.

It comes last there: what is loaded by then is left out of garbage collection, which would copy it in each of them.
"""

import gc

from config.valve_file import load_valve, shipped_valve
from sim.valve import Valve

Valve.from_file(load_valve(shipped_valve("seed")))
gc.freeze()
