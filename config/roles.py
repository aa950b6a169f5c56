"""The roles of a secured connection: each may also do what those below it may.

Which role may write a register stands in the table of registers (`config.registers`, `Register.writer`).
"""

from enum import IntEnum


class Role(IntEnum):
    """What a certificate makes of its owner; NONE is a certificate that names no role, or one that is not known."""

    NONE = 0
    OBSERVER = 1
    OPERATOR = 2
    ENGINEER = 3
