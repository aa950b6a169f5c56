"""What a valve file leaves of a recording as it was given, before any parameter is fitted.

holds     what was held out has no evidence for the model that was found, or hardly any, or less than overwhelming and
          from events whose mean is within `SELECTION.most_moved` standard errors: whatever a fit would rather have, the
          recording does not refute the file. Where break-aways scatter, evidence does by as much as is asked
          (`workbench.select.effect_acceptance`)
is off    it does worse, and leaves more than `compare` calls adequate: where the refitted valve explains all, no
          effect is missing
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from config.results.result import Brief
from config.valve_file import ValveFile
from workbench.compare.comparison import ADEQUATE
from workbench.data.held_out import Split, residual_m
from workbench.fit.fit_result import NOTHING, Fit
from workbench.select.block_errors import BlockErrors, block_errors, relative_error_reduction
from workbench.select.selection_thresholds import SELECTION


@dataclass(frozen=True, slots=True, repr=False)
class AsGiven(Brief):
    """The errors of a valve file as it was given; the floor, m, None if it is unknown."""

    errors: BlockErrors
    floor_m: float | None

    @classmethod
    def of(cls, valve: ValveFile, split: Split, like: Fit) -> Self:
        """Simulate a valve file as a fit was."""
        given = replace(like, valve=valve, parameters={}, known=NOTHING)
        error_m = residual_m(split.train, given.indicated_m(split.train.record))
        given = replace(given, rms_m=float(np.sqrt(np.nanmean(error_m**2))))
        return cls(block_errors(given, split), split.floor_m)

    def holds(self, best: BlockErrors) -> bool:
        """Whether the recording does not tell the file from the model that was found, whose errors these are."""
        evidence = 2.0 * best.held_out.nats_above(self.errors.held_out)
        _, standard_errors = relative_error_reduction(self.errors.logs, best.logs)
        scatters = evidence <= SELECTION.overwhelming_evidence and standard_errors <= SELECTION.most_moved
        return evidence <= SELECTION.least_held_out or scatters

    def is_off(self, best: BlockErrors) -> bool:
        """Whether it leaves what `compare` would not call adequate, and the model that was found does better."""
        most_m = max(self.errors.train_rmse_m, self.errors.test_rmse_m)
        return self.floor_m is not None and most_m > ADEQUATE * self.floor_m and not self.holds(best)
