"""Results as a person meets them: short reprs, the command's own words, figures, data frames, HTML."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import positioner as pos
from config.drive import VALVE
from config.results.block import Table, as_html, as_text
from config.results.result import Result
from positioner.cli.main import main
from workbench.discover import form_search
from workbench.discover.grammar import FORMS

LONGEST = 300


@pytest.fixture(scope="module")
def hidden() -> pos.Hidden:
    return pos.hide(305, duration_s=6.0)


@pytest.fixture(scope="module")
def stepped() -> pos.Recording:
    """Steps of the pressure, held until the stem is at rest."""
    time_s = np.arange(0.0, 12.0, 2e-3)
    command_pa = 20e3 * np.array([1, 2, 3, 2, 3, 2])[(time_s / 2.0).astype(int)]
    return pos.simulate(pos.valve("seed"), time_s, command_pa, noise_std_m=1e-5)


@pytest.fixture(scope="module")
def bench() -> pos.Recording:
    """Strokes imposed on a stem with springs and friction, the force measured."""
    time_s = np.arange(0.0, 40.0, 0.02)
    position_m = 0.05 + 0.04 * np.sin(2 * np.pi * time_s / 10.0)
    generator = np.random.default_rng(1)
    load_n = 40e3 * position_m + 500.0 * np.sign(np.gradient(position_m)) + generator.normal(0.0, 5.0, time_s.size)
    pressure_pa = 1e5 + generator.normal(0.0, 100.0, time_s.size)
    return pos.Recording(
        {"time_s": time_s, "pressure_pa": pressure_pa, "position_m": position_m, "load_n": load_n - 0.05 * pressure_pa}
    )


@pytest.fixture(scope="module")
def results(hidden: pos.Hidden, stepped: pos.Recording, bench: pos.Recording) -> dict[str, Result]:
    """One result of each kind."""
    effects = ["asymmetric_friction"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(form_search, "FORMS", [form for form in FORMS if form.name == "scaled_over_direction_sign"])
        discovered = pos.discover(hidden.fit, hidden.base, test=hidden.test)
    return {
        "Recording": hidden.fit,
        "Comparison": pos.compare(hidden.fit, hidden.base),
        "Fit": pos.fit(hidden.fit, hidden.base),
        "Diagnosis": pos.diagnose(hidden.fit, hidden.base, test=hidden.test, effects=effects),
        "Discovery": discovered,
        "Extension": pos.extend(hidden.fit, hidden.base, effects, test=hidden.test),
        "ForceDiagnosis": pos.diagnose_forces(bench, hidden.base),
        "ResponseFigures": pos.respond(stepped),
        "RecordingEstimates": pos.estimate(stepped),
    }


KINDS = (
    "Recording",
    "Comparison",
    "Fit",
    "Diagnosis",
    "Discovery",
    "Extension",
    "ForceDiagnosis",
    "ResponseFigures",
    "RecordingEstimates",
)
each_kind = pytest.mark.parametrize("kind", KINDS)


def parts(value: Any) -> Iterator[Any]:
    """Yield a result and all dataclasses in it."""
    if is_dataclass(value) and not isinstance(value, type):
        yield value
        for each in fields(value):
            yield from parts(getattr(value, each.name))
    elif isinstance(value, tuple):
        for each in value[:3]:
            yield from parts(each)


@each_kind
def test_a_result_and_its_parts_have_short_reprs(kind: str, results: dict[str, Result]) -> None:
    result = results[kind]
    assert repr(result).startswith(f"<{kind}: ")
    long = {type(part).__name__: len(repr(part)) for part in parts(result) if len(repr(part)) > LONGEST}
    assert long == {}
    assert "\n" not in repr(result)


@each_kind
def test_a_summary_begins_with_the_line_that_is_the_repr(kind: str, results: dict[str, Result]) -> None:
    first, *others = results[kind].summary().splitlines()
    assert repr(results[kind])[1:].startswith(f"{kind}: {first[:100]}")
    assert len(others) > 3


@each_kind
def test_a_figure_is_drawn_and_nothing_is_left_open(kind: str, results: dict[str, Result], tmp_path: Path) -> None:
    from matplotlib import pyplot

    figure = results[kind].plot()
    figure.savefig(tmp_path / "figure.png")
    axes = figure.get_axes()
    assert all(each.get_ylabel() or each.get_yticklabels() for each in axes)
    assert axes[-1].get_xlabel()
    assert any(each.lines or each.collections or each.containers for each in axes)
    assert pyplot.get_fignums() == []


@each_kind
def test_a_frame_holds_the_numbers_in_si_units(kind: str, results: dict[str, Result]) -> None:
    result = results[kind]
    frame = result.to_frame()
    columns = result.frame_columns()
    assert list(frame.columns) == list(columns)
    assert len(frame) == len(next(iter(columns.values()))) > 0


class Tags(HTMLParser):
    """Collects text, and what is open at the end."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += f"{data} "


@each_kind
def test_a_notebook_shows_all_words_of_the_summary(kind: str, results: dict[str, Result]) -> None:
    page = Tags(results[kind]._repr_html_())
    assert page.open == []
    assert page.text.split()[0] == kind
    assert sorted(page.text.split()[1:]) == sorted(results[kind].summary().split())


def test_a_frame_of_a_comparison_is_the_comparison(results: dict[str, Result]) -> None:
    comparison = results["Comparison"]
    assert isinstance(comparison, pos.Comparison)
    frame = comparison.to_frame()
    assert frame["residual_m"].to_numpy() == pytest.approx(comparison.residual_m, nan_ok=True)
    assert (frame["phase"] == "stuck").sum() == comparison.phases[0].count


def test_the_command_prints_the_summary(hidden: pos.Hidden, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    hidden.fit.write(tmp_path / "fit.csv")
    pos.write_valve(tmp_path / "valve.toml", hidden.base)
    words = [str(tmp_path / "fit.csv"), "--valve", str(tmp_path / "valve.toml")]
    assert main(["compare", *words]) == 1
    assert capsys.readouterr().out.endswith(f": {pos.compare(hidden.fit, hidden.base).summary()}\n")


def test_a_parameter_that_means_nothing_is_said_to() -> None:
    from workbench.fit.parameter_estimate import Fitted, parameter_table

    parameters = {
        "free": Fitted(1.0, 0.1, 0.8, 1.2, at_bound=False, physical=True),
        "open": Fitted(1.0, np.inf, 0.8, np.inf, at_bound=False, physical=True),
        "at_end": Fitted(0.0, 0.1, 0.0, 1.2, at_bound=True, physical=True),
        "beyond": Fitted(0.0, 0.1, 0.0, 1.2, at_bound=True, physical=False),
    }
    remarks = [row[-1] for row in parameter_table(parameters, VALVE).rows]
    assert remarks[0] == ""
    assert len(set(remarks)) == len(parameters)


def test_a_table_is_aligned_and_escaped() -> None:
    table = Table(("name", "value", ""), [("a", "1", "<b>"), ("long", "10.5", "")], "title")
    assert as_text(["first", table, "last"]) == (
        "first\n\ntitle\n  name  value\n  a         1  <b>\n  long   10.5\n\nlast"
    )
    assert "<b>" not in as_html("A", [table]).replace("<b>A</b>", "")


@pytest.mark.parametrize(
    ("missing", "asked", "extra"),
    [("matplotlib", "plot", "sim,plot"), ("pandas", "to_frame", "frame")],
)
def test_what_is_not_installed_is_named_with_its_extra(missing: str, asked: str, extra: str) -> None:
    code = (
        f"import sys; sys.modules[{missing!r}] = None\n"
        "import numpy as np, positioner as pos\n"
        "one = np.arange(2.0)\n"
        f"pos.Recording({{'time_s': one, 'command_pa': one, 'position_m': one}}).{asked}()"
    )
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=False, timeout=60)
    assert done.stderr.splitlines()[-1].endswith(
        f"{asked} needs {missing}, which is not installed: pip install 'positioner[{extra}]'"
    )


@pytest.mark.parametrize(
    "make",
    [
        lambda: pos.Recording({name: np.array([]) for name in ("time_s", "command_pa", "position_m")}),
        lambda: pos.Recording(
            {"time_s": np.zeros(1), "command_pa": np.array([np.nan]), "position_m": np.array([np.nan])}
        ),
        lambda: pos.respond(
            pos.Recording({"time_s": np.arange(9.0), "command_pa": np.zeros(9), "position_m": np.zeros(9)})
        ),
    ],
)
def test_of_nothing_there_is_still_something_to_say(make: Callable[[], Result]) -> None:
    assert len(repr(make())) < LONGEST
    assert make().summary()
    assert make()._repr_html_()
