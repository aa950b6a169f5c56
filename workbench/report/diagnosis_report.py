"""The report of a diagnosis: what is missing, how the error fell, what is not told apart, what to measure next."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from config.recording import Recording
from sim.effect import find_effect
from workbench.compare.comparison import Comparison, compare
from workbench.data.held_out import Split
from workbench.diagnosis.diagnosis import Diagnosis
from workbench.fit.parameter_estimate import Fitted
from workbench.model.simulation_regime import MORE_LANDINGS
from workbench.report import effect_ranking
from workbench.report import report_html as page
from workbench.report.charts import EXTENDED, MODEL, QUIET, axis, layout, line
from workbench.report.comparison_report import MEANINGS, WORDS, facts, overlaid, recording
from workbench.report.display_units import Reading, Shown, of_stroke, times
from workbench.report.effects_table import RankedStep, headline, not_told_apart, ranks, show_added, show_tried
from workbench.report.overlay import HELD_OUT, Mask, Shade, Simulated, overlay
from workbench.report.plot_series import draw_series, round_values
from workbench.report.signature_loop import signature
from workbench.select.effect_candidates import EffectCandidate, EvaluatedModel
from workbench.select.equivalence import undetectable
from workbench.select.selection_thresholds import SELECTION
from workbench.select.separating_experiment import Experiment

DIAGNOSIS_WORDS = {
    "Effect": "One piece of physics on the way from the command to the indicated position: a lag, a kind of friction, "
    "backlash in the linkage, a sensor's fault.",
    "Fitted, held out": "The model's parameters are fitted to one part of the data. The other part is held out: "
    "the model has not seen it, so an error that falls there shows more than a good fit.",
    "Evidence": "How much better an effect explains the fitted part than the model without it, less a price for "
    f"each parameter it brings (gain of the Bayesian information criterion). Above {SELECTION.least_evidence:g} it "
    f"counts. Held out, where nothing was fitted, no price is taken: above {SELECTION.least_held_out:g} it counts.",
    "95 % interval": "The parameter lies in it with a probability of 95 %.",
    "Rival": "An effect that explains the recording as well as the one that was added.",
    "Told simulation": "The simulation is told when the stem moves, as the recording shows it. It computes where the "
    "stem goes.",
}


@dataclass(frozen=True, slots=True)
class _Validation:
    """What the report takes from a diagnosis beyond its models: the recording held out, and which rows of it."""

    recording: Recording
    held_out: Mask
    floor_m: float | None
    base: Comparison
    best: Comparison


def _validation(diagnosis: Diagnosis) -> _Validation:
    part = diagnosis.split.test
    base, best = (compare(part.recording, each.fit.valve) for each in (diagnosis.base, diagnosis.best))
    return _Validation(part.recording, part.counted, diagnosis.split.floor_m, base, best)


def report_diagnosis(diagnosis: Diagnosis, path: Path, subject: page.Subject, commands: Sequence[str] = ()) -> None:
    """Write the report.

    Args:
        diagnosis: what `diagnose` returned.
        path: the HTML file.
        subject: the valve as it was given, and the recordings.
        commands: that act on the verdict, to be typed.

    Raises:
        InputError: plotly is not installed, or the file cannot be written.
    """
    validation = _validation(diagnosis)
    name = subject.valve.valve.name
    page.write(
        path,
        f"{diagnosis.kind.noun} {name}: which effect is missing",
        [
            page.heading(
                f"{diagnosis.kind.noun} “{name}”: which effect is missing", subject, _facts(diagnosis, validation)
            ),
            _verdict(diagnosis, validation),
            _key_figures(diagnosis, validation),
            _fall(diagnosis, validation),
            _overlay(validation),
            *([] if validation.base.by_setpoint else [_signature(validation)]),
            _where(validation),
            _ranking(diagnosis, validation),
            _section_of_added(diagnosis),
            not_told_apart(diagnosis.indistinguishable, _names(diagnosis), diagnosis.missing, "see the next section"),
            _next(diagnosis, commands),
            _undetectable(diagnosis),
            _preview(diagnosis),
            recording(subject, diagnosis.split.train.record.notes, []),
            page.section("words", "Words used here", page.glossary(DIAGNOSIS_WORDS | WORDS)),
        ],
    )


def _facts(diagnosis: Diagnosis, validation: _Validation) -> str:
    held_out, fitted = int(validation.held_out.sum()), int(diagnosis.split.train.counted.sum())
    if held_out < len(validation.recording):
        return f"{facts(validation.base)}; {fitted} fitted, {held_out} held out"
    return f"fitted {fitted} samples; held out {facts(validation.base)}"


def _verdict(diagnosis: Diagnosis, validation: _Validation) -> page.Html:
    return page.verdict(
        *headline(diagnosis.verdict, diagnosis.missing, parameters_off=diagnosis.parameters_off),
        page.text(diagnosis.sentence, "Where the model failed before:"),
        page.bullets(validation.base.sentences),
    )


def _key_figures(diagnosis: Diagnosis, validation: _Validation) -> page.Html:
    before, after, read = diagnosis.base.errors, diagnosis.best.errors, Reading(diagnosis.kind)
    stroke_m = diagnosis.base.fit.valve.valve.stroke_m
    added = ", ".join(find_effect(name, "effects").name.replace("_", " ") for name in diagnosis.missing)
    return page.figures_of_merit(
        [
            (
                read.title("Held-out error before, rms, mm"),
                read.length(before.test_rmse_m),
                f"{of_stroke(before.test_rmse_m, stroke_m)}, base parameters refitted",
            ),
            (read.title("and after, mm"), read.length(after.test_rmse_m), of_stroke(after.test_rmse_m, stroke_m)),
            (read.title("Floor, mm"), read.length(validation.floor_m), "no model does better"),
            ("Added", Shown(added or "nothing"), f"of {len(_names(diagnosis))} effects tried"),
        ]
    )


def _names(diagnosis: Diagnosis) -> frozenset[str]:
    return frozenset(each.name for each in diagnosis.candidates)


def _fall(diagnosis: Diagnosis, validation: _Validation) -> page.Html:
    stages: list[tuple[str, EvaluatedModel, EffectCandidate | None]] = [("as it was, refitted", diagnosis.base, None)]
    stages += [
        (f"+ {step.added.name}", step.added.model, step.added)
        for step in diagnosis.steps
        if step.added and step.added.model
    ]
    errors = [(name, model.errors.train_rmse_m, model.errors.test_rmse_m) for name, model, _ in stages]
    read = Reading(diagnosis.kind)
    figure = effect_ranking.error_reduction(errors, validation.floor_m, read.errors)
    rows = [
        page.Row(
            [
                name,
                read.length(model.errors.train_rmse_m),
                read.length(model.errors.test_rmse_m),
                times(model.errors.test_rmse_m, validation.floor_m),
                read.length(model.errors.test_block_m),
                "–" if candidate is None or candidate.gain is None else f"{candidate.gain.bic:.4g}",
            ],
            "" if model.explained else "something is left to explain",
            "good" if model.explained else "",
        )
        for name, model, candidate in stages
    ]
    head = ["Model", "Error, fitted, mm", "Held out, mm", "In floors", "Median move, held out, mm", "Evidence"]
    head = [read.title(each) for each in head]
    return page.section(
        "fall",
        "How the error fell",
        page.plot(
            "plot-fall",
            figure,
            300,
            f"Error, rms, of each model, on a logarithmic scale. No model was fitted to the held-out data. Dashed: the "
            f"floor, {read.said(validation.floor_m)}.",
        ),
        page.table("table-fall", head, rows),
        page.text(
            "All errors are those of the told simulation. A move is taken with the rest that it ends in. One bad move "
            "does not change the median, and raises the rms."
        ),
    )


def _models(validation: _Validation) -> list[Simulated]:
    base, best = validation.base, validation.best
    models = [Simulated("before", MODEL, base.simulated_m)]
    if base is not best and not np.array_equal(base.simulated_m, best.simulated_m, equal_nan=True):
        models.append(Simulated("after", EXTENDED, best.simulated_m))
    return models


def _signature(validation: _Validation) -> page.Html:
    base = validation.base
    return signature(base.command_pa, base.measured_m, _models(validation), Reading(base.own))


def _overlay(validation: _Validation) -> page.Html:
    base = validation.base
    whole = bool(validation.held_out.all())
    figure = overlay(
        base.time_s,
        base.command_pa,
        base.measured_m,
        _models(validation),
        [] if whole else [Shade("held out", HELD_OUT, validation.held_out)],
        by_setpoint=base.by_setpoint,
        read=Reading(base.own),
    )
    told = "All of it was held out." if whole else "Green background: held out."
    return overlaid(figure, told, base.time_s.size)


def _where(validation: _Validation) -> page.Html:
    read = Reading(validation.base.own)
    rows = [
        page.Row(
            [before.name, read.length(before.rms_m), read.length(after.rms_m), times(after.rms_m, validation.floor_m)],
            MEANINGS[before.name],
        )
        for before, after in zip(validation.base.phases, validation.best.phases, strict=True)
        if before.count
    ]
    slips = [
        f"slips {when}: {len(each.slips.matched)} matched, {len(each.slips.missed_s)} missed, "
        f"{len(each.slips.spurious_s)} spurious"
        for when, each in (("before", validation.base), ("after", validation.best))
    ]
    head = ["What the stem does", read.title("Error before, mm"), read.title("After, mm"), "After, in floors"]
    return page.section(
        "where",
        "Where it failed, and what is left",
        page.table("table-phases", head, rows),
        page.bullets([*slips, *(f"after: {each}" for each in validation.best.sentences)]),
    )


def _ranking(diagnosis: Diagnosis, validation: _Validation) -> page.Html:
    steps = [RankedStep(step.before.effects, step.before.errors.test_rmse_m, ranks(step)) for step in diagnosis.steps]
    return show_tried(steps, validation.floor_m, Reading(diagnosis.kind).errors)


def _section_of_added(diagnosis: Diagnosis) -> page.Html:
    read = Reading(diagnosis.kind)
    names = dict.fromkeys([*diagnosis.base.fit.parameters, *diagnosis.best.fit.parameters])
    rows = [
        _parameter(name, diagnosis.base.fit.parameters.get(name), diagnosis.best.fit.parameters.get(name), read)
        for name in names
    ]
    head = ["Parameter", "Before", "After", "95 % interval", "Unit"]
    return show_added(diagnosis.missing, page.table("table-parameters", head, rows, (0,)))


def _parameter(name: str, before: Fitted | None, after: Fitted | None, read: Reading) -> page.Row:
    words, factor, unit = read.parameter(name)

    def show_fitted(each: Fitted | None) -> Shown:
        return (
            Shown("–")
            if each is None
            else Shown(f"{factor * each.value:.4g}", f"{read.kind.text(name)} = {each.value:.6g}")
        )

    interval = "–" if after is None else f"{factor * after.lower:.4g} to {factor * after.upper:.4g}"
    remark = "at the end of its physical range" if after and after.at_bound else ""
    return page.Row([words, show_fitted(before), show_fitted(after), interval, unit], remark)


def _next(diagnosis: Diagnosis, commands: Sequence[str]) -> page.Html:
    chosen = diagnosis.experiment
    adding = (page.text("To add what is missing, type:" if len(commands) == 1 else "To add one of them, type:"),)
    acting = (*adding, page.keep_lines("\n".join(commands))) if commands else ()
    if chosen is None or not chosen.separates:
        return page.section("next", "What to do next", *acting, page.bullets(_advice(diagnosis)))
    return page.section(
        "next",
        "What to do next",
        page.text(
            f"Play this command to the valve: {chosen.sentence}. It stays within the pressures of the recording and "
            "begins at rest.",
        ),
        page.plot(
            "plot-experiment",
            _command(chosen, Reading(diagnosis.kind)),
            260,
            "The command of the experiment; --experiment FILE writes it.",
        ),
        page.text("Then diagnose again with both recordings."),
        *acting,
    )


def _to_be_judged(split: Split) -> str:
    """Say what would let a recording be judged."""
    if split.early:
        return split.early.advice[0].lower() + split.early.advice[1:]
    if split.floor_m is not None:
        return MORE_LANDINGS
    return "give the noise of the sensor, --noise-m, or record the stem at rest: hold the command for 40 samples"


def _advice(diagnosis: Diagnosis) -> list[str]:
    advice = []
    if diagnosis.verdict == "adequate":
        advice.append("nothing is needed; record again when the valve has aged or been serviced")
    if diagnosis.verdict == "missing":
        advice.append("put the extended valve file into use, and compare it with a recording of another day")
    if diagnosis.verdict == "one_of":
        advice.append(
            "no command of the menu tells all of these apart; look at what the table above names, or measure it"
        )
    if diagnosis.verdict in ("unexplained", "untrusted"):
        advice.append(
            "record again with slow ramps, steps of several heights and restarts in the same direction after holds"
        )
        advice.append("write the missing effect as a file of your own, where the section above says what is left")
    if diagnosis.verdict == "unjudged":
        advice.append(_to_be_judged(diagnosis.split))
    if diagnosis.verdict == "unfinished":
        advice.append("let the diagnosis run through, or name fewer effects, --effects")
    if diagnosis.split.train.record.pressure_pa is None and diagnosis.verdict != "adequate":
        advice.append("record the actuator pressure, too: it tells effects before the actuator from those at the stem")
    if diagnosis.split.train.record.repeatability_m is None:
        advice.append("let the command repeat a stretch of some seconds: this shows the repeatability of the valve")
    return advice


def _command(chosen: Experiment, read: Reading) -> dict[str, object]:
    series, command = draw_series(chosen.time_s, chosen.command_pa), read.kind.command.read
    trace = line(
        round_values(series.time_s, 4),
        round_values(command.factor * series.value, 3),
        "command",
        QUIET,
        f"%{{y:.2f}} {command.unit} (%{{customdata:.6~g}} {read.kind.command.si})<br>at %{{x:.3f}} s",
        customdata=round_values(series.value, 0),
    )
    return {
        "data": [trace],
        "layout": layout(xaxis=axis("time, s"), yaxis=axis(f"command, {command.unit}"), showlegend=False),
    }


def _undetectable(diagnosis: Diagnosis) -> page.Html:
    best, read = diagnosis.best.fit, Reading(diagnosis.kind)
    said = [each.sentence(lambda name: read.parameter(name)[0]) for each in best.undetermined]
    said += [
        f"at the end of its physical range: {read.parameter(key)[0]}"
        for key, f in best.parameters.items()
        if f.at_bound
    ]
    said += [each.sentence for each in undetectable(diagnosis.split, best.valve)]
    if not best.trusted:
        said.append("searches from independent starts end at different parameters: a better fit may exist")
    said.append("pressure and position show ratios of forces only: the diaphragm area is that of the valve file")
    said.append("an effect that does not show under this recording's inputs may still be there")
    return page.section("undetectable", "What the recording cannot show", page.bullets(said))


def _preview(diagnosis: Diagnosis) -> page.Html:
    rows = [page.Row([each.name, f"{100 * each.score:.3g} %"]) for each in diagnosis.preview]
    return page.fold_parts(
        "preview",
        "For specialists: the first guess, before any effect was fitted",
        page.text(
            "Share of the error that a weak effect of each kind would explain. It names the right effect in about two "
            "of three cases."
        ),
        page.table("table-preview", ["Effect", "Share"], rows),
    )
