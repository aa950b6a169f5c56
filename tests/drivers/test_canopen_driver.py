"""The contract on CANopen, between the threads of one process over the loopback CAN bus."""

from collections.abc import Callable, Iterator

import pytest

from config.canopen_device import CanBus, CanopenDevice
from config.valve_file import shipped_valve
from drivers.canopen.driver import canopen_driver
from fieldbus.canopen.loopback import free_channel
from sim.slave import canopen_slave
from sim.slave.canopen_slave import NodeServer
from sim.slave.clocks import Lockstep
from sim.slave.simulated_device import Device
from sim.slave.slave import device_of
from tests.drivers.test_driver_contract import FILE, Bench, WireBench, WireContract

pytestmark = pytest.mark.real_time

NODE = 5


def serve(device: Device, channel: str) -> NodeServer:
    node = NodeServer(CanBus(channel=channel, node=NODE), device, Lockstep(device), "contract")
    node.start()
    return node


class TestCanopen(WireContract):
    reply_timeout_s = 2.0

    @pytest.fixture
    def make(self, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[], Bench]]:
        monkeypatch.setattr(canopen_slave, "LISTEN_S", 0.0)  # nobody else is on the channel
        benches: list[WireBench] = []

        def make() -> WireBench:
            device = device_of(FILE, shipped_valve("seed"))
            channel = free_channel()
            server = serve(device, channel)
            config = CanopenDevice(
                channel=channel,
                node=NODE,
                reply_timeout_s=self.reply_timeout_s,
                heartbeat_s=2.0,
                communication_timeout_s=1.5,
                communication_action="vent",
            )
            benches.append(WireBench(device, canopen_driver(config), server))
            return benches[-1]

        yield make
        for bench in benches:
            bench.driver.close()
            bench.server.stop()

    def serve(self, device: Device, address: str | None) -> NodeServer:
        return serve(device, (address or free_channel()).rpartition(":")[2])
