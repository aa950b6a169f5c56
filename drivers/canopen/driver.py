"""A device on CANopen: RPDO and SYNC out, the TPDOs of one sample back, all in the thread that calls.

`open` asks who the node is and what it holds, tells it by SDO what its data sheet allows (communication time-out,
heartbeat, SYNC, PDO mapping), makes it ACTIVE and starts it by NMT. One cycle is then

    RPDO (command, control word), SYNC  ->  TPDOs (position, pressure, counter, time, status, status word)

canopen gives data sheet and SDO transfers, python-can the bus. No thread receives behind the caller's back: what else
came since the last cycle (heartbeats, emergencies) is heeded in the next. Whatever cannot be trusted ends the
connection; the reason begins with one of `NodeEvent`. What does not end it is logged under that name.

A node that is not ACTIVE, or is operated locally, is no actuator: its readings carry NOT_READY, the log says why, and
a fault of its own is reset once a cycle.
"""

import logging
import math
import random
import struct
import time
from collections.abc import Mapping
from contextlib import suppress
from enum import StrEnum
from typing import Any

import can
from canopen.objectdictionary import ObjectDictionary, ODVariable
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from config.canopen_device import CanopenDevice, Entry
from config.device import CommunicationAction, DeviceStatus
from config.errors import InputError
from drivers.boundary import BadReply, Capabilities, Driver, DriverError, NoConnection, NoReply, Reading, Refused
from fieldbus.canopen.eds import read_eds
from fieldbus.canopen.objects import ACTIVATE, MOST_PDOS, NO_FAULT, Control, first_fit, inactive_because

log = logging.getLogger(__name__)

ILLEGAL_VALUE = 3
OPERATIONAL, BOOT_UP = 5, 0
START, ENTER_PRE_OPERATIONAL = 1, 128
SYNC, IDENTITY, HEARTBEAT_MS = 0x1005, 0x1018, 0x1017
VENDOR, PRODUCT = 1, 2
RESERVED = range(0x0400, 0x1000)
"""Indices at which CiA 301 lets no node have an object."""
RPDO, TPDO, MAPPING = 0x1400, 0x1800, 0x200
INVALID = 1 << 31
EACH_SYNC = 1
UNNAMED = bytes(3)
"""What some nodes say for the object that they refuse."""
SDO_ABORTED, SDO_UPLOAD, SDO_DOWNLOAD = 0x80, 0x40, 0x60
CAN_ERROR_BUS_OFF = 0x40
"""Of an error frame's id, as SocketCAN has them."""
NMT_STATES = {0: "booting", 4: "STOPPED", 5: "OPERATIONAL", 127: "PRE-OPERATIONAL"}
REFUSED_COMMAND = 0x6320
EMERGENCIES = {
    0x1000: "generic error",
    0x2000: "current",
    0x3000: "voltage",
    0x4000: "temperature",
    0x5000: "device hardware",
    0x6000: "device software",
    0x6300: "data set",
    REFUSED_COMMAND: "a parameter is out of its range",
    0x7000: "additional modules",
    0x8000: "monitoring",
    0x8100: "communication",
    0x8110: "CAN overrun, frames were lost",
    0x8120: "CAN in error passive mode",
    0x8130: "life guard or heartbeat error",
    0x8140: "recovered from bus off",
    0x8150: "collision of CAN identifiers",
    0x8200: "protocol error",
    0x8210: "PDO not processed due to its length",
    0x8220: "PDO longer than mapped",
    0x8240: "unexpected length of SYNC",
    0x8250: "no RPDO within the communication time-out",
    0x9000: "external error",
    0xF000: "additional functions",
    0xFF00: "specific to the device",
}
"""Error codes of CiA 301; a class ends in 00 or 000."""


class NodeEvent(StrEnum):
    """What can happen to a node or its bus; every reason and every log line begins with one of these."""

    NO_NODE = "no node answers"
    WRONG_EDS = "wrong EDS"
    NODE_ID_TAKEN = "node id taken"
    BUS_OFF = "bus off"
    SYNC_LOST = "SYNC not answered"
    HEARTBEAT_LOST = "heartbeat lost"
    PDO_TOO_SHORT = "PDO too short"
    SDO_ABORT = "SDO abort"
    SDO_TIMEOUT = "SDO not answered"
    NODE_RESTARTED = "node restarted"
    NOT_OPERATIONAL = "node not OPERATIONAL"
    NOT_ACTIVE = "node not ACTIVE"
    ACTIVE = "node ACTIVE"
    EMERGENCY = "emergency"
    COMMAND_REFUSED = "command refused"


def canopen_driver(config: CanopenDevice) -> Driver:
    """Return a driver, or one that only watches.

    Raises:
        InputError: the data sheet cannot be read, or has not what the map names.
    """
    return CanopenWatcher(config) if config.only_watch else CanopenDriver(config)


def cause_of(code: int) -> str:
    """Return what an emergency's error code means."""
    classes = (code, code & 0xFF00, code & 0xF000)
    return next((EMERGENCIES[each] for each in classes if each in EMERGENCIES), "not in CiA 301")


class _Node:
    """What driving and watching a node have in common: the bus, its data sheet, SDO."""

    def __init__(self, config: CanopenDevice) -> None:
        self._config = config
        self._number = config.node
        self._who = f"{config.interface} {config.channel} node {config.node}"
        self._sheet = read_eds(config.eds, config.node)
        self._bus: can.BusABC | None = None
        self._sdo = _Sdo(self)
        self._asked = self._answered = 0
        self.variables = {name: self._variable(name, entry) for name, entry in config.map.entries.items()}

    @property
    def number(self) -> int:
        """The node id."""
        return self._number

    @property
    def sheet(self) -> ObjectDictionary:
        """The data sheet."""
        return self._sheet

    @property
    def capabilities(self) -> Capabilities:
        """What the device can do."""
        objects = self._config.map
        return Capabilities(
            one_transaction=not self._config.only_watch,
            device_time=objects.device_time_us is not None,
            sample_counter=objects.sample_counter is not None,
        )

    def close(self) -> None:
        """Leave the bus; the node keeps its last command until its own time-out."""
        bus, self._bus = self._bus, None
        if bus is not None:
            with suppress(can.CanError, OSError):
                bus.shutdown()

    def ask(self, request: bytes) -> bytes:
        """Send an SDO request and return the node's answer to it.

        Raises:
            SdoAbortedError: the node refused.
            SdoCommunicationError: no answer within the reply time-out.
        """
        self._asked += 1
        self._send(0x600 + self._number, request)
        end_s = time.monotonic() + self._config.reply_timeout_s
        while (rest_s := end_s - time.monotonic()) > 0:
            message = self._receive(rest_s)
            if message is None or message.arbitration_id != 0x580 + self._number or len(message.data) != 8:
                self._heed_emergency(message)
                continue
            answer = bytes(message.data)
            self._answered += 1
            names_object = answer[0] & 0xE0 in (SDO_UPLOAD, SDO_DOWNLOAD, SDO_ABORTED)
            if names_object and request[0] & 0xE0 in (0x20, 0x40) and answer[1:4] != request[1:4]:
                continue  # the late answer to another request
            if answer[0] == SDO_ABORTED:
                raise SdoAbortedError(struct.unpack_from("<I", answer, 4)[0])
            return answer
        raise SdoCommunicationError("no answer")

    def tell(self, request: bytes) -> None:
        """Send an SDO frame to which there is no answer.

        Raises:
            CanError: the bus is off.
        """
        self._send(0x600 + self._number, request)

    def _variable(self, name: str, entry: Entry) -> ODVariable:
        found = self._sheet.get_variable(entry.index, entry.subindex)
        if found is None or found.data_type not in ODVariable.STRUCT_TYPES:
            where = f"{entry.index:#06x} sub {entry.subindex}"
            raise InputError(str(self._config.eds), f"device.map.{name}: the data sheet has no number at {where}")
        return found

    def _connect(self, identities: Mapping[int, int]) -> None:
        filters = [{"can_id": each, "can_mask": mask, "extended": False} for each, mask in identities.items()]
        self._asked = self._answered = 0
        try:
            arguments: dict[str, Any] = self._config.bus_arguments
            self._bus = can.Bus(can_filters=filters, **arguments)
        except Exception as error:  # somebody else's interface: it may raise anything
            said = " ".join(str(error).split())
            raise NoConnection(f"{self._who}: {NodeEvent.BUS_OFF}: the bus cannot be opened: {said}") from None

    def _pass_over_late_answers(self) -> None:
        """Wait until the node has answered what was asked before: a node answers in turn.

        It is asked for an object that it cannot have, chosen by lot; what comes before the refusal of that object
        answers somebody's earlier requests, and is dropped.
        """
        multiplexer = struct.pack("<HB", random.choice(RESERVED), random.randrange(256))
        self._send(0x600 + self._number, bytes((SDO_UPLOAD,)) + multiplexer + bytes(4))
        end_s = time.monotonic() + self._config.reply_timeout_s
        while (rest_s := end_s - time.monotonic()) > 0:
            message = self._receive(rest_s)
            if message is None or message.arbitration_id != 0x580 + self._number:
                self._heed_emergency(message)
            elif message.data[:1] == bytes((SDO_ABORTED,)) and message.data[1:4] in (multiplexer, UNNAMED):
                return
        raise NoConnection(f"{self._who}: {NodeEvent.NO_NODE} within {1e3 * self._config.reply_timeout_s:g} ms")

    def _identify(self) -> None:
        """Hold the node against its data sheet."""
        found = [self._upload(IDENTITY, part) for part in (VENDOR, PRODUCT)]
        for part, name, is_there in zip((VENDOR, PRODUCT), ("vendor", "product"), found, strict=True):
            variable = self._sheet.get_variable(IDENTITY, part)
            expected = variable.default if variable is not None else None
            if expected is not None and expected != is_there:
                raise BadReply(
                    f"{self._who}: {NodeEvent.WRONG_EDS}: it says {name} {is_there:#010x}, "
                    f"{self._config.eds.name} is of {expected:#010x}"
                )

    def _held_command_pa(self) -> float:
        entry = self._config.map.command_pa
        held_pa = entry.value(self._upload(entry.index, entry.subindex))
        if not math.isfinite(held_pa):
            raise BadReply(f"{self._who}: the command it holds is {held_pa}")
        return held_pa

    def _upload(self, index: int, subindex: int = 0) -> float:
        variable = self._sheet.get_variable(index, subindex)
        try:
            data = self._sdo.upload(index, subindex)
            if variable is None or 8 * len(data) != len(variable):
                raise BadReply(f"{self._who}: {NodeEvent.WRONG_EDS}: {index:#06x} sub {subindex} is {len(data)} bytes")
            value: Any = variable.decode_raw(data)
        except (SdoAbortedError, SdoCommunicationError) as error:
            raise self._sdo_fault(error, index, subindex) from None
        return float(value) if isinstance(value, float) else int(value)

    def _sdo_fault(self, error: Exception, index: int, subindex: int) -> DriverError:
        where = f"{index:#06x} sub {subindex}"
        if isinstance(error, SdoAbortedError):
            return Refused(f"{self._who}: {NodeEvent.SDO_ABORT}: {where}: {error}", error.code)
        milliseconds = 1e3 * self._config.reply_timeout_s
        return NoReply(f"{self._who}: {NodeEvent.SDO_TIMEOUT}: {where}: {error} within {milliseconds:g} ms")

    def _send(self, identity: int, data: bytes) -> None:
        self._put(can.Message(arbitration_id=identity, data=data, is_extended_id=False))

    def _put(self, message: can.Message) -> None:
        bus = self._open_bus()
        try:
            bus.send(message, self._config.reply_timeout_s)
        except (can.CanError, OSError) as error:
            raise self._off(str(error)) from None

    def _receive(self, timeout_s: float) -> can.Message | None:
        bus = self._open_bus()
        try:
            message = bus.recv(timeout_s)
        except (can.CanError, OSError) as error:
            raise self._off(str(error)) from None
        if message is not None and message.is_error_frame:
            if message.arbitration_id & CAN_ERROR_BUS_OFF:
                raise self._off("the controller says so")
            return self._receive(0.0)  # of no node; what lies behind it counts
        return message

    def _open_bus(self) -> can.BusABC:
        if self._bus is None:
            raise NoConnection(f"{self._who}: the driver is not open")
        return self._bus

    def _off(self, said: str) -> NoConnection:
        self.close()
        return NoConnection(f"{self._who}: {NodeEvent.BUS_OFF}: {' '.join(said.split())}")

    def _heed_emergency(self, message: can.Message | None) -> int | None:
        """Tell an emergency with its cause; return its code, None if the frame is something else."""
        if message is None or message.arbitration_id != 0x80 + self._number or len(message.data) < 3:
            return None
        code, register = struct.unpack_from("<HB", message.data)
        level, cause = (logging.WARNING, cause_of(code)) if code else (logging.INFO, "over")
        self._says(level, NodeEvent.EMERGENCY, code=code, cause=cause, register=register)
        return int(code)

    def _says(self, level: int, event: NodeEvent, **fields: object) -> None:
        log.log(level, event, extra={"fields": {"device": self._who, **fields}})


class CanopenDriver(_Node):
    """Drives a node.

    Args:
        config: bus, node id, data sheet, time-outs, where its quantities are.

    Raises:
        InputError: the data sheet cannot be read, or has not what the map names.
    """

    def __init__(self, config: CanopenDevice) -> None:
        super().__init__(config)
        objects = config.map
        for name, entry in {**objects.sampled, **objects.commanded}.items():
            self.variables[name] = self._variable(name, entry)
        self._tpdos = [_Tpdo(n, names, self) for n, names in enumerate(self._grouped(list(objects.sampled)))]
        self._by_id = {pdo.cob_id: pdo for pdo in self._tpdos}
        self._command = _Rpdo(list(objects.commanded), self)
        self._frame = can.Message(arbitration_id=self._command.cob_id, data=bytes(8), is_extended_id=False)
        self._sync = can.Message(arbitration_id=config.sync_cob_id, is_extended_id=False)
        self._has_words = objects.control_word is not None and objects.status_word is not None
        self._control = ACTIVATE
        self._why_inactive: str | None = None
        self._heard_s = -math.inf
        self._was_operational = False
        self._refusal: str | None = None

    def entry(self, name: str) -> Entry:
        """Return where a quantity or word lies."""
        objects = self._config.map
        return {**objects.sampled, **objects.commanded}[name]

    def open(self) -> float:
        """Configure and start the node; return the command it holds, in Pa. Moves nothing.

        Raises:
            DriverError: not there, not the one of the data sheet, or it refused; the bus is left.
        """
        self.close()
        try:
            self._connect(self._identities())
            self._send(0, bytes((ENTER_PRE_OPERATIONAL, self._number)))
            self._pass_over_late_answers()
            self._identify()
            held_pa = self._held_command_pa()
            self._configure()
            self._map_pdos()
            self._activate()
            self._require_alone()
            self._send(0, bytes((START, self._number)))
        except BaseException:
            self.close()
            raise
        self._heard_s, self._was_operational = time.monotonic(), False
        return held_pa

    def read(self) -> Reading:
        """Return a measurement."""
        self._catch_up()
        self._put(self._sync)
        return self._sample()

    def write(self, command_pa: float) -> None:
        """Command a pressure."""
        self.exchange(command_pa)

    def exchange(self, command_pa: float) -> Reading:
        """Command a pressure and return the newest measurement after that."""
        try:
            data = self._command.data(command_pa, self._control)
        except ValueError as error:
            self._open_bus()
            raise Refused(f"{self._who}: {NodeEvent.COMMAND_REFUSED}: not sent: {error}", ILLEGAL_VALUE) from None
        self._catch_up()
        self._frame.data, self._frame.dlc = bytearray(data), len(data)
        self._put(self._frame)
        self._put(self._sync)
        reading = self._sample()
        if self._refusal is not None:
            raise Refused(
                f"{self._who}: {NodeEvent.COMMAND_REFUSED}: {command_pa:g} Pa: {self._refusal}", ILLEGAL_VALUE
            )
        return reading

    def _grouped(self, names: list[str]) -> list[list[str]]:
        groups = first_fit({name: len(self.variables[name]) // 8 for name in names})
        offered = sum(TPDO + n in self._sheet for n in range(MOST_PDOS))
        if len(groups) > offered:
            raise InputError(
                str(self._config.eds), f"device.map: needs {len(groups)} TPDOs, the data sheet offers {offered}"
            )
        return groups

    def _identities(self) -> dict[int, int]:
        """Return the arbitration ids that matter here, with their masks."""
        fixed = (0x80 + self._number, 0x580 + self._number, 0x700 + self._number)
        return dict.fromkeys((*fixed, *self._by_id), 0x7FF)

    def _configure(self) -> None:
        # The action first: a time-out must never start with another's action.
        config, objects = self._config, self._config.map
        if objects.communication_action:
            self._set("communication_action", CommunicationAction[config.communication_action.upper()])
        if objects.communication_timeout_s:
            self._set("communication_timeout_s", config.communication_timeout_s)
        self._download(HEARTBEAT_MS, 0, round(1e3 * config.heartbeat_s))
        self._download(SYNC, 0, config.sync_cob_id)

    def _map_pdos(self) -> None:
        for pdo in (self._command, *self._tpdos):
            first = RPDO if pdo is self._command else TPDO
            record = first + pdo.place
            self._download(record, 1, pdo.cob_id | INVALID)
            self._download(record, 2, EACH_SYNC)
            self._download(record + MAPPING, 0, 0)
            for n, mapped in enumerate(pdo.mapping, 1):
                self._download(record + MAPPING, n, mapped)
            self._download(record + MAPPING, 0, len(pdo.mapping))
            self._download(record, 1, pdo.cob_id)
        for n in range(len(self._tpdos), MOST_PDOS):
            if TPDO + n in self._sheet:
                self._download(TPDO + n, 1, (0x180 + 0x100 * n + self._number) | INVALID)

    def _activate(self) -> None:
        """Steer the node to ACTIVE; one that will not is reported, and no actuator."""
        self._control, self._why_inactive = ACTIVATE, None
        if not self._has_words:
            return
        status = self.entry("status_word")
        if not int(self._upload(status.index, status.subindex)) & NO_FAULT:
            self._set("control_word", 0)
            self._set("control_word", Control.RESET)
        self._set("control_word", ACTIVATE)
        self._judge(int(self._upload(status.index, status.subindex)))

    def _require_alone(self) -> None:
        """Refuse a node whose requests were answered more than once."""
        while (message := self._receive(0.0)) is not None:
            self._answered += message.arbitration_id == 0x580 + self._number
            self._heed_emergency(message)
        if self._answered > self._asked:
            raise BadReply(
                f"{self._who}: {NodeEvent.NODE_ID_TAKEN}: {self._answered} answers to {self._asked} SDO requests"
            )

    def _set(self, name: str, value: float) -> None:
        entry = self._config.map.entries.get(name) or self.entry(name)
        self._download(entry.index, entry.subindex, entry.raw(value))

    def _download(self, index: int, subindex: int, value: float) -> None:
        variable = self._sheet.get_variable(index, subindex)
        if variable is None:
            raise BadReply(f"{self._who}: {NodeEvent.WRONG_EDS}: it has no object {index:#06x} sub {subindex}")
        try:
            whole = value if variable.data_type in (0x08, 0x11) else round(value)
            data = variable.encode_raw(whole)
        except (ValueError, OverflowError):
            raise Refused(f"{self._who}: {value} does not fit {index:#06x} sub {subindex}", ILLEGAL_VALUE) from None
        try:
            self._sdo.download(index, subindex, bytes(data))
        except (SdoAbortedError, SdoCommunicationError) as error:
            raise self._sdo_fault(error, index, subindex) from None

    def _catch_up(self) -> None:
        """Heed what came since the last cycle."""
        self._open_bus()
        self._refusal = None
        while (message := self._receive(0.0)) is not None:
            if message.arbitration_id in self._by_id:
                self.close()
                raise BadReply(
                    f"{self._who}: {NodeEvent.NODE_ID_TAKEN}: a TPDO without SYNC: another node has this id, "
                    "or another master sends SYNC"
                )
            self._heed(message)

    def _sample(self) -> Reading:
        """Wait for the TPDOs of the SYNC just sent."""
        missing = dict(self._by_id)
        values: dict[str, float] = {}
        end_s = time.monotonic() + self._config.reply_timeout_s
        rest_s = self._config.reply_timeout_s
        while missing:
            message = self._receive(max(0.0, rest_s))
            rest_s = end_s - time.monotonic()
            if message is None or message.arbitration_id not in missing:
                if message is not None:
                    self._heed(message)
                if rest_s <= 0:
                    raise self._silent(len(missing))
                continue
            pdo = missing.pop(message.arbitration_id)
            if len(message.data) < pdo.layout.size:
                self.close()
                raise BadReply(
                    f"{self._who}: {NodeEvent.PDO_TOO_SHORT}: TPDO {pdo.place + 1} has {len(message.data)} bytes, "
                    f"mapped are {pdo.layout.size}"
                )
            values.update(pdo.values(message.data))
        self._require_heartbeat()
        if not all(map(math.isfinite, values.values())):
            said = ", ".join(f"{name} {value}" for name, value in values.items())
            raise BadReply(f"{self._who}: a measurement that is no number: {said}")
        return self._reading(values)

    def _reading(self, values: Mapping[str, float]) -> Reading:
        status = round(values.get("status", 0))
        if self._has_words:
            self._judge(round(values["status_word"]))
        if self._why_inactive is not None:
            status |= DeviceStatus.NOT_READY
        counter, time_us = values.get("sample_counter"), values.get("device_time_us")
        return Reading(
            position_m=values["position_m"],
            pressure_pa=values.get("pressure_pa"),
            sample_counter=None if counter is None else round(counter),
            device_time_s=None if time_us is None else time_us / 1e6,
            status=status,
        )

    def _judge(self, status_word: int) -> None:
        """Note whether the node is an actuator, say so when that changes, and choose the next control word."""
        why = inactive_because(status_word)
        if why != self._why_inactive:
            self._why_inactive = why
            if why is None:
                self._says(logging.INFO, NodeEvent.ACTIVE)
            else:
                self._says(logging.WARNING, NodeEvent.NOT_ACTIVE, why=why, status_word=status_word)
        failed = not status_word & NO_FAULT
        self._control = ACTIVATE ^ Control.RESET if failed and not self._control & Control.RESET else ACTIVATE

    def _heed(self, message: can.Message) -> None:
        """Take in what is no TPDO: an emergency or a heartbeat."""
        code = self._heed_emergency(message)
        if code is not None:
            self._refusal = cause_of(code) if code == REFUSED_COMMAND else self._refusal
        elif message.arbitration_id == 0x700 + self._number and len(message.data) == 1:
            self._heard_s = time.monotonic()
            state = message.data[0] & 0x7F
            if state == BOOT_UP:
                self.close()
                raise NoConnection(f"{self._who}: {NodeEvent.NODE_RESTARTED}: it booted, and must be configured anew")
            # One that left before the node was started may come after; a node that was not started sends no TPDO.
            self._was_operational |= state == OPERATIONAL
            if state != OPERATIONAL and self._was_operational:
                self.close()
                said = NMT_STATES.get(state, str(state))
                raise NoConnection(f"{self._who}: {NodeEvent.NOT_OPERATIONAL}: its heartbeat says {said}")
        elif message.arbitration_id in self._by_id:
            self.close()
            raise BadReply(f"{self._who}: {NodeEvent.NODE_ID_TAKEN}: the same TPDO came twice after one SYNC")

    def _silent(self, missing: int) -> NoReply:
        """Return what it means that TPDOs are missing."""
        self.close()
        age_s = time.monotonic() - self._heard_s
        event = NodeEvent.HEARTBEAT_LOST if age_s > self._config.heartbeat_timeout_s else NodeEvent.SYNC_LOST
        return NoReply(
            f"{self._who}: {event}: {missing} of {len(self._tpdos)} TPDOs missing "
            f"{1e3 * self._config.reply_timeout_s:g} ms after SYNC, last heartbeat {1e3 * age_s:.0f} ms ago"
        )

    def _require_heartbeat(self) -> None:
        age_s = time.monotonic() - self._heard_s
        if age_s > self._config.heartbeat_timeout_s:
            self.close()
            raise NoReply(f"{self._who}: {NodeEvent.HEARTBEAT_LOST}: the last came {1e3 * age_s:.0f} ms ago")


class CanopenWatcher(_Node):
    """Reads a node that another drives, or nobody: by SDO alone. Its values may be of several samples."""

    def open(self) -> float:
        """Return the command the node holds, in Pa.

        Raises:
            DriverError: not there, or not the one of the data sheet.
        """
        self.close()
        try:
            self._connect({0x580 + self._number: 0x7FF})
            self._pass_over_late_answers()
            self._identify()
            return self._held_command_pa()
        except BaseException:
            self.close()
            raise

    def read(self) -> Reading:
        """Return a measurement."""
        values = {
            name: entry.value(self._upload(entry.index, entry.subindex))
            for name, entry in self._config.map.sampled.items()
        }
        counter, time_us = values.get("sample_counter"), values.get("device_time_us")
        return Reading(
            position_m=values["position_m"],
            pressure_pa=values.get("pressure_pa"),
            sample_counter=None if counter is None else round(counter),
            device_time_s=None if time_us is None else time_us / 1e6,
            status=round(values.get("status", 0)),
        )

    def write(self, command_pa: float) -> None:
        """Command nothing."""
        raise Refused(f"{self._who}: {NodeEvent.COMMAND_REFUSED}: {command_pa:g} Pa: only_watch is set", ILLEGAL_VALUE)

    def exchange(self, command_pa: float) -> Reading:
        """Command nothing."""
        self.write(command_pa)
        return self.read()


class _Sdo(SdoClient):
    """canopen's SDO transfers, with requests and answers in the calling thread."""

    def __init__(self, node: _Node) -> None:
        super().__init__(0x600 + node.number, 0x580 + node.number, node.sheet)  # type: ignore[no-untyped-call]
        self._node = node

    def request_response(self, sdo_request: bytes) -> bytes:
        return self._node.ask(bytes(sdo_request))

    def send_request(self, request: bytes) -> None:
        self._node.tell(bytes(request))


class _Pdo:
    """The mapped objects of one PDO."""

    def __init__(self, place: int, names: list[str], first_id: int, driver: CanopenDriver) -> None:
        self.place = place
        self.names = names
        self.cob_id = first_id + 0x100 * place + driver.number
        self.entries = [driver.entry(name) for name in names]
        variables = [driver.variables[name] for name in names]
        self.mapping = [each.index << 16 | each.subindex << 8 | len(each) for each in variables]
        letters = (ODVariable.STRUCT_TYPES[each.data_type or 0].format.lstrip("<") for each in variables)
        self.layout = struct.Struct("<" + "".join(letters))
        self.is_plain = all(entry.scale == 1 and entry.offset == 0 for entry in self.entries)
        self.is_float = [each.data_type in (0x08, 0x11) for each in variables]


class _Tpdo(_Pdo):
    """What the node sends."""

    def __init__(self, place: int, names: list[str], driver: CanopenDriver) -> None:
        super().__init__(place, names, 0x180, driver)

    def values(self, data: bytes | bytearray) -> dict[str, float]:
        """Return the quantities by name."""
        raw = self.layout.unpack_from(data)
        if not self.is_plain:
            raw = tuple(entry.value(each) for entry, each in zip(self.entries, raw, strict=True))
        return dict(zip(self.names, raw, strict=True))


class _Rpdo(_Pdo):
    """What the node is sent: the command, and the control word if it has one."""

    def __init__(self, names: list[str], driver: CanopenDriver) -> None:
        super().__init__(0, names, 0x200, driver)

    def data(self, command_pa: float, control: Control) -> bytes:
        """Return the bytes.

        Raises:
            ValueError: the command is not a finite number, or its object cannot hold it.
        """
        raw = self.entries[0].raw(command_pa)
        try:
            return self.layout.pack(raw if self.is_float[0] else round(raw), *(int(control),)[: len(self.names) - 1])
        except (struct.error, OverflowError):
            raise ValueError(f"{command_pa:g} does not fit") from None
