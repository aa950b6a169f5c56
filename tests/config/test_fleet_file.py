"""A daemon's file of several valves: what is common, what is own, and what cannot be."""

from pathlib import Path

import pytest

from config.daemon_file import load_daemon, load_valves
from config.errors import InputError
from config.loading import SHIPPED

COMMON = "[device]\nhost = '10.0.0.1'\nreply_timeout_s = 0.2\n[safety]\naction = 'vent'\nlost_after_cycles = 5\n"
FIRST = "[[valve]]\nname = 'A'\nunit = 1\nstroke_m = 0.1\n[valve.device]\nport = 1\n"
SECOND = "[[valve]]\nname = 'B'\nunit = 2\nstroke_m = 0.2\n[valve.device]\nport = 2\n"
RTU = "device = {{ bus = 'rtu', serial = {{ path = '/dev/ttyS{line}', baud = 115200 }}, unit = {unit} }}\n"


def written(folder: Path, text: str) -> Path:
    path = folder / "fleet.toml"
    path.write_text(text)
    return path


def problem(folder: Path, text: str) -> str:
    path = written(folder, text)
    with pytest.raises(InputError) as caught:
        load_valves(path)
    assert "\n" not in str(caught.value)
    return str(caught.value).removeprefix(f"{path}: ")


def on_a_line(period_s: float, line: int, unit: int) -> str:
    device = RTU.format(line=line, unit=unit)
    return f"[[valve]]\nname = 'L{unit}'\nunit = {unit}\nstroke_m = 0.1\n{device}cycle = {{ period_s = {period_s} }}\n"


def test_a_valve_has_what_is_common_and_over_it_what_is_its_own(tmp_path: Path) -> None:
    text = COMMON + FIRST + SECOND + "[valve.safety]\naction = 'fill'\n"
    first, second = load_valves(written(tmp_path, text))
    assert (first.valve.name, first.valve.stroke_m, first.supervisory.unit) == ("A", 0.1, 1)
    assert (second.valve.name, second.valve.stroke_m, second.supervisory.unit) == ("B", 0.2, 2)
    assert first.device.model_dump(include={"host", "port", "reply_timeout_s"}) == {
        "host": "10.0.0.1", "port": 1, "reply_timeout_s": 0.2,
    }  # fmt: skip
    assert (first.safety.action, first.safety.lost_after_cycles) == ("vent", 5)
    assert (second.safety.action, second.safety.lost_after_cycles) == ("fill", 5)


def test_a_file_of_one_valve_is_what_it_was(tmp_path: Path) -> None:
    path = written(tmp_path, "[valve]\nname = 'A'\nstroke_m = 0.1\n" + COMMON)
    assert load_valves(path) == (load_daemon(path),) == (load_daemon(path, "A"),)
    assert load_daemon(path).supervisory.unit == 1


def test_a_device_on_another_bus_has_all_its_keys_itself(tmp_path: Path) -> None:
    _, second = load_valves(written(tmp_path, COMMON + FIRST + on_a_line(0.2, 0, 2)))
    assert second.device.bus == "rtu"


def test_the_valves_are_found_by_name(tmp_path: Path) -> None:
    path = written(tmp_path, FIRST + SECOND)
    assert load_daemon(path, "B").valve.stroke_m == 0.2
    with pytest.raises(InputError, match=r"has several valves, say which: A, B$"):
        load_daemon(path)
    with pytest.raises(InputError, match=r"valve: allowed are A, B, got C$"):
        load_daemon(path, "C")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (FIRST + SECOND.replace("'B'", "'A'"), "valve.name: two valves have 'A', allowed is one each"),
        (FIRST + SECOND.replace("unit = 2", "unit = 1"), "valve.unit: A and B have 1, allowed is one each"),
        (
            FIRST + SECOND.replace("port = 2", "port = 1\nreply_timeout_s = 0.3"),
            "valve.device: A and B have the same device, unit 1 at 127.0.0.1:1, allowed is one each",
        ),
        (FIRST + SECOND.replace("unit = 2\n", ""), "valve 2 (B): valve.unit: is required and missing"),
        (FIRST + SECOND.replace("name = 'B'\n", ""), "valve 2: valve.name: is required and missing"),
        (FIRST + SECOND.replace("unit = 2", "unit = 0"), "valve 2 (B): supervisory.unit: Input should be greater"),
        (FIRST.replace("stroke_m", "strok_m"), "valve 1 (A): valve.strok_m: unknown key; allowed here: action,"),
        (FIRST + SECOND.replace("port = 2", "prt = 2"), "valve 2 (B): device.prt: unknown key; allowed here: bus,"),
        ("[supervisory]\nunit = 3\n" + FIRST, "valve 1 (A): supervisory.unit: each of several valves has its own"),
        ("valve = [1]\n", "valve 1: is not a table"),
        ("valve = []\n", "valve: must be a table"),
        (COMMON.replace("'vent'", "'open'") + FIRST, "valve 1 (A): safety.action: Input should be 'hold'"),
    ],
)
def test_what_cannot_be_is_one_line(tmp_path: Path, text: str, said: str) -> None:
    assert problem(tmp_path, text).startswith(said)


def test_a_line_needs_a_period_with_room_for_every_devices_time_out(tmp_path: Path) -> None:
    crowded = problem(tmp_path, on_a_line(0.1, 0, 1) + on_a_line(0.1, 0, 2))
    assert crowded.startswith("L1: cycle.period_s must be at least 0.107 s, for 2 valves on line /dev/ttyS0 of which")
    assert len(load_valves(written(tmp_path, on_a_line(0.11, 0, 1) + on_a_line(0.11, 0, 2)))) == 2
    assert len(load_valves(written(tmp_path, on_a_line(0.06, 0, 1) + on_a_line(0.06, 1, 2)))) == 2, "a line each"
    uneven = problem(tmp_path, on_a_line(0.2, 0, 1) + on_a_line(0.3, 0, 2))
    assert uneven == "L2: cycle must be that of L1, which is on the same line /dev/ttyS0"


def nodes(first: str, second: str) -> str:
    """Return a file of two valves on one CAN bus."""
    valve = "[[valve]]\nname = '{0}'\nunit = {1}\nstroke_m = 0.1\n[valve.device]\n{2}\n"
    return "[device]\nbus = 'canopen'\n" + valve.format("A", 1, first) + valve.format("B", 2, second)


@pytest.mark.parametrize(
    ("first", "second", "said"),
    [
        ("node = 7", "node = 7\nsync_cob_id = 0x681", "node 7 on loopback 29500"),
        ("node = 7", "node = 8", "sync_cob_id 0x80 on loopback 29500"),
        ("node = 7", "node = 8\nsync_cob_id = 0x87", "arbitration id 0x87 on loopback 29500, as sync_cob_id and as"),
        ("node = 7\nsync_cob_id = 0x188", "node = 8", "arbitration id 0x188 on loopback 29500, as sync_cob_id and as"),
    ],
)
def test_on_one_can_bus_each_has_its_node_and_its_sync(tmp_path: Path, first: str, second: str, said: str) -> None:
    assert problem(tmp_path, nodes(first, second)).startswith(f"valve.device: A and B have {said}")


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("node = 7", "node = 8\nsync_cob_id = 0x680"),
        ("node = 7", "node = 7\nchannel = '29516'"),
        ("node = 7", "node = 7\ninterface = 'socketcan'"),
        ("node = 7", "node = 7\noptions = { port = 43113 }"),
    ],
)
def test_nodes_that_cannot_be_taken_for_each_other_are_no_clash(tmp_path: Path, first: str, second: str) -> None:
    assert len(load_valves(written(tmp_path, nodes(first, second)))) == 2


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("0x84", "device: sync_cob_id must be none of node 4's own ids, it is 0x84"),
        ("0x65", "device.sync_cob_id: must be 0x80 to 0x100, 0x181 to 0x580 or 0x680 to 0x6df"),
        ("0x604", "device.sync_cob_id: must be 0x80 to 0x100"),
    ],
)
def test_a_sync_that_would_be_taken_for_another_frame_is_refused(tmp_path: Path, value: str, said: str) -> None:
    text = f"[valve]\nstroke_m = 0.1\n[device]\nbus = 'canopen'\nnode = 4\nsync_cob_id = {value}\n"
    assert problem(tmp_path, text).startswith(said)


def test_two_valves_on_one_line_have_their_units_and_the_same_characters(tmp_path: Path) -> None:
    first, second = on_a_line(0.2, 0, 1), on_a_line(0.2, 0, 2)
    same = problem(tmp_path, first + second.replace("unit = 2 }", "unit = 1 }"))
    assert same == "valve.device: L1 and L2 have the same device, unit 1 on /dev/ttyS0, allowed is one each"
    other = problem(tmp_path, first + second.replace("115200", "57600"))
    assert other == "valve.device: L1 and L2 have the line /dev/ttyS0 with other characters, allowed is one each"


def test_the_shipped_fleet_is_valid() -> None:
    files = load_valves(SHIPPED / "profiles" / "fleet.toml")
    assert [file.device.line for file in files] == [None, None, "/dev/ttyUSB0", "/dev/ttyUSB0"]
