import os
from threading import Event

import pytest

from config.errors import InputError
from tests.waiting import until
from workbench.page.background import Failed, News, Progressed, Tell, Work

pytestmark = pytest.mark.patient


def ends(tell: Tell, how: str) -> str:
    """Tell that it has begun, then end so."""
    tell(Progressed(how, 0.5))
    if how == "never":
        Event().wait()
    if how == "refused":
        raise InputError("recording", "holds too little")
    if how == "killed":
        os._exit(9)
    return "done"


def told(work: Work, *, last: type) -> list[News]:
    news: list[News] = []

    def came() -> bool:
        news.extend(work.news())
        return any(isinstance(each, last) for each in news)

    until(came, last.__name__)
    return news


@pytest.mark.parametrize(
    ("how", "last"),
    [
        ("refused", Failed("recording: holds too little")),
        ("killed", Failed("the work ended by itself, exit status 9")),
    ],
)
def test_work_tells_how_far_it_is_and_how_it_ended(how: str, last: News) -> None:
    assert told(Work(ends, how), last=type(last)) == [Progressed(how, 0.5), last]


def test_what_is_cancelled_is_gone_at_once() -> None:
    work = Work(ends, "never")
    told(work, last=Progressed)
    work.cancel()
    assert work.is_over
    assert not work.is_alive
