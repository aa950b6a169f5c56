"""Progress on a terminal: one line on standard error, written over; nothing where it is not a terminal."""

import sys


def show(what: str, done: float) -> None:
    """Show what is being done and the fraction done."""
    if sys.stderr.isatty():
        bar = "#" * round(20 * done)
        print(f"\r\033[K{what} [{bar:<20}] {done:.0%}", end="\n" if done >= 1.0 else "", file=sys.stderr, flush=True)
