"""How the numbers of a file are written: its decimal sign, and what groups thousands.

One notation holds for a whole file, and its numbers show which:

    50,5   0,612   1.234,5   1.234.567     the comma is the decimal sign
    50.5   0.612   1,234.5   1,234,567     the point is
    1,234  1.234                           either: a thousand or one and a bit

Spaces and apostrophes (1 234,5; 1'234.5) only ever group; a minus may stand behind, as business programs put it
(12,5-). Where all that a file shows is of the third kind, or numbers of both first kinds stand in it, a person must
say; but a point in fields that commas separate is the decimal sign, for nobody writes decimal commas there.
"""

import re
from collections.abc import Iterable
from math import nan

from config.errors import InputError

GROUPING = " \u00a0\u202f\u2009'\u2019"
_BODY = re.compile(rf"[+-]?[\d.,{GROUPING}]*\d[\d.,{GROUPING}]*(?:[eE][+-]?\d+)?")
_AMBIGUOUS = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")
_PLAIN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_FORMS = {
    decimal: re.compile(
        rf"[+-]?(?:\d+|[1-9]\d{{0,2}}([{thousands}{GROUPING}])\d{{3}}(?:\1\d{{3}})*|(?=[{decimal}]\d))"
        rf"(?:[{decimal}]\d*)?(?:[eE][+-]?\d+)?"
    )
    for decimal, thousands in ((".", ","), (",", "."))
}
"""By the decimal sign: digits, in groups of three by one sign or in one piece, a fraction, an exponent."""


def is_numeral(text: str) -> bool:
    """Return whether a text is a number, with one decimal sign or the other."""
    return any(form.fullmatch(_normalise_sign(text)) for form in _FORMS.values())


def number(text: str, decimal: str) -> float | None:
    """Return a text's number; NaN for words, None for a numeral that is none with this decimal sign.

    >>> number("1.234,5", ","), number("1 234,5-", ","), number("Bad", ","), number("12.34", ",")
    (1234.5, -1234.5, nan, None)
    """
    if decimal == "." and _PLAIN.fullmatch(text):
        return float(text)
    plain = _normalise_sign(text)
    if _FORMS[decimal].fullmatch(plain):
        for sign in GROUPING + (",." if decimal == "." else ".,")[0]:
            plain = plain.replace(sign, "")
        return float(plain.replace(",", "."))
    return None if _BODY.fullmatch(plain) else nan


def _normalise_sign(text: str) -> str:
    plain = text.replace("\u2212", "-") if "\u2212" in text else text
    return f"-{plain[:-1]}" if plain.endswith("-") and plain[:1].isdigit() else plain


def decimal_sign(source: str, texts: Iterable[str], separator: str) -> str:
    """Return the decimal sign that the numbers among some texts show.

    Raises:
        InputError: they show both, or leave it open; says what to type.
    """
    shown: dict[str, str] = {}
    open_: dict[str, str] = {}
    for text in texts:
        if "," not in text and "." not in text:
            continue
        plain = _normalise_sign(text)
        if _AMBIGUOUS.fullmatch(plain):
            open_.setdefault("," if "," in plain else ".", text)
        elif sign := _decimal_sign_of(plain):
            shown.setdefault(sign, text)
    if len(shown) == 2:
        raise InputError(
            source,
            f"{shown['.']!r} has a decimal point and {shown[',']!r} a decimal comma: "
            "say which the file has, --decimal . or --decimal ,",
        )
    if shown:
        return next(iter(shown))
    if "," in open_ or ("." in open_ and separator in {";", "\t", "|"}):
        text = open_.get(",", open_.get(".", ""))
        digits = text.replace(",", "").replace(".", "")
        raise InputError(
            source,
            f"{text!r} may be {digits} or {text.replace(',', '.')}: say which sign is the decimal one, "
            "--decimal . or --decimal ,",
        )
    return "."


def _decimal_sign_of(text: str) -> str | None:
    """Return the decimal sign that a numeral shows; None if it is none."""
    if not _BODY.fullmatch(text):
        return None
    fits = [sign for sign, form in _FORMS.items() if form.fullmatch(text)]
    return fits[0] if len(fits) == 1 else None
