"""What the drivers of a node are made of, and the one that only watches: it reads by SDO alone, and sets nothing.

No NMT, no SYNC: another drives the node, or nobody.
"""

from config.canopen_device import CanopenDevice
from drivers.boundary import Capabilities, Reading, Refused
from drivers.canopen.events import NodeEvent
from drivers.canopen.node_bus import SDO_ANSWER, NodeBus
from drivers.canopen.node_configuration import NodeConfiguration
from drivers.canopen.pdo import PdoExchange
from drivers.canopen.sdo import ILLEGAL_VALUE, SdoTransfers, device_sheet
from drivers.canopen.watcher import NodeWatcher


class NodeDriver:
    """What the drivers of a node are made of.

    Args:
        config: bus, node id, data sheet, time-outs, where its quantities are.

    Raises:
        InputError: the data sheet cannot be read, or has not what the map names.
    """

    def __init__(self, config: CanopenDevice) -> None:
        sheet = device_sheet(config)
        self._config = config
        self.bus = NodeBus(config)
        self._watcher = NodeWatcher(config, self.bus)
        self.sdo = SdoTransfers(config, sheet, self.bus, self._watcher)
        self.pdos = PdoExchange(config, sheet, self.bus, self._watcher)
        self._configuration = NodeConfiguration(config, sheet, self.bus, self._watcher, self.sdo, self.pdos)

    @property
    def capabilities(self) -> Capabilities:
        """What the device can do."""
        return Capabilities(
            one_transaction=not self._config.only_watch,
            device_time=self._config.map.device_time_us is not None,
            sample_counter=self._config.map.sample_counter is not None,
        )


class WatchingDriver(NodeDriver):
    """A driver that commands nothing. The values of one reading may be of several samples."""

    def open(self) -> float:
        """Return the command the node holds, in Pa.

        Raises:
            DriverError: not there, or not the one of the data sheet; the bus is left.
        """
        self.close()
        try:
            self.bus.open((SDO_ANSWER + self._config.node,))
            self.sdo.open()
            return self.sdo.held_command_pa(self._config.map.command_pa)
        except BaseException:
            self.close()
            raise

    def read(self) -> Reading:
        """Return a measurement.

        Raises:
            DriverError: an object could not be read.
        """
        sampled = self._config.map.sampled
        values = {name: self.sdo.get(entry) for name, entry in sampled.items()}
        return Reading.of(values, round(values.get("status", 0)))

    def write(self, command_pa: float) -> None:
        """Command nothing.

        Raises:
            Refused: always.
        """
        said = f"{command_pa:g} Pa: only_watch is set"
        raise Refused(f"{self.bus.who}: {NodeEvent.COMMAND_REFUSED}: {said}", ILLEGAL_VALUE)

    def exchange(self, command_pa: float) -> Reading:
        """Command nothing; raises as `write`."""
        self.write(command_pa)
        return self.read()

    def refused(self) -> str | None:
        """Say which of what it would be told to be driven the node refuses by its data sheet; None if nothing.

        Raises:
            DriverError: it did not answer.
        """
        return self._configuration.refused()

    def close(self) -> None:
        """Leave the bus. Never raises."""
        self.bus.close()
