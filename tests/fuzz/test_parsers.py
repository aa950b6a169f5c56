"""Whatever bytes come: a right answer, or one refusal in one line, soon and in bounded memory.

The inputs are the same each time. `make fuzz` tries millions, guided by what they reach.
"""

import logging
import resource
import time
from collections.abc import Iterator

import pytest

from tests.fuzz.bus_parsers import bus_parsers
from tests.fuzz.file_parsers import file_parsers
from tests.fuzz.inputs import near
from tests.fuzz.parser import Parser

PARSERS = {**bus_parsers(), **file_parsers()}
FEWEST, MOST = 20, 500
LONGEST_S = 1.0
"""Of work for one input, on a busy machine too."""
MOST_MEMORY_KB = 300_000


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    logging.disable()
    yield
    logging.disable(logging.NOTSET)


def worked_s(parser: Parser, data: bytes) -> float:
    """Return how long a parser works on an input."""
    start_s = time.thread_time()
    parser.parse(data)
    return time.thread_time() - start_s


def inputs(parser: Parser) -> int:
    """Return how many inputs a parser gets: by its share, which says how fast it is."""
    return max(FEWEST, min(MOST, round(25 * parser.share)))


@pytest.mark.parametrize("name", PARSERS)
def test_whatever_comes_is_answered_or_refused_in_one_line(name: str) -> None:
    parser = PARSERS[name]
    for good in parser.good:
        parser.parse(good)
    held_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    for data in near(parser.good, inputs(parser), name, text=parser.text):
        try:
            worked = worked_s(parser, data)
            if worked > LONGEST_S:
                worked = min(worked_s(parser, data) for _ in range(3))
            assert worked < LONGEST_S, f"too long for {len(data)} bytes"
        except BaseException as error:
            error.add_note(f"of {name}, the input {data!r}")
            raise
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - held_kb < MOST_MEMORY_KB
