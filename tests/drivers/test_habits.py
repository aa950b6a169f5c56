"""Devices with habits of their own never start without a key of `[device]`; the error names it, and with it they do."""

import re
import socket
import time
from collections.abc import Callable, Iterator
from threading import Event
from typing import Any

import pytest

from config.daemon_file import DaemonFile
from config.device import ModbusTcpDevice
from drivers import driver_for
from drivers.boundary import DriverError, NoConnection, NoReply
from tests.drivers.raw_device import Habits, RawDevice

pytestmark = pytest.mark.real_time

UNIT, POSITION, COMMAND = 5, 2, 10
REPLY_TIMEOUT_S = 0.3
HELD_PA, PUSH_PA, STEM_M = 41e3, 62e3, 0.0271

Make = Callable[[Habits], RawDevice]


@pytest.fixture
def make() -> Iterator[Make]:
    made: list[RawDevice] = []

    def device(habits: Habits) -> RawDevice:
        made.append(RawDevice(habits))
        made[-1].put_float(POSITION, STEM_M)
        made[-1].put_float(COMMAND, HELD_PA)
        return made[-1]

    yield device
    for each in made:
        each.close()


def described(device: RawDevice, keys: dict[str, Any]) -> ModbusTcpDevice:
    orders: dict[str, Any] = {each: keys[each] for each in ("word_order", "byte_order") if each in keys}
    places: dict[str, dict[str, Any]] = {
        "position_m": {"address": POSITION, **orders},
        "command_pa": {"address": COMMAND, **orders},
    }
    rest = {each: value for each, value in keys.items() if each not in orders}
    return ModbusTcpDevice.model_validate(
        {"port": device.port, "unit": UNIT, "reply_timeout_s": REPLY_TIMEOUT_S, "map": places, **rest}
    )


def driven(device: RawDevice, keys: dict[str, Any]) -> tuple[float, float, float]:
    """Drive it for two cycles; return what it held, where its stem is, and what it was told."""
    driver = driver_for(described(device, keys))
    try:
        held_pa = driver.open()
        for _ in range(2):
            reading = driver.exchange(PUSH_PA)
    finally:
        driver.close()
    return held_pa, reading.position_m, device.get_float(COMMAND)


WHOLE = pytest.approx((HELD_PA, STEM_M, PUSH_PA), rel=1e-6)

CURED: dict[str, tuple[Habits, dict[str, Any], str]] = {
    "silent on function 23": (
        Habits(silent_on=(23,)),
        {"write_functions": [16, 6]},
        "function 23 was never answered: device.write_functions = [16, 6]",
    ),
    "a pause between requests": (Habits(pause_s=0.1), {"pause_s": 0.15}, "device.pause_s"),
    "deaf just after connecting": (Habits(deaf_s=0.4), {"connect_pause_s": 0.5}, "device.connect_pause_s"),
    "a serial line's frames": (Habits(framing="rtu"), {"framing": "rtu"}, 'device.framing = "rtu"'),
    "its own transaction": (
        Habits(transaction=0),
        {"echoes_transaction": False},
        "transaction 0 came, 1 was asked.*device.echoes_transaction = false",
    ),
    "its own unit": (
        Habits(unit=255),
        {"reply_unit": 255},
        "unit 255 answered, unit 5 was asked.*device.reply_unit = 255",
    ),
    "its own unit in a serial line's frames": (
        Habits(framing="rtu", unit=1),
        {"framing": "rtu", "reply_unit": 1},
        'device.framing = "rtu"',
    ),
}


@pytest.mark.parametrize(("habits", "keys", "said"), CURED.values(), ids=CURED)
def test_the_error_names_the_key_and_the_key_cures_it(
    make: Make, habits: Habits, keys: dict[str, Any], said: str
) -> None:
    device = make(habits)
    with pytest.raises(DriverError) as caught:
        driven(device, {})
    assert re.search(said.replace("[", r"\["), str(caught.value))
    assert "\n" not in str(caught.value)
    assert driven(device, keys) == WHOLE


def test_one_that_is_silent_on_function_16_is_written_by_6(make: Make) -> None:
    device = make(Habits(silent_on=(16, 23)))
    places = {name: {"address": at, "type": "uint16"} for name, at in (("position_m", 30), ("command_pa", 31))}
    keys = {"map": places, "port": device.port, "unit": UNIT, "reply_timeout_s": REPLY_TIMEOUT_S}
    device.words |= {30: 0, 31: 40}
    driver = driver_for(ModbusTcpDevice.model_validate({**keys, "write_functions": [16, 6]}))
    driver.open()
    with pytest.raises(NoReply, match=re.escape("function 16 was never answered: device.write_functions = [6]")):
        driver.exchange(50.0)
    driver.close()
    driver = driver_for(ModbusTcpDevice.model_validate({**keys, "write_functions": [6]}))
    assert driver.open() == 40.0
    driver.exchange(50.0)
    driver.close()
    assert device.words[31] == 50


@pytest.mark.parametrize(
    ("habits", "keys"),
    [
        (Habits(framing="rtu", twice_every=7), {"framing": "rtu"}),
        (Habits(transaction=0, twice_every=7), {"echoes_transaction": False}),
        (Habits(twice_every=7), {}),
    ],
    ids=["a serial line's frames", "its own transaction", "numbered"],
)
def test_a_reply_that_comes_twice_is_not_taken_for_the_next(make: Make, habits: Habits, keys: dict[str, Any]) -> None:
    """Each sample after it would be a cycle old, and one more with each that comes twice."""
    device = make(habits)
    driver = driver_for(described(device, keys))
    driver.open()
    kinds = set()
    for cycle in range(40):
        device.put_float(POSITION, float(cycle))
        try:
            assert driver.exchange(PUSH_PA).position_m == cycle
        except DriverError as error:
            kinds.add(error.kind)
            driver.open()
    driver.close()
    assert kinds == {"duplicated reply"}


@pytest.mark.parametrize(("by_words", "by_bytes"), [(False, False), (True, False), (False, True), (True, True)])
def test_a_float_comes_in_any_order_of_words_and_bytes(make: Make, by_words: bool, by_bytes: bool) -> None:
    orders = {
        "word_order": "little" if by_words else "big",
        "byte_order": "little" if by_bytes else "big",
    }
    assert driven(make(Habits(swapped=(by_words, by_bytes))), orders) == WHOLE


def test_a_function_that_the_registers_need_is_not_left_out() -> None:
    with pytest.raises(ValueError, match=r"write_functions: map\.command_pa is written by 16, which is missing"):
        ModbusTcpDevice(write_functions=(23, 6))


def test_a_pause_longer_than_the_cycle_is_refused() -> None:
    tables = {"valve": {"stroke_m": 0.1}, "cycle": {"period_s": 0.02}}
    with pytest.raises(
        ValueError, match=r"device\.pause_s: allowed is less than cycle\.period_s \(0\.02 s\), got 0\.05"
    ):
        DaemonFile.model_validate({**tables, "device": {"pause_s": 0.05}})


def test_a_name_that_nobody_resolves_keeps_the_cycle_no_longer_than_a_reply(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    device, answered, asked = make(Habits()), Event(), Event()
    found = socket.getaddrinfo

    def slow(host: str, *rest: Any) -> Any:
        asked.set()
        answered.wait(30.0)
        return found("127.0.0.1", *rest)

    monkeypatch.setattr(socket, "getaddrinfo", slow)
    config = described(device, {}).model_copy(update={"host": "valve-7"})
    driver = driver_for(config)
    begin_s = time.monotonic()
    with pytest.raises(NoConnection, match="the address of valve-7 is not known within 300 ms"):
        driver.open()
    assert time.monotonic() - begin_s < 10 * REPLY_TIMEOUT_S
    assert asked.is_set()
    answered.set()
    while True:  # the same look-up goes on, and is found by a later attempt
        try:
            assert driver.open() == pytest.approx(HELD_PA)
        except NoConnection:
            continue
        break
    answered.clear()
    assert driver.open() == pytest.approx(HELD_PA), "the address found before is taken where the next look-up hangs"
    answered.set()
    driver.close()
