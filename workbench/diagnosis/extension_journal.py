"""The journal of a valve file: which effect was added when, why, and how far the error fell at each step.

It lies beside the valve file as NAME.journal.json; extending the file again goes on with it.
"""

from pathlib import Path
from typing import Self

from config.drive import Scale
from config.errors import InputError
from config.loading import Schema, validate
from config.valve_file_writer import write_valve
from config.whole_file import beside
from workbench.diagnosis.extension import Extension


class ExtensionStep(Schema):
    """One extension. Errors are rms, m: of the valve as given, refitted without the effects, and with them."""

    effects: tuple[str, ...]
    why: str
    given_train_rmse_m: float
    given_test_rmse_m: float
    refitted_train_rmse_m: float
    refitted_test_rmse_m: float
    extended_train_rmse_m: float
    extended_test_rmse_m: float
    floor_m: float | None
    parameters: dict[str, float]
    """All that was fitted."""

    @property
    def words(self) -> str:
        """What was done."""
        return f"{', '.join(self.effects)} added" if self.effects else "refitted, nothing added"

    @property
    def before_test_rmse_m(self) -> float:
        """Of the valve before, m, held out: refitted without the effects, or, where none is added, as given."""
        return self.refitted_test_rmse_m if self.effects else self.given_test_rmse_m

    @classmethod
    def of(cls, extension: Extension) -> Self:
        """Return the step that an extension is."""
        length = extension.extended.kind.length
        found, before, after = extension.gain, extension.refitted_errors, extension.extended_errors
        said = (
            f"evidence {found.bic:.4g}, held out {found.held_out_evidence:.3g}; error of the median held-out move: "
            f"{length.number(before.test_block_m, '.4g')} before, {length.said(after.test_block_m, '.4g')} after"
        )
        floor_m = extension.split.floor_m
        left = "" if floor_m is None else f"; {after.rms_floors(floor_m):.3g} times the floor is left"
        return cls(
            effects=extension.effects,
            why=said if extension.effects else f"parameters alone were changed{left}",
            given_train_rmse_m=extension.given_train_rmse_m,
            given_test_rmse_m=extension.given_test_rmse_m,
            refitted_train_rmse_m=before.train_rmse_m,
            refitted_test_rmse_m=before.test_rmse_m,
            extended_train_rmse_m=after.train_rmse_m,
            extended_test_rmse_m=after.test_rmse_m,
            floor_m=floor_m,
            parameters={name: each.value for name, each in extension.extended.parameters.items()},
        )


class Journal(Schema):
    """The steps in order."""

    steps: tuple[ExtensionStep, ...] = ()

    @classmethod
    def beside(cls, valve: Path) -> Self:
        """Read the journal of a valve file; empty if it has none.

        Raises:
            InputError: it is not a journal.
        """
        path = journal_path(valve)
        if not path.is_file():
            return cls()
        try:
            return cls.model_validate_json(path.read_bytes())
        except ValueError:
            raise InputError(str(path), "is not a journal; remove it to begin another") from None

    def followed_by(self, extension: Extension) -> Self:
        """Return the journal with one more step."""
        return validate(type(self), {"steps": (*self.steps, ExtensionStep.of(extension))}, "journal")

    def write_beside(self, valve: Path) -> None:
        """Write the journal of a valve file."""
        with beside(journal_path(valve)) as new:
            new.write_text(self.model_dump_json(indent=2) + "\n", encoding="utf-8")

    def remarks(self, length: Scale) -> tuple[str, ...]:
        """Return one line a step, lengths as they are read."""
        return tuple(
            f"step {i}: {each.words}; held-out error "
            f"{length.number(each.before_test_rmse_m, '.4g')} to {length.said(each.extended_test_rmse_m, '.4g')} "
            f"rms; {each.why}"
            for i, each in enumerate(self.steps, start=1)
        )


def write_extended(extension: Extension, given: Path, out: Path) -> Journal:
    """Write an extended valve's file, its journal beside it; return the journal.

    Args:
        extension: to be written.
        given: the valve file that was extended, whose journal goes on.
        out: the new file.

    Raises:
        InputError: what lies beside the given file is not a journal.
    """
    journal = Journal.beside(given).followed_by(extension)
    write_valve(out, extension.valve, journal.remarks(extension.extended.kind.length))
    journal.write_beside(out)
    return journal


def journal_path(valve: Path) -> Path:
    """Return where the journal of a valve file lies."""
    return valve.with_suffix(".journal.json")
