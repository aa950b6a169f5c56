"""In a child process: asks a simulated device, or a daemon, what a test wants to know; answers each line with one.

    python -m positioner.testing.agent daemon PORT
    python -m positioner.testing.agent device PORT

A line that comes is {"call": NAME, "given": {...}}, one that goes {"value": ...} or {"error": "why"}.
"""

import json
import sys
from collections.abc import Callable, Mapping
from typing import Any

from config.device import ModbusTcpDevice
from config.errors import CommandFailed, InputError
from drivers import driver_for
from drivers.boundary import DriverError
from positioner.dcs import Dcs, value_of

HOST = "127.0.0.1"
AGENT_WITHIN_S = 20.0
"""A reply that a busy machine gives later is none."""

Calls = Mapping[str, Callable[..., Any]]


def serve(calls: Calls) -> None:
    """Answer line by line until nobody asks any more."""
    print("ready", flush=True)
    for line in sys.stdin:
        print(json.dumps(_answer(calls, json.loads(line))), flush=True)


def _answer(calls: Calls, asked: dict[str, Any]) -> dict[str, Any]:
    try:
        return {"value": calls[asked["call"]](**asked["given"])}
    except (InputError, CommandFailed, DriverError, ValueError) as error:
        return {"error": str(error)}


def daemon_calls(port: int) -> Calls:
    """Return what a daemon can be asked; each on a connection of its own, so that it may have been restarted."""

    def get(names: list[str]) -> dict[str, float]:
        with Dcs(HOST, port, timeout_s=AGENT_WITHIN_S) as dcs:
            return dcs.get_all(*names)

    def write(values: dict[str, float | str]) -> None:
        with Dcs(HOST, port, timeout_s=AGENT_WITHIN_S) as dcs:
            dcs.set_all({name: value_of(name, str(value)) for name, value in values.items()})

    def identify(excitation: dict[str, float], within_s: float) -> str | None:
        with Dcs(HOST, port, timeout_s=AGENT_WITHIN_S) as dcs:
            return dcs.identify(excitation, within_s)

    return {"get": get, "set": write, "identify": identify}


def device_calls(port: int) -> Calls:
    """Return what a device can be asked; on one connection, opened when it is first needed."""
    driver = driver_for(ModbusTcpDevice(host=HOST, port=port, reply_timeout_s=AGENT_WITHIN_S))
    connected: list[float] = []

    def ask(what: Callable[[], Any]) -> Any:
        if not connected:
            connected.append(driver.open())
        try:
            return what()
        except DriverError:
            connected.clear()
            driver.close()
            raise

    return {
        "read": lambda: ask(lambda: driver.read()._asdict()),
        "exchange": lambda command_pa: ask(lambda: driver.exchange(command_pa)._asdict()),
    }


if __name__ == "__main__":
    which, port_text = sys.argv[1:]
    serve({"daemon": daemon_calls, "device": device_calls}[which](int(port_text)))
