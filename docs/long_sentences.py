"""The sentences of the documents that are longer than 25 words; `python -m docs.words` counts them."""

import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
LONGEST_WORDS = 25
"""Words of a sentence that is read once."""
FENCED = re.compile(r"^```.*?^```|^>>> .*?(?=\n\s*\n|\Z)", re.MULTILINE | re.DOTALL)
NO_TEXT = re.compile(r"<!--.*?-->|!\[[^\]]*\]\([^)]*\)", re.DOTALL)
NO_LINE = re.compile(r" {4}|>>> |\.\.\. |[|\- ]+$")
"""Code, an example, a rule of a table."""
LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")
CODE = re.compile(r"`[^`]+`")
BLOCK = re.compile(r"\n\s*\n|\n(?=\s*(?:[-*#|>]|\d+\.) ?)|\||<br>")
"""Ends a paragraph, an item of a list, a heading, a cell of a table."""
END = re.compile(r"(?<=[.!?])[*\")]*\s+(?=[A-Z0-9*\"`(])")


def sentences(text: str) -> Iterator[str]:
    """Yield the sentences of a page; code counts as one word, indented blocks and tables' rules are none."""
    text = NO_TEXT.sub("", FENCED.sub("", text))
    text = "\n".join("" if NO_LINE.match(line) else line for line in text.splitlines())
    for block in BLOCK.split(CODE.sub("CODE", LINK.sub(r"\1", text))):
        yield from END.split(" ".join(block.split()))


def long_sentences() -> Iterator[tuple[str, str]]:
    """Yield page and sentence of each that is too long."""
    for page in PAGES:
        for sentence in sentences(page.read_text(encoding="utf-8")):
            if len(re.findall(r"\w[\w'-]*", sentence)) > LONGEST_WORDS:
                yield str(page.relative_to(ROOT)), sentence
