"""The workbench: hold the model against measurements, see where it fails, fit it, find what it lacks.

    from workbench import Recording, compare, diagnose, fit

    recording = Recording.read("rec.csv")
    print(compare(recording, load_valve("valve.toml")).sentences)
    better = fit(recording, load_valve("valve.toml")).valve
    print(diagnose(recording, load_valve("valve.toml")).sentence)

Its rooms, each on those before it:

    data           a recording made ready
    model          the model run through it
    compare        where it fails
    fit            the parameters that explain it
    select         which effect is missing: the library refitted, the rule by which one is added
    discover       the form of an effect that the library lacks
    diagnosis      what is said of it, and the valve with it
    forces         the same where a rig imposes the position, and there is nothing to simulate
    discriminate   rivals told apart by experiments
    blind          recordings with an effect that nobody knows
    report         all of it for a browser
    fleet          many valves at once
    loops          control loops without a stem signal
"""

from config.recording import Recording
from workbench.compare.comparison import Comparison, compare
from workbench.data.imposed_motion import read_imposed
from workbench.diagnosis.diagnosis import Diagnosis, diagnose
from workbench.diagnosis.extension import Extension, extend
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import fit
from workbench.forces.force_diagnosis import ForceDiagnosis, diagnose_forces

__all__ = [
    "Comparison",
    "Diagnosis",
    "Extension",
    "Fit",
    "ForceDiagnosis",
    "Recording",
    "compare",
    "diagnose",
    "diagnose_forces",
    "extend",
    "fit",
    "read_imposed",
]
