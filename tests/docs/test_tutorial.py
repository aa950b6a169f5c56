"""The executed pages: what their blocks print stands after them."""

import re
import shutil
from pathlib import Path

import pytest

from docs.notebook import run

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
    (tmp_path / "page.md").write_text(SOURCE)
    run(tmp_path / "page.md")
    assert (tmp_path / "page.md").read_text() == PAGE
    assert (tmp_path / "img" / "page-a-figure.png").read_bytes() == b"picture"


def test_what_was_printed_before_is_written_anew(tmp_path: Path) -> None:
    (tmp_path / "img").mkdir()
    (tmp_path / "page.md").write_text(PAGE.replace("42", "41").replace("key = 1\n[exit", "key = 2\n[exit"))
    run(tmp_path / "page.md")
    assert (tmp_path / "page.md").read_text() == PAGE


@pytest.mark.parametrize("command", ["exit 2", "kill $$", "nothing-of-that-name", "false &"])
def test_a_command_that_cannot_do_its_work_ends_the_run(command: str, tmp_path: Path) -> None:
    page = f"```sh\n{command}\n```\n"
    (tmp_path / "page.md").write_text(page)
    with pytest.raises(SystemExit, match=r"ends with|did not start"):
        run(tmp_path / "page.md")
    assert (tmp_path / "page.md").read_text() == page


def test_the_figures_of_the_tutorial_are_there() -> None:
    for figure in re.findall(r"\(img/(tutorial-[\w-]+\.png)\)", (DOCS / "tutorial.md").read_text()):
        assert (DOCS / "img" / figure).is_file()


@pytest.mark.parametrize("name", ["recordings.md", "valve-file.md"])
def test_a_quick_page_prints_today_what_it_shows(name: str, tmp_path: Path) -> None:
    shutil.copy(DOCS / name, tmp_path)
    run(tmp_path / name)
    assert (tmp_path / name).read_text(encoding="utf-8") == (DOCS / name).read_text(encoding="utf-8")
