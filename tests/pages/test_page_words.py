"""A page names no options: it has none."""

from pathlib import Path

import pytest

from config.errors import InputError
from webpage.page_words import in_page_words
from workbench.data.noise_floor import UNKNOWN
from workbench.imports.column_mapping import read_mapping
from workbench.imports.export_preview import preview
from workbench.imports.historian_export import read_export


def test_a_noise_that_is_not_known_is_said_in_the_file() -> None:
    said = in_page_words(UNKNOWN)
    assert "# noise_m: M" in said
    assert "--" not in said


def test_what_an_export_needs_is_chosen_on_the_page(tmp_path: Path) -> None:
    (tmp_path / "odd.csv").write_text("t,PV [%],OUT\n0,1.5,1\n1,1.5,1\n")
    mapping = read_mapping(["time_s=t", "position_m=PV:mm", "command_pa=OUT:bar"])
    with pytest.raises(InputError, match="type --column position_m=PV:%") as refused:
        read_export(tmp_path / "odd.csv", mapping, 0.04)
    said = in_page_words(str(refused.value))
    assert "choose % as the unit of 'PV', or mend the file" in said
    assert "--" not in said


def test_a_column_that_is_not_found_is_chosen_on_the_page(tmp_path: Path) -> None:
    (tmp_path / "odd.csv").write_text("t,a,b\n0,1.5,1\n1,1.5,1\n")
    said = [in_page_words(each) for each in preview(tmp_path / "odd.csv").proposal.open]
    assert "position_m is open: no column is called like it; choose it here" in said
