"""Control loops without a stem signal: does the valve stick, told from output OP, process value PV and set point SP.

    record = LoopRecord.of_samples("FIC101", time_s, op_pct, pv, sp)
    print(diagnose_loop(record).summary())

The loop is never simulated: the controller's output is on record and is fed to the stem, the stem to the process. Three
answers: sticks (how much, how sure), something else (what), cannot be told (why, and what to record instead).

    loop_diagnosis      puts it together: the verdict on one loop
    joint               several records of one valve taken together
    loop_record         the samples of a loop on an even clock
    quality_gates       what a record cannot tell, before anything is worked out
    oscillation         the period and how regular it is; the time scale of a loop
    controller_law      the PI law, seen in OP against SP - PV
    stem_and_process    PV as a stem and a process make it of OP, and how likely that is, compiled
    causes              causes held against each other by likelihood
    calibration         from evidence to the probability that the valve sticks
    literature_votes    methods of the literature, which vote beside it
    remedies            what to do: retune or compensate, simulated on the identified loop
    plant               many loops: ranked, and which of them oscillate together
    loop_report         all of it as a page
    loop_thresholds     every number by which something is decided
"""

from workbench.loops.loop_diagnosis import LoopDiagnosis, diagnose_loop
from workbench.loops.loop_record import LoopRecord

__all__ = ["LoopDiagnosis", "LoopRecord", "diagnose_loop"]
