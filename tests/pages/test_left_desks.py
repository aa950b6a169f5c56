"""A tab that is closed stops its work and leaves nothing; one that is loaded again finds it.

The page's library takes a second to load: it is loaded by the tests, not in every worker that only collects them.
"""

import asyncio
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import pytest

from tests.pages.laid_out import ends, hidden, never_ends
from tests.waiting import until
from workbench.page.background import Work
from workbench.page.desk import Desk
from workbench.page.provenance import NamedValve
from workbench.page.recording_opening import Opened

if TYPE_CHECKING:
    from workbench.page.page import Workbench

pytestmark = pytest.mark.patient


@pytest.fixture
def workbench() -> "Iterator[Workbench]":
    from workbench.page.page import Workbench

    workbench = Workbench((), None, only_here=True)
    yield workbench
    workbench.clear()


def goes_on(work: Work) -> bool:
    return work.is_alive


def laid(desk: Desk) -> Desk:
    desk.take_valve(NamedValve("valve.toml", Path("valve.toml"), hidden().base))
    desk.take_recording(Opened.of("fit.csv", Path("fit.csv"), hidden().fit))
    return desk


def busy(desk: Desk) -> Desk:
    search = laid(desk).begin("diagnose", never_ends)
    until(lambda: search.look() and bool(search.doing), "the first word of the search")
    return desk


def test_a_diagnosis_goes_on_while_its_page_is_loaded_again_and_stops_when_it_is_closed(workbench: "Workbench") -> None:
    desk = busy(workbench.desk("a"))
    assert desk.search is not None
    work = desk.search.work
    workbench.came(desk)
    workbench.came(desk)  # loaded again: the new page is there before the old one is gone
    workbench.left(desk)
    assert goes_on(work)
    assert workbench.desk("a") is desk
    workbench.left(desk)
    assert not goes_on(work)
    assert desk.search.is_running is False
    assert desk.folder.exists()


def test_what_a_search_comes_to_is_not_for_the_page_that_was_loaded_again(workbench: "Workbench") -> None:
    from nicegui import Client, ui

    from workbench.page.search_panel import SearchPanel

    desk = laid(workbench.desk("a"))
    search = desk.begin("diagnose", ends)
    until(lambda: not search.work.is_alive, "the end of the search")

    async def looks() -> None:
        with Client(ui.page("/")):  # no browser shows it
            await SearchPanel.look(cast(SearchPanel, SimpleNamespace(_desk=desk)))

    asyncio.run(looks())
    assert search.look(), "it is still there for the new page"
    assert (search.result, search.failed) == ("found", "")


def test_of_many_closed_tabs_the_oldest_leave_nothing(workbench: "Workbench") -> None:
    from workbench.page.page import MOST_EMPTY_DESKS

    desks = [workbench.desk(f"tab {i}") for i in range(MOST_EMPTY_DESKS + 3)]
    for desk in desks:
        workbench.came(desk)
    for desk in desks:
        workbench.left(desk)
    assert [desk.folder.exists() for desk in desks] == [False] * 3 + [True] * MOST_EMPTY_DESKS
    workbench.clear()
    assert not any(desk.folder.exists() for desk in desks)
