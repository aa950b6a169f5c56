"""Campaigns keep a line of JSON a case, so that a run can be broken off and taken up again."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

Line = Mapping[str, Any]


def kept(file: Path) -> list[Line]:
    """Read the lines that are there."""
    return [json.loads(each) for each in file.read_text().splitlines()] if file.is_file() else []


def run(file: Path, case: Callable[..., Line], todo: Sequence[tuple[Any, ...]], workers: int | None) -> Iterator[Line]:
    """Run cases in processes of their own, each of which gives a line; keep and yield a line as soon as it is there.

    Args:
        file: where they are kept; its folder is made.
        case: a function of a module, for processes import it.
        todo: what each case is called with.
        workers: processes; None is one a core.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(workers) as pool, file.open("a") as lines:
        for done in as_completed([pool.submit(case, *each) for each in todo]):
            line = done.result()
            print(json.dumps(line), file=lines, flush=True)
            yield line
