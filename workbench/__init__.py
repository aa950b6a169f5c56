"""The workbench: hold the model against measurements, see where it fails, fit it.

    from workbench import Recording, compare, fit

    recording = Recording.read("rec.csv")
    print(compare(recording, load_valve("valve.toml")).sentences)
    better = fit(recording, load_valve("valve.toml")).valve

`record` makes a recording ready for simulation and tells what is wrong with it, `free_run` simulates it, `comparison`
holds the two against each other, `fitting` finds the parameters.
"""

from config.recording import Recording
from workbench.comparison import Comparison, compare
from workbench.fitting import Fit, fit

__all__ = ["Comparison", "Fit", "Recording", "compare", "fit"]
