"""What a browser would find in a report."""

import json
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

FETCHING = {"src", "href", "srcset", "action", "data", "poster", "background"}


@dataclass
class Page(HTMLParser):
    """What a browser would find in the file."""

    fetched: list[str] = field(default_factory=list)
    sections: list[str] = field(default_factory=list)
    tables: dict[str, list[list[tuple[str, str]]]] = field(default_factory=dict)
    figures: dict[str, Any] = field(default_factory=dict)
    words: str = ""
    style: str = ""
    policy: str = ""

    def __post_init__(self) -> None:
        super().__init__()
        self._inside: list[tuple[str, dict[str, str]]] = []
        self._table = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        attributes = {name: value or "" for name, value in attrs}
        self.fetched += [f"{tag} {name}" for name in FETCHING.intersection(attributes)]
        if tag == "meta":
            self.policy = attributes["content"] if "http-equiv" in attributes else self.policy
            return
        if tag in {"section", "details"}:
            self.sections.append(attributes["id"])
        if tag == "table":
            self._table = attributes["id"]
            self.tables[self._table] = []
        if tag == "tr":
            self.tables[self._table].append([])
        if tag in {"td", "th"}:
            self.tables[self._table][-1].append(("", attributes.get("title", "")))
        self._inside.append((tag, attributes))

    def handle_endtag(self, tag: str) -> None:
        assert self._inside.pop()[0] == tag

    def handle_data(self, data: str) -> None:
        if not self._inside:
            return
        tag, attributes = self._inside[-1]
        if tag == "script":
            if attributes.get("type") == "application/json":
                self.figures[attributes["id"].removesuffix("-data")] = json.loads(data)
        elif tag == "style":
            self.style += data
        else:
            self.words += data
            if tag in {"td", "th"}:
                text, si = self.tables[self._table][-1][-1]
                self.tables[self._table][-1][-1] = text + data, si


def read(path: Path) -> Page:
    page = Page()
    page.feed(path.read_text(encoding="utf-8"))
    page.close()
    return page
