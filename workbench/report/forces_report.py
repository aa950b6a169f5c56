"""The report of a balance of forces: what it lacks, how its error fell, what is not told apart."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from config.recording import Column
from workbench.compare.residuals import BINS, FEWEST_BIN_ROWS, Profile, profile
from workbench.data.imposed_motion import Rows
from workbench.forces.force_balance import ForceFit, balanced_n, carried_n
from workbench.forces.force_diagnosis import BALANCE_FLOORS, ForceDiagnosis
from workbench.report import effect_ranking
from workbench.report import report_html as page
from workbench.report.charts import EXTENDED, MEASURED, MODEL, QUIET, Figure, axis, layout, line, profiles
from workbench.report.comparison_report import WORDS
from workbench.report.diagnosis_report import DIAGNOSIS_WORDS
from workbench.report.display_units import FORCE, Shown, force, parameter, times
from workbench.report.effects_table import RankedStep, headline, not_told_apart, ranks, show_added, show_tried
from workbench.report.plot_series import round_values

DRAWN_ROWS = 6_000
"""Rows drawn at most."""
LARGE_DOT_ROWS = 200
"""Rows below which a dot is drawn large."""
BALANCE = {
    "constant_n": "constant force: preload, weight, offsets",
    "coulomb_n": "sliding (Coulomb) friction",
    "diaphragm_area_m2": "diaphragm area",
}
FORCE_WORDS = {
    "Balance": "While the stem moves, the force that is measured equals spring, friction and the pressure's share. "
    "The rest is the error of the balance.",
    "rms": WORDS["rms"],
    "Floor": "By how much strokes over the same place in the same direction differ: no balance does better.",
    **{word: DIAGNOSIS_WORDS[word] for word in ("Effect", "Fitted, held out", "Evidence")},
    "Std": "Standard deviation of a parameter over fits that each leave a part of the data out.",
}


def report_forces(diagnosis: ForceDiagnosis, path: Path, subject: page.Subject) -> None:
    """Write the report.

    Args:
        diagnosis: what `diagnose_forces` returned.
        path: the HTML file.
        subject: the valve as it was given, and the recordings.

    Raises:
        InputError: plotly is not installed, or the file cannot be written.
    """
    title = f"Valve “{subject.valve.valve.name}”: what the balance of forces lacks"
    page.write(
        path,
        title,
        [
            page.heading(title, subject, _facts(diagnosis.rows)),
            page.verdict(*headline(diagnosis.verdict, diagnosis.missing), page.text(diagnosis.sentence)),
            _key_figures(diagnosis),
            _fall(diagnosis),
            _friction(diagnosis, balanced_n(diagnosis.rows, subject.valve.valve)),
            _where(diagnosis),
            _ranking(diagnosis),
            show_added(diagnosis.missing, _parameters(diagnosis)),
            not_told_apart(diagnosis.indistinguishable, _names(diagnosis), diagnosis.missing, "nothing in such rows"),
            page.section("recording", "About the recordings", page.bullets(diagnosis.rows.notes or (ALL_TAKEN,))),
            page.section("words", "Words used here", page.glossary(FORCE_WORDS)),
        ],
    )


ALL_TAKEN = "nothing in them had to be left out"


def _facts(rows: Rows) -> str:
    if rows.load_n is None:
        return f"a static curve of {len(rows)} readings"
    recordings, strokes = int(rows.recording.max()) + 1, int(rows.stroke.max()) + 1
    return f"{len(rows)} rows, {recordings} recording{'s' if recordings > 1 else ''}, {strokes} strokes"


def _key_figures(diagnosis: ForceDiagnosis) -> page.Html:
    floor_n, best = diagnosis.floor_n, diagnosis.best
    typical = (
        Shown("–") if floor_n is None else Shown(times(best.median_error_n, floor_n)),
        f"of {floor_n:.3g} N; explained: at most {BALANCE_FLOORS:g} ×" if floor_n else "each place is passed once",
    )
    added = ", ".join(name.replace("_", " ") for name in diagnosis.missing)
    return page.figures_of_merit(
        [
            ("Held-out error before, rms, N", force(diagnosis.base.test_rms_n), "the bare balance, refitted"),
            ("and after, N", force(best.test_rms_n), ""),
            ("Median error in floors", *typical),
            ("Added", Shown(added or "nothing"), f"of {len(_names(diagnosis))} effects tried"),
        ]
    )


def _names(diagnosis: ForceDiagnosis) -> frozenset[str]:
    return frozenset(each.name for each in diagnosis.candidates)


def _fall(diagnosis: ForceDiagnosis) -> page.Html:
    stages = [("bare", diagnosis.base), *((f"+ {s.added.name}", s.added.fit) for s in diagnosis.steps if s.added)]
    errors = [(name, fit.train_rms_n, fit.test_rms_n) for name, fit in stages]
    rows = [
        page.Row(
            [
                name,
                force(fit.train_rms_n),
                force(fit.test_rms_n),
                force(fit.median_error_n),
                f"{diagnosis.base.bic - fit.bic:.4g}",
            ]
        )
        for name, fit in stages
    ]
    return page.section(
        "fall",
        "How the error fell",
        page.plot(
            "plot-fall",
            effect_ranking.error_reduction(errors, None, FORCE),
            300,
            "Error of the balance, rms. Each held-out part is predicted by a fit that has not seen it.",
        ),
        page.table(
            "table-fall", ["Balance", "Error, fitted, N", "Held out, N", "Median, held out, N", "Evidence"], rows
        ),
    )


def _friction(diagnosis: ForceDiagnosis, measured_n: Column) -> page.Html:
    rows, best = diagnosis.rows, diagnosis.best
    every = -(-len(rows) // DRAWN_ROWS)
    left_n = (measured_n - carried_n(rows, best.parameters))[::every]
    explained_n = left_n - best.residual_n[::every]
    place = round_values(1e3 * rows.position_m[::every], 4)
    traces = [
        line(place, round_values(force_n, 3), name, colour, HOVER, mode="markers", marker=_dot(colour, place))
        for name, colour, force_n in (("measured", MEASURED, left_n), ("balance", EXTENDED, explained_n))
    ]
    figure: Figure = {
        "data": traces,
        "layout": layout(xaxis=axis("position, mm"), yaxis=axis("friction, N", zeroline=True, zerolinecolor=QUIET)),
    }
    figure["layout"]["legend"] |= {"itemsizing": "constant"}
    thinned = f" Every {every}th row is drawn; the figures are of all {len(rows)}." if every > 1 else ""
    return page.section(
        "friction",
        "Friction: what spring and pressure leave",
        page.plot(
            "plot-friction",
            figure,
            420,
            "The measured force less spring, pressure and constant force, positive while opening; and the same by the "
            f"balance with all that was added.{thinned}",
        ),
    )


HOVER = "%{y:.4~g} N at %{x:.4~g} mm"


def _dot(colour: str, drawn: Sequence[float | None]) -> Figure:
    return {"color": colour, "size": 4 if len(drawn) > LARGE_DOT_ROWS else 9, "opacity": 0.6}


def _where(diagnosis: ForceDiagnosis) -> page.Html:
    rows = diagnosis.rows
    opening = rows.direction > 0.0
    places = [
        ("opening", "over position, mm, while opening", rows.position_m, 1e3, opening),
        ("closing", "over position, mm, while closing", rows.position_m, 1e3, ~opening),
    ]
    if rows.load_n is not None:
        places.append(("pressure", "over the actuator pressure, kPa", rows.pressure_pa, 1e-3, np.ones_like(opening)))
    if rows.velocity_m_per_s is not None:
        speed = np.abs(rows.velocity_m_per_s)
        places.append(("speed", "over the stem's speed, mm/s", speed, 1e3, np.ones_like(opening)))
    fits = [("before", MODEL, diagnosis.base)]
    if diagnosis.missing:
        fits.append(("after", EXTENDED, diagnosis.best))
    return page.section(
        "where",
        "Where it failed, and what is left",
        page.text(
            "The error, counted against the motion: positive where the stem resists more than the balance says. "
            "Means with ± 1 standard error; of a static curve each reading."
        ),
        page.pair(
            *(_profile(name, title, over, factor, kept, rows, fits) for name, title, over, factor, kept in places)
        ),
    )


def _profile(
    name: str,
    title: str,
    over: Column,
    factor: float,
    kept: np.ndarray[tuple[int], np.dtype[np.bool_]],
    rows: Rows,
    fits: list[tuple[str, str, ForceFit]],
) -> page.Html:
    resisting = [
        (said, colour, _means(over[kept], (rows.direction * fit.residual_n)[kept])) for said, colour, fit in fits
    ]
    figure = profiles(resisting, (title, factor), ("resistance left, N", 1.0, "N", "N"))
    return page.plot(f"plot-over-{name}", figure, 280, f"Mean error {title}.")


def _means(over: Column, values: Column) -> Profile:
    """Return the profile, of few readings each of them."""
    if over.size >= BINS * FEWEST_BIN_ROWS:
        return profile(over, values)
    order = np.argsort(over)
    return Profile(over[order], values[order], np.zeros(over.size), np.ones(over.size, np.int64))


def _ranking(diagnosis: ForceDiagnosis) -> page.Html:
    steps = [RankedStep(step.before.effects, step.before.test_rms_n, ranks(step)) for step in diagnosis.steps]
    return show_tried(steps, None, FORCE)


def _parameters(diagnosis: ForceDiagnosis) -> page.Html:
    base, best = diagnosis.base, diagnosis.best
    rows = [_parameter(name, base, best) for name in dict.fromkeys([*base.parameters, *best.parameters])]
    return page.table("table-parameters", ["Parameter", "Before", "After", "Std", "Unit"], rows, (0,))


def _parameter(name: str, base: ForceFit, best: ForceFit) -> page.Row:
    words, factor, unit = parameter(name)

    def show(value: float | None) -> Shown:
        return Shown("–") if value is None else Shown(f"{factor * value:.4g}", f"{name} = {value:.6g}")

    std = best.deviations.get(name)
    spread = "–" if std is None else f"{factor * std:.2g}"
    return page.Row(
        [BALANCE.get(name, words), show(base.parameters.get(name)), show(best.parameters.get(name)), spread, unit]
    )
