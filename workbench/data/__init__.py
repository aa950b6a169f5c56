"""A recording made ready.

Its files:

    record            cut where it is broken, its bad samples marked, all of it told
    held_out          what is fitted, and what judges
    noise_floor       what no model explains: noise, rounding, how well the valve repeats itself
    motion            velocity, and the slips
    imposed_motion    a bench where a rig imposes the position, and static curves
"""
