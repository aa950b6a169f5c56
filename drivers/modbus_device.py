"""A device on any Modbus: its quantities by the map of its registers, in requests and replies without frames.

One transaction a cycle (function 23), or more where it must be (16, or 6 where that is refused; then 3 or 4, once for
each table, and for each run without a hole where the device refuses to read registers that it has not). A device that
passes over a function in silence is told by `write_functions`, for silence may be a lost reply. Checked here: function,
byte count, length, echo, and that every number is one. How a request travels, a subclass knows.
"""

import math
import struct
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence

from pymodbus.constants import ExcCodes
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    ReadInputRegistersRequest,
    ReadWriteMultipleRegistersRequest,
    WriteMultipleRegistersRequest,
    WriteSingleRegisterRequest,
)

from config.device import ModbusDevice
from config.modbus_map import Place, Run, one_by_one, without_holes
from drivers.boundary import BadReply, Capabilities, DriverError, NoNumber, NoReply, Reading, Refused
from fieldbus.modbus.exception_codes import exception_text
from fieldbus.modbus.pdu import encoded
from fieldbus.modbus.register_packing import layout

OF_A_GATEWAY = (ExcCodes.GATEWAY_PATH_UNAVIABLE, ExcCodes.GATEWAY_NO_RESPONSE)
"""Exceptions that the device did not send: it may be away, or be restarted meanwhile."""

NOT_NOW = (ExcCodes.ACKNOWLEDGE, ExcCodes.DEVICE_BUSY)
"""Exceptions by which the device says that it is at work on something else."""

CUTS: Mapping[int, Callable[[Run], list[Run]]] = {
    ExcCodes.ILLEGAL_ADDRESS: without_holes,
    ExcCodes.ILLEGAL_VALUE: one_by_one,
}
"""How a read is cut that is refused: a register is not there, or they are too many at once."""
READ_COUNTS = (1, 2, 3, 4)
"""Of registers, of reads that make sure that answers are in step with what is asked: none fits another's length."""


class ModbusDriver(ABC):
    """Drives a device by the map of its registers.

    Args:
        config: how long the device may take, what its registers hold.
        who: the device, as errors name it.
    """

    def __init__(self, config: ModbusDevice, who: str) -> None:
        self._config = config
        self._who = who
        self._reads = [_Read(each) for each in config.map.runs]
        self._command = _Setting("command_pa", config.map.command_pa)
        self._exchange_head = _exchange_head(self._reads[0], config.map.command_pa)
        places = (config.map.communication_action, config.map.communication_timeout_s)
        self._settings = [_Read({"setting": place}) for place in places if place is not None]
        self._told: list[bytes] | None = None
        """What the registers of the settings said once they were told; None: they are not known, or cannot be read."""
        self._one_register_at_a_time = 16 not in config.write_functions
        """Whether the device knows function 6 and not 16; known by the file, or by its first refusal."""
        # Function 23 reads holding registers only.
        in_one = len(self._reads) == 1 and self._reads[0].table == "holding"
        self._one_transaction = in_one and 23 in config.write_functions
        self._free_s = 0.0
        """When the next request may set out; 0: whenever it likes."""
        self._functions_answered: set[int] = set()
        self._has_opened = False
        """Whether the device was ever ready to be driven."""

    @abstractmethod
    def _connect(self) -> None:
        """Reach the device (again).

        Raises:
            DriverError: it cannot be reached.
        """

    @abstractmethod
    def _transact(self, request: bytes, head: bytes, length: int) -> bytes:
        """Return the reply to a request: it begins with `head`, has that length, and is the answer to no other.

        Raises:
            DriverError: none such came, as `drivers.boundary` has it.
        """

    @abstractmethod
    def close(self) -> None:
        """Let go of the device; it keeps its last command until its own time-out."""

    def _position_read(self, count: int) -> bytes:
        """Return a request to read so many registers from the position's on: it moves nothing, whatever answers."""
        place = self._config.map.position_m
        return struct.pack(">BHH", 3 if place.table == "holding" else 4, place.address, count)

    @property
    def capabilities(self) -> Capabilities:
        """What the device can do; a device without function 23 is known by its first exchange."""
        return Capabilities(
            one_transaction=self._one_transaction,
            device_time=self._config.map.device_time_us is not None,
            sample_counter=self._config.map.sample_counter is not None,
            counter_range=self._config.map.sample_counter_range,
        )

    def open(self) -> float:
        """Connect and return the command the device holds, in Pa; set its time-out and action where it has them.

        Raises:
            DriverError: not reached within the reply time-out, or one of these refused or garbled; it is closed.
        """
        try:
            self._connect()
            held_pa = self.held_pa()
            self._configure()
            self._told = self._settings_shown()
        except BaseException:
            self.close()
            raise
        self._has_opened = True
        return held_pa

    def read(self) -> Reading:
        """Return a measurement."""
        try:
            return self._read_all(self._reads)
        except Refused as refusal:
            if not self._cut_reads(refusal):
                raise
        return self._read_all(self._reads)

    def write(self, command_pa: float) -> None:
        """Command a pressure."""
        self._tell(self._command, command_pa)

    def exchange(self, command_pa: float) -> Reading:
        """Command a pressure and return the newest measurement after that."""
        if self._one_transaction:
            try:
                return self._write_and_read(command_pa)
            except Refused as refusal:
                if refusal.code != ExcCodes.ILLEGAL_FUNCTION and not self._cut_reads(refusal):
                    raise
                self._one_transaction = False
        self.write(command_pa)
        return self.read()

    def held_pa(self) -> float:
        """Return the command that the device holds, in Pa, whoever gave it; moves nothing."""
        place = self._config.map.command_pa
        words = place.format.words
        request = encoded(ReadHoldingRegistersRequest(address=place.address, count=words))
        (raw,) = layout([place]).unpack(self._ask(request, bytes((3, 2 * words)), 2 + 2 * words))
        held_pa = place.value(raw)
        if not math.isfinite(held_pa):
            raise BadReply(f"{self._about(request)}: the command it holds is {held_pa}")
        return held_pa

    @property
    def has_settings(self) -> bool:
        """Whether time-out and action were told, and can be read."""
        return bool(self._told)

    def settings_kept(self) -> bool:
        """Return whether time-out and action are what they were once they were told; moves nothing.

        A device that refuses to say is not known to have lost them.
        """
        return self._settings_shown() in (None, self._told)

    def _settings_shown(self) -> list[bytes] | None:
        try:
            return [self._ask(each.request, each.head, each.length) for each in self._settings]
        except Refused:
            return None

    def _read_all(self, reads: Sequence["_Read"]) -> Reading:
        values: dict[str, float] = {}
        for each in reads:
            values |= each.values(self._ask(each.request, each.head, each.length))
        return self._reading(values)

    def _cut_reads(self, refusal: Refused) -> bool:
        """Read in smaller parts from now on, if the device then gives what it refuses; return whether it does.

        What was refused may have been the command beside a read: the whole is read once more.
        """
        cut = CUTS.get(refusal.code)
        parts = [] if cut is None else [_Read(part) for each in self._reads for part in cut(each.run)]
        if len(parts) <= len(self._reads) or not self._refuses(self._reads) or self._refuses(parts):
            return False
        self._reads = parts
        return True

    def _refuses(self, reads: Sequence["_Read"]) -> bool:
        try:
            self._read_all(reads)
        except Refused:
            return True
        return False

    def _configure(self) -> None:
        # The action first: a time-out must never start with another's action.
        config, places = self._config, self._config.map
        if places.communication_action:
            action = places.action_code(config.communication_action)
            self._tell(_Setting("communication_action", places.communication_action), action)
        if places.communication_timeout_s:
            self._tell(
                _Setting("communication_timeout_s", places.communication_timeout_s), config.communication_timeout_s
            )

    def _write_and_read(self, command_pa: float) -> Reading:
        read, request = self._reads[0], self._exchange_request(command_pa)
        return self._reading(read.values(self._ask(request, read.head_after, read.length)))

    def _exchange_request(self, command_pa: float) -> bytes:
        return self._exchange_head + self._data(self._command, command_pa)

    def _tell(self, setting: "_Setting", value: float) -> None:
        data = self._data(setting, value)
        if self._one_register_at_a_time and len(data) == 2:
            self._tell_one_register(setting, data)
            return
        request = setting.head + data
        try:
            self._ask(request, request[:5], 5)
        except Refused as refusal:
            if refusal.code != ExcCodes.ILLEGAL_FUNCTION or len(data) != 2:
                raise
            self._tell_one_register(setting, data)
            self._one_register_at_a_time = True

    def _tell_one_register(self, setting: "_Setting", data: bytes) -> None:
        request = setting.head_of_one + data
        self._ask(request, request, len(request))

    def _data(self, setting: "_Setting", value: float) -> bytes:
        try:
            return setting.data(value)
        except ValueError as error:
            raise Refused(f"{self._who}: {setting.name} not sent: {error}", ExcCodes.ILLEGAL_VALUE) from None

    def _reading(self, said: Mapping[str, float]) -> Reading:
        if not all(map(math.isfinite, said.values())):
            values = ", ".join(f"{name} {value}" for name, value in said.items())
            raise NoNumber(f"{self._who}: a measurement that is no number: {values}")
        return Reading.of(said, self._config.map.device_status(round(said.get("status", 0))))

    def _ask(self, request: bytes, head: bytes, length: int) -> bytes:
        """Return what follows `head` in the reply, which must begin with it and have that length."""
        return self._answer(request, head, length)[len(head) :]

    def _answer(self, request: bytes, head: bytes, length: int) -> bytes:
        """Return the reply as `_transact`, asked for no sooner than the device can take a request."""
        if self._free_s > 0.0:
            self._await_pause()
        try:
            reply = self._transact(request, head, length)
        except Refused:
            self._note_answer(request[0])
            raise
        self._note_answer(request[0])
        return reply

    def _begin_connection(self) -> None:
        """Let the device come to itself: it was just connected to."""
        if self._config.connect_pause_s:
            self._free_s = time.monotonic() + self._config.connect_pause_s

    def _await_pause(self) -> None:
        if (left_s := self._free_s - time.monotonic()) > 0:
            time.sleep(left_s)

    def _note_answer(self, function: int) -> None:
        """Note that the device has answered a function, and let it rest, if it needs that before the next request."""
        self._functions_answered.add(function)
        if self._config.pause_s:
            self._free_s = time.monotonic() + self._config.pause_s

    def _cure_of_silence(self, request: bytes) -> str:
        """Say which key of `[device]` is for a device that was silent so; nothing where any reply may be lost."""
        function, known = request[0], self._config.write_functions
        if not self._functions_answered:
            return (
                "; nothing was answered yet: is this unit there? One that needs time after connecting: "
                f"device.connect_pause_s{self._for_nothing_answered()}"
            )
        if function in known and function not in self._functions_answered and len(known) > 1:
            others = [each for each in known if each != function]
            return f"; function {function} was never answered: device.write_functions = {others}"
        return "" if self._has_opened else "; one that needs time between requests: device.pause_s"

    def _for_nothing_answered(self) -> str:
        """Say what else it may be, on this bus, that nothing was answered yet."""
        return ""

    def _refused(self, request: bytes, code: int) -> DriverError:
        """Return what an exception of the device means; by some a gateway says that the device itself was silent."""
        said = f"{self._about(request)}: {exception_text(code)}"
        if code in OF_A_GATEWAY:
            return NoReply(said)
        refusal = Refused(said, code)
        if code in NOT_NOW:
            refusal.kind = "device busy"
        return refusal

    def _about(self, request: bytes) -> str:
        """Say who was asked what."""
        return f"{self._who}: {_question(request)}"


class _Read:
    """A run of registers: how to ask for it and what it says."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self._places = list(run.values())
        self._names = list(run)
        self._layout = layout(self._places)
        self._is_plain = all(place.is_plain for place in self._places)
        self.table = self._places[0].table
        self.address, self.count = address, count = self._layout.address, self._layout.words
        read = ReadHoldingRegistersRequest if self.table == "holding" else ReadInputRegistersRequest
        self.length = 2 + 2 * count
        self.request = encoded(read(address=address, count=count))
        self.head = bytes((read.function_code, 2 * count))
        self.head_after = bytes((ReadWriteMultipleRegistersRequest.function_code, 2 * count))

    def values(self, data: bytes) -> dict[str, float]:
        """Return the quantities by name."""
        raw = self._layout.unpack(data)
        if not self._is_plain:
            raw = tuple(place.value(each) for place, each in zip(self._places, raw, strict=True))
        return dict(zip(self._names, raw, strict=True))


class _Setting:
    """The registers of one quantity that is set: how to write it."""

    def __init__(self, name: str, place: Place) -> None:
        self.name = name
        self._place = place
        self._layout = layout([place])
        nothing = [0] * self._layout.words
        self.head = encoded(WriteMultipleRegistersRequest(address=place.address, registers=nothing))[:6]
        """The request up to its registers."""
        self.head_of_one = encoded(WriteSingleRegisterRequest(address=place.address, registers=[0]))[:3]
        """The same of function 6, which writes one register."""

    def data(self, value: float) -> bytes:
        """Return the registers that say a value.

        Raises:
            ValueError: it is not a finite number, or they cannot hold it.
        """
        return self._layout.pack((self._place.raw(value),))


def _exchange_head(read: _Read, command: Place) -> bytes:
    """Return the request of function 23 that writes a command and reads a sample, up to its registers."""
    nothing = [0] * command.format.words
    return encoded(ReadWriteMultipleRegistersRequest(read.address, read.count, command.address, nothing))[:10]


def _question(request: bytes) -> str:
    """Say in words what was asked."""
    function, address, count = struct.unpack(">BHH", request[:5])
    if function == 23:
        to, words = struct.unpack(">HH", request[5:9])
        return f"function 23, write {words} at {to}, read {count} at {address}"
    if function == 6:
        return f"function 6, write 1 at {address}"
    return f"function {function}, {'write' if function == 16 else 'read'} {count} at {address}"
