"""What the stem is by the measured pressure, where the model's pressure is another.

A hysteresis of the I/P, a supply that sags or a noise of its own stands in for friction and spring: the position fits,
and the packing is called what it is not. Where the actuator's pressure was measured, that shows: the best model is
fitted once more from the measured pressure on, without the pressure path, and what is another then is said.

    A e_rms > 3 % of F_c      e as `pressure_errors` has it, without the transmitter's noise

Noise of the transmitter that hangs together from sample to sample counts, too, and is not told from what the actuator
does. But it moves no stem: where the stem follows the command better, that is said besides.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from config.drive import Kind
from workbench.diagnosis.diagnosis_thresholds import DIAGNOSIS
from workbench.diagnosis.doubt import Case, Doubt
from workbench.diagnosis.pressure_scale import PressureScale, pressure_scale
from workbench.fit.fitting import fit
from workbench.select.effect_candidates import EvaluatedModel, model_json, outdoes
from workbench.select.effect_search import evaluated


@dataclass(frozen=True, slots=True, repr=False)
class ByMeasuredPressure(Doubt):
    """A model whose pressure is off the measured one, and what it is from that one on."""

    key: ClassVar[str] = "by_pressure"

    off_pa: float
    of_friction: float
    """What that is on the diaphragm, of F_c."""
    model: EvaluatedModel
    """From the measured pressure on."""
    others: tuple[tuple[str, float, float], ...]
    """Parameters that are others: name, from the command on, from the measured pressure on."""
    commanded_rmse_m: float
    """Held out, from the command on."""
    worse: bool
    """Whether the stem follows the command better."""

    def sentence(self, kind: Kind) -> str:
        """Say so."""
        read, word = kind.command.read, kind.command.word
        others = "".join(f", {name} {after:.4g}, not {before:.4g}" for name, before, after in self.others)
        error = kind.length.said(self.model.errors.test_rmse_m)
        return kind.text(
            f"the measured {word} differs from the model's by {read.said(self.off_pa)} rms, {self.of_friction:.0%} of "
            f"the friction; driven by the measured one, the valve leaves a held-out error of {error}{others}"
            f"{self._doubt(kind)}"
        )

    def as_json(self) -> dict[str, Any]:
        """Return it in plain types, with the model from the measured pressure on."""
        return {"off_pa": self.off_pa, **model_json(self.model)}

    def _doubt(self, kind: Kind) -> str:
        if not self.worse:
            return ""
        return (
            f"; driven by the command, {kind.length.said(self.commanded_rmse_m)}. Slow noise of the transmitter would "
            "look so, and moves no stem"
        )


def by_measured_pressure(case: Case) -> ByMeasuredPressure | PressureScale | None:
    """Return what the best model is from the measured pressure on; None where its own pressure is that one.

    Where that pressure is on another scale than the command, that is said in its place. Nor is it asked behind a
    positioner, whose set point is no pressure (`positioner_or_packing`).
    """
    best, record = case.best, case.parts.train.record
    if best.pressure is None or record.by_setpoint:
        return None
    valve, off_pa = best.fit.valve.valve, best.pressure.structured_pa
    of_friction = valve.diaphragm_area_m2 * off_pa / valve.coulomb_n if valve.coulomb_n else 0.0
    if of_friction <= DIAGNOSIS.pressure_off:
        return None
    if scale := pressure_scale(record):
        return scale
    model = driven_otherwise(case)
    others = tuple(
        (name, before.value, after.value)
        for name, after in model.fit.parameters.items()
        if (before := best.fit.parameters.get(name))
        and abs(after.value - before.value) > DIAGNOSIS.another_value * abs(before.value)
    )
    return ByMeasuredPressure(off_pa, of_friction, model, others, best.errors.test_rmse_m, outdoes(best, model))


def driven_otherwise(case: Case) -> EvaluatedModel:
    """Return the best model fitted once more, by the command if it was by the measured pressure, or the other way."""
    best, parts, by_pressure = case.best, case.parts, not case.best.fit.from_pressure
    what = f"fitting {'from the measured pressure' if by_pressure else 'by the command'}"
    found = fit(
        parts.train.recording,
        best.fit.valve,
        workers=case.workers,
        from_pressure=by_pressure,
        progress=lambda done: case.progress(what, done),
    )
    return evaluated(found, parts)
