"""Which commands there are: the roof's own, and those that rooms and other packages bring by entry points.

    [project.entry-points."positioner.commands"]
    page = "northbound.operator_page.command [web]"

The module has `HELP`, `EXAMPLE`, `add_arguments` and `run`; in brackets stands the extra that it needs. Only the
command that is asked for is imported, or, for a list of all, those whose extra is installed.
"""

import importlib
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from typing import Any

from config.entry_points import find_offers, origin
from config.errors import InputError
from config.extras import EXTRAS

GROUP = "positioner.commands"
GROUPS: dict[str, dict[str, str]] = {
    "to begin": {
        "demo": "sim,plot",
        "completion": "completion",
    },
    "a valve under control": {
        "sim": "sim,plot",
        "run": "",
        "probe": "",
        "doctor": "",
        "get": "",
        "set": "",
        "identify": "",
        "certify": "",
        "certificates": "tls",
    },
    "tests and experiments, most of which move the valve": {
        "commission": "",
        "signature": "",
        "pst": "",
        "cst": "",
        "steps": "",
        "report": "",
        "discriminate": "sim,plot",
    },
    "what a running valve shows": {
        "map": "",
        "health": "",
        "alarms": "",
        "events": "",
    },
    "a recording and a model": {
        "import": "",
        "valve": "",
        "simulate": "sim,plot",
        "export": "sim,plot",
        "play": "sim,plot",
        "estimate": "",
        "response": "",
        "compare": "sim,plot",
        "diagnose": "sim,plot",
        "discover": "sim,plot",
        "extend": "sim,plot",
        "hide": "sim,plot",
    },
    "many valves, control loops, benchmarks": {
        "fleet": "fleet",
        "loop": "sim,plot",
        "loops": "sim,plot",
        "bench": "sim,plot",
        "reproduce": "sim,plot",
    },
}
"""The roof's own, as `positioner --help` groups them, each with the extras that it needs."""
BROUGHT = "pages, servers, and what other packages bring"
"""Heading of the commands that come by entry points."""
COMMANDS = {name: extra for group in GROUPS.values() for name, extra in group.items()}
MODULES = {"import": "import_recording", "valve": "valve_from_data_sheet"}
"""Files of commands whose name is taken: by the language, by another file."""


@dataclass(frozen=True)
class Command:
    """A command, not yet imported."""

    name: str
    extra: str
    entry: EntryPoint | None

    @cached_property
    def module(self) -> Any:
        """The module, imported.

        Raises:
            InputError: another package's cannot be loaded; says whose it is and why.
        """
        if self.entry is None:
            return importlib.import_module(f"positioner.cli.{MODULES.get(self.name, self.name)}")
        try:
            return self.entry.load()
        except Exception as error:  # somebody else's module: anything may be wrong in it
            raise InputError(origin(self.entry), f"command {self.name!r} cannot be loaded: {error}") from None

    @property
    def lacks(self) -> str:
        """What to install for it; empty where everything is there."""
        needed = [module for module, extra in EXTRAS.items() if extra == self.extra]
        if all(find_spec(module) for module in needed):
            return ""
        return f"needs more: pip install 'positioner[{self.extra}]'"


def all_commands() -> dict[str, Command]:
    """Return all commands by name, the roof's first.

    Raises:
        InputError: two packages bring the same name.
    """
    own = {name: Command(name, extra, None) for name, extra in COMMANDS.items()}
    brought = find_offers(GROUP, "command").items()
    return {name: Command(name, ",".join(entry.extras), entry) for name, entry in brought} | own


def commands_for(words: list[str]) -> list[Command]:
    """Return the command that begins a command line, or else all, for a list of them."""
    first = words[0] if words else ""
    if first in COMMANDS:
        return [Command(first, COMMANDS[first], None)]
    every = all_commands()
    if first in every:
        return [every[first]]
    return [every[name] for name in (*COMMANDS, *(each for each in sorted(every) if each not in COMMANDS))]


def headings(names: list[str]) -> dict[str, str]:
    """Return the heading that stands before a command in a list of all, by the command's name."""
    first = {next(iter(group)): heading for heading, group in GROUPS.items()}
    brought = next((name for name in names if name not in COMMANDS), None)
    return first if brought is None else {**first, brought: BROUGHT}
