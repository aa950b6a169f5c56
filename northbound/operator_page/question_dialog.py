"""A question before the valve moves: what is going to happen, and what may be answered."""

from collections.abc import Callable, Coroutine, Sequence
from dataclasses import dataclass
from typing import Any

from nicegui import ui

Do = Callable[[], Coroutine[Any, Any, None]]


@dataclass(frozen=True, slots=True)
class Answer:
    """A button: what it says, by which name a test finds it, and what is done then."""

    label: str
    name: str
    do: Do


class Question:
    """The dialog; nothing is done before an answer is pressed."""

    def __init__(self) -> None:
        with ui.dialog() as self._dialog, ui.card().props('data-testid="question"'):
            self._title = ui.label().classes("text-h6")
            self._lines = ui.element("ul").classes("said")
            self._answers = ui.row()

    def ask(self, title: str, lines: Sequence[str], answers: Sequence[Answer]) -> None:
        """Ask; whoever turns away has said no."""
        self._title.set_text(title)
        self._lines.clear()
        with self._lines:
            for line in lines:
                with ui.element("li"):
                    ui.label(line)
        self._answers.clear()
        with self._answers:
            for answer in answers:
                button = ui.button(answer.label, on_click=lambda answer=answer: self._handle_answer(answer))
                button.props(f'no-caps data-testid="answer-{answer.name}"')
            ui.button("Cancel", on_click=self._dialog.close).props('no-caps flat data-testid="answer-cancel"')
        self._dialog.open()

    async def _handle_answer(self, answer: Answer) -> None:
        self._dialog.close()
        await answer.do()
