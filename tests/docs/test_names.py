"""What the documents name exists: files, modules and what is in them, commands with their options, targets, links."""

import argparse
import importlib
import re
import shlex
from collections.abc import Callable, Iterator
from functools import cache
from importlib.util import find_spec
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple, get_args

import pytest

from config.daemon_file import DaemonFile
from config.slave_file import SlaveFile
from positioner.cli.main import command_parser
from positioner.cli.parts.command_finder import all_commands

ROOT = Path(__file__).parents[2]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
ROOMS = (
    "benchmarks",
    "config",
    "signals",
    "northbound",
    "webpage",
    "deploy",
    "docs",
    "drivers",
    "fieldbus",
    "positioner",
    "sim",
    "tests",
    "workbench",
)
FILES = {path.name for room in ROOMS for path in (ROOT / room).rglob("*.*")} | {path.name for path in ROOT.glob("*.*")}
OF_THE_READER = {"acme_device.py", "acme_driver.py", "tight_spot.py"}
"""Files that a document tells its reader to write."""
FENCED = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
SPAN = re.compile(r"`([^`\n]+)`")
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")

each_document = pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))


def spans(text: str) -> list[str]:
    """Return what stands in backticks outside the blocks."""
    return SPAN.findall(FENCED.sub("", text))


def lines(text: str) -> Iterator[str]:
    """Yield the command lines of the blocks, each in one piece and without its comment."""
    for language, block in FENCED.findall(text):
        if language in {"", "sh"}:
            yield from re.sub(r"\\\n\s*", " ", block).splitlines()


@cache
def parser() -> argparse.ArgumentParser:
    return command_parser()


@cache
def options(command: str) -> set[str]:
    """Return the options of a command."""
    (commands,) = (each for each in parser()._actions if isinstance(each, argparse._SubParsersAction))
    return {option for action in commands.choices[command]._actions for option in action.option_strings}


def missing(span: str) -> str | None:
    """Say what of a span is not there; None where all is, or where it names nothing of ours."""
    for pattern, check in CHECKS.items():
        if match := re.fullmatch(pattern, span):
            return check(*match.groups())
    return None


def wrong_path(path: str) -> str | None:
    return None if any(ROOT.glob(path.rstrip("/"))) else "no such file"


def wrong_file(name: str) -> str | None:
    return None if name in FILES | OF_THE_READER else "no file of that name"


def wrong_name(name: str) -> str | None:
    return None if is_there(name) else "no such module or name in it"


class Source(NamedTuple):
    """A Python file: its name without the ending, the words in it and the classes that it defines."""

    name: str
    words: frozenset[str]
    classes: frozenset[str]


@cache
def sources() -> list[Source]:
    """Return every Python file but the tests' of documents."""
    files = [path for room in ROOMS for path in (ROOT / room).rglob("*.py") if path.parent != Path(__file__).parent]
    texts = {path: path.read_text(encoding="utf-8") for path in files}
    return [
        Source(path.stem, frozenset(re.findall(r"\w+", text)), frozenset(re.findall(r"^class (\w+)", text, re.M)))
        for path, text in texts.items()
    ]


def wrong_member(holder: str, member: str) -> str | None:
    """Say whether a class, or a module, of ours has no such member; what is not ours may be anything."""
    own = [each for each in sources() if holder == each.name or holder in each.classes]
    return None if not own or any(member in each.words for each in own) else f"{holder} has none"


def wrong_constant(name: str) -> str | None:
    return None if any(name in each.words for each in sources()) else "no such constant"


def is_there(name: str) -> bool:
    """Return whether a dotted name is a module, or something in one."""
    parts = name.split(".")
    for cut in range(len(parts), 0, -1):
        path = ROOT.joinpath(*parts[:cut])
        if path.is_dir() or path.with_suffix(".py").is_file():
            thing: object = importlib.import_module(".".join(parts[:cut]))
            for part in parts[cut:]:
                if not hasattr(thing, part) and part not in getattr(thing, "__annotations__", {}):
                    return False
                thing = getattr(thing, part, None)
            return True
    return False


def wrong_command(line: str) -> str | None:
    command, *words = line.split()
    if command.startswith("-") or command == "COMMAND":
        return None
    if command not in all_commands():
        return "no such command"
    used = {word.partition("=")[0] for word in words if word.startswith("-") and not word.lstrip("-")[:1].isdigit()}
    return f"no option {min(used - options(command))}" if used - options(command) else None


def wrong_module(name: str) -> str | None:
    return None if find_spec(name) else "no such module"


def wrong_target(name: str) -> str | None:
    return None if re.search(rf"^{name}:", (ROOT / "Makefile").read_text(), re.MULTILINE) else "no such target"


def wrong_table(table: str, key: str | None) -> str | None:
    """Say what is wrong with `[table] key` of the daemon's or the slave's file."""
    fields = [schema.model_fields[table] for schema in (DaemonFile, SlaveFile) if table in schema.model_fields]
    if not fields:
        return None if table in {"valve", "drive", "effect", "export"} else "no such table"
    return None if key is None or any(key in keys(field.annotation) for field in fields) else "no such key"


def keys(annotation: object) -> set[str]:
    """Return the keys of the tables in an annotation."""
    own = set(getattr(annotation, "model_fields", {}))
    return own.union(*(keys(each) for each in get_args(annotation)))


CHECKS: dict[str, Callable[..., str | None]] = {
    rf"((?:{'|'.join(ROOMS)})/[\w./*-]*)": wrong_path,
    r"(\w+\.(?:py|md))": wrong_file,
    rf"((?:{'|'.join(ROOMS)})(?:\.\w+)+)": wrong_name,
    r"([A-Z][a-z]\w+|[a-z]\w+)\.([A-Za-z_]\w*)": wrong_member,
    r"([A-Z][A-Z0-9]*_[A-Z0-9_]+)": wrong_constant,
    r"positioner (.+)": wrong_command,
    r"python -m ([\w.]+).*": wrong_module,
    r"make (\w+)": wrong_target,
    r"\[([a-z_0-9]+)\](?: (\w+))?(?: = .*)?": wrong_table,
}
"""What a span may name, and how it is looked for."""


@each_document
def test_what_stands_in_backticks_exists(document: Path) -> None:
    text = document.read_text(encoding="utf-8")
    wrong = [f"`{span}`: {problem}" for span in dict.fromkeys(spans(text)) if (problem := missing(span))]
    assert not wrong, "\n".join(wrong)


@each_document
def test_every_command_line_can_be_parsed(document: Path) -> None:
    if document.name.startswith("add-"):  # what is added, test_recipes follows
        return
    for line in lines(document.read_text(encoding="utf-8")):
        words = shlex.split(line, comments=True) if re.match(r"(positioner|make|python) ", line) else []
        if words[:1] == ["positioner"]:
            parser().parse_args([word for word in takewhile(lambda word: word != "|", words[1:]) if word != "&"])
        elif words:
            assert missing(" ".join(words[:3] if words[0] == "python" else words[:2])) is None, line


@each_document
def test_every_link_leads_somewhere(document: Path) -> None:
    for target in LINK.findall(FENCED.sub("", document.read_text(encoding="utf-8"))):
        assert "://" in target or (document.parent / target).exists(), target


def test_each_decision_has_its_number_and_names_others_that_exist() -> None:
    records = sorted((ROOT / "docs" / "decisions").glob("*.md"))
    numbers = {path.name[:4] for path in records}
    assert len(numbers) == len(records)
    for path in records:
        text = path.read_text(encoding="utf-8")
        assert text.startswith(f"# {int(path.name[:4])}. ")
        assert set(re.findall(r"\b00\d\d\b", text)) <= numbers | {"0013"}, path.name


@pytest.mark.parametrize(
    ("span", "problem"),
    [
        ("sim/karnop.py", "no such file"),
        ("tests/*/test_of_nothing.py", "no such file"),
        ("karnop.py", "no file of that name"),
        ("config.registers.REGISTER", "no such module or name in it"),
        ("config.registers.Register.adress", "no such module or name in it"),
        ("Cycle.request", "Cycle has none"),
        ("controller.stepp", "controller has none"),
        ("LEAST_LUCK", "no such constant"),
        ("positioner diagnos rec.csv", "no such command"),
        ("positioner get --config daemon.toml --valf FV", "no option --valf"),
        ("python -m benchmarks.luck", "no such module"),
        ("make tests", "no such target"),
        ("[contrl] law", "no such table"),
        ("[control] lawn", "no such key"),
    ],
)
def test_what_does_not_exist_is_found(span: str, problem: str) -> None:
    assert missing(span) == problem


@pytest.mark.parametrize(
    "span",
    [
        "sim/karnopp.py",
        "sim/effects/",
        "karnopp.py",
        "config.registers.Register.address",
        "Cycle.requests",
        "controller.step",
        "time.sleep",
        "STROKE_SHARES",
        "positioner get --valve FV",
        "python -m benchmarks",
        "make test",
        "[control] law",
        "[valve] breakaway_pa",
        "u = -(b/c r + k/c)",
    ],
)
def test_what_exists_is_let_pass(span: str) -> None:
    assert missing(span) is None
