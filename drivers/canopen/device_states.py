"""The device states of CiA 408, from the master's side: the control word out, the status word back.

    status   fault (bit 3 low)  ->  control 0, then RESET; then ENABLE, LEAVE_HOLD, ACTIVATE  ->  ACTIVE

The node itself is started before, by NMT (`driver.py`).

A node that is not ACTIVE, or is operated locally, is no actuator. A fault of its own is reset once a cycle: the reset
bit counts when it rises, so it is set in every second control word.
"""

import logging

from config.canopen_device import ObjectMap
from drivers.canopen.events import NodeEvent
from drivers.canopen.node_bus import NodeBus
from drivers.canopen.sdo import SdoTransfers
from fieldbus.canopen.objects import ACTIVATE, NO_FAULT, Control, inactive_because


class Activation:
    """Keeps a node ACTIVE, and says when it is not.

    Args:
        objects: where its control and status word are; without them it counts as ACTIVE.
        bus: says to whom log lines belong.
    """

    def __init__(self, objects: ObjectMap, bus: NodeBus) -> None:
        self._control_word, self._status_word, self._bus = objects.control_word, objects.status_word, bus
        self.control = ACTIVATE
        """The control word to send next."""
        self._inactive_reason: str | None = None

    @property
    def is_active(self) -> bool:
        """Whether the node obeys, by its last status word."""
        return self._inactive_reason is None

    def activate(self, sdo: SdoTransfers) -> None:
        """Steer the node to ACTIVE; one that does not get there is logged, and no actuator.

        Raises:
            DriverError: as `SdoTransfers.upload` and `download`.
        """
        self.control, self._inactive_reason = ACTIVATE, None
        if self._control_word is None or self._status_word is None:
            return
        if not int(sdo.get(self._status_word)) & NO_FAULT:
            sdo.set(self._control_word, 0)
            sdo.set(self._control_word, Control.RESET)
        sdo.set(self._control_word, ACTIVATE)
        self.update(int(sdo.get(self._status_word)))

    def update(self, status_word: int) -> None:
        """Take in a status word: log a change, and choose the next control word."""
        reason = inactive_because(status_word)
        if reason != self._inactive_reason:
            self._inactive_reason = reason
            if reason is None:
                self._bus.say(logging.INFO, NodeEvent.ACTIVE)
            else:
                self._bus.say(logging.WARNING, NodeEvent.NOT_ACTIVE, why=reason, status_word=status_word)
        failed = not status_word & NO_FAULT
        self.control = ACTIVATE ^ Control.RESET if failed and not self.control & Control.RESET else ACTIVATE
