"""Blind cases through the whole diagnosis: `python -m benchmarks.blind --cases N`; `make blind` runs the campaign.

A case hides one effect or none (`workbench.hiding`, seed 1000 + i), is diagnosed against the whole library, and the
answer is opened. An effect counts if it is visible. Every fifth case hides nothing; one in eight takes the hidden
effect out of the library, where the right verdict is "unexplained".
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sim.effect import shipped_effects
from workbench.diagnosis import Diagnosis, diagnose
from workbench.hiding import Hidden, hide

FIRST_SEED = 1000


@dataclass(frozen=True, slots=True)
class Outcome:
    """One case: what was hidden ("" nothing), whether the library had it, and what came of it."""

    seed: int
    hidden: str
    in_library: bool
    visible: bool
    diagnosis: Diagnosis
    floor_m: float
    seconds: float

    @property
    def named(self) -> tuple[str, ...]:
        """The first set named: the effect, or those that do as well."""
        step = self.diagnosis.steps[0]
        return tuple(each.name for each in step.alike)


def outcome(index: int, *, dirty: bool, most: int) -> Outcome:
    seed = FIRST_SEED + index
    nothing, outside = index % 5 == 4, index % 8 == 7
    case = hide(seed, effects=0 if nothing else 1, dirty=dirty)
    hidden = "" if nothing else case.truth.effect[0].name
    others = [name for name in shipped_effects() if name != hidden]
    rivals = np.random.default_rng(seed).permutation(others)[: most - 1].tolist()
    library = sorted(rivals if outside or nothing else [hidden, *rivals])
    began_s = time.perf_counter()
    diagnosis = diagnose(case.fit, case.base, test=case.test, effects=library)
    seconds = time.perf_counter() - began_s
    return Outcome(seed, hidden, not outside, _visible(case), diagnosis, case.answer["floor_m"]["test"], seconds)


def _visible(case: Hidden) -> bool:
    return any(each["is_visible"] for each in case.answer["visible"].values())


def report(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Yield the figures."""
    seen = [each for each in outcomes if each.hidden and each.in_library and each.visible]
    none = [each for each in outcomes if not each.hidden]
    outside = [each for each in outcomes if each.hidden and not each.in_library and each.visible]
    single = [each for each in seen if each.diagnosis.verdict == "missing"]
    ratio = [each.diagnosis.best.errors.test_rmse_m / each.floor_m for each in seen]
    yield share("true effect first", [each.hidden in each.diagnosis.missing[:1] for each in seen])
    yield share("true effect first or in the set", [each.hidden in each.named for each in seen])
    yield share("a single effect named, and right", [each.diagnosis.missing == (each.hidden,) for each in single])
    yield share("false alarms, nothing hidden", [each.diagnosis.verdict != "adequate" for each in none])
    yield share("outside the library: unexplained", [each.diagnosis.verdict == "unexplained" for each in outside])
    if ratio:
        yield f"{'held-out error after over floor, median':<44}{np.median(ratio):.2f}"
    yield f"{'seconds a case, median':<44}{np.median([each.seconds for each in outcomes]):.0f}"
    yield f"seeds {outcomes[0].seed} to {outcomes[-1].seed}"


def share(what: str, holds: Sequence[bool]) -> str:
    return f"{what:<44}{sum(holds)} of {len(holds)}" + (f" ({sum(holds) / len(holds):.0%})" if holds else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="number of the first case (0)")
    parser.add_argument("--dirty", action="store_true", help="pressure noise, break-away jitter, 12 bits")
    parser.add_argument(
        "--library",
        type=int,
        default=len(shipped_effects()),
        metavar="N",
        help="try only N effects, drawn by the seed (all)",
    )
    arguments = parser.parse_args()
    outcomes = []
    for index in range(arguments.first, arguments.first + arguments.cases):
        each = outcome(index, dirty=arguments.dirty, most=arguments.library)
        outcomes.append(each)
        found = each.diagnosis
        where = "" if each.in_library else " (not in the library)"
        print(
            f"{each.seed} {each.hidden or 'nothing'}{where}{'' if each.visible or not each.hidden else ', invisible'}: "
            f"{found.verdict} {', '.join(each.named)}; {1e3 * found.base.errors.test_rmse_m:.4f} to "
            f"{1e3 * found.best.errors.test_rmse_m:.4f} mm, floor {1e3 * each.floor_m:.4f}; {each.seconds:.0f} s",
            flush=True,
        )
    print(*report(outcomes), sep="\n")


if __name__ == "__main__":
    main()
