"""Peers that are not ours: modbus-tk, which shares no code with the product's library, and knows function 23 and RTU.

Its clients take turns under one lock of the library, so they are no load; `fieldbus.modbus.client` is for that.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import pytest
from modbus_tk import defines
from modbus_tk.exceptions import ModbusError
from modbus_tk.modbus_tcp import TcpMaster

TIMEOUT_S = 20.0


class IndependentClient:
    """A client on Modbus TCP, by number of the function."""

    def __init__(self, master: TcpMaster, unit: int) -> None:
        self._master, self._unit = master, unit

    def read_holding(self, address: int, count: int) -> list[int]:
        return list(self._master.execute(self._unit, defines.READ_HOLDING_REGISTERS, address, count))

    def read_input(self, address: int, count: int) -> list[int]:
        return list(self._master.execute(self._unit, defines.READ_INPUT_REGISTERS, address, count))

    def read_coils(self, address: int, count: int) -> list[int]:
        return list(self._master.execute(self._unit, defines.READ_COILS, address, count))

    def write_one(self, address: int, word: int) -> tuple[int, int]:
        echo: tuple[int, int] = self._master.execute(
            self._unit, defines.WRITE_SINGLE_REGISTER, address, output_value=word
        )
        return echo

    def write(self, address: int, words: Sequence[int]) -> tuple[int, int]:
        echo: tuple[int, int] = self._master.execute(
            self._unit, defines.WRITE_MULTIPLE_REGISTERS, address, output_value=words
        )
        return echo

    def write_and_read(self, write_address: int, words: Sequence[int], address: int, count: int) -> list[int]:
        return list(
            self._master.execute(
                self._unit,
                defines.READ_WRITE_MULTIPLE_REGISTERS,
                address,
                count,
                output_value=words,
                write_starting_address_fc23=write_address,
            )
        )


@contextmanager
def independent_client(port: int, unit: int = 1) -> Iterator[IndependentClient]:
    """Give a client of a server on this machine."""
    master = TcpMaster("127.0.0.1", port, TIMEOUT_S)
    try:
        yield IndependentClient(master, unit)
    finally:
        master.close()


@contextmanager
def refused_with(code: int) -> Iterator[None]:
    """Expect the exception of a code."""
    with pytest.raises(ModbusError) as caught:
        yield
    assert caught.value.get_exception_code() == code
