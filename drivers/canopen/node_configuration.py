"""What a node must be told to be driven, and what of that it will refuse.

What it has already is left alone, so it may be a constant: communication time-out and action, heartbeat (0x1017), SYNC
(0x1005) where a PDO waits for it, PDOs; and, where it shall watch its master, whose heartbeat it consumes:

    0x1016 sub n   node id << 16 | longest time between two heartbeats, ms
"""

import math

from canopen.objectdictionary import ObjectDictionary

from config.canopen_device import CanopenDevice
from config.quantities import CommunicationAction
from drivers.boundary import Refused
from drivers.canopen.events import NodeEvent
from drivers.canopen.node_bus import NodeBus
from drivers.canopen.pdo import PdoExchange
from drivers.canopen.sdo import HEARTBEAT_MS, NO_SUCH_OBJECT, SdoTransfers, Setting
from drivers.canopen.watcher import NodeWatcher

SYNC, CONSUMED_HEARTBEATS = 0x1005, 0x1016  # objects of CiA 301
DEFAULT_SYNC_ID = 0x80  # CiA 301


class NodeConfiguration:
    """Holds a node against what is wanted of it; sets nothing.

    Args:
        config: what is wanted.
        sheet: the data sheet, read for this node.
        bus: names the node.
        watcher: is told how long the node may be silent.
        sdo: asks the node.
        pdos: its PDOs.
    """

    def __init__(
        self,
        config: CanopenDevice,
        sheet: ObjectDictionary,
        bus: NodeBus,
        watcher: NodeWatcher,
        sdo: SdoTransfers,
        pdos: PdoExchange,
    ) -> None:
        self._config, self._sheet, self._bus = config, sheet, bus
        self._watcher, self._sdo, self._pdos = watcher, sdo, pdos

    def wanted(self) -> list[Setting]:
        """Return what must be set, in order: what the node has already is left alone.

        Raises:
            DriverError: the node did not answer, or lacks what is wanted.
        """
        config, sdo = self._config, self._sdo
        of_pdos = self._pdos.wanted(sdo)
        wanted = [*self._silence(), *self._heartbeats()]
        if self._pdos.need_sync and (sdo.has(SYNC) or config.sync_cob_id != DEFAULT_SYNC_ID):
            wanted.append(Setting(SYNC, 0, config.sync_cob_id))
        return [each for each in wanted if not sdo.holds(each)] + of_pdos

    def refused(self) -> str | None:
        """Say which of it the node will refuse by its data sheet; None if nothing.

        Raises:
            DriverError: as `wanted`.
        """
        for index, subindex, _ in self.wanted():
            variable = self._sheet.get_variable(index, subindex)
            if variable is None or not variable.writable:
                return f"{index:#06x} sub {subindex} would have to be set, and the data sheet lets nobody"
        return None

    def _silence(self) -> list[Setting]:
        config, objects = self._config, self._config.map
        wanted = []
        # The action first: a time-out must never start with another's action.
        if entry := objects.communication_action:
            action = CommunicationAction[config.communication_action.upper()]
            wanted.append(Setting(entry.index, entry.subindex, entry.raw(action)))
        if entry := objects.communication_timeout_s:
            wanted.append(Setting(entry.index, entry.subindex, entry.raw(config.communication_timeout_s)))
        return wanted

    def _heartbeats(self) -> list[Setting]:
        config, sdo = self._config, self._sdo
        wanted = []
        self._watcher.heartbeat_timeout_s = config.heartbeat_timeout_s
        if sdo.has(HEARTBEAT_MS):
            wanted.append(Setting(HEARTBEAT_MS, 0, round(1e3 * config.heartbeat_s)))
        else:  # that it lives, its TPDOs show
            self._watcher.heartbeat_timeout_s = math.inf
        if config.master_node is not None and not self._is_consumed(config.master_node):
            consumed = config.master_node << 16 | round(1e3 * config.master_timeout_s)
            wanted.append(Setting(CONSUMED_HEARTBEATS, 1, consumed))
        return wanted

    def _is_consumed(self, master: int) -> bool:
        """Return whether the node watches this master already, patiently enough."""
        count = self._sdo.whole_number(CONSUMED_HEARTBEATS, 0)
        if count == 0 or self._sheet.get_variable(CONSUMED_HEARTBEATS, 1) is None:
            said = f"{self._bus.who}: {NodeEvent.SDO_ABORT}: master_node: the node watches no heartbeat (0x1016)"
            raise Refused(said, NO_SUCH_OBJECT)
        entries = (self._sdo.whole_number(CONSUMED_HEARTBEATS, n) for n in range(1, count + 1))
        least_ms = 1e3 * self._config.master_heartbeat_s
        return any(each >> 16 & 0x7F == master and each & 0xFFFF > least_ms for each in entries)
