"""What the names of a valve's files begin with.

A valve is named as the plant names it; a file takes letters, digits, `-` and `_`. Names that differ there give stems
that differ, too: a name that had to be changed carries a part of its own checksum.
"""

import re
from hashlib import sha256


def file_stem(name: str) -> str:
    """Return what the names of a valve's files begin with: no two valves have the same."""
    plain = re.sub(r"[^A-Za-z0-9_-]+", "-", name)
    if plain == name:
        return name
    return f"{plain.strip('-') or 'valve'}-{sha256(name.encode()).hexdigest()[:8]}"
