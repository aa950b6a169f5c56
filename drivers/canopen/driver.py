"""Drives a device on CANopen, all in the thread that calls.

`open` asks by SDO who the node is, what it holds and how it is configured (communication time-out, heartbeat, SYNC, PDO
mapping), which changes nothing. What is not as wanted it sets in PRE-OPERATIONAL; where the node refuses, all is put
back. Then it makes the node ACTIVE and starts it by NMT (CiA 301, 7.3.2). One cycle is then

    RPDO (command, control word), SYNC  ->  TPDOs (position, pressure, counter, time, status, status word)

What else came since the last cycle (heartbeats, emergencies) is taken in by the next. Whatever cannot be trusted ends
the connection; the reason begins with a `NodeEvent`. What does not end it is logged under that name. The readings of a
node that is no actuator carry NOT_READY; so does the first of one that booted or was stopped by another master: that
is more than a lost sample.
"""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

from config.canopen_device import CanopenDevice
from config.quantities import CommunicationAction, DeviceStatus
from drivers.boundary import Capabilities, Driver, DriverError, Reading, Refused
from drivers.canopen.activation import Activation
from drivers.canopen.events import NodeEvent
from drivers.canopen.node_bus import EMERGENCY, HEARTBEAT, NMT, SDO_ANSWER, NodeBus
from drivers.canopen.only_watch import WatchingDriver
from drivers.canopen.pdo import PdoExchange
from drivers.canopen.readings import capabilities_of, reading_of
from drivers.canopen.sdo import HEARTBEAT_MS, ILLEGAL_VALUE, SdoTransfers, Setting, device_sheet
from drivers.canopen.watcher import NodeWatcher

START, ENTER_PRE_OPERATIONAL = 1, 128
SYNC = 0x1005
DEFAULT_SYNC_ID = 0x80


def canopen_driver(config: CanopenDevice) -> Driver:
    """Return a driver, or one that only watches.

    Raises:
        InputError: the data sheet cannot be read, or has not what the map names.
    """
    return WatchingDriver(config) if config.only_watch else CanopenDriver(config)


class CanopenDriver:
    """Drives a node.

    Args:
        config: bus, node id, data sheet, time-outs, where its quantities are.

    Raises:
        InputError: the data sheet cannot be read, or has not what the map names.
    """

    def __init__(self, config: CanopenDevice) -> None:
        sheet = device_sheet(config)
        self._config = config
        self._bus = NodeBus(config)
        self._watcher = NodeWatcher(config, self._bus)
        self._sdo = SdoTransfers(config, sheet, self._bus, self._watcher)
        self._pdos = PdoExchange(config, sheet, self._bus, self._watcher)
        self._activation = Activation(config.map, self._bus)

    @property
    def capabilities(self) -> Capabilities:
        """What the device can do."""
        return capabilities_of(self._config)

    def open(self) -> float:
        """Configure and start the node; return the command it holds, in Pa. Moves nothing.

        Raises:
            DriverError: not there, not the one of the data sheet, or it refused; the bus is left.
        """
        self.close()
        try:
            own_ids = tuple(first + self._config.node for first in (EMERGENCY, SDO_ANSWER, HEARTBEAT))
            self._bus.open(own_ids)
            self._sdo.open()
            held_pa = self._sdo.held_command_pa(self._config.map.command_pa)
            wanted = self._wanted()
            self._bus.hear((*own_ids, *self._pdos.tpdo_ids))
            self._sdo.require_alone()
            self._set(wanted)
            self._manage(START)
        except BaseException:
            self.close()
            raise
        self._watcher.begin()
        return held_pa

    def read(self) -> Reading:
        """Return a measurement; moves nothing.

        Raises:
            DriverError: none came that can be trusted.
        """
        self._pdos.catch_up()
        reading = self._reading(self._pdos.sample())
        if self._watcher.was_interrupted:
            self._watcher.was_interrupted = False
            return replace(reading, status=reading.status | DeviceStatus.NOT_READY)
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
            self._pdos.prepare(command_pa, self._activation.control)
        except ValueError as error:
            self._bus.require_open()
            raise self._refused(f"not sent: {error}") from None
        self._pdos.catch_up()
        self._pdos.send_command()
        reading = self._reading(self._pdos.sample())
        if self._watcher.refusal is not None:
            raise self._refused(f"{command_pa:g} Pa: {self._watcher.refusal}")
        return reading

    def close(self) -> None:
        """Leave the bus; the node keeps its last command until its own time-out. Never raises."""
        self._bus.close()

    def _manage(self, command: int) -> None:
        self._bus.send(NMT, bytes((command, self._config.node)))

    def _wanted(self) -> list[Setting]:
        """Return what must be set, in order: what the node has already is left alone."""
        config, objects, sdo = self._config, self._config.map, self._sdo
        wanted: list[Setting] = []
        # The action first: a time-out must never start with another's action.
        if entry := objects.communication_action:
            action = CommunicationAction[config.communication_action.upper()]
            wanted.append(Setting(entry.index, entry.subindex, entry.raw(action)))
        if entry := objects.communication_timeout_s:
            wanted.append(Setting(entry.index, entry.subindex, entry.raw(config.communication_timeout_s)))
        self._watcher.heartbeat_timeout_s = config.heartbeat_timeout_s
        if sdo.has(HEARTBEAT_MS):
            wanted.append(Setting(HEARTBEAT_MS, 0, round(1e3 * config.heartbeat_s)))
        else:  # that it lives, its TPDOs show
            self._watcher.heartbeat_timeout_s = math.inf
        if sdo.has(SYNC) or config.sync_cob_id != DEFAULT_SYNC_ID:
            wanted.append(Setting(SYNC, 0, config.sync_cob_id))
        return [each for each in wanted if not sdo.holds(each)] + self._pdos.wanted(sdo)

    def _set(self, wanted: Sequence[Setting]) -> None:
        """Set it and make the node ACTIVE, or put back what was set and raise as `SdoTransfers.download`."""
        was_operational = bool(wanted) and self._sdo.hears_operational()
        self._sdo.begin()
        try:
            if wanted:
                self._manage(ENTER_PRE_OPERATIONAL)
            for each in wanted:
                self._sdo.download(*each)
            self._activation.activate(self._sdo)
            self._sdo.require_alone()
        except BaseException:
            self._sdo.put_back()
            if was_operational:
                with suppress(DriverError):
                    self._manage(START)
            raise

    def _reading(self, values: Mapping[str, float]) -> Reading:
        if "status_word" not in values:
            return reading_of(values)
        self._activation.update(round(values["status_word"]))
        return reading_of(values, 0 if self._activation.is_active else DeviceStatus.NOT_READY)

    def _refused(self, said: str) -> Refused:
        return Refused(f"{self._bus.who}: {NodeEvent.COMMAND_REFUSED}: {said}", ILLEGAL_VALUE)
