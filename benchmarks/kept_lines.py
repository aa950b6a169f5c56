"""Campaigns keep a line of JSON a case, so that a run can be broken off and taken up again."""

import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

Line = Mapping[str, Any]


def kept(file: Path) -> list[Line]:
    """Read the lines that are there."""
    return [json.loads(each) for each in file.read_text().splitlines()] if file.is_file() else []


def keep(file: Path | None, line: Line) -> None:
    """Keep another one; without a file, none."""
    if file is not None:
        with file.open("a", encoding="utf-8") as lines:
            print(json.dumps(line), file=lines, flush=True)


def run(file: Path, case: Callable[..., Line], todo: Sequence[tuple[Any, ...]], workers: int | None) -> Iterator[Line]:
    """Run cases in processes of their own, each of which gives a line; keep and yield a line as soon as it is there.

    A case that fails is told at once, and raised when the others are through.

    Args:
        file: where they are kept; its folder is made.
        case: a function of a module, for processes import it.
        todo: what each case is called with.
        workers: processes; None is one a core.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    failed: BaseException | None = None
    with ProcessPoolExecutor(workers) as pool, file.open("a") as lines:
        asked = {pool.submit(case, *each): each for each in todo}
        for done in as_completed(asked):
            if error := done.exception():
                failed = failed or error
                print(f"{asked[done]} failed: {error!r}", file=sys.stderr, flush=True)
                continue
            line = done.result()
            print(json.dumps(line), file=lines, flush=True)
            yield line
    if failed:
        raise failed
