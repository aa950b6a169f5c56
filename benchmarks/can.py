"""One cycle on CANopen: the loopback CAN bus against udp_multicast, and the daemon's full cycle against a bare loop.

A bare loop is canopen's own: RPDO and SYNC sent, the TPDOs of the sample awaited by its receiving thread. The two buses
are compared by the driver's cycle. Every slave is a process of its own in lockstep; the ways take turns cycle by cycle,
so the ratios hold on a noisy machine; the two buses do in blocks, in which what a bus still does behind an answer
(`udp_multicast` hears its own frames) counts.
"""

import statistics
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import canopen

from benchmarks.bus import ANY_PORT, BLOCK, CYCLES, PUSH_PA, measured, ratio, slave_process
from benchmarks.cycle_time import daemon_loop
from config.canopen_device import SHIPPED_EDS, CanBus, CanopenDevice
from drivers import driver_for
from drivers.boundary import DriverError
from fieldbus.canopen.eds import read_eds
from fieldbus.canopen.objects import ACTIVATE

TARGET_BUS, TARGET_DAEMON = 1.5, 0.8
ROUNDS = 5
REPLY_TIMEOUT_S = 1.0
MULTICAST = CanBus(
    interface="udp_multicast", channel="239.74.163.2", node=1, options={"port": 43120, "hop_limit": 0, "fd": False}
)


def report() -> list[str]:
    """Return lines: cycle rates and their ratios."""
    times: dict[str, list[float]] = {}
    with ExitStack() as stack:
        ways = {
            "bare canopen, loopback bus": stack.enter_context(bare_loop(stack.enter_context(node()))),
            "driver, loopback bus": stack.enter_context(driver_loop(stack.enter_context(node()))),
        }
        try:
            ways["driver, udp_multicast"] = stack.enter_context(driver_loop(stack.enter_context(node(MULTICAST))))
        except (DriverError, RuntimeError) as error:
            unusable = f"udp_multicast cannot be used here: {error}"
        else:
            unusable = ""
        ways["the daemon's full cycle"] = stack.enter_context(
            daemon_loop(driver_for(device_on(stack.enter_context(node()))))
        )
        times = measured(ways)
    middles = {name: statistics.median(taken) for name, taken in times.items()}
    bare = middles["bare canopen, loopback bus"]
    lines = [f"{'one cycle, back to back':32}{'median us':>10}{'99 % us':>10}{'cycles/s':>10}{'rate / bare':>12}"]
    for name, taken in times.items():
        late = statistics.quantiles(taken, n=100)[98]
        lines.append(
            f"{name:32}{middles[name]:10.1f}{late:10.1f}{1e6 / middles[name]:10.0f}{bare / middles[name]:12.2f}"
        )
    full = ratio(times["bare canopen, loopback bus"], times["the daemon's full cycle"])
    lines.append(f"the daemon against the bare loop {full}, target at least {TARGET_DAEMON}")
    if unusable:
        return [*lines, unusable]
    buses = ratio(*of_both_buses())
    return [*lines, f"loopback bus against udp_multicast {buses}, target at least {TARGET_BUS}"]


def of_both_buses() -> tuple[list[float], list[float]]:
    """Return the times of the driver's cycle on udp_multicast and on the loopback bus, us.

    New processes each round: where the machine puts them may favour one bus for as long as they live.
    """
    multicast, loopback = [], []
    for _ in range(ROUNDS):
        with (
            node(MULTICAST) as bus,
            node() as other_bus,
            driver_loop(bus) as on_multicast,
            driver_loop(other_bus) as on_loopback,
        ):
            times = measured({"multicast": on_multicast, "loopback": on_loopback}, CYCLES // 4, block=BLOCK)
        multicast += times["multicast"]
        loopback += times["loopback"]
    return multicast, loopback


def device_on(bus: CanBus) -> CanopenDevice:
    return CanopenDevice.model_validate({**bus.model_dump(), "reply_timeout_s": REPLY_TIMEOUT_S})


@contextmanager
def bare_loop(bus: CanBus) -> Iterator[Callable[[], object]]:
    """Give one cycle of a loop that only talks: canopen alone, configured as its own documentation has it."""
    network = canopen.Network()
    network.connect(**bus.bus_arguments)
    try:
        remote = canopen.RemoteNode(bus.node, read_eds(SHIPPED_EDS, bus.node))
        network.add_node(remote)
        remote.sdo.RESPONSE_TIMEOUT = REPLY_TIMEOUT_S
        remote.nmt.state = "PRE-OPERATIONAL"
        for pdo in (remote.rpdo[1], *(remote.tpdo[n] for n in (1, 2, 3))):
            pdo.read()
        network.unsubscribe(remote.rpdo[1].cob_id)  # udp_multicast hears itself
        remote.sdo[0x6040].raw = int(ACTIVATE)
        remote.nmt.state = "OPERATIONAL"
        came = threading.Event()
        remote.tpdo[3].add_callback(lambda _: came.set())
        command, control = remote.rpdo[1]["command_pa"], remote.rpdo[1]["control_word"]
        position, pressure = remote.tpdo[1]["position_m"], remote.tpdo[1]["pressure_pa"]
        counter, time_us = remote.tpdo[2]["sample_counter"], remote.tpdo[3]["device_time_us"]
        control.raw = int(ACTIVATE)

        def once() -> object:
            came.clear()
            command.raw = PUSH_PA
            remote.rpdo[1].transmit()
            network.sync.transmit()
            if not came.wait(REPLY_TIMEOUT_S):
                raise RuntimeError("no TPDO")
            return position.raw, pressure.raw, counter.raw, time_us.raw

        once()
        yield once
    finally:
        network.disconnect()


@contextmanager
def driver_loop(bus: CanBus) -> Iterator[Callable[[], object]]:
    """Give one cycle of the driver alone."""
    driver = driver_for(device_on(bus))
    driver.open()
    yield lambda: driver.exchange(PUSH_PA)
    driver.close()


@contextmanager
def node(bus: CanBus | None = None) -> Iterator[CanBus]:
    """Run a simulated slave in lockstep; give its bus. By default it is alone on a loopback bus."""
    table = CanBus() if bus is None else bus
    options = "".join(f"{name} = {str(value).lower()}\n" for name, value in table.options.items())
    text = (
        f'[bus]\nkind = "canopen"\ninterface = "{table.interface}"\nchannel = "{table.channel}"\n'
        f"node = {table.node}\n[bus.options]\n{options}"
    )
    with (
        tempfile.TemporaryDirectory() as folder,
        slave_process(Path(folder, "slave.toml"), text, *(() if bus else ANY_PORT)) as ready,
    ):
        yield table if bus else table.model_copy(update={"channel": ready.rsplit(":", 1)[1]})


if __name__ == "__main__":
    print("\n".join(report()))
