"""What the shells are given: bash itself completes by it."""

import subprocess
from pathlib import Path

import pytest

from positioner.cli.completion import SHELLS
from positioner.cli.main import main


@pytest.fixture(scope="module")
def words(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What bash is given, in a file."""
    path = tmp_path_factory.mktemp("completion") / "positioner.bash"
    with pytest.MonkeyPatch.context() as patch, path.open("w") as file:
        patch.setattr("sys.stdout", file)
        assert main(["completion", "bash"]) == 0
    return path


def completed(words: Path, *typed: str) -> set[str]:
    """Return what bash proposes for the last word."""
    function = "_shtab_positioner"
    line = " ".join(typed)
    script = f"source {words}; COMP_WORDS=({line}); COMP_CWORD={len(typed) - 1}; {function}; echo ${{COMPREPLY[@]}}"
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True, cwd=words.parent)
    return set(done.stdout.split())


def test_bash_completes_a_command(words: Path) -> None:
    assert completed(words, "positioner", "diag") == {"diagnose"}


def test_bash_completes_an_option(words: Path) -> None:
    assert "--report" in completed(words, "positioner", "compare", "--re")


def test_bash_completes_a_file(words: Path) -> None:
    (words.parent / "rec.csv").touch()
    assert "rec.csv" in completed(words, "positioner", "diagnose", "re")


@pytest.mark.parametrize("shell", SHELLS)
def test_every_shell_is_given_all_commands(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    printed = capsys.readouterr().out
    for command in ("diagnose", "identify", "certificates"):
        assert command in printed
