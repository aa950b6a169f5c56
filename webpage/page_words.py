"""What the commands say, in the words of a page: there are no options to be typed here.

A recording's own lines, `# noise_m: 5e-5`, and the names of its columns say here what options say there.
"""

import re

WORDS: tuple[tuple[str, str], ...] = (
    (
        r"([Ss]ay) (?:it|how much|the noise of the sensor), --noise-m(?: M)?",
        r"\1 it in the file's first line, # noise_m: M",
    ),
    (
        r"import it, --column (\w+)=NAME:(\S+?), or NAME:(\w+)",
        r'name its unit in the file, as "\1 [\2]" or "\1 [\3]"',
    ),
    (r"import it, --column (\w+)=NAME:(\S+)", r'name its unit in the file, as "\1 [\2]"'),
    (r"; --column \w+=NAME:UNIT says which is", "; choose it here"),
    (r"type --column \w+=(.+?):UNIT, of (.+)", r"choose the unit of '\1', of \2"),
    (r"type --column \w+=(.+?):(\S+?)(?=, |$)", r"choose \2 as the unit of '\1'"),
    (r'--time-format (?=")', ""),
    (r"let the diagnosis run through, or name fewer effects, --effects", "give it more time, or choose fewer effects"),
    (r": positioner set mode automatic", ": choose automatic"),
    (r": positioner set acknowledge 1, once its cause is gone", ": acknowledge it, once its cause is gone"),
    (r": say which, --sheet NAME", ": leave one of them in the file, or read it by `positioner import`"),
)
"""What the commands say, as a regular expression, and what a page says in its place."""


def in_page_words(said: str) -> str:
    """Return what a command would say, with what there is on a page in place of options.

    >>> in_page_words("a dead band, say how much, --noise-m M")
    "a dead band, say it in the file's first line, # noise_m: M"
    >>> in_page_words("it looks like mm; import it, --column position_m=NAME:mm")
    'it looks like mm; name its unit in the file, as "position_m [mm]"'
    """
    for pattern, words in WORDS:
        said = re.sub(pattern, words, said)
    return said
