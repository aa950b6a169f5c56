"""SDO transfers with one node (CiA 301, 7.2.4): objects read and written one by one, each confirmed.

    request   0x600 + n    command specifier, index (2 bytes), subindex, data (4 bytes)
    answer    0x580 + n    the same; specifier 0x80: refused, the data says why

canopen makes and reads the frames; they are sent and awaited here, in the calling thread. An answer that names another
object than the request, or is of another kind, is not taken for its answer: other masters ask the node, too. Nodes that
share a node id show by answers beyond the requests; so that a slow node's answers to an earlier session are not
counted, `open` lets them go by first. Then it compares vendor and product with the data sheet: a node of another
identity is refused by name.
"""

import math
import random
import struct
import time
from contextlib import suppress
from typing import Any, NamedTuple

from canopen.objectdictionary import ObjectDictionary, ODVariable
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from config.canopen_device import CanopenDevice, Entry
from config.errors import InputError
from drivers.boundary import BadReply, DriverError, NoConnection, NoReply, Refused
from drivers.canopen.events import NodeEvent
from drivers.canopen.node_bus import SDO_ANSWER, SDO_REQUEST, NodeBus
from drivers.canopen.watcher import BOOT_UP, NMT_STATES, OPERATIONAL, PRE_OPERATIONAL, NodeWatcher
from fieldbus.canopen.eds import read_eds

ILLEGAL_VALUE = 3
"""The code of `Refused` for a value that the device cannot be told, as Modbus has it."""
IDENTITY, VENDOR, PRODUCT = 0x1018, 1, 2  # object and its parts, CiA 301
HEARTBEAT_MS = 0x1017
LONGEST_LISTENING_S = 1.0
"""For a heartbeat, however short its period: one that comes late is of a node that may well be running."""
NO_SUCH_OBJECT = 0x06020000  # abort code of CiA 301
RESERVED = range(0x0400, 0x1000)
"""Indices at which CiA 301 lets no node have an object."""
UNNAMED = bytes(3)
"""What some nodes say for the object that they refuse."""
DOWNLOAD_REQUEST, UPLOAD_REQUEST, ABORT = 0x20, 0x40, 0x80  # command bytes of CiA 301
SPECIFIER = 0xE0
"""The bits of the first byte that say which kind of request or answer it is."""
ANSWERS = {DOWNLOAD_REQUEST: 0x60, UPLOAD_REQUEST: 0x40, 0x00: 0x20, 0x60: 0x00}
"""The kind of answer to each kind of request: the first two name their object, their further segments do not."""
REALS = (0x08, 0x11)
"""Data types REAL32 and REAL64."""


def sheet_variable(sheet: ObjectDictionary, config: CanopenDevice, name: str, entry: Entry) -> ODVariable:
    """Return what the data sheet says of a quantity's object.

    Raises:
        InputError: the data sheet has no number there.
    """
    found = sheet.get_variable(entry.index, entry.subindex)
    if found is None or found.data_type not in ODVariable.STRUCT_TYPES:
        where = f"{entry.index:#06x} sub {entry.subindex}"
        raise InputError(str(config.eds), f"device.map.{name}: the data sheet has no number at {where}")
    return found


def device_sheet(config: CanopenDevice) -> ObjectDictionary:
    """Read the data sheet of a node, and see that it has all that the map names.

    Raises:
        InputError: the data sheet cannot be read, or has not what the map names.
    """
    sheet = read_eds(config.eds, config.node)
    for name, entry in config.map.places.items():
        sheet_variable(sheet, config, name, entry)
    return sheet


class Setting(NamedTuple):
    """A number for an object."""

    at: int
    """Index of the object."""
    subindex: int
    value: float


class SdoTransfers:
    """Reads and writes a node's objects.

    Args:
        config: the reply time-out, and the data sheet's name.
        sheet: the data sheet, read for this node.
        bus: the node's frames.
        watcher: takes the emergencies that come meanwhile.
    """

    def __init__(self, config: CanopenDevice, sheet: ObjectDictionary, bus: NodeBus, watcher: NodeWatcher) -> None:
        self._sheet, self._bus, self._watcher = sheet, bus, watcher
        self._eds_name = config.eds.name
        self.timeout_s = config.reply_timeout_s
        self._request_id, self._answer_id = SDO_REQUEST + bus.node, SDO_ANSWER + bus.node
        self._client = _Client(self, self._request_id, self._answer_id, sheet)
        self._requests = self._answers = 0
        self._before: list[tuple[int, int, bytes]] = []
        """What objects held before they were written, in order."""

    def open(self) -> None:
        """Find the node, and hold it against its data sheet.

        Raises:
            NoConnection: nothing answers.
            BadReply: it is another device than the data sheet's.
            DriverError: it did not say who it is.
        """
        self._requests = self._answers = 0
        self._watcher.state = None
        self._pass_over_late_answers()
        self._identify()

    def upload(self, index: int, subindex: int = 0) -> float:
        """Return an object's number, as the node has it.

        Raises:
            Refused: the node aborted the transfer.
            NoReply: no answer within the reply time-out.
            BadReply: it is of another size than the data sheet says.
        """
        variable = self._sheet.get_variable(index, subindex)
        try:
            data = self._client.upload(index, subindex)
            if variable is None or 8 * len(data) != len(variable):
                said = f"{index:#06x} sub {subindex} is {len(data)} bytes"
                raise self._bus.fault(BadReply, NodeEvent.WRONG_EDS, said)
            value: Any = variable.decode_raw(data)
        except (SdoAbortedError, SdoCommunicationError) as error:
            raise self._fault(error, index, subindex) from None
        return float(value) if isinstance(value, float) else int(value)

    def whole_number(self, index: int, subindex: int) -> int:
        """Return an unsigned number that need not be in the data sheet; 0 where the node has none.

        Raises:
            NoReply: no answer within the reply time-out.
        """
        try:
            return int.from_bytes(self._client.upload(index, subindex), "little")
        except SdoAbortedError:
            return 0
        except SdoCommunicationError as error:
            raise self._fault(error, index, subindex) from None

    def download(self, index: int, subindex: int, value: float) -> None:
        """Write a number, as the node has it, into an object.

        Raises:
            Refused: the node aborted the transfer, or the object cannot hold the number.
            NoReply: no answer within the reply time-out.
            BadReply: the data sheet has no such object.
        """
        data = self._encoded(index, subindex, value)
        try:
            before = self._client.upload(index, subindex)
            self._client.download(index, subindex, data)
        except (SdoAbortedError, SdoCommunicationError) as error:
            raise self._fault(error, index, subindex) from None
        self._before.append((index, subindex, bytes(before)))

    def has(self, index: int) -> bool:
        """Return whether data sheet and node have an object; raises as `upload`."""
        if self._sheet.get_variable(index) is None:
            return False
        try:
            self.upload(index)
        except Refused as refusal:
            if refusal.code != NO_SUCH_OBJECT:
                raise
            return False
        return True

    def holds(self, setting: Setting) -> bool:
        """Return whether an object has a number already; raises as `upload` and `download`."""
        index, subindex, value = setting
        data = self._encoded(index, subindex, value)
        try:
            return bytes(self._client.upload(index, subindex)) == data
        except SdoAbortedError:
            return False  # some mappings cannot be read beyond their length
        except SdoCommunicationError as error:
            raise self._fault(error, index, subindex) from None

    def begin(self) -> None:
        """Note what `put_back` puts back from now on."""
        self._before.clear()

    def put_back(self) -> None:
        """Write what was written back to what it was, as far as the node lets us. Never raises."""
        while self._before:
            with suppress(SdoAbortedError, SdoCommunicationError, DriverError):
                self._client.download(*self._before.pop())

    def hears_operational(self) -> bool:
        """Return whether the node's heartbeat says OPERATIONAL; False of one that has none.

        That it boots is no answer: what it does then it says next.

        Raises:
            DriverError: as `upload`.
        """
        heartbeats = self.has(HEARTBEAT_MS) and self.upload(HEARTBEAT_MS) > 0
        end_s = time.monotonic() + (LONGEST_LISTENING_S if heartbeats else 0.0)
        while self._watcher.state in (None, BOOT_UP) and (rest_s := end_s - time.monotonic()) > 0:
            self._receive(rest_s)
        return self._watcher.state == OPERATIONAL

    def hears_stopped(self) -> bool:
        """Return whether the node's heartbeat says that it is not OPERATIONAL; raises as `hears_operational`."""
        return not self.hears_operational() and self._watcher.state is not None

    def _encoded(self, index: int, subindex: int, value: float) -> bytes:
        variable = self._sheet.get_variable(index, subindex)
        if variable is None:
            raise self._bus.fault(BadReply, NodeEvent.WRONG_EDS, f"it has no object {index:#06x} sub {subindex}")
        try:
            return bytes(variable.encode_raw(value if variable.data_type in REALS else round(value)))
        except (ValueError, OverflowError):
            said = f"{self._bus.who}: {value} does not fit {index:#06x} sub {subindex}"
            raise Refused(said, ILLEGAL_VALUE) from None

    def get(self, entry: Entry) -> float:
        """Return a quantity, in the map's unit; raises as `upload`."""
        return entry.value(self.upload(entry.index, entry.subindex))

    def set(self, entry: Entry, value: float) -> None:
        """Write a quantity, in the map's unit; raises as `download`."""
        self.download(entry.index, entry.subindex, entry.raw(value))

    def held_command_pa(self, entry: Entry) -> float:
        """Return the command that the node holds, in Pa.

        Raises:
            BadReply: it is no number.
            DriverError: as `upload`.
        """
        held_pa = self.get(entry)
        if not math.isfinite(held_pa):
            raise BadReply(f"{self._bus.who}: the command it holds is {held_pa}")
        return held_pa

    def require_alone(self) -> None:
        """Ask that no request of this session was answered more than once.

        Raises:
            BadReply: some were: two nodes have this id.
        """
        while (message := self._bus.receive(0.0)) is not None:
            self._answers += message.arbitration_id == self._answer_id
            self._watcher.note(message)
        if self._answers > self._requests:
            said = f"{self._answers} answers to {self._requests} SDO requests"
            raise self._bus.fault(BadReply, NodeEvent.NODE_ID_TAKEN, said)

    def exchange(self, request: bytes) -> bytes:
        """Send a request and return the node's answer to it.

        Raises:
            SdoAbortedError: the node refused.
            SdoCommunicationError: no answer within the reply time-out.
        """
        self._requests += 1
        self.send(request)
        end_s = time.monotonic() + self.timeout_s
        while (rest_s := end_s - time.monotonic()) > 0:
            answer = self._receive(rest_s)
            if answer is None:
                continue
            self._answers += 1
            if not _answers(request, answer):
                continue
            if answer[0] == ABORT:
                raise SdoAbortedError(struct.unpack_from("<I", answer, 4)[0])
            return answer
        raise SdoCommunicationError("no answer")

    def send(self, request: bytes) -> None:
        """Send a frame to which there may be no answer.

        Raises:
            NoConnection: the bus is off.
        """
        self._bus.send(self._request_id, request)

    def _receive(self, timeout_s: float) -> bytes | None:
        """Return an answer if it is what comes next."""
        message = self._bus.receive(timeout_s)
        if message is None:
            return None
        if message.arbitration_id == self._answer_id and len(message.data) == 8:
            return bytes(message.data)
        self._watcher.note(message)
        return None

    def _pass_over_late_answers(self) -> None:
        """Wait until the node has answered what was asked before: a node answers in turn.

        It is asked for an object that it cannot have, chosen by lot; what comes before the refusal of that object
        answers somebody's earlier requests, and is dropped.
        """
        multiplexer = struct.pack("<HB", random.choice(RESERVED), random.randrange(256))
        self.send(bytes((UPLOAD_REQUEST,)) + multiplexer + bytes(4))
        end_s = time.monotonic() + self.timeout_s
        while (rest_s := end_s - time.monotonic()) > 0:
            answer = self._receive(rest_s)
            if answer is not None and answer[0] == ABORT and answer[1:4] in (multiplexer, UNNAMED):
                return
        state = self._watcher.state
        if state is not None and state not in (OPERATIONAL, PRE_OPERATIONAL):
            said = f"its heartbeat says {NMT_STATES.get(state, str(state))}; it is left so, for another master to start"
            raise self._bus.fault(NoConnection, NodeEvent.NOT_OPERATIONAL, said)
        raise NoConnection(f"{self._bus.who}: {NodeEvent.NO_NODE} within {1e3 * self.timeout_s:g} ms")

    def _identify(self) -> None:
        for part, name in ((VENDOR, "vendor"), (PRODUCT, "product")):
            is_there = int(self.upload(IDENTITY, part))
            variable = self._sheet.get_variable(IDENTITY, part)
            expected = variable.default if variable is not None else None
            if expected is not None and expected != is_there:
                said = f"it says {name} {is_there:#010x}, {self._eds_name} is of {expected:#010x}"
                raise self._bus.fault(BadReply, NodeEvent.WRONG_EDS, said)

    def _fault(self, error: Exception, index: int, subindex: int) -> DriverError:
        where = f"{index:#06x} sub {subindex}"
        if isinstance(error, SdoAbortedError):
            return Refused(f"{self._bus.who}: {NodeEvent.SDO_ABORT}: {where}: {error}", error.code)
        said = f"{where}: {error} within {1e3 * self.timeout_s:g} ms"
        return self._bus.fault(NoReply, NodeEvent.SDO_TIMEOUT, said)


def _answers(request: bytes, answer: bytes) -> bool:
    """Return whether it answers this request: of its kind, or a refusal, and of the object asked for."""
    kind = request[0] & SPECIFIER
    if answer[0] != ABORT and answer[0] & SPECIFIER != ANSWERS.get(kind):
        return False
    return kind not in (DOWNLOAD_REQUEST, UPLOAD_REQUEST) or answer[1:4] == request[1:4]


class _Client(SdoClient):
    """canopen's SDO transfers, with requests and answers in the calling thread."""

    def __init__(self, transfers: SdoTransfers, request_id: int, answer_id: int, sheet: ObjectDictionary) -> None:
        super().__init__(request_id, answer_id, sheet)  # type: ignore[no-untyped-call]
        self._transfers = transfers

    def request_response(self, sdo_request: bytes) -> bytes:
        return self._transfers.exchange(bytes(sdo_request))

    def send_request(self, request: bytes) -> None:
        self._transfers.send(bytes(request))
