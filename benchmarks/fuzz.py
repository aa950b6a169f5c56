"""Every parser on millions of inputs, guided by what they reach: `make fuzz`.

    python -m benchmarks.fuzz [--inputs N] [--only WORDS] [--seed N] [--keep FOLDER]

The parsers are those of `tests/fuzz`; atheris (libFuzzer) changes inputs that are taken, and keeps what reaches new
code, ours or of the libraries that parse for us. Each parser runs in a process of its own. What breaks one is kept in a
file of the folder, and the parser is tried on, `BREAKS` times at most.
"""

import argparse
import logging
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import atheris

if TYPE_CHECKING:
    from tests.fuzz.parser import Parser

INSTRUMENTED = (
    "config", "fieldbus", "drivers", "positioner.daemon", "positioner.history", "northbound", "webpage", "sim.slave",
    "canopen", "pymodbus.pdu", "pymodbus.framer", "tomllib", "json", "csv", "configparser", "openpyxl",
)  # fmt: skip
"""The packages whose branches guide; not the valve's equations, which are compiled."""
LIMITS = ("-timeout=5", "-rss_limit_mb=2000", "-max_len=4096", "-print_final_stats=1")
"""Seconds for one input at most, also on a busy machine; the test judges 0.2 s of work."""
BREAKS = 3


def rows(inputs: int, only: str, kept: Path, seed: int) -> Iterator[str]:
    """Yield the table, a parser a row."""
    parsers = {name: each for name, each in instrumented_parsers().items() if only in name}
    logging.disable()
    shares = sum(each.share for each in parsers.values())
    head = ("parser", "inputs", "branches reached", "inputs a second", "slowest, s", "most memory, MB", "broken")
    yield f"| {' | '.join(head)} |\n|{'---|' * len(head)}"
    total = broken = 0
    for name, parser in parsers.items():
        tried = _tried(name, parser, round(inputs * parser.share / shares), kept, seed)
        total, broken = total + tried.inputs, broken + tried.broken
        cells = (name, tried.inputs, tried.reached, tried.speed, tried.slowest_s, tried.most_mb, tried.broken)
        yield f"| {' | '.join(map(str, cells))} |"
    yield f"\n{total} inputs, {broken} of them broke a parser."


class Tried(NamedTuple):
    """What libFuzzer says at its end."""

    inputs: int
    reached: int
    speed: int
    slowest_s: int
    most_mb: int
    broken: int


def instrumented_parsers() -> dict[str, "Parser"]:
    """Return the parsers, whose code tells which branches it takes."""
    with atheris.instrument_imports(include=list(INSTRUMENTED), enable_loader_override=False):
        from tests.fuzz.bus_parsers import bus_parsers
        from tests.fuzz.file_parsers import file_parsers
    return {**bus_parsers(), **file_parsers()}


def _tried(name: str, parser: "Parser", runs: int, kept: Path, seed: int) -> Tried:
    """Try a parser on so many inputs, from what broke it on anew."""
    tried, start_s = Tried(0, 0, 0, 0, 0, 0), time.monotonic()
    stem = re.sub(r"\W+", "_", name)
    # Not as a context: the child, a copy of this process, must not clean up after itself what its parent tries on with.
    corpus = tempfile.mkdtemp(prefix="fuzz-corpus-")
    try:
        for n, good in enumerate(parser.good):
            (Path(corpus) / f"good{n}").write_bytes(good)
        while tried.inputs < runs and tried.broken < BREAKS:
            log = kept / f"{stem}-{tried.broken}.log"
            words = [
                f"-runs={runs - tried.inputs}",
                f"-artifact_prefix={kept}/{stem}-",
                f"-seed={seed + tried.broken}",
                *LIMITS,
                corpus,
            ]
            status = _in_a_process(parser, words, log)
            said = log.read_text(errors="replace")
            found = {key: int(value) for key, value in re.findall(r"stat::(\w+): +(\d+)", said)}
            tried = Tried(
                tried.inputs + found.get("number_of_executed_units", 0),
                max((int(each) for each in re.findall(r"cov: (\d+)", said)), default=tried.reached),
                0,
                max(tried.slowest_s, found.get("slowest_unit_time_sec", 0)),
                max(tried.most_mb, found.get("peak_rss_mb", 0)),
                tried.broken + (status != 0),
            )
            if not status:
                log.unlink()
    finally:
        shutil.rmtree(corpus, ignore_errors=True)
    return tried._replace(speed=round(tried.inputs / (time.monotonic() - start_s)))


def _in_a_process(parser: "Parser", words: list[str], log: Path) -> int:
    """Let libFuzzer try a parser in a process of its own, which it ends; return its status."""
    process = os.fork()
    if process:
        return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(output, 1)
    os.dup2(output, 2)
    atheris.Setup([sys.argv[0], *words], parser.parse)
    atheris.Fuzz()
    os._exit(0)


if __name__ == "__main__":
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--inputs", type=int, default=10_000_000)
    arguments.add_argument("--only", default="")
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--keep", type=Path, default=None)
    given = arguments.parse_args()
    folder = given.keep or Path(tempfile.mkdtemp(prefix="fuzz-broken-"))
    folder.mkdir(parents=True, exist_ok=True)
    for line in rows(given.inputs, given.only, folder, given.seed):
        print(line, flush=True)
    print(f"What broke a parser is in {folder}.")
