"""How the daemon is told to end, and what else ends it: signals, and threads that died.

Every signal that would kill it and can be caught ends it in the safe state (`assembled_valves`, `leave`). What cannot
be caught (SIGKILL, a crash of the interpreter, SIGSTOP, loss of power) is the business of the device's own
communication time-out. The signals by which a terminal stops a job are not obeyed.
"""

import logging
import signal
import sys
import threading

log = logging.getLogger(__name__)

ALWAYS = frozenset((signal.SIGTERM, signal.SIGINT))
"""Caught even where whoever started the daemon ignores them."""
OF_TERMINALS = frozenset((signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU))
HARMLESS = frozenset((signal.SIGCHLD, signal.SIGCONT, signal.SIGURG, signal.SIGWINCH))
NOT_CATCHABLE = frozenset((signal.SIGKILL, signal.SIGSTOP))
CRASHES = frozenset((signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL))
"""Raised by a broken interpreter, which cannot handle them any more."""
ENDING = frozenset(signal.valid_signals()) - OF_TERMINALS - HARMLESS - NOT_CATCHABLE - CRASHES


class Endings:
    """What has ended the daemon since this was made; in the main thread."""

    def __init__(self) -> None:
        # A list, not an Event: a handler that sets one may deadlock with the wait it interrupts.
        self._signals: list[int] = []
        self._told: list[str] = []
        self._dead: list[str] = []
        for number in ENDING:
            if number in ALWAYS or signal.getsignal(number) is not signal.SIG_IGN:  # as nohup has it
                signal.signal(number, lambda number, _frame: self._signals.append(number))
        for number in OF_TERMINALS:
            signal.signal(number, signal.SIG_IGN)
        threading.excepthook = self._note_death

    @property
    def came(self) -> bool:
        """Whether it is to end."""
        return bool(self._signals or self._dead or self._told)

    def tell(self, reason: str) -> None:
        """Have it end for a reason of its own. Called by any thread."""
        self._told.append(reason)

    @property
    def signal(self) -> int:
        """The signal that ended it, SIGTERM where there was none: by it others are told to end."""
        return self._signals[0] if self._signals else int(signal.SIGTERM)

    @property
    def status(self) -> int:
        """The exit status: 1 if a thread died."""
        return 1 if self._dead else 0

    @property
    def reason(self) -> str:
        """What ended it."""
        signals = (signal.strsignal(number) or str(number) for number in self._signals)
        return ", ".join((*self._dead, *self._told, *signals))

    def _note_death(self, died: threading.ExceptHookArgs) -> None:
        name = died.thread.name if died.thread is not None else "a thread"
        self._dead.append(f"{name} died")
        print(f"positioner run: {name} died: {died.exc_type.__name__}: {died.exc_value}", file=sys.stderr, flush=True)
        log.critical("%s died", name, exc_info=died.exc_value)
