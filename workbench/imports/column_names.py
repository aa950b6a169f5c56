"""What columns are called, in the languages and trades that name them: by what is meant, from the surest word on.

Names are taken apart at _, . and - and where capitals follow small letters: `stemPos_mm`, `FIC101.OP`.
"""

import re

from workbench.imports.cell_units import unit_in_header

SETPOINT = r"soll|\bs[pv]\b|set ?point|consign|zadan|riferimento|b[öo]rv[äa]rde|gewenst|\breference\b"
PROCESS_VALUE = (
    r"\bpv\b|\bist|process ?value|messwert|flow|durchfl|d[ée]bit|caudal|portata|przep[lł]yw|level|f[üu]llstand|"
    r"niv(el|eau)|temp[eé]rat"
)
"""Of a loop: what it controls."""
COMMON = {
    "time_s": (
        r"time|zeit|stamp|date|datum|^ts?\b|uhr|temps|horo|heure|tiempo|fecha|\bhora|tempo\b|czas|tijd|\btid\b|aika|[čc]as\b|"
        r"время|时间|時間|時刻",
        r"^data\b|^dag\b|^giorno|^d[ií]a\b|^jour",
    ),
    "position_m": (
        r"travel|stroke|hub|lift|stem|\bz[ti]|\bweg\b|rückm|stellung|course|corsa|carrera|skok|klepstand|ход|行程|阀位|開度|开度",
        r"posi[tcçz]|\bpos|po[łl]o[żz]en|pozyc|feedback|opening|öffnung|ouverture|apertura|otwarci|[äa]pning|l[äa]ge|asento|"
        r"положен",
        r"\bpv\b|\bist|^x\b",
    ),
    "command_pa": (
        r"command|cmd|\bout\b|\bop\b|\bmv\b|\bao\b|output|stell|demand|^u\b|sortie|salida|uscita|sa[ií]da|wyj[śs]ci|uitgang|"
        r"mando\b|comando|sterow|выход|输出|出力",
        r"signal|se[ñn]al|segnale|sinal|sygna[łl]|drive|pressure|druck|pressi?[oó]n|ci[śs]nien|давлен|压力|圧力",
        SETPOINT,
    ),
}
"""By ours, from what is said of nothing else to what may be said of a loop's flow or level."""
STATUS = re.compile(r"status|quality|qualität|güte|\bqual\b|validit|calidad|qualit[ée]|jako[śs]", re.IGNORECASE)
"""What columns are called that say which rows are good."""
COUNTER = re.compile(r"\b(index|idx|seq|sample|row|nr|no|number|count|counter|id|zeile)\b|^#$", re.IGNORECASE)
"""What columns are called that number the rows."""


def is_called(words: str, name: str) -> bool:
    """Return whether a column's name holds one of some words, a pattern.

    >>> is_called(SETPOINT, "FIC101.SP [m3/h]"), is_called(COMMON["position_m"][1], "Posición válvula (%)")
    (True, True)
    """
    # Of a structure's field, log.t, the field's own name counts as well; the unit behind a name does not.
    plain = unit_in_header(name)[0]
    names = (split_words(each) for each in (name, plain, plain.rpartition(".")[2]))
    return any(re.search(words, each, re.IGNORECASE) for each in names)


def rank_by_name(ours: str, name: str) -> int | None:
    """Return how surely a column is ours by its name, 0 best; None if it is called like nothing of ours."""
    return next((rank for rank, words in enumerate(COMMON[ours]) if is_called(words, name)), None)


def split_words(name: str) -> str:
    """Return the words of a name.

    >>> split_words("stemPos_mm")
    'stem Pos mm'
    """
    return re.sub(r"[_.-]+|(?<=[a-zäöü0-9])(?=[A-Z])", " ", name).strip()
