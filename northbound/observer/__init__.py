"""A running daemon as an observer knows it, over Modbus alone: polled, kept for minutes, said in words, never stale.

`ValveView` takes readings with their time and says at any time what is of now; it needs no browser and no clock.

    valve_view                      what is known of one valve, and what has changed
    freshness                       whether what was read last is still so
    waiting_reference               a reference that automatic will follow, and who wrote it
    trends                          the last minutes, with their gaps, and the states as bands
    valve_events                    what has happened, from the daemon's history or as seen, each thing once
    register_words                  codes, causes and estimates in words
    poller                          reads a daemon in a thread of its own
    watched_valves                  the valves that somebody looks at, their pollers and connections
    last_moves                      the last minutes as a recording, and the response figures of their steps
    identify_permissives            what must hold before an identification
    valve_commands                  what an operator may do, confirmed by what is read back
    seen_alarms                     the alarms that are not normal, and what to do about each
    valve_tests                     tests begun by who watches: consent, the command in a process, breaking off
"""

from northbound.observer.valve_events import SeenEvent
from northbound.observer.valve_view import ValvePicture, ValveView

__all__ = ["SeenEvent", "ValvePicture", "ValveView"]
