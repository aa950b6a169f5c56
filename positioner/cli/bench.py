"""`positioner bench`: the open benchmark."""

import argparse
import sys
from pathlib import Path

from config.errors import InputError

HELP = "score methods of diagnosis on loops and effects whose true cause is known"
EXAMPLE = "positioner bench cases --drawn 300"
RESULTS = "results.csv"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder of the cases; made if it is empty")
    parser.add_argument("--drawn", type=int, default=300, metavar="N", help="number of simulated loops")
    parser.add_argument(
        "--effects", type=int, default=0, metavar="N", help="number of hidden effects, half a minute each"
    )
    parser.add_argument(
        "--first-seed", type=int, default=4000, metavar="SEED", help="first seed of the simulated cases"
    )
    parser.add_argument(
        "--labelled", type=Path, metavar="DIR", help="measured loops of others: labels.csv and its files"
    )
    parser.add_argument(
        "--judge", type=Path, nargs="+", default=[], metavar="FILE", help="results files of other methods"
    )
    parser.add_argument("--workers", type=int, metavar="N", help="number of processes (one a core)")


def run(arguments: argparse.Namespace) -> int:
    """Write the cases, answer them where that is not done, and print the scores; 0."""
    from concurrent.futures import ProcessPoolExecutor

    from workbench.bench.cases import CASES, read_cases, write_cases
    from workbench.bench.methods import answers_of
    from workbench.bench.scores import add_results, read_results, tell_scores

    for name in ("drawn", "effects", "first_seed"):
        if (value := getattr(arguments, name)) < 0:
            raise InputError(f"--{name.replace('_', '-')}", f"must be 0 or more, got {value}")
    folder = arguments.folder
    if not (folder / CASES).exists():
        write_cases(folder, arguments.drawn, arguments.effects, arguments.first_seed, arguments.labelled)
    cases, results = read_cases(folder), folder / RESULTS
    answers = read_results(results, cases) if results.exists() else []
    done = {(each.set, each.case) for each in answers}
    left = [each for each in cases if (each.set, each.name) not in done]
    with ProcessPoolExecutor(arguments.workers) as pool:
        for count, found in enumerate(pool.map(answers_of, left), start=1):
            add_results(results, found)
            answers += found
            print(f"\r{count} of {len(left)} cases", end="" if count < len(left) else "\n", file=sys.stderr, flush=True)
    for path in arguments.judge:
        answers += read_results(path, cases)
    print(*tell_scores(cases, answers), sep="\n")
    return 0
