"""A node's quantities as the boundary has them: `Reading` and `Capabilities`."""

from collections.abc import Mapping

from config.canopen_device import CanopenDevice
from drivers.boundary import Capabilities, Reading


def reading_of(values: Mapping[str, float], more_status: int = 0) -> Reading:
    """Return the reading of a sample.

    Args:
        values: the sampled quantities by name, in their units.
        more_status: bits of `DeviceStatus` beside the device's own.
    """
    counter, time_us = values.get("sample_counter"), values.get("device_time_us")
    return Reading(
        position_m=values["position_m"],
        pressure_pa=values.get("pressure_pa"),
        sample_counter=None if counter is None else round(counter),
        device_time_s=None if time_us is None else time_us / 1e6,
        status=round(values.get("status", 0)) | more_status,
    )


def capabilities_of(config: CanopenDevice) -> Capabilities:
    """Return what a device can do, by its map."""
    return Capabilities(
        one_transaction=not config.only_watch,
        device_time=config.map.device_time_us is not None,
        sample_counter=config.map.sample_counter is not None,
    )
