"""The report of a comparison: whether the model holds, and where it fails."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from config.recording import period_text
from workbench.compare.comparison import ADEQUATE, Comparison, Phase
from workbench.compare.comparison_sentences import shorten_notes
from workbench.compare.measures import fit_in_words
from workbench.report import report_html as page
from workbench.report.charts import MEASURED, MODEL, Figure, correlation, profiles, spectrum
from workbench.report.display_units import Reading, Shown, of_stroke, times
from workbench.report.overlay import Simulated, overlay, phase_shades
from workbench.report.plot_series import MOST_SERIES_POINTS, stretch
from workbench.report.signature_loop import signature

MEANINGS = {
    "stuck": "the stem rests",
    "slipping up": "the stem moves in the opening direction",
    "slipping down": "the stem moves in the closing direction",
    "reversal": "from the first slip of a new direction to the start of the next slip",
    "near stops": "within 2 % of the stroke of a stop",
}
WORDS = {
    "Free run": "The model is given the command and the stem's first position, and nothing else.",
    "Error": "Simulated less measured position. Positive: the model stands too far open.",
    "rms": "Root of the mean square: the usual size of the error, in which large errors weigh more.",
    "Floor": "The least error that any model can have: the noise of the position sensor. Where the command repeats "
    "itself, it is the valve's repeatability, if that is more.",
    "Fit": "100 % less the error's size in per cent of the measured motion's. 100 % is perfect; "
    "below 0 % a straight line would do better.",
    "Slip": "A stuck stem that breaks away and moves until it is stuck again.",
}
LISTED = 12
"""Times of slips that are spelt out."""


def report_comparison(
    comparison: Comparison, path: Path, subject: page.Subject, grown: Sequence[page.Html] = ()
) -> None:
    """Write the report.

    Args:
        comparison: what `compare` returned.
        path: the HTML file.
        subject: the valve and the recording that were compared.
        grown: sections of how the valve came to be.

    Raises:
        InputError: plotly is not installed, or the file cannot be written.
    """
    name = subject.valve.valve.name
    stroke_m = subject.valve.valve.stroke_m
    page.write(
        path,
        f"{comparison.own.noun} {name}: model against measurement",
        [
            page.heading(f"{comparison.own.noun} “{name}”: model against measurement", subject, facts(comparison)),
            page.verdict(*headline(comparison), page.bullets(comparison.sentences)),
            _key_figures(comparison, stroke_m),
            _overlay(comparison),
            *([] if comparison.by_setpoint else [_signature(comparison)]),
            _phases(comparison, stroke_m),
            _friction(comparison),
            _slips(comparison),
            _statistics(comparison),
            *grown,
            recording(subject, comparison.notes, _pressure(comparison)),
            page.section("words", "Words used here", page.glossary(WORDS)),
        ],
    )


def facts(comparison: Comparison) -> str:
    """Say how long a recording is and how finely sampled."""
    time_s = comparison.time_s
    steps = np.diff(time_s)
    forward = steps[steps > 0.0]
    return (
        f"{time_s.size} samples, {float(np.sum(forward)):.6g} s, one every {period_text(float(np.median(forward)))}"
        if forward.size
        else f"{time_s.size} samples"
    )


def headline(each: Comparison) -> tuple[str, str]:
    """Return how a comparison is marked, good, open or bad, and its first words."""
    if each.adequate:
        return "good", "The model holds."
    if each.floor_m is None or not each.over_direction.count.sum():
        return "open", "This recording cannot judge the model."
    return "bad", "The model does not hold. Where it fails:"


def _key_figures(each: Comparison, stroke_m: float) -> page.Html:
    missed, spurious = len(each.slips.missed_s), len(each.slips.spurious_s)
    read, floor = Reading(each.own), "sensor noise" if _is_noise(each) else "repeatability of the valve"
    return page.figures_of_merit(
        [
            (read.title("Error, rms, mm"), read.length(each.rms_m), of_stroke(each.rms_m, stroke_m)),
            (
                read.title("Floor, mm"),
                read.length(each.floor_m),
                floor,
            ),
            ("Error in floors", Shown(times(each.rms_m, each.floor_m)), f"a model that holds: at most {ADEQUATE:g} ×"),
            ("Fit", Shown(fit_in_words(each.fit_percent)), "100 % is perfect"),
            ("Slips matched", Shown(f"{len(each.slips.matched)}"), f"{missed} missed, {spurious} spurious"),
        ]
    )


def _is_noise(each: Comparison) -> bool:
    return each.repeatability_m is None or (each.noise_m is not None and each.repeatability_m <= each.noise_m)


def _model(each: Comparison) -> Simulated:
    return Simulated("model", MODEL, each.simulated_m)


def _signature(each: Comparison) -> page.Html:
    return signature(each.command_pa, each.measured_m, [_model(each)], Reading(each.own))


def _overlay(each: Comparison) -> page.Html:
    valid = np.isfinite(each.residual_m)
    figure = overlay(
        each.time_s,
        each.command_pa,
        each.measured_m,
        [_model(each)],
        phase_shades(each.phase, valid),
        each.slips,
        by_setpoint=each.by_setpoint,
        read=Reading(each.own),
    )
    return overlaid(
        figure, "The background colour shows what the measured stem does; white: it rests.", each.time_s.size
    )


def overlaid(figure: Figure, ground: str, samples: int) -> page.Html:
    """Return the section of an overlay; `ground` says what the shades behind it mean."""
    return page.section(
        "overlay",
        "Measured and simulated position",
        page.plot(
            "plot-overlay",
            figure,
            640,
            "Above the stem position, in the middle the error (simulated less measured), below the command. "
            f"{ground} Drag across a plot to look closer, all three follow; double-click to return.{thinning(samples)}",
        ),
    )


def thinning(count: int) -> str:
    """Say how a long series is drawn; empty for a short one."""
    if count <= MOST_SERIES_POINTS:
        return ""
    return f" Of every {stretch(count)} samples the least and the greatest are drawn; the figures are of all {count}."


def _phases(each: Comparison, stroke_m: float) -> page.Html:
    read = Reading(each.own)
    return page.section(
        "phases",
        "Where it fails",
        page.text(
            "The error by what the stem is doing. The mean says which way the model is off, "
            f"the last column how much of the whole (squared) error lies there. Marked: above {ADEQUATE:g} floors."
        ),
        page.table(
            "table-phases",
            [
                "What the stem does",
                "Samples",
                read.title("Error, rms, mm"),
                "In floors",
                "Of stroke",
                read.title("Mean error, mm"),
                "Of whole error",
            ],
            [_phase(part, each.floor_m, stroke_m, read) for part in each.phases if part.count],
        ),
        page.text(
            "The same error over the position, the velocity, the last direction and the pressure; bars: ± 1 std. error."
        ),
        page.pair(
            _profile("position", each, "over the stem's position, mm", read.kind.length.factor),
            _profile("velocity", each, "over the stem's velocity, mm/s (opening +)", read.kind.length.factor),
            _profile("direction", each, "over the last direction of motion", 1.0),
            _profile("pressure", each, "over the actuator pressure, kPa", read.kind.command.read.factor),
        ),
    )


def _phase(part: Phase, floor_m: float | None, stroke_m: float, read: Reading) -> page.Row:
    return page.Row(
        [
            part.name,
            f"{part.count}",
            read.length(part.rms_m),
            times(part.rms_m, floor_m),
            f"{100 * part.rms_m / stroke_m:.3g} %",
            read.length(part.mean_m, sign=True),
            f"{100 * part.share:.1f} %",
        ],
        MEANINGS[part.name],
        "over" if floor_m is not None and part.rms_m > ADEQUATE * floor_m else "",
    )


def _mean_error(read: Reading) -> tuple[str, float, str, str]:
    return read.title("mean error, mm"), read.kind.length.factor, read.kind.length.unit, read.si


def _profile(over: str, each: Comparison, title: str, factor: float) -> page.Html:
    read = Reading(each.own)
    title = read.title(title)
    figure = profiles([("error", MODEL, getattr(each, f"over_{over}"))], (title, factor), _mean_error(read))
    if over == "direction":
        figure["layout"]["xaxis"] |= {"tickvals": [-1, 1], "ticktext": ["closing", "opening"], "range": [-1.6, 1.6]}
    return page.plot(f"plot-over-{over}", figure, 270, f"Mean error {title}.")


def _friction(each: Comparison) -> page.Html:
    both = (("measured", MEASURED), ("model", MODEL))
    read = Reading(each.own)
    force = (read.title("friction, N"), 1.0, read.kind.force.si, read.kind.force.si)

    def draw_way(way: str) -> Figure:
        pair_ = getattr(each.friction, way)
        parts = [(name, colour, part) for (name, colour), part in zip(both, pair_, strict=True)]
        millimetres = "velocity, mm/s (opening +)" if way == "over_velocity" else "position, mm"
        return profiles(parts, (read.title(millimetres), read.kind.length.factor), force)

    return page.section(
        "friction",
        "Friction, from the balance of forces",
        page.text(
            "While the stem moves, pressure times area less spring and inertia is friction, with any force that the "
            "model lacks. It is drawn from the measurement, and in the same way from the model. Where they differ, the "
            "model lacks something that depends on this velocity or this position."
        ),
        page.plot("plot-friction-velocity", draw_way("over_velocity"), 330, "Friction over velocity."),
        page.pair(
            page.plot("plot-friction-opening", draw_way("opening_over_position"), 300, "Over position, while opening."),
            page.plot("plot-friction-closing", draw_way("closing_over_position"), 300, "Over position, while closing."),
        ),
    )


def _slips(each: Comparison) -> page.Html:
    slips, read = each.slips, Reading(each.own)
    rows = []
    for name, wanted in (("opening", 1), ("closing", -1)):
        for reversal, when in ((True, "after a reversal"), (False, "going on")):
            found = [pair_ for pair_ in slips.matched if pair_.direction == wanted and pair_.reversal == reversal]
            if found:
                late_s = float(np.median([pair_.late_s for pair_ in found]))
                farther_m = float(np.median([pair_.farther_m for pair_ in found]))
                rows.append(
                    page.Row([f"{name}, {when}", f"{len(found)}", f"{late_s:+.3f}", read.length(farther_m, sign=True)])
                )
    return page.section(
        "slips",
        "Slips: matched, missed, spurious",
        page.text(
            f"Matched: {len(slips.matched)}. Missed, the stem slipped and the model did not: {len(slips.missed_s)}"
            f"{_at(slips.missed_s)}. Spurious, the model slipped and the stem did not: {len(slips.spurious_s)}"
            f"{_at(slips.spurious_s)}."
        ),
        *(_list_slips(rows, read) if rows else ()),
    )


def _list_slips(rows: list[page.Row], read: Reading) -> tuple[page.Html, page.Html]:
    head = ["Matched slips", "Number", "Model later by, s", read.title("Model farther by, mm")]
    return page.table("table-slips", head, rows), page.text("Medians; a minus: earlier, or not far enough.")


def _at(times_s: tuple[float, ...]) -> str:
    if not times_s:
        return ""
    shown = ", ".join(f"{each:.2f}" for each in times_s[:LISTED])
    rest = len(times_s) - LISTED
    return f" (at {shown} s{f' and {rest} more' if rest > 0 else ''})"


def _statistics(each: Comparison) -> page.Html:
    read = Reading(each.own)
    return page.fold_parts(
        "statistics",
        "For specialists: correlations and spectrum of the error",
        page.text(
            "An error that correlates with the command shows that the model answers the command wrongly. Inside the "
            "grey band (99 %) nothing is proved. An error that correlates with itself alone may be the sensor's."
        ),
        page.pair(
            page.plot(
                "plot-input-correlation",
                correlation(each.input_correlation, "correlation"),
                280,
                f"Error with the command: {each.input_correlation.outside} of {each.input_correlation.lag.size} shifts "
                "outside the band. Right of 0 the command comes first.",
            ),
            page.plot(
                "plot-autocorrelation",
                correlation(each.autocorrelation, "correlation"),
                280,
                f"Error with itself: {each.autocorrelation.outside} of {each.autocorrelation.lag.size - 1} shifts "
                "outside the band of white noise.",
            ),
        ),
        page.plot("plot-spectrum", spectrum(each.spectrum, read), 280, "Spectrum of the error."),
        page.plot(
            "plot-over-time",
            profiles([("error", MODEL, each.over_time)], ("time, s", 1.0), _mean_error(read)),
            250,
            "Mean error over time: a slope is drift.",
        ),
        page.text(f"Robust error, median of the rms over blocks of 1 s: {read.said(each.robust_m)}."),
    )


def _pressure(each: Comparison) -> list[str]:
    side, read = each.pressure_side, Reading(each.own)
    if side is None:
        return [
            "The recording has no measured actuator pressure. Only the shape of an error shows whether it arises "
            "before the actuator (converter, tubing) or at the stem"
        ]
    return [
        f"The {read.title('actuator pressure')} is measured; the model's is off by "
        f"{read.kind.command.read.said(side.pressure_rms_pa)} rms. Run from the measured {read.kind.command.word} "
        f"instead of the command, the error is {read.said(side.stem_rms_m)} rms, "
        f"fit {fit_in_words(side.stem_fit_percent)}: that much arises at the stem"
    ]


def recording(subject: page.Subject, notes: tuple[str, ...], more: list[str]) -> page.Html:
    """Return what is known of the recording itself."""
    said = [f"{key}: {value}" for key, value in subject.metadata.items()]
    whole = [] if notes else ["No samples were left out"]
    return page.section("recording", "About the recording", page.bullets([*shorten_notes(notes), *whole, *more, *said]))
