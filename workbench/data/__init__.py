"""A recording made ready: `record` says what is wrong with it, `noise` what no model explains, `held_out` what is kept.

`motion` finds the slips, `imposed_motion` reads a bench where a rig imposes the position.
"""
