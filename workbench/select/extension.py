"""Extend: add effects to a valve, refit, and say how the error on held-out data fell.

as given     the valve file as it is
refitted     its own parameters fitted to the recording, nothing added: what the effects have to beat
extended     the effects added, everything fitted
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from config.errors import InputError
from config.recording import Recording
from config.valve_file import ValveFile
from sim.composition import Composition
from sim.effect import find_effect
from workbench.data.held_out import Part, Split, residual_m, split
from workbench.fit.fitting import Fit, fit
from workbench.model.free_run import FreeRun
from workbench.select.block_errors import BlockErrors, block_errors
from workbench.select.effect_acceptance import Gain, gain

Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class Extension:
    """A valve with effects added, and the errors on the way."""

    effects: tuple[str, ...]
    given_train_rmse_m: float
    given_test_rmse_m: float
    refitted: Fit
    refitted_errors: BlockErrors
    extended: Fit
    extended_errors: BlockErrors
    gain: Gain
    split: Split

    @property
    def valve(self) -> ValveFile:
        """The new valve file."""
        return self.extended.valve

    @property
    def falls(self) -> bool:
        """Whether the effects lower the held-out error below that of the refitted valve without them."""
        return self.gain.held_out > 0.0 and self.extended_errors.test_rmse_m < self.refitted_errors.test_rmse_m


def extend(
    recording: Recording | Sequence[Recording],
    valve: ValveFile,
    effects: Sequence[str],
    *,
    test: Recording | None = None,
    seed: int = 0,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Extension:
    """Add effects to a valve file and refit it.

    Args:
        recording: one or several.
        valve: the valve to be extended.
        effects: names, or paths of own effects' files, to be added together.
        test: held out; by default the last third of the recording.
        seed: of the searches.
        workers: threads, by default one a core.
        progress: called with what is being done, and the fraction of it done.

    Raises:
        InputError: the recording holds too little or other units than SI, an unknown effect or one that is there.
    """
    there = {find_effect(each.name, "valve file").name for each in valve.effect}
    for name in effects:
        if find_effect(name, "effects").name in there:
            raise InputError("valve file", f"effect {name} is there already")
    tell = progress or (lambda _what, _done: None)
    on = split([recording] if isinstance(recording, Recording) else recording, test)
    train = on.train.recording
    before = fit(train, valve, seed=seed, workers=workers, progress=lambda done: tell("fitting without", done))
    after = fit(
        train,
        before.valve,
        effects=tuple(effects),
        base=before,
        seed=seed,
        workers=workers,
        progress=lambda done: tell(f"fitting with {', '.join(effects)}", done),
    )
    before_errors, after_errors = block_errors(before, on), block_errors(after, on)
    return Extension(
        effects=tuple(effects),
        given_train_rmse_m=_rmse_m(valve, on.train),
        given_test_rmse_m=_rmse_m(valve, on.test),
        refitted=before,
        refitted_errors=before_errors,
        extended=after,
        extended_errors=after_errors,
        gain=gain(before, after, before_errors, after_errors),
        split=on,
    )


def _rmse_m(valve: ValveFile, part: Part) -> float:
    composition = Composition.from_file(valve)
    error_m = residual_m(part, FreeRun(composition, part.record).position_m(composition.theta))
    return float(np.sqrt(np.nanmean(error_m**2)))
