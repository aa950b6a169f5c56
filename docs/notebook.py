"""Runs the commands and code of a page as a person would, and puts after each what it printed and drew.

    python docs/notebook.py docs/tutorial.md

The page is Markdown, and its own source: what stands after its blocks is written anew. Everything happens in one folder
that goes away afterwards, block by block:

    ```toml NAME      a file to be written there
    ```sh             commands, one a line or continued by a backslash; one that ends in & goes on until the page ends
    ```python         code; all blocks share their names, and a figure saved as *.png follows the block that saved it

Output but for progress follows its block as ```text, with an exit status of 1 (what was asked about does not hold);
anything worse ends the run. Nothing else of the page is changed.
"""

import io
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, chdir, contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

BLOCK = re.compile(
    r"^(?P<block>```(?P<kind>toml|sh|python)(?: (?P<name>\S+))?\n(?P<text>.*?)^```\n)"
    r"(?P<shown>\n```text\n.*?^```\n)?(?P<figures>(?:\n!\[[^\]\n]*\]\(img/[\w.-]+\)\n)*)",
    re.MULTILINE | re.DOTALL,
)
"""A block, and what it printed and drew when the page was run last."""
PROGRESS = re.compile(r"^.*(?:: \d+%|, \d+ s so far)\n", re.MULTILINE)
"""What a command says while it works, which is another line each time."""
HOLDS_NOT = 1
END_WITHIN_S = 20.0


class Notebook:
    """The folder, the names and the processes of one page."""

    def __init__(self, images: Path, prefix: str, processes: ExitStack) -> None:
        self._images = images
        self._prefix = prefix
        self._processes = processes
        self._names: dict[str, Any] = {"__name__": "__notebook__"}

    def after(self, block: re.Match[str]) -> str:
        """Run a block; return it with what comes after it on the page."""
        kind, text = block["kind"], block["text"]
        if kind == "toml":
            if block["name"]:
                Path(block["name"]).write_text(text, encoding="utf-8")
            return block[0]
        printed = "".join(map(self._command, _commands(text))) if kind == "sh" else self._code(text)
        shown = f"\n```text\n{printed.rstrip()}\n```\n" if printed.strip() else ""
        return block["block"] + shown + "".join(self._figures())

    def _command(self, command: str) -> str:
        print(f"$ {command}", file=sys.stderr, flush=True)
        if command.endswith("&"):
            return self._processes.enter_context(_going_on(command.removesuffix("&").strip()))
        words = ["bash", "-c", command]
        done = subprocess.run(
            words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False, env=_environment()
        )
        if done.returncode not in (0, HOLDS_NOT):  # below 0 a signal has ended it
            raise SystemExit(f"`{command}` ends with {done.returncode}:\n{done.stdout}")
        printed = PROGRESS.sub("", done.stdout)
        return printed + (f"[exit status {done.returncode}]\n" if done.returncode else "")

    def _code(self, text: str) -> str:
        printed = io.StringIO()
        with redirect_stdout(printed):
            exec(compile(text, "notebook", "exec"), self._names)
        return printed.getvalue()

    def _figures(self) -> Iterator[str]:
        for path in sorted(Path().glob("*.png")):
            kept = self._images / f"{self._prefix}-{path.name}"
            shutil.move(path, kept)
            yield f"\n![{path.stem.replace('-', ' ')}](img/{kept.name})\n"


def _commands(text: str) -> list[str]:
    return [line.strip() for line in text.replace("\\\n", " ").splitlines() if line.strip()]


def _environment() -> dict[str, str]:
    """Return the environment of a command: this installation's `positioner`, and no terminal's width."""
    return {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}", "COLUMNS": "120"}


@contextmanager
def _going_on(command: str) -> Iterator[str]:
    """Start a command, give its first line of output, and end it at last."""
    path = Path(f"{re.sub(r'[^a-z]+', '-', command)}.log")
    with path.open("w") as log:
        process = subprocess.Popen(command.split(), stdout=subprocess.PIPE, stderr=log, text=True, env=_environment())
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        if not line:
            raise SystemExit(f"`{command}` did not start: {path.read_text().strip()}")
        yield line
    finally:
        process.terminate()
        process.wait(END_WITHIN_S)
        if process.stdout is not None:
            process.stdout.close()


def run(page: Path) -> None:
    """Run a page and write it anew, its figures into `img` beside it."""
    page = page.resolve()
    text = page.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder, chdir(folder), ExitStack() as processes:
        notebook = Notebook(page.parent / "img", page.stem, processes)
        text = BLOCK.sub(notebook.after, text)
    page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    os.environ["MPLBACKEND"] = "Agg"
    for name in sys.argv[1:]:
        run(Path(name))
