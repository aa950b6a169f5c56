"""Where a sticking stem rests, told the output: the Karnopp valve without inertia, in % of the output.

    |u - x| <= f_s    it rests
    |u - x| >  f_s    it slips and lands at  x = u - f_d sign(u - x)

u output, x stem; S = f_s + f_d is the apparent stiction (dead band and stick band), J = f_s - f_d the slip jump.
After a landing it sticks anew (He, Wang, Pottmann and Qin 2007), or slides on behind the output until that turns
(Kano 2004, Choudhury 2005): a slow and a quick actuator. The output is on record, so no loop is simulated, and a slip
that came early or late is forgotten at the next landing.
"""

import numpy as np
import numpy.typing as npt

from workbench.loops.loop_record import Array


def rest_positions(output: Array, stiction: Array, slip_jump: Array, slides_on: npt.NDArray[np.bool_]) -> Array:
    """Return the stems, (n, g), of an output, (n,), for g triples of S, J and manner, (g,) each; all in one unit."""
    breaks, slides = 0.5 * (stiction + slip_jump), 0.5 * (stiction - slip_jump)
    stems = np.empty((output.size, stiction.size))
    stem, way = np.full(stiction.size, float(output[0])), np.zeros(stiction.size)
    for row, now in enumerate(output.tolist()):
        load = now - stem
        landing = now - np.copysign(slides, load)
        slips = np.abs(load) > breaks
        follows = slides_on & (way * (now - way * slides - stem) > 0.0)
        stem = np.where(slips | follows, np.where(slips, landing, now - way * slides), stem)
        way = np.where(slips, np.sign(load), np.where(follows, way, 0.0))
        stems[row] = stem
    return stems
