"""Passwords as they are kept, and how often a wrong one may be tried.

A password itself is kept only as scrypt leaves it. After `MOST_WRONG` wrong ones in a row nobody's password is looked
at for `PAUSE_S`.
"""

import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from hashlib import scrypt
from hmac import compare_digest
from time import monotonic

MOST_WRONG = 5  # in a row; then all wait
PAUSE_S = 30.0
SALT_BYTES = 16
COST = {"n": 2**14, "r": 8, "p": 1}
"""Of scrypt: 16 MiB and some 50 ms a password."""


@dataclass(frozen=True, slots=True)
class Password:
    """A password as it is kept."""

    salt: bytes
    digest: bytes = field(repr=False)

    @classmethod
    def of(cls, text: str) -> "Password":
        """Return what is kept of a password."""
        salt = secrets.token_bytes(SALT_BYTES)
        return cls(salt, scrypt(text.encode(), salt=salt, **COST))

    def fits(self, text: str) -> bool:
        """Whether it is this one."""
        return compare_digest(self.digest, scrypt(text.encode(), salt=self.salt, **COST))


@dataclass(slots=True)
class SignIn:
    """Passwords by what they give: a role, or "" for the page itself.

    Args:
        passwords: by role.
        clock: time, s.
    """

    passwords: Mapping[str, Password]
    clock: Callable[[], float] = monotonic
    _wrong: int = 0
    _again_s: float = 0.0

    @property
    def wait_s(self) -> float:
        """How long no password is looked at, s; 0: it is."""
        return max(0.0, self._again_s - self.clock())

    def refused(self, role: str, text: str) -> str:
        """Return why a password is not taken; empty if it is."""
        if self.wait_s:
            return f"too many wrong passwords: try again in {self.wait_s:.0f} s"
        if role in self.passwords and self.passwords[role].fits(text):
            self._wrong = 0
            return ""
        self._wrong += 1
        if self._wrong >= MOST_WRONG:
            self._wrong, self._again_s = 0, self.clock() + PAUSE_S
        return "wrong password"
