"""The tables of the documents that repeat a code, written from the code: `python -m docs.code_tables`.

`codes.md` is written whole; in `history.md`, `law.md` and `reliability.md` what stands between marks is.
"""

from dataclasses import fields
from pathlib import Path

from config.codes import CAUSES, AlarmState, Code, EventKind, Ne107Cause, Ne107Status, Refusal, ValveTestVerdict
from northbound.observer.register_words import CODES
from positioner.control.laws.slides.transitions import TABLE, Rule
from positioner.control.permissives import PERMISSIVES
from positioner.daemon.health.ne107 import CLASS
from positioner.daemon.service_state import table
from positioner.history.entries import TABLES, Entry

HERE = Path(__file__).parent
STATES_BEGIN = "<!-- states: written by `python -m docs.code_tables` -->"
STATES_END = "<!-- end of the states -->"
PERMISSIVES_BEGIN = "<!-- permissives: written by `python -m docs.code_tables` -->"
PERMISSIVES_END = "<!-- end of the permissives -->"
TRANSITIONS_BEGIN = "<!-- transitions: written by `python -m docs.code_tables` -->"
TRANSITIONS_END = "<!-- end of the transitions -->"
TABLES_BEGIN = "<!-- tables: written by `python -m docs.code_tables` -->"
TABLES_END = "<!-- end of the tables -->"
HEAD = """# What the numbers say

For who programs a DCS. After this page you can say what each number of a register means. A number never gets a new
meaning. Written by `python -m docs.code_tables` from `config/codes.py`.
"""
SERVED: dict[type[Code], str] = {code: register for register, code in CODES.items()} | {
    Refusal: "*_reason, refusal",
    Ne107Status: "ne107, event_class",
    Ne107Cause: "ne107_cause, and bit n - 1 of ne107_causes, from 17 up bit n - 17 of ne107_causes_high",
    AlarmState: "none, what `positioner alarms` prints",
    ValveTestVerdict: "none, what tests on the valve print and keep",
}
"""The register that serves each."""


def codes() -> str:
    """Return the whole of `codes.md`."""
    return "\n".join([HEAD, *(_section(code, register) for code, register in SERVED.items())])


def _section(code: type[Code], register: str) -> str:
    said = (code.__doc__ or "").strip().partition("\n")[0]
    width = max(len(each.name) for each in code)
    rows = [f"{int(each):2} {each.name:{width}} {_said(each)}{_beside(each)}".rstrip() for each in code]
    return "\n".join([f"## {code.__name__}: register {register}", "", said, "", "```text", *rows, "```", ""])


def _said(each: Code) -> str:
    """Return the text of a number; nothing where its name says the same."""
    return "" if each.text.lower() == each.name.lower().replace("_", " ") else each.text


def _beside(each: Code) -> str:
    """Return the NE 107 class of a cause, and the code that numbers the cause of an event."""
    if isinstance(each, Ne107Cause) and each:
        return f" ({CLASS[each].text[0]})" if each in CLASS else " (class by the file)"
    return f" (cause: {CAUSES[each].__name__})" if isinstance(each, EventKind) and each in CAUSES else ""


def with_states(document: str) -> str:
    """Return `reliability.md` with the service's states, and what permits a test, between their marks."""
    document = _between(document, STATES_BEGIN, STATES_END, table())
    return _between(document, PERMISSIVES_BEGIN, PERMISSIVES_END, permissives())


def permissives() -> list[str]:
    """Return the permissives as rows of a table."""
    head = (
        "a test needs",
        "by",
        "S3: `why`",
        "when it goes away",
        "experiment: `experiment_state`",
        "when it goes away",
    )
    rows = [
        (
            each.condition,
            each.key,
            f"{int(each.why)}" if each.why else "",
            each.excitation_later,
            f"{int(each.experiment)}",
            each.experiment_later,
        )
        for each in PERMISSIVES
    ]
    return [f"| {' | '.join(row)} |" for row in (head, ("---",) * len(head), *rows)]


def with_tables(document: str) -> str:
    """Return `history.md` with the tables of the file between their marks."""
    tables = [
        f"| `{each.TABLE}` | {', '.join(_column(each, field.name) for field in fields(each))} |" for each in TABLES
    ]
    columns = ["| table | columns; what tells a row from another in bold |", "|---|---|", *tables]
    return _between(document, TABLES_BEGIN, TABLES_END, columns)


def with_transitions(document: str) -> str:
    """Return `law.md` with the transitions of the law of slides between their marks."""
    rows = [f"| {each.when} | {_to(each)} | {', '.join(str(int(why)) for why in each.why if why)} |" for each in TABLE]
    return _between(document, TRANSITIONS_BEGIN, TRANSITIONS_END, ["| when | to | `why` |", "|---|---|---|", *rows])


def _to(rule: Rule) -> str:
    return ", ".join(each.__name__ for each in rule.to) or "the state stays"


def _column(of: type[Entry], name: str) -> str:
    return f"**{name}**" if name in of.KEY else name


def _between(document: str, begin: str, end: str, lines: list[str]) -> str:
    head, _, rest = document.partition(begin)
    return "\n".join([head + begin, *lines, end + rest.partition(end)[2]])


if __name__ == "__main__":
    (HERE / "codes.md").write_text(codes(), encoding="utf-8")
    reliability = HERE / "reliability.md"
    reliability.write_text(with_states(reliability.read_text(encoding="utf-8")), encoding="utf-8")
    law = HERE / "law.md"
    law.write_text(with_transitions(law.read_text(encoding="utf-8")), encoding="utf-8")
    history = HERE / "history.md"
    history.write_text(with_tables(history.read_text(encoding="utf-8")), encoding="utf-8")
