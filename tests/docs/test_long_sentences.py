"""What counts as a sentence of a document, and as a long one."""

from docs.long_sentences import sentences


def test_sentences_are_those_of_paragraphs_items_and_cells() -> None:
    page = """# A head

One sentence. And `code` another; it
goes on. `more` begins a third.

- an item
- [a link](somewhere.md), and
  its end

| cell | other cell |
|---|---|

    k = 1. No sentence.

```
no. Sentence.
```
"""
    assert [each for each in sentences(page) if each] == [
        "# A head",
        "One sentence.",
        "And CODE another; it goes on.",
        "CODE begins a third.",
        "- an item",
        "- a link, and its end",
        "cell",
        "other cell",
    ]
