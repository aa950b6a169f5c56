"""What `positioner identify` says of keeping what was found."""

from pathlib import Path
from types import TracebackType
from typing import Self

import pytest

from config.codes import Mode
from positioner.cli.main import main


class Identified:
    """A daemon that has identified its valve."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        pass

    def get_all(self, *names: str) -> dict[str, float]:
        return dict.fromkeys(names, 0.0) | {"mode": float(Mode.AUTOMATIC)}

    def identify(self, _excitation: object, _timeout_s: float) -> None:
        pass


def test_who_keeps_a_memory_is_not_told_to_type_a_law_in_which_would_set_it_aside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("positioner.cli.identify.connect_dcs", lambda _: Identified())
    assert main(["identify"]) == 0
    assert "without it, copy into that file:\n[law]" in capsys.readouterr().out
