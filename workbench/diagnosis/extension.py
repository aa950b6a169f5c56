"""Extend: add effects to a valve, refit, and say how the error on held-out data fell.

as given     the valve file as it is
refitted     its own parameters fitted to the recording, nothing added: what the effects have to beat
extended     the effects added, everything fitted; without effects the refitted valve itself
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from config.arguments import kinds_held
from config.errors import InputError
from config.recording import Recording
from config.results.block import Block, Table
from config.results.result import Result
from config.valve_file import ValveFile
from sim.effect import find_effect, find_effects
from workbench.data.held_out import Split, residual_m, split
from workbench.diagnosis.diagnosis import Diagnosis
from workbench.diagnosis.error_before_fit import AsGiven
from workbench.diagnosis.pressure_scale import pressure_scale
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import fit
from workbench.fit.parameter_estimate import parameter_table
from workbench.select.block_errors import BlockErrors, block_errors
from workbench.select.effect_acceptance import Gain, gain
from workbench.select.effect_candidates import EvaluatedModel
from workbench.select.pressure_scatter import with_pressure_scatter

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True, repr=False)
class Extension(Result):
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
        """Whether the effects, or without any the refit, lower the held-out error below that of the valve before."""
        if not self.effects:
            return self.extended_errors.test_rmse_m < self.given_test_rmse_m
        return self.gain.held_out > 0.0 and self.extended_errors.test_rmse_m < self.refitted_errors.test_rmse_m

    @property
    def stages(self) -> Mapping[str, tuple[float, float]]:
        """The rms error, m, fitted and held out, of each valve on the way."""
        before, after = self.refitted_errors, self.extended_errors
        stages = {
            "as given": (self.given_train_rmse_m, self.given_test_rmse_m),
            "refitted, nothing added": (before.train_rmse_m, before.test_rmse_m),
        }
        return stages | ({self.named: (after.train_rmse_m, after.test_rmse_m)} if self.effects else {})

    @property
    def named(self) -> str:
        """What the new valve is, in words."""
        return f"with {', '.join(self.effects)}" if self.effects else "refitted, nothing added"

    def blocks(self) -> list[Block]:
        """Say whether the effects help, the errors on the way, and the parameters of the new valve."""
        before_m = self.refitted_errors.test_rmse_m if self.effects else self.given_test_rmse_m
        after_m = self.extended_errors.test_rmse_m
        length = self.extended.kind.length
        falls = "falls from" if self.falls else "does not fall by more than chance: from"
        rows = [
            (what, length.number(train_m, ".4g"), length.number(test_m, ".4g"))
            for what, (train_m, test_m) in self.stages.items()
        ]
        floor = "unknown" if self.split.floor_m is None else length.number(self.split.floor_m, ".4g")
        by_command = self.extended.from_pressure and self.split.by_pressure is None
        rows.append(("floor: least error of any model" + BY_COMMAND * by_command, floor, floor))
        scale = pressure_scale(self.split.train.record) if self.extended.from_pressure else None
        return [
            f"{self.named}{'' if self.effects else ':'} the held-out error {falls} {length.number(before_m, '.4g')} to "
            f"{length.said(after_m, '.4g')} rms",
            Table((f"error, {length.unit} rms", "fitted", "held out"), rows),
            parameter_table(self.extended.parameters, self.extended.kind),
            *([f"but {scale.sentence(self.extended.kind)}"] if scale else []),
            *([self.extended.by.sentence] if self.extended.by.sentence else []),
        ]

    def frame_columns(self) -> dict[str, list[object]]:
        """Return a row a valve on the way: its rms errors, m."""
        return {
            "stage": list(self.stages),
            "train_rmse_m": [train_m for train_m, _ in self.stages.values()],
            "test_rmse_m": [test_m for _, test_m in self.stages.values()],
        }

    def plot(self) -> "Figure":
        """Draw the error on what was held out, refitted without the effects and with them, over time."""
        from config.results.drawing import BETTER, MODEL, legend, line, panels

        part, length = self.split.test, self.extended.kind.length
        figure, (axes,) = panels({f"error on held-out data, {length.unit}": 4.0}, "time, s")
        for name, found, errors, colour in (
            ("refitted, nothing added", self.refitted, self.refitted_errors, MODEL),
            *([(self.named, self.extended, self.extended_errors, BETTER)] if self.effects else []),
        ):
            error_m = residual_m(part, found.indicated_m(part.record))
            label = f"{name}: {length.said(errors.test_rmse_m)} rms"
            line(axes, part.record.time_s - part.record.time_s[0], length.factor * error_m, colour, label)
        legend(axes)
        return figure


BY_COMMAND = " by the command"
"""Of a floor: a measured pressure tells why the valve does not repeat itself."""


@kinds_held
def extend(
    recording: Recording | Sequence[Recording],
    valve: ValveFile,
    effects: Sequence[str],
    *,
    test: Recording | None = None,
    diagnosis: Diagnosis | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
    from_pressure: bool = False,
) -> Extension:
    """Add effects to a valve file and refit it.

    Args:
        recording: one or several.
        valve: the valve to be extended.
        effects: names, or paths of own effects' files, to be added together; none: the valve is refitted as it is.
        test: held out; by default the last third of the recording.
        diagnosis: of the same recordings and valve: its fits are gone on from, so that nothing ends worse than there.
        workers: threads, by default one a core.
        progress: called with what is being done, and the fraction of it done.
        from_pressure: the stem is driven by its measured pressure; the diagnosis, if any, says itself whether it is.

    Raises:
        InputError: the recording holds too little or other units than SI, an unknown effect or one that is there.
    """
    there = {find_effect(each.name, "valve file").name for each in valve.effect}
    for name, found in zip(effects, find_effects(effects, "effects"), strict=True):
        if found.name in there:
            raise InputError("valve file", f"effect {name} is there already")
    tell = progress or (lambda _what, _done: None)
    on = split([recording] if isinstance(recording, Recording) else recording, test)
    train = on.train.recording
    if diagnosis is None:
        before = fit(
            train,
            valve,
            workers=workers,
            from_pressure=from_pressure,
            progress=lambda done: tell("fitting without", done),
        )
    else:
        before = diagnosis.base.fit
    after = before
    if effects:
        after = fit(
            train,
            valve,
            effects=tuple(effects),
            base=before,
            workers=workers,
            progress=lambda done: tell(f"fitting with {', '.join(effects)}", done),
        )
    on = with_pressure_scatter(on, before)
    there_already = diagnosis.fit_with(effects) if diagnosis and effects else None
    if there_already is not None and there_already.cost < after.cost:
        after = there_already
    refitted = EvaluatedModel(before, block_errors(before, on), on.floor_m)
    extended = EvaluatedModel(after, block_errors(after, on), on.floor_m) if effects else refitted
    return _extension(tuple(effects), AsGiven.of(valve, on, before), refitted, extended, on)


def extension_of(diagnosis: Diagnosis) -> Extension:
    """Return what a diagnosis has added to the valve that it began with; nothing is fitted again."""
    return _extension(diagnosis.missing, diagnosis.given, diagnosis.base, diagnosis.best, diagnosis.split)


def _extension(
    effects: tuple[str, ...], given: AsGiven, before: EvaluatedModel, after: EvaluatedModel, on: Split
) -> Extension:
    return Extension(
        effects=effects,
        given_train_rmse_m=given.errors.train_rmse_m,
        given_test_rmse_m=given.errors.test_rmse_m,
        refitted=before.fit,
        refitted_errors=before.errors,
        extended=after.fit,
        extended_errors=after.errors,
        gain=gain(before.fit, after.fit, before.errors, after.errors),
        split=on,
    )
