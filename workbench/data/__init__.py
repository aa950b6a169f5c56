"""A recording made ready.

Its files:

    record            cut where it is broken, its bad samples marked, all of it told
    held_out          what is fitted, and what judges
    clock_difference  whether the stem moves before its command, or against it
    noise_floor       what no model explains: noise, rounding, how well the valve repeats itself
    pressure_lag      the lag of a measured pressure, and what it was where it was not measured
    motion            velocity and acceleration
    informative_rows  which rows tell something, and which only say it again
    stretches         of a long one, those that tell the most
    kept_results      results kept in a folder by the content of what they are of
    imposed_motion    a bench where a rig imposes the position, and static curves
"""
