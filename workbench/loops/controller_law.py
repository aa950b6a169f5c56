"""The controller's own law, seen in its output against the control error e = SP - PV.

    OP(t) - OP(t-1) = K (e(t) - e(t-1)) + (K T / T_i) e(t)

K in % per unit of PV, T_i reset time, T sampling period. The sign of K is the loop's action: the process has the same.
"""

from dataclasses import dataclass

import numpy as np

from workbench.loops.loop_record import LoopRecord
from workbench.loops.loop_thresholds import LIMITS


@dataclass(frozen=True, slots=True)
class ControllerLaw:
    """A PI law as the record shows it.

    Attributes:
        gain: K, % per unit of PV.
        reset_s: T_i; infinite where no integral part is seen.
        explained: share of OP's changes that the law explains.
        action: sign of the process's gain: +1, -1; 0 where the record does not show it.
    """

    gain: float
    reset_s: float
    explained: float
    action: int

    @property
    def seen(self) -> bool:
        """Whether the law is taken as seen."""
        return self.explained > LIMITS.law_is_seen


def see_law(record: LoopRecord) -> ControllerLaw:
    """Return the law of a record's controller."""
    sp = np.full(record.pv.size, record.pv.mean()) if record.sp is None else record.sp
    error = sp - record.pv
    unknowns = np.column_stack([np.diff(error), error[1:]])
    changes = np.diff(record.op_pct)
    scale = np.maximum(unknowns.std(axis=0), 1e-12)
    found = np.linalg.lstsq(unknowns / scale, changes, rcond=None)[0]
    left = changes - unknowns / scale @ found
    changed = float(changes @ changes)
    explained = 1.0 - float(left @ left) / changed if changed > 0.0 else 0.0
    gain, integral = (found / scale).tolist()
    action = int(np.sign(found.sum())) if explained > ACTION_SHOWS else 0
    reset_s = gain / integral * record.period_s if gain * integral > 0.0 else float("inf")
    return ControllerLaw(gain, reset_s, max(0.0, explained), action)


ACTION_SHOWS = 0.02
"""Share of OP's changes that the law must explain before its sign is believed: noise alone explains 2 in n."""
