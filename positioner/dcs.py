"""A small DCS: reads and writes the daemon's supervisory registers by name, over Modbus TCP.

What `positioner get`, `set` and `identify` use, and what plays the DCS in `positioner demo`.
"""

from collections.abc import Mapping
from types import TracebackType
from typing import Self

from pyModbusTCP.client import ModbusClient

from config.device import MOST_REGISTERS
from config.errors import InputError
from config.registers import Register, register_named


class DcsError(Exception):
    """The daemon did not do what was asked; one line says what and why."""


class Dcs:
    """A connection to a daemon's supervisory server; used as a context."""

    def __init__(self, host: str, port: int, unit: int = 1, timeout_s: float = 2.0) -> None:
        self._where = f"{host}:{port}"
        self._client = ModbusClient(host=host, port=port, unit_id=unit, timeout=timeout_s, auto_open=False)

    def __enter__(self) -> Self:
        if not self._client.open():
            raise DcsError(f"{self._where}: no daemon answers there (is `positioner run` running?)")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._client.close()

    def get(self, name: str) -> float:
        """Return a register's value.

        Raises:
            InputError: no register of that name.
            DcsError: the daemon does not answer, or refuses.
        """
        register = register_named(name)
        return self._decoded(register, self._read(register.address, register.end), register.address)

    def get_all(self, *names: str) -> dict[str, float]:
        """Return several values, those within one reply's reach from the same snapshot."""
        registers = sorted((register_named(name) for name in names), key=lambda each: each.address)
        values: dict[str, float] = {}
        while registers:
            start = registers[0].address
            near = [each for each in registers if each.end <= start + MOST_REGISTERS]
            words = self._read(start, near[-1].end)
            values |= {each.name: self._decoded(each, words, start) for each in near}
            registers = registers[len(near) :]
        return {name: values[name] for name in names}

    def set(self, name: str, value: float) -> None:
        """Write a register.

        Raises:
            InputError: no register of that name, read-only, or a value outside its range.
            DcsError: the daemon does not answer, or refuses.
        """
        register = register_named(name)
        if problem := register.problem_with(value):
            raise InputError(name, problem.removeprefix(f"{name}: "))
        if not self._client.write_multiple_registers(register.address, register.format.encode(value)):
            raise DcsError(f"{self._where}: {name} = {value:g} was refused: {self._reason()}")

    def set_all(self, values: Mapping[str, float]) -> None:
        """Write several registers, one after another."""
        for name, value in values.items():
            self.set(name, value)

    def _read(self, start: int, end: int) -> list[int]:
        words = self._client.read_holding_registers(start, end - start)
        if words is None:
            raise DcsError(f"{self._where}: registers {start} to {end - 1} cannot be read: {self._reason()}")
        return list(words)

    @staticmethod
    def _decoded(register: Register, words: list[int], start: int) -> float:
        return register.format.decode(words[register.address - start : register.end - start])

    def _reason(self) -> str:
        if self._client.last_except:
            return f"exception {self._client.last_except}, {self._client.last_except_as_txt.lower()} (see its log)"
        return str(self._client.last_error_as_txt)
