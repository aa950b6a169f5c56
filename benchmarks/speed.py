"""Speed as change indication: what a piece of work takes, in loops of Python timed beside it, against stored runs.

    python -m benchmarks.speed                  the ratios, and what has moved since the run stored last
    python -m benchmarks.speed --store NAME     the same, kept in speed.json: at each release, by its name

Processor time of the thread counts, and work and loop take turns: a machine that is busy or slow changes both. What
has moved by more than a quarter is marked; caches and clock rates move a tenth.
"""

import argparse
import json
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import median

from benchmarks import cycle_time, physics
from config.valve_file import ValveFile, load_valve, shipped_valve
from sim.valve import Valve

STORED = Path(__file__).with_name("speed.json")
ROUNDS, LOOPS, MOVED = 5, 20_000, 0.25


def report(store: str | None = None) -> list[str]:
    """Return lines: each ratio, the one stored last, and whether it moved."""
    kept: dict[str, Mapping[str, float]] = json.loads(STORED.read_text()) if STORED.exists() else {}
    last, before = next(reversed(kept.items()), ("nothing", {}))
    now = ratios()
    lines = [f"{'in reference loops':42}{'now':>10}{last:>16}"]
    for name, value in now.items():
        then = before.get(name)
        moved = then is not None and abs(value / then - 1.0) > MOVED
        said = f"  moved by {100 * (value / then - 1.0):+.0f} %" if then and moved else ""
        lines.append(f"{name:42}{value:10.4f}{then if then is not None else float('nan'):16.4f}{said}")
    if store is not None:
        kept[store] = {name: round(each, 4) for name, each in now.items()}
        STORED.write_text(json.dumps(kept, indent=1) + "\n")
    return lines


def ratios() -> dict[str, float]:
    """Return the median of each piece's time over that of the loop beside it."""
    found: dict[str, list[float]] = {}
    pieces = _pieces()
    for _ in range(ROUNDS):
        for name, piece in pieces.items():
            found.setdefault(name, []).append(_taken_s(piece) / _taken_s(_loop))
    return {name: median(each) for name, each in found.items()}


def _pieces() -> dict[str, Callable[[], object]]:
    bare = load_valve(shipped_valve("seed"))
    full = ValveFile(valve=bare.valve, effect=physics.EFFECTS)
    fast, slow, stairs = physics.seed_scenario(1e-5), physics.seed_scenario(1e-3), physics.staircase()
    pieces: dict[str, Callable[[], object]] = {}
    for name, file in (("bare", bare), ("effects", full)):
        valve = Valve.from_file(file, step_s=physics.STEP_S)
        pieces |= {
            f"{name}: 0.8 s, command every 10 us": _run(valve, partial(valve.run, fast, 1e-5)),
            f"{name}: stick-slip staircase": _run(valve, partial(valve.run, stairs, 1e-3)),
            f"{name}: 800 calls of 1 ms": _run(valve, partial(_calls, valve, slow.tolist())),
        }
    inputs = cycle_time.virtual_run()
    return pieces | {
        f"daemon's cycle, {cycle_time.RUN_S:g} s in virtual time": cycle_time.virtual_run,
        f"control core alone, those {len(inputs)} steps": partial(cycle_time.core_again, inputs),
    }


def _calls(valve: Valve, commands_pa: Sequence[float]) -> None:
    for each in commands_pa:
        valve.advance(each, 1e-3)


def _run(valve: Valve, work: Callable[[], object]) -> Callable[[], object]:
    def once() -> None:
        valve.rest_at(0.0, 0.0)
        work()

    return once


def _loop() -> None:
    total = 0
    for i in range(LOOPS):
        total += i * i


def _taken_s(piece: Callable[[], object]) -> float:
    begun_s = time.thread_time()
    piece()
    return time.thread_time() - begun_s


def main(words: Sequence[str] | None = None) -> None:
    """Print the lines."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.speed")
    parser.add_argument("--store", metavar="NAME", help="keep the ratios under a release's name")
    print(*report(parser.parse_args(words).store), sep="\n")


if __name__ == "__main__":
    main()
