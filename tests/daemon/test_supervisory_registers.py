"""The supervisory registers on a virtual valve: what is read, what is taken, what is refused."""

import logging
import math
from collections.abc import Sequence

import pytest
from pymodbus.constants import ExcCodes

from config.codes import Fault, InhibitReason, Mode, Ne107Status, Quality
from config.registers import BY_NAME, FLOAT_TEST, LONG_TEST, SIZE, WORD_TEST
from drivers.boundary import Capabilities, NoConnection, Reading
from fieldbus.modbus.function_codes import RegisterError
from fieldbus.modbus.server import RegisterServer
from positioner import dcs
from positioner.daemon.supervisory_registers import version_numbers
from tests.daemon.panel import STROKE_M, Panel, refused


@pytest.fixture
def panel() -> Panel:
    return Panel()


def test_every_register_can_be_read_alone_and_all_at_once(panel: Panel) -> None:
    everything = panel.registers.read("input", 0, SIZE)
    for register in BY_NAME.values():
        alone = panel.registers.read("holding", register.address, register.format.words)
        assert list(everything[register.address : register.end]) == list(alone)


def test_the_test_constants_tell_the_word_order(panel: Panel) -> None:
    assert panel.get("word_test") == WORD_TEST
    assert panel.get("long_test") == LONG_TEST
    assert panel.get("float_test") == FLOAT_TEST
    assert panel.registers.read("holding", BY_NAME["long_test"].address, 2) == [0x1234, 0x5678]


def test_it_starts_so_that_nothing_moves(panel: Panel) -> None:
    quiet = {"mode": 0, "eta_1": 1, "eta_2": 1, "eta_3": 1, "state": 0, "fault": 0}
    assert {name: panel.get(name) for name in quiet} == quiet


def test_before_any_write_the_reference_reads_as_the_stem(panel: Panel) -> None:
    panel.run()
    assert panel.get("reference") == pytest.approx(panel.get("position"))
    assert panel.get("position") == pytest.approx(0.02 / STROKE_M)


def test_a_written_reference_reads_back_in_both_scales_and_moves_the_valve_in_automatic(panel: Panel) -> None:
    panel.set("mode", 2)
    panel.set("reference", 0.5)
    assert panel.get("reference") == 0.5
    assert panel.get("reference_scaled") == 5000
    panel.run(500)
    assert panel.get("state") == 1
    assert panel.get("position") == pytest.approx(0.5, abs=0.005)
    assert panel.get("delta_r") == pytest.approx(0.5 - 0.02 / STROKE_M, abs=1e-6)
    assert panel.get("command") == pytest.approx(814e3 * 0.5 * STROKE_M + 22e3)


def test_the_scaled_reference_is_the_same_reference(panel: Panel) -> None:
    panel.set("reference_scaled", 2500)
    assert panel.get("reference") == pytest.approx(0.25)


def test_one_request_may_give_all_commands(panel: Panel) -> None:
    values = {
        "reference": 0.5, "reference_scaled": 5000, "mode": 2, "eta_1": 1, "eta_2": 1, "eta_3": 0, "acknowledge": 0,
        "heartbeat": 7, "manual_pressure": 50e3, "alpha": 40e3, "beta": 10e3, "omega": 2.0,
    }  # fmt: skip
    words = [word for name, value in values.items() for word in BY_NAME[name].format.encode(value)]
    panel.registers.write(0, words, "test")
    panel.run()
    read = {name: panel.get(name) for name in values}
    assert read == values


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("reference", 1.5),
        ("reference", -0.1),
        ("reference", math.nan),
        ("reference", math.inf),
        ("reference_scaled", 10001),
        ("mode", 3),
        ("eta_1", 2),
        ("acknowledge", 2),
        ("omega", 0.0),
        ("alpha", -1.0),
        ("manual_pressure", 200.1e3),
    ],
)
def test_a_value_outside_its_range_is_an_illegal_value(panel: Panel, name: str, value: float) -> None:
    assert refused(panel, name, value) is ExcCodes.ILLEGAL_VALUE


@pytest.mark.parametrize("name", ["state", "position", "a_e", "cycles", "word_test"])
def test_what_is_measured_cannot_be_written(panel: Panel, name: str) -> None:
    assert refused(panel, name, 0) is ExcCodes.ILLEGAL_ADDRESS


@pytest.mark.parametrize(("address", "words"), [(0, [0]), (1, [0]), (1, [0, 0]), (15, [0]), (17, [0]), (900, [0])])
def test_a_part_of_a_value_or_nothing_at_all_is_an_illegal_address(
    panel: Panel, address: int, words: list[int]
) -> None:
    before = panel.cycle.requests
    with pytest.raises(RegisterError) as caught:
        panel.registers.write(address, words, "test")
    assert caught.value.code is ExcCodes.ILLEGAL_ADDRESS
    assert panel.cycle.requests == before


def test_one_bad_value_spoils_its_whole_request(panel: Panel) -> None:
    before = panel.cycle.requests
    with pytest.raises(RegisterError):
        panel.registers.write(0, [*BY_NAME["reference"].format.encode(0.5), 20000], "test")
    assert panel.cycle.requests == before


def test_references_that_disagree_in_one_request_are_refused(panel: Panel) -> None:
    with pytest.raises(RegisterError) as caught:
        panel.registers.write(0, [*BY_NAME["reference"].format.encode(0.5), 4000], "test")
    assert caught.value.code is ExcCodes.ILLEGAL_VALUE


def test_reading_beyond_the_map_is_an_illegal_address(panel: Panel) -> None:
    with pytest.raises(RegisterError) as caught:
        panel.registers.read("holding", SIZE - 1, 2)
    assert caught.value.code is ExcCodes.ILLEGAL_ADDRESS


def test_a_bad_write_is_one_line_in_the_log(panel: Panel, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO), pytest.raises(RegisterError):
        panel.set("reference", 1.5)
    (record,) = caplog.records
    assert record.message == "write refused"
    assert record.__dict__["fields"]["reason"] == "reference: allowed is 0 to 1 p.u., got 1.5"
    assert record.__dict__["fields"]["peer"] == "test"


class Unplugged:
    """What the driver finds where the valve was: nothing."""

    capabilities = Capabilities(one_transaction=True, device_time=True, sample_counter=True)

    def open(self) -> float:
        raise NoConnection("unplugged")

    def read(self) -> Reading:
        raise NoConnection("unplugged")

    def write(self, command_pa: float) -> None:
        raise NoConnection("unplugged")

    def exchange(self, command_pa: float) -> Reading:
        raise NoConnection("unplugged")

    def close(self) -> None:
        pass


def test_a_latched_fault_keeps_the_mode_until_acknowledged(panel: Panel, monkeypatch: pytest.MonkeyPatch) -> None:
    panel.set("mode", 2)
    panel.run()
    with monkeypatch.context() as cable:
        cable.setattr(panel.cycle.link, "driver", Unplugged())
        panel.run(3)
        assert (panel.get("fault"), panel.get("mode"), panel.get("quality")) == (Fault.NO_REPLY, 0, 2)
        assert panel.get("lost_replies") == 3
    panel.run(2)
    assert refused(panel, "mode", 2) is ExcCodes.DEVICE_BUSY
    panel.set("mode", 0)
    panel.set("acknowledge", 1)
    panel.run()
    assert panel.get("fault") == Fault.NONE
    panel.set("mode", 2)
    panel.run()
    assert panel.get("mode") == 2


def test_the_cycle_waits_for_no_request(panel: Panel) -> None:
    """Even one that is being answered, with the server's lock held, for as long as it likes."""
    server = RegisterServer(panel.registers, "127.0.0.1", 0, 1)
    with server.lock:
        panel.run(10)
        assert panel.cycle.snapshot.sample.time_s == pytest.approx(0.011)


def test_estimates_are_served_with_their_reasons(panel: Panel) -> None:
    assert math.isnan(panel.get("a_e"))
    assert panel.get("a_valid") == 0
    assert panel.get("a_reason") == 1
    assert panel.get("b_over_c_applied") == -814e3
    assert panel.get("identifications") == 0


def test_the_age_is_worked_out_when_it_is_read_and_what_is_old_is_not_good(
    panel: Panel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a cycle that stands still."""
    panel.run()
    monkeypatch.setattr(panel.cycle.link, "longest_unattended_s", 1.0)
    for stands_s, quality, fault in ((0.5, Quality.GOOD, Fault.NONE), (2.5, Quality.LOST, Fault.STALLED)):
        monkeypatch.setattr(panel.cycle.pace, "since_s", lambda _now_s, stands_s=stands_s: stands_s)
        assert panel.get("sample_age") == pytest.approx(stands_s)
        assert (panel.get("quality"), panel.get("fault")) == (quality, fault)
        assert (panel.get("ne107") == Ne107Status.FAILURE) == (fault is Fault.STALLED)


class Registers:
    """A client of the panel's registers; while it reads, the daemon cycles."""

    def __init__(self, panel: Panel) -> None:
        self._panel = panel

    def read_holding_registers(self, address: int, count: int) -> list[int]:
        self._panel.run(30)
        return list(self._panel.registers.read("holding", address, count))

    def write_registers(self, address: int, words: Sequence[int]) -> None:
        self._panel.registers.write(address, words, "test")


def test_a_dcs_identifies_though_somebody_left_the_switches_on(panel: Panel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("positioner.dcs.time.sleep", lambda _: None)
    for name, value in {"alpha": 60e3, "beta": 13e3, "eta_1": 0}.items():
        panel.set(name, value)
    for mode in (Mode.AUTOMATIC, Mode.HOLD, Mode.AUTOMATIC):
        panel.set("mode", mode)
        panel.run()
    assert (panel.get("state"), panel.get("why")) == (0, InhibitReason.EXCITATION_FROM_BEFORE)
    client = dcs.Dcs("127.0.0.1", 1)
    monkeypatch.setattr(client, "client", Registers(panel))
    monkeypatch.setattr(client, "decided_since", lambda _: True)
    seen: list[float] = []
    client.identify({"alpha": 60e3, "beta": 13e3}, 5.0, seen.append)
    assert seen[-1] == 1.0, "it was excited to the end"


@pytest.mark.parametrize("text", ["1.2.3", "1.2.3rc1", "1.2.3.dev4+g12ab"])
def test_a_version_is_three_numbers_to_a_client_also_before_its_release(text: str) -> None:
    assert version_numbers(text) == (1.0, 2.0, 3.0)
