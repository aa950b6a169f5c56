"""The effects, one file each, named as in a valve file; `sim.effect` says how one is written."""
