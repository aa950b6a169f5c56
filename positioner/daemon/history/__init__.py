"""What the daemon writes into its history, and how: never by the cycle thread, which only leaves what has changed.

`docs/history.md` says what is kept, and what happens when it cannot be.

    history_keeper                the thread that numbers what has happened and writes it; what it does when it cannot
    valve_history                 one valve's side: what its cycle, its health and its clients leave
    decision_events               which events lie between two decisions of the controller
    audited_writes                writes and sessions with peer and role, like ones taken together
    health_hours                  health by the hour
    configuration_changes         what is another in the daemon's file than at the last start
"""

from positioner.daemon.history.history_keeper import HistoryKeeper
from positioner.daemon.history.valve_history import ValveHistory

__all__ = ["HistoryKeeper", "ValveHistory"]
"""The thread, made once; `HistoryKeeper.valve` gives each valve its side."""
