"""The executed page: what a source's blocks print stands after them, and the committed page is its source's."""

from pathlib import Path

import pytest

from docs.notebook import BLOCK, run

DOCS = Path(__file__).parents[2] / "docs"
SOURCE = """# Title
```toml made.toml
key = 1
```
```sh
cat \\
    made.toml
echo 'fitting 5 forms: 40%'
echo 'fitting 5 forms: 40%, 60 s so far'
echo 'at work, 20 s so far'
false
yes on &
```
```python
from pathlib import Path
value = 6 * 7
```
Words.
```python
print(value)
Path("a-figure.png").write_bytes(b"picture")
```
"""
PAGE = """# Title
```toml made.toml
key = 1
```
```sh
cat \\
    made.toml
echo 'fitting 5 forms: 40%'
echo 'fitting 5 forms: 40%, 60 s so far'
echo 'at work, 20 s so far'
false
yes on &
```

```text
key = 1
[exit status 1]
on
```
```python
from pathlib import Path
value = 6 * 7
```
Words.
```python
print(value)
Path("a-figure.png").write_bytes(b"picture")
```

```text
42
```

![a figure](img/page-a-figure.png)
"""


def test_a_page_holds_what_its_blocks_print_and_draw(tmp_path: Path) -> None:
    (tmp_path / "img").mkdir()
    (tmp_path / "source.md").write_text(SOURCE)
    run(tmp_path / "source.md", tmp_path / "page.md")
    made, _, page = (tmp_path / "page.md").read_text().partition("\n\n")
    assert "source.md" in made
    assert page == PAGE
    assert (tmp_path / "img" / "page-a-figure.png").read_bytes() == b"picture"


@pytest.mark.parametrize("command", ["exit 2", "kill $$", "nothing-of-that-name", "false &"])
def test_a_command_that_cannot_do_its_work_ends_the_run(command: str, tmp_path: Path) -> None:
    (tmp_path / "source.md").write_text(f"```sh\n{command}\n```\n")
    with pytest.raises(SystemExit, match=r"ends with|did not start"):
        run(tmp_path / "source.md", tmp_path / "page.md")
    assert not (tmp_path / "page.md").exists()


@pytest.mark.parametrize(
    ("source_name", "page_name"),
    [
        ("source.md", "tutorial.md"),
        ("slow_source.md", "slow-data.md"),
        ("recordings_source.md", "recordings.md"),
        ("valve_file_source.md", "valve-file.md"),
    ],
)
def test_a_page_is_its_source_run(source_name: str, page_name: str) -> None:
    source, page = DOCS / "tutorial" / source_name, DOCS / page_name
    text = page.read_text(encoding="utf-8")
    at = 0
    for part in BLOCK.split(source.read_text(encoding="utf-8"))[::4]:
        assert part in text[at:], f"{page} is not what {source} makes: run `make docs`"
        at = text.index(part, at)
    for block in BLOCK.finditer(source.read_text(encoding="utf-8")):
        assert block[0] in text, f"{page} lacks {block[0]}: run `make docs`"


def test_the_tutorial_has_its_figures() -> None:
    for name in ("compared", "race", "fall"):
        assert (DOCS / "img" / f"tutorial-{name}.png").is_file()


@pytest.mark.parametrize(
    ("source_name", "page_name"), [("recordings_source.md", "recordings.md"), ("valve_file_source.md", "valve-file.md")]
)
def test_a_quick_page_prints_today_what_it_shows(source_name: str, page_name: str, tmp_path: Path) -> None:
    run(DOCS / "tutorial" / source_name, tmp_path / page_name)
    assert (tmp_path / page_name).read_text(encoding="utf-8") == (DOCS / page_name).read_text(encoding="utf-8")
