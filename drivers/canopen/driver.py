"""Drives a device on CANopen, all in the thread that calls.

`open` asks by SDO who the node is, what it holds and how it is configured (communication time-out, heartbeat, SYNC, PDO
mapping), which changes nothing. What is not as wanted it sets in PRE-OPERATIONAL; where the node refuses, all is put
back. Then it makes the node ACTIVE and starts it by NMT (CiA 301, 7.3.2). A node that does not obey its set point is
given what it does in its place before, for ACTIVE it would go to what was commanded last. One cycle is then

    RPDO (command, control word), SYNC  ->  TPDOs (position, pressure, counter, time, status, status word)

What else came since the last cycle (heartbeats, emergencies) is taken in by the next. Whatever cannot be trusted ends
the connection; the reason begins with a `NodeEvent`. What does not end it is logged under that name. The readings of a
node that is no actuator carry NOT_READY; so does the first of one that booted or was stopped by another master, as its
heartbeat says, be it when it is opened again: that is more than a lost sample.
"""

import math
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

from config.canopen_device import CanopenDevice
from config.quantities import DeviceStatus
from drivers.boundary import Capabilities, Driver, DriverError, Reading, Refused
from drivers.canopen.device_states import Activation
from drivers.canopen.events import NodeEvent
from drivers.canopen.node_bus import EMERGENCY, HEARTBEAT, NMT, SDO_ANSWER
from drivers.canopen.sdo import ILLEGAL_VALUE, Setting
from drivers.canopen.watching_driver import NodeDriver, WatchingDriver
from fieldbus.canopen.objects import HOLDING, LOCAL, STATE_BITS, NodeState, inactive_because

START, ENTER_PRE_OPERATIONAL = 1, 128  # NMT commands of CiA 301
OPERATIONAL = bytes((5,))


def canopen_driver(config: CanopenDevice) -> Driver:
    """Return a driver, or one that only watches.

    Raises:
        InputError: the data sheet cannot be read, or has not what the map names.
    """
    return WatchingDriver(config) if config.only_watch else CanopenDriver(config)


class CanopenDriver(NodeDriver):
    """Drives a node."""

    def __init__(self, config: CanopenDevice) -> None:
        super().__init__(config)
        self._activation = Activation(config.map, self.bus)
        self._said_alive_s = -math.inf
        self._has_driven = False

    @property
    def capabilities(self) -> Capabilities:
        """What the device can do."""
        capabilities = super().capabilities
        return replace(capabilities, sample_counter=capabilities.sample_counter or self.pdos.come_by_themselves)

    def open(self) -> float:
        """Configure and start the node; return the command in force in it, in Pa. Moves nothing.

        Raises:
            DriverError: not there, not the one of the data sheet, or it refused; the bus is left.
        """
        self.close()
        try:
            own_ids = tuple(first + self._config.node for first in (EMERGENCY, SDO_ANSWER, HEARTBEAT))
            self.bus.open(own_ids)
            self.sdo.open()
            if self._has_driven:
                self._watcher.was_interrupted |= self.sdo.hears_stopped()
            set_point_pa = self.sdo.held_command_pa(self._config.map.command_pa)
            status_word = self._status_word()
            held_pa = self._in_force_pa(set_point_pa, status_word)
            wanted = self._configuration.wanted()
            self._say_alive()
            self.bus.hear((*own_ids, *self.pdos.tpdo_ids))
            self.sdo.require_alone()
            as_found = held_pa == set_point_pa or status_word & LOCAL  # a set point is not taken then
            self._set(wanted, None if as_found else held_pa)
            self._manage(START)
        except BaseException:
            self.close()
            raise
        self._watcher.begin()
        self._has_driven = True
        return held_pa

    def read(self) -> Reading:
        """Return a measurement; moves nothing.

        Raises:
            DriverError: none came that can be trusted.
        """
        self.pdos.catch_up()
        reading = self._reading(self.pdos.sample())
        if self._watcher.was_interrupted:
            self._watcher.was_interrupted = False
            return reading._replace(status=reading.status | DeviceStatus.NOT_READY)
        return reading

    def write(self, command_pa: float) -> None:
        """Command a pressure; raises as `exchange`."""
        self.exchange(command_pa)

    def exchange(self, command_pa: float) -> Reading:
        """Command a pressure and return the newest measurement after that.

        Raises:
            Refused: the command cannot be sent, or the node's emergency says that it is out of range.
            DriverError: no measurement came that can be trusted.
        """
        try:
            self.pdos.prepare(command_pa, self._activation.control)
        except ValueError as error:
            self.bus.require_open()
            raise self._refused(f"not sent: {error}") from None
        self.pdos.catch_up()
        self._say_alive()
        self.pdos.send_command()
        reading = self._reading(self.pdos.sample())
        if self._watcher.refusal is not None:
            raise self._refused(f"{command_pa:g} Pa: {self._watcher.refusal}")
        return reading

    def held_pa(self) -> float:
        """Return the command that the node holds, asked by SDO; moves nothing.

        Raises:
            DriverError: it did not answer, or is not OPERATIONAL any more.
        """
        self.pdos.catch_up()
        self._watcher.state = None
        held_pa = self.sdo.held_command_pa(self._config.map.command_pa)
        self._watcher.judge_state()
        return held_pa

    def close(self) -> None:
        """Leave the bus; the node keeps its last command until its own time-out. Never raises."""
        self.bus.close()

    def _manage(self, command: int) -> None:
        self.bus.send(NMT, bytes((command, self._config.node)))

    def _status_word(self) -> int:
        """Return the status word; that of an ACTIVE node where it has none."""
        entry = self._config.map.status_word
        return NodeState.ACTIVE if entry is None else int(self.sdo.get(entry))

    def _in_force_pa(self, set_point_pa: float, status_word: int) -> float:
        """Return the command that holds the valve where it is: the set point, or what the node does in its place.

        One that is not ACTIVE may hold, have vented or have filled: its pressure shows which, or where it shows none
        its state says whether it holds. One that is operated locally does what it shows.
        """
        if inactive_because(status_word) is None:
            return set_point_pa
        shown = self._config.map.pressure_pa
        shown_pa = math.nan if shown is None else self.sdo.get(shown)
        if not math.isfinite(shown_pa):
            return set_point_pa if status_word & STATE_BITS in HOLDING else 0.0
        if status_word & LOCAL or (self._config.acts_alone_by == "fill" and shown_pa > set_point_pa):
            return max(shown_pa, 0.0)
        return min((set_point_pa, 0.0), key=lambda each: abs(each - shown_pa))

    def _set(self, wanted: Sequence[Setting], command_pa: float | None) -> None:
        """Set it and make the node ACTIVE, or put back what was set and raise as `SdoTransfers.download`.

        With a command, Pa, that one is its set point before.
        """
        was_operational = bool(wanted) and self.sdo.hears_operational()
        self.sdo.begin()
        try:
            if wanted:
                self._manage(ENTER_PRE_OPERATIONAL)
            for each in wanted:
                self.sdo.download(*each)
            if command_pa is not None:
                self.sdo.set(self._config.map.command_pa, command_pa)
            self._activation.activate(self.sdo)
            self.sdo.require_alone()
        except BaseException:
            self.sdo.put_back()
            if was_operational:
                with suppress(DriverError):
                    self._manage(START)
            raise

    def _say_alive(self) -> None:
        """Send this master's heartbeat when it is due, if the node shall watch it: half a period early, not late."""
        master, now_s = self._config.master_node, time.monotonic()
        if master is not None and now_s - self._said_alive_s >= self._config.master_heartbeat_s / 2:
            self._said_alive_s = now_s
            self.bus.send(HEARTBEAT + master, OPERATIONAL)

    def _reading(self, values: Mapping[str, float]) -> Reading:
        status = round(values.get("status", 0))
        if "status_word" in values:
            self._activation.update(round(values["status_word"]))
            status |= 0 if self._activation.is_active else DeviceStatus.NOT_READY
        if self._watcher.is_unfit:
            status |= DeviceStatus.DEVICE_FAULT
        return Reading.of(values, status, self._watcher.emergency)

    def _refused(self, said: str) -> Refused:
        return Refused(f"{self.bus.who}: {NodeEvent.COMMAND_REFUSED}: {said}", ILLEGAL_VALUE)
