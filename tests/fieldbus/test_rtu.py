"""Modbus RTU frames and times against the specification, and what table `[device]` may say of a serial line."""

from pathlib import Path

import pytest
from modbus_tk.utils import calculate_crc

from config.daemon_file import load_daemon
from config.device import ModbusRtuDevice
from config.errors import InputError
from config.loading import SHIPPED
from config.serial_port import SerialPort
from fieldbus.modbus.register_packing import layout
from fieldbus.modbus.rtu import framed, is_whole


@pytest.mark.parametrize(
    ("data", "wire"),
    [("01 03 00 00 00 0a", "c5 cd"), ("02 07", "41 12"), ("11 03 00 6b 00 03", "76 87")],
)
def test_the_check_sum_is_that_of_the_specification(data: str, wire: str) -> None:
    unit, *pdu = bytes.fromhex(data)
    assert framed(unit, bytes(pdu)) == bytes.fromhex(data + wire)


def test_the_check_sum_is_that_of_an_independent_library() -> None:
    for size in range(1, 254, 7):
        data = bytes((37 * each + size) & 0xFF for each in range(size))
        assert int.from_bytes(framed(data[0], data[1:])[-2:]) == calculate_crc(data)


def test_a_frame_is_whole_or_not() -> None:
    frame = framed(17, b"\3\0\x6b\0\3")
    assert frame == bytes.fromhex("11 03 00 6b 00 03 76 87")
    assert is_whole(frame)
    for bit in range(8 * len(frame)):
        turned = bytearray(frame)
        turned[bit // 8] ^= 1 << bit % 8
        assert not is_whole(bytes(turned)), bit
    assert not is_whole(frame[:-1])
    assert not is_whole(b"")
    assert not is_whole(b"\xff\xff"), "the check sum of nothing"
    assert is_whole(framed(1, bytes(253)))
    assert not is_whole(framed(1, bytes(254))), "longer than 256 bytes"


@pytest.mark.parametrize(
    ("port", "silence_s"),
    [
        (SerialPort(path="-", baud=1200), 3.5 * 11 / 1200),
        (SerialPort(path="-"), 3.5 * 11 / 19200),
        (SerialPort(path="-", baud=9600, parity="none"), 3.5 * 10 / 9600),
        (SerialPort(path="-", baud=9600, parity="none", stop_bits=2), 3.5 * 11 / 9600),
        (SerialPort(path="-", baud=38400), 1.75e-3),
        (SerialPort(path="-", baud=921600, parity="odd"), 1.75e-3),
    ],
)
def test_the_silence_between_frames_is_that_of_the_specification(port: SerialPort, silence_s: float) -> None:
    assert port.silence_s == pytest.approx(silence_s)


SERIAL = 'serial.path = "/dev/ttyUSB0"\n'


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("", "device.serial: is required and missing"),
        ("port = 502\n" + SERIAL, "device.port: unknown key; allowed here: bus, communication_action,"),
        (SERIAL + "serial.baud = 110\n", "device.serial.baud: Input should be 1200, 2400,"),
        (SERIAL + 'serial.parity = "mark"\n', "device.serial.parity: Input should be 'none', 'even' or 'odd'"),
        (SERIAL + "unit = 0\n", "device.unit: Input should be greater than or equal to 1, got 0"),
        (SERIAL + "unit = 248\n", "device.unit: Input should be less than or equal to 247, got 248"),
        (
            SERIAL + "serial.baud = 1200\n",
            "device: reply_timeout_s must be more than 0.2796 s, which a measurement takes at 1200 baud",
        ),
        (SERIAL + "map.position_m = {address = 70000}\n", "device.map.position_m.address: Input should be less"),
    ],
)
def test_what_a_serial_device_cannot_be_is_one_line(tmp_path: Path, table: str, said: str) -> None:
    path = tmp_path / "daemon.toml"
    path.write_text(f'[valve]\nstroke_m = 0.1\n[device]\nbus = "rtu"\n{table}')
    with pytest.raises(InputError) as caught:
        load_daemon(path)
    assert str(caught.value).removeprefix(f"{path}: ").startswith(said)
    assert "\n" not in str(caught.value)


def test_the_serial_profile_is_valid_and_its_period_holds_an_exchange() -> None:
    file = load_daemon(SHIPPED / "profiles" / "daemon_rtu.toml")
    assert isinstance(file.device, ModbusRtuDevice)
    port = file.device.serial
    characters = 17 + 5 + 2 * layout(file.device.map.sampled.values()).words
    assert file.cycle.period_s > characters * port.character_s + 2 * port.silence_s


def test_a_bus_nobody_has_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "daemon.toml"
    path.write_text('[valve]\nstroke_m = 0.1\n[device]\nbus = "rtx"\n')
    with pytest.raises(InputError, match=r"device\.bus: allowed are .*'modbus'.*, got 'rtx'"):
        load_daemon(path)


def test_paths_in_a_file_count_from_its_folder(tmp_path: Path) -> None:
    (tmp_path / "daemon.toml").write_text(
        "[valve]\nstroke_m = 0.1\n[supervisory.tls]\nauthority = 'pki/a.pem'\ncertificate = '/b.pem'\nkey = 'b.key'\n"
    )
    tls = load_daemon(tmp_path / "daemon.toml").supervisory.tls
    assert tls is not None
    assert (tls.authority, tls.certificate, tls.key) == (tmp_path / "pki/a.pem", Path("/b.pem"), tmp_path / "b.key")


def test_a_slow_line_with_a_timeout_that_fits_is_right() -> None:
    port = SerialPort(path="-", baud=1200)
    assert ModbusRtuDevice(serial=port, reply_timeout_s=0.3).serial.baud == 1200
