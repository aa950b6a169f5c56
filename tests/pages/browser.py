"""A page in Debian's Chromium: whatever it complains of on its console, or cannot fetch, fails the test."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Page, expect, sync_playwright

CHROMIUM = shutil.which("chromium")
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="no chromium here: apt-get install chromium")
LONGEST_MS = 200_000.0
"""That something comes at all, on a busy machine; nothing waits for it to be over."""

expect.set_options(timeout=LONGEST_MS)


@contextmanager
def served(*words: str) -> Iterator[str]:
    """Run a command that serves a page and give the address that it prints; it ends as told."""
    # NiceGUI behaves otherwise where it finds itself under pytest.
    environment = {name: value for name, value in os.environ.items() if name != "PYTEST_CURRENT_TEST"}
    command = [sys.executable, "-m", "positioner.cli", *words, "--no-open", "--listen-port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
    with process:
        assert process.stdout is not None
        assert process.stderr is not None
        try:
            line = process.stdout.readline()
            assert line, process.stderr.read()
            yield line.partition(": ")[2].strip()
        finally:
            process.terminate()
            said = process.stderr.read()
    assert not said, said


@contextmanager
def opened(
    address: str, *, width_px: int = 1400, dark: bool = False, executable: str | None = CHROMIUM
) -> Iterator[Page]:
    """Open a page in a browser of its own."""
    complaints: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=["--no-sandbox", "--disable-gpu"])
        context = browser.new_context(
            viewport={"width": width_px, "height": 900}, color_scheme="dark" if dark else "light"
        )
        context.set_default_timeout(LONGEST_MS)
        page = context.new_page()
        page.on("console", lambda said: complaints.append(said.text) if said.type == "error" else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("requestfailed", lambda request: complaints.append(f"not fetched: {request.url}"))
        page.on("request", lambda request: complaints.extend(_from_elsewhere(request.url, address)))
        page.on("response", lambda got: complaints.append(f"{got.status} {got.url}") if got.status >= 400 else None)
        page.goto(address)
        yield page
        context.close()
        browser.close()
    assert not complaints, complaints


def _from_elsewhere(url: str, address: str) -> list[str]:
    here = address.partition("?")[0]
    same = url.startswith((here, here.replace("http", "ws", 1), "data:", "blob:"))
    return [] if same else [f"asks another machine: {url}"]
