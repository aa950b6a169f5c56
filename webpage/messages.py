"""What a page says to a person: an error in its line, a list of sentences."""

import asyncio
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from html import escape
from typing import TypeVar

from nicegui import ui

from config.errors import CommandFailed, InputError
from webpage.page_words import in_page_words

T = TypeVar("T")


@contextmanager
def errors_told(names: Mapping[str, str] | None = None) -> Iterator[None]:
    """Say what a person did wrong instead of raising it; `names`: what a source that errors name is called here."""
    try:
        yield
    except InputError as error:
        tell_error(str(error.named(names or {})))
    except CommandFailed as error:
        tell_error(str(error))


def tell_error(said: str) -> None:
    """Say an error; it stays until it is closed."""
    ui.notification(
        in_page_words(said), type="negative", timeout=0, close_button="close", multi_line=True, position="top"
    )


async def aside(work: Callable[..., T], *arguments: object) -> T:
    """Do it on a thread, so that other tabs go on; what it raises comes back."""
    return await asyncio.to_thread(work, *arguments)


def is_looked_at() -> bool:
    """Return whether a browser shows the page: of one that was loaded again the old one is kept for a while.

    What comes but once, as the result of a search, is not for that one: nobody would see it.
    """
    return ui.context.client.has_socket_connection


def sentences(items: Sequence[str], name: str) -> None:
    """Show sentences as a list."""
    lines = "".join(f"<li>{escape(in_page_words(each))}</li>" for each in items)
    ui.html(f'<ul class="said">{lines}</ul>', sanitize=False).props(f'data-testid="{name}"')


def heading(text: str, name: str = "") -> None:
    """Show a section's heading; by its name `look_at` finds it."""
    place = f' data-testid="{name}" tabindex="-1"' if name else ""
    ui.html(f"<h2{place}>{escape(text)}</h2>", sanitize=False)


def look_at(name: str) -> None:
    """Bring a heading to the top; who goes by keyboard goes on from there."""
    ui.run_javascript(
        f"""const it = document.querySelector('[data-testid="{name}"]');
        it?.focus({{preventScroll: true}}); it?.scrollIntoView();"""
    )
