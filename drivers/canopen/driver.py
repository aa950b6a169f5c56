"""Drives a device on CANopen, all in the thread that calls.

`open` asks who the node is and what it holds, tells it by SDO what its data sheet allows (communication time-out,
heartbeat, SYNC, PDO mapping), makes it ACTIVE and starts it by NMT (CiA 301, 7.3.2). One cycle is then

    RPDO (command, control word), SYNC  ->  TPDOs (position, pressure, counter, time, status, status word)

What else came since the last cycle (heartbeats, emergencies) is taken in by the next. Whatever cannot be trusted ends
the connection; the reason begins with a `NodeEvent`. What does not end it is logged under that name. The readings of a
node that is no actuator carry NOT_READY.
"""

from collections.abc import Mapping

from config.canopen_device import CanopenDevice
from config.quantities import CommunicationAction, DeviceStatus
from drivers.boundary import Capabilities, Driver, Reading, Refused
from drivers.canopen.activation import Activation
from drivers.canopen.events import NodeEvent
from drivers.canopen.node_bus import EMERGENCY, HEARTBEAT, NMT, SDO_ANSWER, NodeBus
from drivers.canopen.only_watch import WatchingDriver
from drivers.canopen.pdo import PdoExchange
from drivers.canopen.readings import capabilities_of, reading_of
from drivers.canopen.sdo import ILLEGAL_VALUE, SdoTransfers, sheet_variable
from drivers.canopen.watcher import NodeWatcher
from fieldbus.canopen.eds import read_eds

START, ENTER_PRE_OPERATIONAL = 1, 128
SYNC, HEARTBEAT_MS = 0x1005, 0x1017


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
        sheet = read_eds(config.eds, config.node)
        for name, entry in config.map.entries.items():
            sheet_variable(sheet, config, name, entry)
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
            own_ids = (first + self._config.node for first in (EMERGENCY, SDO_ANSWER, HEARTBEAT))
            self._bus.open((*own_ids, *self._pdos.tpdo_ids))
            self._manage(ENTER_PRE_OPERATIONAL)
            self._sdo.open()
            held_pa = self._sdo.held_command_pa(self._config.map.command_pa)
            self._configure()
            self._pdos.configure(self._sdo)
            self._activation.activate(self._sdo)
            self._sdo.require_alone()
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
        return self._reading(self._pdos.sample())

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

    def _configure(self) -> None:
        # The action first: a time-out must never start with another's action.
        config, objects = self._config, self._config.map
        if objects.communication_action:
            self._sdo.set(objects.communication_action, CommunicationAction[config.communication_action.upper()])
        if objects.communication_timeout_s:
            self._sdo.set(objects.communication_timeout_s, config.communication_timeout_s)
        self._sdo.download(HEARTBEAT_MS, 0, round(1e3 * config.heartbeat_s))
        self._sdo.download(SYNC, 0, config.sync_cob_id)

    def _reading(self, values: Mapping[str, float]) -> Reading:
        if "status_word" not in values:
            return reading_of(values)
        self._activation.update(round(values["status_word"]))
        return reading_of(values, 0 if self._activation.is_active else DeviceStatus.NOT_READY)

    def _refused(self, said: str) -> Refused:
        return Refused(f"{self._bus.who}: {NodeEvent.COMMAND_REFUSED}: {said}", ILLEGAL_VALUE)
