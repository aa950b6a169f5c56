"""What does on a command line what was done on a desk."""

import shlex
from math import inf

from positioner.pages.workbench_page.desk import BLIND, Desk
from sim.effect import tried_effects


def command_lines(desk: Desk) -> tuple[str, ...]:
    """Return the lines, in order; none before a recording and a valve are there."""
    if desk.opened is None or desk.valve is None:
        return ()
    first = desk.journal[0].before if desk.journal else desk.valve
    recording, read = desk.opened.name, desk.opened.words
    held_out = ("--test", desk.held_out.name) if desk.held_out else ()
    budget = () if desk.budget_s == inf else ("--budget-s", f"{desk.budget_s:g}")
    own = ("--effects", *map(str, desk.effects.values()), *tried_effects()) if desk.effects else ()
    lines: list[tuple[str, ...]] = [("hide", "--seed", str(desk.seed), "-o", BLIND)] if desk.sealed else []
    lines.append(("compare", recording, "--valve", first.name, *read))
    lines.append(("diagnose", recording, "--valve", first.name, *held_out, *read, *budget, *own))
    given = first.name
    for i, step in enumerate(desk.journal, start=1):
        out = f"better-{i}.toml"
        lines.append(
            ("extend", given, "--effect", *step.extension.effects, "--fit", recording, *held_out, *read, "-o", out)
        )
        given = out
    return tuple(desk.plain(shlex.join(("positioner", *line))) for line in lines)
