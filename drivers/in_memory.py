"""A device in the same process and virtual time: an exchange lets one period pass, as fast as it computes."""

from typing import Protocol

from drivers.boundary import Capabilities, NoConnection, Reading, Refused

ILLEGAL_VALUE = 3  # Modbus exception 3


class Plant(Protocol):
    """What the driver needs of a device; attributes as in `config.quantities.QUANTITIES`."""

    position_m: float
    pressure_pa: float
    command_pa: float

    @property
    def sample_counter(self) -> int:
        """The number of the sample."""
        ...

    @property
    def device_time_us(self) -> int:
        """The device's clock at the sample."""
        ...

    @property
    def status(self) -> int:
        """The status word."""
        ...

    def tick(self, command_pa: float) -> None:
        """Obey a pressure for one period, then measure.

        Raises:
            ValueError: the device refuses the command; nothing changed.
        """
        ...


class MemoryDriver:
    """Drives a plant directly.

    Args:
        plant: the device.
    """

    capabilities = Capabilities(one_transaction=True, device_time=True, sample_counter=True)

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._is_open = False

    def open(self) -> float:
        """Return the command the plant holds, in Pa."""
        self._is_open = True
        return self._plant.command_pa

    def read(self) -> Reading:
        """Return the last measurement."""
        self._check_open()
        plant = self._plant
        return Reading(
            plant.position_m, plant.pressure_pa, plant.sample_counter, plant.device_time_us / 1e6, int(plant.status)
        )

    def write(self, command_pa: float) -> None:
        """Let one period pass under a command."""
        self._check_open()
        try:
            self._plant.tick(command_pa)
        except ValueError as error:
            raise Refused(f"in memory: {error}", ILLEGAL_VALUE) from None

    def exchange(self, command_pa: float) -> Reading:
        """Let one period pass under a command and return the measurement at its end."""
        self.write(command_pa)
        return self.read()

    def held_pa(self) -> float:
        """Return the command that the plant obeys, in Pa."""
        self._check_open()
        return self._plant.command_pa

    def close(self) -> None:
        """Let go of the plant."""
        self._is_open = False

    def _check_open(self) -> None:
        if not self._is_open:
            raise NoConnection("in memory: the driver is not open")
