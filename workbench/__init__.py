"""The workbench: hold the model against measurements, see where it fails, fit it, find what it lacks.

    from workbench import Recording, compare, diagnose, fit

    recording = Recording.read("rec.csv")
    print(compare(recording, load_valve("valve.toml")).sentences)
    better = fit(recording, load_valve("valve.toml")).valve
    print(diagnose(recording, load_valve("valve.toml")).sentence)

`record` makes a recording ready for simulation and tells what is wrong with it, `free_run` simulates it, `comparison`
holds the two against each other, `fitting` finds the parameters, `diagnosis` the effects that are missing, `extension`
adds them, `report` writes it all down for a browser. Where a rig imposes the position there is nothing to simulate:
`imposed` reads such forces, `force_balance` balances them, `force_diagnosis` says what the balance lacks.
`hiding` draws recordings with an effect nobody knows.
"""

from config.recording import Recording
from workbench.compare.comparison import Comparison, compare
from workbench.data.imposed_motion import read_imposed
from workbench.fit.fitting import Fit, fit
from workbench.forces.force_diagnosis import ForceDiagnosis, diagnose_forces
from workbench.select.diagnosis import Diagnosis, diagnose
from workbench.select.extension import Extension, extend

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
