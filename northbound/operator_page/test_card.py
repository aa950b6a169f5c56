"""Tests on the valve: begun by who may consent, broken off, and what they said; the report as found and as left."""

import tempfile
import time
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

from nicegui import ui

from config.roles import Role
from northbound.observer.identify_permissives import identify_permissives
from northbound.observer.valve_commands import Confirmation, refusal_for
from northbound.observer.valve_tests import KEPT_AS, TESTS, ValveTests
from northbound.observer.valve_view import ValvePicture
from northbound.observer.watched_valves import Place
from northbound.operator_page.question_dialog import Answer, Question
from northbound.operator_page.signed_in import SignedIn
from webpage.messages import heading
from webpage.page_words import in_page_words

Do = Callable[..., Coroutine[Any, Any, None]]


class TestCard:
    """The tests of one valve.

    Args:
        place: of the valve.
        tests: on it.
        signed: who is in front of the page.
        do: has a command done, and says what became of it.
    """

    def __init__(self, place: Place, tests: ValveTests, signed: SignedIn, do: Do) -> None:
        self._tests = tests
        self._place, self._signed, self._do = place, signed, do
        self._said, self._runs, self._written = "", False, b""
        with ui.card().classes("full-width").props('data-testid="tests"'):
            heading("Tests on the valve, which move it")
            self._why = ui.label().classes("quiet").props('data-testid="tests-why"')
            self._test = ui.select(list(TESTS), value=next(iter(TESTS)), label="test").classes("full-width")
            self._test.props('data-testid="test"')
            self._kind = ui.select(dict(KEPT_AS), value="", label="kept as").classes("full-width")
            self._kind.props('data-testid="kept-as"')
            with ui.row():
                self._begin = ui.button("Begin …", on_click=self._ask).props('no-caps data-testid="begin-test"')
                self._off = ui.button("Break off", on_click=self._tests.break_off)
                self._off.props('no-caps outline color=negative data-testid="break-off-test"')
                self._report = ui.button("Report", icon="download", on_click=self._take_report)
                self._report.props('no-caps outline data-testid="report"')
            self._text = ui.label().classes("scrolling verbatim full-width").props('data-testid="test-said"')
        self._question = Question()

    def show(self, picture: ValvePicture) -> None:
        """Show whether a test may be begun, or what the one under way has said."""
        why = self._problem(picture)
        self._why.set_text(in_page_words(why))
        self._begin.set_enabled(not why and not self._runs)
        self._report.set_enabled(not self._tests.problem() and not self._runs)
        self._off.set_visibility(self._runs)
        self._text.set_text(self._said)

    def _problem(self, picture: ValvePicture) -> str:
        refused = refusal_for(self._signed.at(time.monotonic()), "experiment_consent")
        if problem := self._tests.problem() or refused or picture.freshness.daemon:
            return problem
        return next((each.remedy for each in identify_permissives(picture.values) if not each.holds), "")

    def _ask(self) -> None:
        limits = self._place.settings
        assert limits is not None
        low, high = limits.experiment.travel_window
        lines = (
            f"The stem moves between {100 * low:g} and {100 * high:g} % of its stroke. The process must allow it.",
            "You consent until the end of the test. If it is broken off or vetoed, the law commands again.",
        )

        async def begin() -> None:
            await self._do(self._play)

        self._question.ask(f"{self._test.value}: the valve moves", lines, [Answer("Consent and begin", "begin", begin)])

    async def _take_report(self) -> None:
        self._written = b""
        await self._do(self._write_report)
        if self._written:
            ui.download.content(self._written, f"{self._place.name}.html")

    def _play(self, role: Role) -> Confirmation:
        def show(said: str) -> None:
            self._said = said

        self._said, self._runs = "", True
        try:
            return self._tests.run(role, str(self._test.value), str(self._kind.value), show)
        finally:
            self._runs = False

    def _write_report(self, _: Role) -> Confirmation:
        """Write the report, and keep it to be taken by the browser."""
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / f"{self._place.name}.html"
            told = self._tests.report(out)
            self._written = out.read_bytes() if told.done else b""
        return Confirmation(told.done, "report written" if told.done else told.text)
