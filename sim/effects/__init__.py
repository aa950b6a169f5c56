"""The effects, one file each, named as in a valve file; `sim.effect` says how one is written.

`python -m sim.effects` prints their catalogue, from their own declarations.
"""
