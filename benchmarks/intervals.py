"""How often the 95 % intervals of a fit hold the truth: `python -m benchmarks.intervals [SETTING [CASES [SEED]]]`.

Valves drawn as `positioner hide` draws them, one recording of 30 s at 100 Hz, an effect of the library in each other
one, which the fit is told the name of. Counted are the parameters of the valve, and those of the effects; apart from
them those of fits that call themselves untrusted, whose intervals are no promise. With n parameters of which a share of
95 % is held, the count scatters by sqrt(0.0475 n).
"""

import sys
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from os import cpu_count

import numpy as np

from sim.composition import Composition
from workbench.blind.hiding import hide
from workbench.fit.fitting import fit

FIRST_SEED = {"clean": 41000, "dirty": 42000}
CASES = 40

Held = tuple[str, float, float, float, bool]
"""Name, truth, the interval's ends, and whether the fit is trusted."""


def held(setting: str, seed: int) -> list[Held]:
    """Fit one case."""
    made = hide(seed, effects=seed % 2, dirty=setting == "dirty")
    found = fit(made.fit, made.base, effects=[each.name for each in made.truth.effect], workers=1)
    composition = Composition.from_file(made.truth)
    truth = dict(zip(composition.names, composition.theta.tolist(), strict=True))
    return [(name, truth[name], each.lower, each.upper, found.trusted) for name, each in found.parameters.items()]


def report(setting: str, cases: int, first: int) -> Iterator[str]:
    """Yield one line a parameter of the valve, and one for all of the effects; two for all fits not trusted."""
    with ProcessPoolExecutor(cpu_count()) as pool:
        found = [each for case in pool.map(held, [setting] * cases, range(first, first + cases)) for each in case]
    inside: dict[str, list[bool]] = defaultdict(list)
    width: dict[str, list[float]] = defaultdict(list)
    for name, value, lower, upper, trusted in found:
        of = "of the effects" if "." in name else name
        of = of if trusted else f"not trusted: of the {'effects' if '.' in name else 'valve'}"
        inside[of].append(lower <= value <= upper)
        width[of].append((upper - lower) / abs(value) if value else np.inf)
    yield f"{setting}, {cases} cases from seed {first}"
    for of, each in inside.items():
        middle = f"median width {100 * float(np.median(width[of])):.3g} %"
        yield f"  {of:<28}{sum(each):>4} of {len(each):<4}{middle}"
    for name, value, lower, upper, trusted in found:
        if "." in name and not lower <= value <= upper:
            yield f"    {name} = {value:.4g}, not in {lower:.4g} to {upper:.4g}{'' if trusted else ', not trusted'}"


if __name__ == "__main__":
    settings = sys.argv[1:2] or list(FIRST_SEED)
    count = int(sys.argv[2]) if len(sys.argv) > 2 else CASES
    for chosen in settings:
        for line in report(chosen, count, int(sys.argv[3]) if len(sys.argv) > 3 else FIRST_SEED[chosen]):
            print(line, flush=True)
