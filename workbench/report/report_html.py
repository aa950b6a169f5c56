"""The page: pieces of HTML, and the template that holds them together with the plots' library, style and script.

Nothing in the file is fetched: it says so to the browser itself, which would refuse (Content-Security-Policy).
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib import import_module
from pathlib import Path
from string import Template
from typing import Any, NewType

from config.errors import InputError, explain_failure
from config.valve_file import ValveFile
from config.whole_file import beside
from workbench.report.display_units import Shown

HERE = Path(__file__).parent
Html = NewType("Html", str)
"""Markup: what stands in it as text has been escaped. A page is made of nothing else, which the type checker holds."""
DATES = ("recorded", "date")
"""Metadata of a recording that say when it was made."""


@dataclass(frozen=True, slots=True)
class Subject:
    """What the report is about: the valve file it began with, the recordings' files, what they say of themselves."""

    valve: ValveFile
    recordings: tuple[str, ...]
    metadata: Mapping[str, str] = field(default_factory=dict)

    @property
    def recorded(self) -> str:
        """When the recording was made, as it says; empty if it does not."""
        return next((self.metadata[key] for key in DATES if key in self.metadata), "")


@dataclass(frozen=True, slots=True)
class Row:
    """A row of a table, `remark` small under its first cell; `kind` marks it: over, good, set, or nothing; `picture` is
    drawn in its last."""

    cells: Sequence[str | Shown]
    remark: str = ""
    kind: str = ""
    picture: Html = Html("")


def require_plotly(path: Path) -> str:
    """Return plotly.js. To be called before long work whose result is to be reported.

    Raises:
        InputError: it is not installed.
    """
    try:
        return str(import_module("plotly.offline").get_plotlyjs())
    except ModuleNotFoundError:
        raise InputError(
            str(path), "a report needs plotly, which is not installed: pip install 'positioner[report]'"
        ) from None


def write(path: Path, title: str, parts: Iterable[Html]) -> None:
    """Write the page.

    Raises:
        InputError: plotly is not installed, or the file cannot be written.
    """
    _write(path, title, parts, require_plotly(path), _read_shipped("page.js"))


def write_without_plots(path: Path, title: str, parts: Iterable[Html]) -> None:
    """Write a page that needs no script.

    Raises:
        InputError: the file cannot be written.
    """
    _write(path, title, parts, "", "")


def _write(path: Path, title: str, parts: Iterable[Html], library: str, script: str) -> None:
    page = Template(_read_shipped("page.html")).substitute(
        title=escape(title),
        style=_read_shipped("page.css"),
        body="\n".join(parts),
        plotly=library,
        script=script,
    )
    with explain_failure(path, "cannot be written"), beside(path) as new:
        new.write_text(page, encoding="utf-8", errors="backslashreplace")  # a file's name need not be text


def heading(title: str, subject: Subject, facts: str) -> Html:
    """Return the title and where the data come from."""
    files = ", ".join(f"<code>{escape(each)}</code>" for each in subject.recordings)
    when = f" · recorded {escape(subject.recorded)}" if subject.recorded else ""
    return Html(f'<h1>{escape(title)}</h1>\n<p class="source">{files}{when} · {escape(facts)}</p>')


def heading_alone(title: str, facts: str) -> Html:
    """Return the title of what is about no recording."""
    return Html(f'<h1>{escape(title)}</h1>\n<p class="source">{escape(facts)}</p>')


def verdict(kind: str, first: str, *parts: Html) -> Html:
    """Return the verdict, with the HTML that belongs to it; kind good, bad or open."""
    return Html(
        f'<section class="verdict {kind}" id="verdict"><strong>{escape(first)}</strong>{_lines(parts)}</section>'
    )


def figures_of_merit(cards: Sequence[tuple[str, Shown, str]]) -> Html:
    """Return the key figures: what, how much, and a remark."""
    shown = "".join(
        f"<div><dt>{escape(what)}</dt><dd{_si(value)}>{escape(value.text)}<small>{escape(remark)}</small></dd></div>"
        for what, value, remark in cards
    )
    return Html(f'<dl class="figures">{shown}</dl>')


def section(name: str, title: str, *parts: Html) -> Html:
    """Return a section; parts are HTML, empty ones are left out."""
    return Html(f'<section id="{name}">\n<h2>{escape(title)}</h2>\n{_lines(parts)}\n</section>')


def subheading(title: str) -> Html:
    """Return a heading inside a section."""
    return Html(f"<h3>{escape(title)}</h3>")


def fold_parts(name: str, title: str, *parts: Html) -> Html:
    """Return what is closed until asked for."""
    return Html(f'<details id="{name}"><summary>{escape(title)}</summary>\n{_lines(parts)}\n</details>')


def link_to(address: str, shown: Html) -> Html:
    """Return what leads to an address."""
    return Html(f'<a href="{escape(address)}">{shown}</a>')


def pair(*parts: Html) -> Html:
    """Return figures side by side where there is room."""
    return Html(f'<div class="pair">{_lines(parts)}</div>')


def text(*paragraphs: str) -> Html:
    """Return paragraphs."""
    return _each("p", [each for each in paragraphs if each])


def bullets(items: Sequence[str]) -> Html:
    """Return a list of sentences."""
    return Html(f"<ul>{_each('li', [sentence(each) for each in items])}</ul>" if items else "")


def keep_lines(lines: str) -> Html:
    """Return lines as they are."""
    return Html(f"<pre>{escape(lines)}</pre>" if lines else "")


def glossary(words: Mapping[str, str]) -> Html:
    """Return words and what they mean."""
    pairs = "".join(f"<dt>{escape(word)}</dt><dd>{escape(meaning)}</dd>" for word, meaning in words.items())
    return Html(f'<dl class="words">{pairs}</dl>')


def table(name: str, head: Sequence[str], rows: Sequence[Row], words: Iterable[int] = (0,)) -> Html:
    """Return a table; the columns in `words` hold words, not numbers."""
    left = set(words)
    top = "".join(f'<th scope="col"{_class(i in left)}>{escape(each)}</th>' for i, each in enumerate(head))
    body = "\n".join(f'<tr class="{row.kind}">{_cells(row, left)}</tr>' for row in rows)
    return Html(
        f'<div class="scroll"><table id="{name}"><thead><tr>{top}</tr></thead>\n<tbody>\n{body}\n</tbody></table></div>'
    )


def plot(name: str, figure: Mapping[str, Any], height_px: int, caption: str) -> Html:
    """Return a figure that the page's script draws."""
    data = json.dumps(figure, allow_nan=False, separators=(",", ":"), ensure_ascii=False).replace("</", "<\\/")
    return Html(
        f'<figure><div class="plot" id="{name}" role="img" aria-label="{escape(caption)}" '
        f'style="height:{height_px}px"></div><script type="application/json" id="{name}-data">{data}</script>\n'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def sentence(words: str) -> str:
    """Return a phrase as a sentence: capital and full stop."""
    return words[:1].upper() + words[1:] + ("" if words.endswith((".", "!", "?")) else ".")


def _cells(row: Row, left: set[int]) -> str:
    last = len(row.cells) - 1
    beside = [_small(row.remark) if i == 0 else "" for i in range(last)] + [
        row.picture or _small(row.remark * (not last))
    ]
    return "".join(
        f"<td{_class(i in left)}{_si(value)}>{escape(value.text)}{more}</td>"
        for i, (value, more) in enumerate(zip(map(_as_shown, row.cells), beside, strict=True))
    )


def _as_shown(cell: str | Shown) -> Shown:
    return Shown(cell) if isinstance(cell, str) else cell


def _small(remark: str) -> str:
    return f"<small>{escape(remark)}</small>" if remark else ""


def _class(is_text: bool) -> str:
    return ' class="text"' if is_text else ""


def _si(value: Shown) -> str:
    return f' title="{escape(value.si)}"' if value.si else ""


def _each(tag: str, texts: Sequence[str]) -> Html:
    return Html("".join(f"<{tag}>{escape(each)}</{tag}>" for each in texts))


def _lines(parts: Iterable[Html]) -> str:
    return "\n".join(part for part in parts if part)


def _read_shipped(name: str) -> str:
    return (HERE / name).read_text(encoding="utf-8")
