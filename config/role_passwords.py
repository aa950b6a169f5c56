"""The passwords of roles, in a file as scrypt leaves them: `--set-password ROLE` of `positioner page` and `opcua`."""

import json
from pathlib import Path

from config.errors import InputError, explain_failure
from config.passwords import Password
from config.roles import Role
from config.whole_file import replace_whole

ROLES = (Role.OBSERVER, Role.OPERATOR, Role.ENGINEER)
WRITERS = ROLES[1:]
"""Who may sign in on a page: whoever sees it is an observer."""
LEAST_LENGTH = 8  # characters, NIST SP 800-63B
OWN_ALONE = 0o600  # the owner reads and writes


def read_passwords(file: Path) -> dict[str, Password]:
    """Return the passwords by the name of their role.

    Raises:
        InputError: the file cannot be read, or is not one of ours.
    """
    try:
        said = json.loads(file.read_text(encoding="utf-8"))
        found = {
            str(role): Password(bytes.fromhex(kept["salt"]), bytes.fromhex(kept["digest"]))
            for role, kept in said.items()
        }
    except OSError as error:
        raise InputError(str(file), f"cannot be read: {error.strerror}") from None
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        made = "positioner page --set-password operator --roles FILE"
        raise InputError(str(file), f"is no file of passwords; {made} makes one") from None
    allowed = [role.name.lower() for role in ROLES]
    for role in found:
        if role not in allowed:
            raise InputError(str(file), f"role: allowed are {', '.join(allowed)}, got {role}")
    return found


def set_password(file: Path, role: str, text: str) -> None:
    """Give a role a password; the other's stays.

    Raises:
        InputError: it is too short, or the file cannot be read or written.
    """
    if len(text) < LEAST_LENGTH:
        raise InputError("password", f"must have {LEAST_LENGTH} characters at least, got {len(text)}")
    kept = read_passwords(file) if file.exists() else {}
    kept[role] = Password.of(text)
    told = {name: {"salt": each.salt.hex(), "digest": each.digest.hex()} for name, each in sorted(kept.items())}
    with explain_failure(file, "cannot be written"):
        file.touch(OWN_ALONE)
        replace_whole(file, json.dumps(told, indent=1) + "\n")
        file.chmod(OWN_ALONE)
