"""The buses: one narrow boundary to a device, one file a bus. A driver knows registers and time-outs, and no control.

    boundary         what every driver does
    modbus_device    a device on any Modbus: its quantities in requests and replies
    modbus_tcp       on TCP, with TLS where that is asked for
    modbus_rtu       on a serial line: noise, silence, and replies of others
    canopen          on CANopen
    in_memory        a valve in the same process and virtual time

`driver_for` finds drivers by the name of their bus, those of other packages too (`config.bus_plugins`).
"""

from config.bus_plugins import DRIVERS, load_entry
from config.device import Device
from config.entry_points import find_offers
from config.errors import InputError
from drivers.boundary import Driver


def driver_for(device: Device) -> Driver:
    """Return the driver of a device's bus, not yet open.

    Raises:
        InputError: no installed package has one, or it cannot be loaded.
    """
    drivers = find_offers(DRIVERS, "bus")
    if device.bus not in drivers:
        known = ", ".join(sorted(drivers))
        raise InputError("device.bus", f"{device.bus}: no installed package has its driver; there are: {known}")
    driver: Driver = load_entry(drivers[device.bus])(device)
    return driver
