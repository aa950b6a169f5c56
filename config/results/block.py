"""Blocks of a summary: sentences and tables, written as plain text for a terminal and as HTML for a notebook."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape

COLUMN_GAP = "  "


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of cells under headings. The first column and those without a heading are words, the others numbers."""

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    title: str = ""

    def is_words(self, column: int) -> bool:
        """Whether a column is aligned as words are, to the left."""
        return column == 0 or not self.headings[column]


Block = str | Table


def as_text(blocks: Sequence[Block]) -> str:
    """Return the blocks as lines; a table stands between empty ones."""
    lines: list[str] = []
    for block in blocks:
        if isinstance(block, str):
            lines += [block]
        else:
            lines += [*([""] if lines and lines[-1] else []), *_lines(block), ""]
    return "\n".join(lines).rstrip("\n")


def _lines(table: Table) -> Iterator[str]:
    if table.title:
        yield table.title
    rows = [table.headings, *table.rows]
    widths = [max(len(row[column]) for row in rows) for column in range(len(table.headings))]
    for row in rows:
        cells = (
            cell.ljust(width) if table.is_words(column) else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        yield COLUMN_GAP + COLUMN_GAP.join(cells).rstrip()


def as_html(name: str, blocks: Sequence[Block]) -> str:
    """Return the blocks as one element, headed by a name."""
    return f"<div><p><b>{escape(name)}</b></p>{''.join(map(_element, blocks))}</div>"


def _element(block: Block) -> str:
    if isinstance(block, str):
        return f"<p>{escape(block.strip())}</p>"
    caption = f"<caption>{escape(block.title)}</caption>" if block.title else ""
    head = "".join(f"<th>{escape(each)}</th>" for each in block.headings)
    body = "".join(f"<tr>{''.join(_cells(block, row))}</tr>" for row in block.rows)
    return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _cells(table: Table, row: Sequence[str]) -> Iterator[str]:
    for column, cell in enumerate(row):
        side = "left" if table.is_words(column) else "right"
        yield f'<td style="text-align: {side}">{escape(cell)}</td>'
