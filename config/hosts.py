"""What can be the name or the address of a host in a file."""

import re
from ipaddress import ip_address

LONGEST_NAME = 253  # characters, RFC 1035
LABEL = re.compile(r"(?!-)[A-Za-z0-9_-]{1,63}(?<!-)")
"""One label of a name, as RFC 1123 section 2.1 has it; and the underscore, which sites use."""


def is_host(text: str) -> bool:
    """Return whether a text is an IPv4 or IPv6 address or can be a host name. Does not look whether it exists."""
    try:
        ip_address(text)
    except ValueError:
        labels = text.removesuffix(".").split(".")
        return len(text) <= LONGEST_NAME and all(LABEL.fullmatch(label) for label in labels)
    return True
