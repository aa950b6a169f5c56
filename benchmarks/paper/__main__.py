"""The paper's figures and claims: as printed, corrected, and under honest noise. `python -m benchmarks.paper`: minutes.

In process and virtual time, at the seed's 10 us; the last row of each table is a sample time a fieldbus can give. The
noise table at the end sets the seed's identifier, ours and the Cramér-Rao bound side by side, many seeds each.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path

from benchmarks.paper import scenario
from benchmarks.paper.findings import CLAIMS, SeedFindings, findings
from benchmarks.paper.formulas import Erratum, errata, refusal_of_printed_static_friction
from benchmarks.paper.noise_table import Cell, lines, table
from benchmarks.paper.scenario import HONEST_SINE, LITERAL, NONE, WHITE
from benchmarks.paper.seed_figures import draw_all
from config.codes import Refusal
from config.json_value import json_value
from config.valve_file import load_valve, shipped_valve

FIELDBUS_PERIOD_S = 1e-3
OWN_NOISE = 2
"""So many of the first cases are noise as the seed says it is: its claims must hold there."""


def main() -> int:
    """Run it; exit status 1 when a claim does not hold without noise, or a printed form is no worse than ours."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, metavar="DIR", help="draw the figures there")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers as JSON")
    parser.add_argument("--seeds", type=int, default=100, help="runs per cell of the noise table, 2 or more (100)")
    arguments = parser.parse_args()
    return reproduced(arguments.out, arguments.json, arguments.seeds)


def reproduced(out: Path | None, numbers: Path | None, seeds: int) -> int:
    """Print all, write figures and numbers if asked to, and return the exit status."""
    started_s = time.monotonic()
    file = load_valve(shipped_valve("seed"))
    cases = [(noise, scenario.SEED_PERIOD_S) for noise in (NONE, LITERAL, HONEST_SINE, WHITE)]
    courses = []
    for noise, period_s in [*cases, (WHITE, FIELDBUS_PERIOD_S)]:
        courses.append(scenario.run_scenario(file, noise, period_s))
        print(f"S3, S1, S2 at {_period(period_s)}, noise {noise.name}: {len(courses[-1].time_s)} cycles", flush=True)
    wrong = errata(courses[0], file)
    refusal = refusal_of_printed_static_friction(file.valve)
    found = [findings(each, file) for each in courses]
    _print_lines(_errata_lines(wrong, refusal))
    _print_lines(_estimate_lines(found))
    _print_lines(_kept_lines(found[OWN_NOISE]))
    _print_lines(_law_lines(found))
    _print_lines(_claim_lines(found))
    cells = list(table(file, seeds))
    _print_lines(lines(cells))
    if out:
        out.mkdir(parents=True, exist_ok=True)
        (out / "noise-table.txt").write_text("\n".join(lines(cells)) + "\n", encoding="utf-8")
        _print_lines(map(str, draw_all(out, courses[0], (courses[2], courses[3]), file)))
    if numbers:
        told = json_value(_jsonable(wrong, refusal, found, cells, time.monotonic() - started_s))
        numbers.write_text(json.dumps(told, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    problems = _problems(wrong, refusal, found)
    _print_lines(f"DOES NOT HOLD: {problem}" for problem in problems)
    print(f"{'failed' if problems else 'done'}, {time.monotonic() - started_s:.0f} s")
    return 1 if problems else 0


def _problems(wrong: list[Erratum], refusal: str, found: list[SeedFindings]) -> list[str]:
    """Return what is not as docs/paper.md says it is."""
    problems = [
        f"{each.where}, {each.quantity}: as printed {each.printed:g}, corrected {each.corrected:g}, true {each.true:g}"
        for each in wrong
        if not each.printed_fails
    ]
    if not refusal:
        problems.append("F_s as printed is accepted in a valve file")
    return problems + [
        f"claim {claim.claim}, noise {each.noise}: {claim.figure:.3g}, limit {claim.limit:g}"
        for each in found[:OWN_NOISE]
        for claim in each.claims
        if not claim.holds
    ]


def _print_lines(lines: Iterable[str]) -> None:
    for line in lines:
        print(line)


def _errata_lines(wrong: list[Erratum], refusal: str) -> list[str]:
    return [
        "",
        "as printed and corrected, on the same motion without noise",
        f"{'where':7}{'quantity':24}{'unit':12}{'printed':>13}{'corrected':>13}{'true':>13}",
        *(
            f"{each.where:7}{each.quantity:24}{each.unit:12}{each.printed:13.5g}{each.corrected:13.5g}{each.true:13.5g}"
            for each in wrong
        ),
        refusal,
    ]


def _estimate_lines(found: list[SeedFindings]) -> list[str]:
    columns = ("a_e", "b_e", "c_e", "worst", "k_e mean", "std", "last")
    lines = [
        "",
        "relative errors of the seed's estimates, corrected forms: a_e, b_e, c_e at 0.8 s and the worst from 0.4 s on;",
        "k_e from 0.4 to 0.8 s: mean, standard deviation, last",
        f"{'noise':20}{'sample':>8}" + "".join(f"{name:>10}" for name in columns),
    ]
    for each in found:
        worst = max(solved.worst_error for solved in each.solved)
        of_k = _deviation(each.k.mean), _percent(each.k.std), _deviation(each.k.last)
        row = (*(_deviation(solved.error) for solved in each.solved), _percent(worst), *of_k)
        lines.append(_head(each) + "".join(f"{text:>10}" for text in row))
    lines += [
        "",
        "relative errors of the daemon's estimates at the end of S3; in brackets: it refuses the value",
        f"{'noise':20}{'sample':>8}" + "".join(f"{name:>11}" for name in ("a", "b", "c", "k", "b/c", "k/c")),
    ]
    for each in found:
        errors_said = (_shown(one.value / one.true - 1, one.reason) for one in each.identified)
        lines.append(_head(each) + "".join(f"{text:>11}" for text in errors_said))
    return lines + list(_refusal_lines(found))


def _refusal_lines(found: list[SeedFindings]) -> Iterable[str]:
    for each in found:
        for reason in dict.fromkeys(one.reason for one in each.identified if one.reason != Refusal.VALID.name):
            names = ", ".join(one.name for one in each.identified if one.reason == reason)
            yield f"  {each.noise}, {_period(each.period_s)}: {names} refused: {Refusal[reason].text}"


def _law_lines(found: list[SeedFindings]) -> list[str]:
    lines = [
        "",
        "largest error of the true stem over the last 0.2 s, p.u. of stroke",
        f"{'noise':20}{'sample':>8}{'':>6}{'reference':>11}{'last k_e kept':>16}{'daemon':>12}",
    ]
    for each in found:
        for step in each.steps:
            lines.append(
                f"{_head(each)}{step.state:>6}{step.reference_pu:11.2f}"
                f"{step.seed_error_pu:16.5f}{step.daemon_error_pu:12.5f}"
            )
    return lines


def _kept_lines(each: SeedFindings) -> list[str]:
    return [
        "",
        f"error, p.u., that a single k_e leaves under the {each.noise}, by each reading of the text; plainest first",
        f"{'filters':14}{'samples':>8}{'x_e':>10}{'last':>10}{'worst':>10}",
        *(
            f"{kept.filters:14}{kept.samples:8}{kept.position:>10}{kept.last_error_pu:10.4f}{kept.worst_error_pu:10.4f}"
            for kept in each.kept
        ),
    ]


def _claim_lines(found: list[SeedFindings]) -> list[str]:
    lines = ["", "the seed's claims", *(f"  {claim:9} {text}" for claim, text in CLAIMS.items())]
    lines.append(f"{'noise':20}{'sample':>8}" + "".join(f"{claim:>16}" for claim in CLAIMS))
    for each in found:
        said = (f"{'yes' if claim.holds else 'NO'} {_figure(claim.figure)}" for claim in each.claims)
        lines.append(_head(each) + "".join(f"{text:>16}" for text in said))
    limits = ", ".join(f"{claim.claim} {claim.limit:g}" for claim in found[0].claims)
    return [*lines, f"limits: {limits}", ""]


def _head(each: SeedFindings) -> str:
    return f"{each.noise:20}{_period(each.period_s):>8}"


def _period(period_s: float) -> str:
    return f"{1e3 * period_s:g} ms" if period_s >= 1e-3 else f"{1e6 * period_s:g} us"


def _deviation(share: float) -> str:
    """Say a share with its sign, where it has one to speak of."""
    said = _percent(abs(share))
    return said if said in ("lost", "0.00 %") else f"{'-' if share < 0 else '+'}{said}"


def _percent(share: float) -> str:
    """Say a share in per cent; beyond 100 % there is nothing left to say."""
    return f"{100 * share:.2f} %" if share < 1 else "lost"


def _shown(error: float, reason: str) -> str:
    return _deviation(error) if reason == "VALID" else f"({_deviation(error)})"


def _figure(figure: float) -> str:
    return f"{figure:.2g}" if figure < 1 else "lost"


def _jsonable(
    wrong: list[Erratum], refusal: str, found: list[SeedFindings], cells: list[Cell], seconds: float
) -> dict[str, object]:
    return {
        "errata": wrong,
        "printed_static_friction_refused": refusal,
        "cases": [_case(each) for each in found],
        "noise_table": cells,
        "seconds": seconds,
    }


def _case(each: SeedFindings) -> dict[str, object]:
    return {
        **asdict(each),
        "solved": [{**asdict(one), "error": one.error} for one in each.solved],
        "identified": [{**asdict(one), "error": one.value / one.true - 1} for one in each.identified],
        "claims": [{**asdict(claim), "holds": claim.holds} for claim in each.claims],
    }


if __name__ == "__main__":
    sys.exit(main())
