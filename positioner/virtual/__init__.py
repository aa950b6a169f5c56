"""The daemon's cycle in virtual time, on a device in memory, and how such a run is drawn and judged."""
