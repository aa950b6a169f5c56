"""Which role the person in front of a tab has: for that tab, and for `SIGNED_IN_S` after its last command."""

from dataclasses import dataclass

from config.roles import Role

SIGNED_IN_S = 900.0


@dataclass(slots=True)
class SignedIn:
    """Which role the person in front of a tab has, and until when, s; an observer's never ends."""

    role: Role = Role.OBSERVER
    until_s: float = 0.0

    def at(self, now_s: float) -> Role:
        """Return the role at a time, on the monotonic clock."""
        if now_s >= self.until_s:
            self.role = Role.OBSERVER
        return self.role

    def begin(self, role: Role, now_s: float) -> None:
        """Take a role, or keep it for longer."""
        self.role, self.until_s = role, now_s + SIGNED_IN_S
