"""A result, as it shows itself: in a line, in sentences, as a figure, as a data frame, as HTML in a notebook.

A result says what it has to say as `blocks` and what it holds as `frame_columns`; all else follows. Its fields stay
what they are: arrays in SI units. Figures need matplotlib (extra `plot`), data frames pandas (extra `frame`), each at
its first use.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from config.extras import import_extra

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from config.results.block import Block

LONGEST_REPR = 240  # characters of one line
LONGEST_VALUE = 40  # characters of one field in it
FEW_ITEMS = 3
"""Items of a series that are shown one by one."""


class Brief:
    """A dataclass with a short repr: arrays by type and shape, series by their length.

    To be declared with `repr=False`, or the dataclass makes a repr of its own.
    """

    __slots__ = ()

    def __repr__(self) -> str:
        shown = ", ".join(f"{each.name}={_show_value(getattr(self, each.name))}" for each in fields(self))  # type: ignore[arg-type]
        return f"{type(self).__name__}({_cut(shown, LONGEST_REPR)})"


class Result(ABC):
    """What the library's functions return. To be declared with `repr=False`, as `Brief`."""

    __slots__ = ()

    @abstractmethod
    def blocks(self) -> "Sequence[Block]":
        """Return what there is to say, sentences and tables; the first block is the whole in one line."""

    @abstractmethod
    def frame_columns(self) -> Mapping[str, Any]:
        """Return the columns of `to_frame`, of equal length, by name; SI units, in the names."""

    @abstractmethod
    def plot(self) -> "Figure":
        """Return a figure: a notebook shows it, `savefig` writes it.

        Raises:
            ModuleNotFoundError: matplotlib is not installed (extra `plot`).
        """

    def summary(self) -> str:
        """Return what there is to say as plain text, one line or more."""
        from config.results.block import as_text

        return as_text(self.blocks())

    def to_frame(self) -> "DataFrame":
        """Return the numbers as a pandas data frame; SI units, in the columns' names.

        Raises:
            ModuleNotFoundError: pandas is not installed (extra `frame`).
        """
        frame: DataFrame = import_extra("pandas", "to_frame").DataFrame(dict(self.frame_columns()))
        return frame

    def _repr_html_(self) -> str:
        """Return the summary for Jupyter."""
        from config.results.block import as_html

        return as_html(type(self).__name__, self.blocks())

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {_cut(str(self.blocks()[0]), LONGEST_REPR)}>"


def _show_value(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"{value.dtype}[{', '.join(map(str, value.shape))}]"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        return f"{{{_cut(', '.join(map(str, value)), LONGEST_VALUE)}}}"
    if isinstance(value, tuple | list) and (len(value) > FEW_ITEMS or any(hasattr(each, "__len__") for each in value)):
        return f"({len(value)} items)"
    return _cut(repr(value), LONGEST_VALUE)


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else f"{text[: longest - 1]}…"
