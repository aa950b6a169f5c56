"""Who came in: a password buys a session, a random number in a cookie."""

import secrets
from dataclasses import dataclass, field


@dataclass(slots=True)
class Sessions:
    """The sessions of those who came in."""

    _known: set[str] = field(default_factory=set)

    def begin(self) -> str:
        """Return a new one."""
        session = secrets.token_urlsafe(32)
        self._known.add(session)
        return session

    def holds(self, session: str) -> bool:
        """Whether it is one of these."""
        return session in self._known
