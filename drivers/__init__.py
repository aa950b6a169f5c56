"""The buses: one narrow boundary to a device, one file a bus.

`boundary` says what every driver does; `modbus_tcp` talks to a device on Modbus TCP, `memory` to a valve in the
same process and virtual time. A driver knows registers and time-outs, and nothing of control.
"""

from config.device import ModbusTcpDevice
from drivers.boundary import Driver


def driver_for(device: ModbusTcpDevice) -> Driver:
    """Return the driver of a device's bus, not yet open."""
    from drivers.modbus_tcp import ModbusTcpDriver

    return ModbusTcpDriver(device)
