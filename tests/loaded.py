"""Loads what takes a simulated slave the longest, its kernel, for the process that `tests.children` forks it off."""

import gc

from config.valve_file import load_valve, shipped_valve
from sim.composition import Composition

Composition.from_file(load_valve(shipped_valve("seed")))
gc.freeze()
