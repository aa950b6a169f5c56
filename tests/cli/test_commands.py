"""The commands as a person meets them: help, bad input as one line, exit status."""

import argparse
import csv
import errno
import io
import json
import os
import re
import socket
import struct
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml

import config
from config.recording import read_recording
from config.recording_oddities import odd_settings
from config.registers import REGISTERS
from positioner.cli.main import command_parser, main
from positioner.cli.parts.command_finder import BROUGHT, GROUPS, all_commands

Capture = pytest.CaptureFixture[str]
DAEMON = "[valve]\nstroke_m = 0.1016\n[device]\nport = {port}\n[supervisory]\nport = 0\n"


@pytest.fixture
def free_port() -> Iterator[int]:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        yield listener.getsockname()[1]


def one_line(capture: Capture) -> str:
    out, err = capture.readouterr()
    assert not out
    assert err.count("\n") == 1, err
    return err.strip()


def test_output_that_nobody_reads_ends_a_command_without_a_word() -> None:
    reads, writes = os.pipe()
    os.close(reads)
    mapped = subprocess.run(
        [sys.executable, "-m", "positioner.cli", "map"], stdout=writes, stderr=subprocess.PIPE, text=True, check=False
    )
    os.close(writes)
    assert (mapped.returncode, mapped.stderr) == (141, "")


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_output_that_a_full_disk_does_not_take_is_one_line_and_no_answer(unbuffered: str) -> None:
    with Path("/dev/full").open("w") as full:
        mapped = subprocess.run(
            [sys.executable, "-m", "positioner.cli", "map"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
        )
    said = "positioner map: standard output cannot be written: No space left on device\n"
    assert (mapped.returncode, mapped.stderr) == (2, said)


@pytest.mark.parametrize(
    ("words", "status"), [(["map"], 0), (["page", "--roles", "roles.json", "--set-password", "engineer"], 2)]
)
def test_a_standard_stream_that_is_closed_is_nowhere(words: list[str], status: int, tmp_path: Path) -> None:
    """Python has none then: after the work was done came a traceback, and the status of what does not hold."""
    closed = 'exec "$@" <&- >&- 2>&-'
    command = ["sh", "-c", closed, "sh", sys.executable, "-m", "positioner.cli", *words]
    assert subprocess.run(command, check=False, cwd=tmp_path).returncode == status


def test_help_names_every_command(capsys: Capture) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    everything = capsys.readouterr().out
    headings = [line.strip(" :") for line in everything.splitlines() if re.match(r"  \S.*:$", line)]
    assert headings == [*GROUPS, BROUGHT]
    assert all(re.search(rf"^ +{name}\b", everything, re.MULTILINE) for name in all_commands())


@pytest.mark.parametrize("command", all_commands())
def test_help_of_each_command_ends_with_an_example(command: str, capsys: Capture) -> None:
    with pytest.raises(SystemExit) as caught:
        main([command, "--help"])
    assert caught.value.code == 0
    assert f"example: positioner {command}" in " ".join(capsys.readouterr().out.split())


def test_the_version_is_said(capsys: Capture) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["--version"])
    assert caught.value.code == 0
    assert re.match(r"positioner \d+\.\d+\.\d+", capsys.readouterr().out)


def test_help_needs_nothing_but_the_standard_library() -> None:
    """Instant help, and a gateway without the model side still has it."""
    parsing = "import sys; from positioner.cli.main import command_parser; command_parser(); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", parsing], capture_output=True, text=True, check=True)
    assert not {"numpy", "numba", "pydantic", "pymodbus", "scipy", "sim", "matplotlib"} & set(done.stdout.split())


GATEWAY = """
import sys
import positioner.cli.parts.command_finder as command_finder
command_finder.find_spec = lambda name: None
from positioner.cli.main import command_parser
import positioner.daemon.service
print(command_parser().format_help(), file=sys.stderr)
print(*sys.modules)
"""
"""No extra is installed."""


def test_a_gateway_imports_no_room_beyond_the_daemon_and_is_told_what_an_extra_adds() -> None:
    done = subprocess.run([sys.executable, "-c", GATEWAY], capture_output=True, text=True, check=True)
    imported = {name.partition(".")[0] for name in done.stdout.split()}
    assert not {"northbound", "webpage", "workbench", "sim"} & imported
    said = " ".join(done.stderr.split())
    assert "page needs more: pip install 'positioner[web]'" in said
    assert "diagnose needs more: pip install 'positioner[sim,plot]'" in said


def test_a_package_brings_a_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    (tmp_path / "acme_command.py").write_text(
        "HELP = 'say hello'\nEXAMPLE = 'positioner hello'\n"
        "def add_arguments(parser): pass\ndef run(arguments): print('hello'); return 0\n"
    )
    metadata = tmp_path / "acme-1.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1\n")
    (metadata / "entry_points.txt").write_text(
        "[positioner.commands]\nhello = acme_command\nbroken = acme_nothing\nrun = acme_command\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert main(["hello"]) == 0
    assert main(["broken"]) == 2
    out, err = capsys.readouterr()
    assert out == "hello\n"
    assert err == "positioner: package acme: command 'broken' cannot be loaded: No module named 'acme_nothing'\n"
    assert all_commands()["run"].entry is None, "the roof's own are not replaced"


@pytest.mark.parametrize("missing", ["numba", "llvmlite"])
def test_a_gateway_without_the_model_side_is_told_what_is_missing(missing: str, tmp_path: Path) -> None:
    """numba where no kernel is there yet, without which nothing can be simulated in any case."""
    (tmp_path / f"{missing}.py").write_text(
        f"raise ModuleNotFoundError(\"No module named '{missing}'\", name='{missing}')\n"
    )
    (tmp_path / "pressure.csv").write_text("time_s,command_pa\n0,0\n1,0\n")
    words = ["simulate", "seed", "--input", str(tmp_path / "pressure.csv"), "-o", str(tmp_path / "out.csv")]
    done = subprocess.run(
        [sys.executable, "-m", "positioner.cli", *words],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path)},
    )
    assert done.returncode == 2
    assert f"needs {missing}, which is not installed: pip install 'positioner[sim,plot]'" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "[valve]\nstroke_m = 0.1\nstrok = 1\n",
            "valve.strok: unknown key; allowed here: action, actuator, breakaway_pa, name, stroke_m",
        ),
        ("[valve]\nstroke_m = 0\n", "valve.stroke_m: allowed is 1e-09 to 1e+06, got 0"),
        ("[valve]\n", "valve.stroke_m: is required and missing"),
        ("[valve]\nstroke_m = 0.1\n[memory]\nfolder = '~/kept'\n", "memory.folder: ~ is not read as a home folder"),
        ("[valve\n", "is not valid TOML"),
    ],
)
@pytest.mark.parametrize("command", ["run", "probe", "doctor"])
def test_a_wrong_daemon_file_is_one_line(tmp_path: Path, command: str, text: str, said: str, capsys: Capture) -> None:
    path = tmp_path / "daemon.toml"
    path.write_text(text)
    assert main([command, str(path)]) == 2
    line = one_line(capsys)
    assert line.startswith(f"positioner {command}: {path}: ")
    assert said in line


def test_doctor_names_a_stroke_in_mm_commands_in_bar_and_a_folder_that_is_a_file(
    tmp_path: Path, free_port: int, capsys: Capture
) -> None:
    path = tmp_path / "daemon.toml"
    path.write_text(
        f"[valve]\nstroke_m = 38.0\n[device]\nport = {free_port}\n[memory]\nfolder = 'daemon.toml'\n"
        f"[supervisory]\nport = {free_port}\n"
    )
    assert main(["doctor", str(path)]) == 1
    said = {line[:12].strip(): line[13:] for line in capsys.readouterr().out.splitlines()}
    assert said["config"].startswith("FAILS ")
    assert "38 m: is it in mm?" in said["config"]
    assert said["memory"].startswith("FAILS ")
    assert odd_settings(0.038, 4.2)
    assert not odd_settings(0.1016, 420e3)


@pytest.mark.parametrize("number", ["-1e-9", "-1E3", "-.5e1", "-0.5"])
def test_a_negative_number_with_an_exponent_is_no_option(number: str, free_port: int, capsys: Capture) -> None:
    assert main(["set", "reference", number, "--port", str(free_port)]) == 1
    assert "no daemon answers there" in one_line(capsys)


def test_a_slave_that_is_not_there_is_one_line(tmp_path: Path, free_port: int, capsys: Capture) -> None:
    path = tmp_path / "daemon.toml"
    path.write_text(DAEMON.format(port=free_port))
    assert main(["run", str(path)]) == 2
    line = one_line(capsys)
    assert f"127.0.0.1:{free_port}" in line
    assert str(path) in line


def test_no_daemon_to_talk_to_is_one_line_and_exit_status_1(free_port: int, capsys: Capture) -> None:
    assert main(["get", "position", "--port", str(free_port)]) == 1
    assert "no daemon answers there" in one_line(capsys)


@pytest.mark.parametrize(
    ("encoding", "name", "shown"), [("ascii", "mü.toml", "m\\xfc"), ("utf-8", "m\udcfc.toml", "m\\udcfc")]
)
def test_what_a_terminal_cannot_show_is_escaped(
    encoding: str, name: str, shown: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A letter that the encoding lacks, and a name of a disk in another encoding, ended in a traceback."""
    printed = io.BytesIO()
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(printed, encoding=encoding))
    words = ["valve", "--area-cm2", "700", "--range-bar", "0.2", "1.0", "--stroke-mm", "40", "-o", str(tmp_path / name)]
    assert main(words) == 0
    assert f"{shown}.toml: written" in printed.getvalue().decode(encoding)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "positioner: the following arguments are required: COMMAND; `positioner --help` says more"),
        (["valve"], "required: -o/--out; `positioner valve --help` says more"),
        (["demo", "--bus", "x"], "invalid choice: 'x' (choose from 'modbus', 'canopen', 'rtu')"),
        (["events", "daemon.toml", "--since", "noon"], "positioner events: argument --since: allowed are 30m, 2h, 7d"),
        (["get", "--bogus"], "positioner get: unrecognized arguments: --bogus; `positioner get --help` says more"),
    ],
)
def test_words_that_no_command_takes_are_one_line(
    capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    with pytest.raises(SystemExit) as caught:
        main(words)
    assert caught.value.code == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert said in err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["get", "positio"], "positio: no register of that name; near: position, position_scaled, position_m, "),
        (["get", "refrence"], "refrence: no register of that name; near: reference, "),
        (["get", "zzz"], "zzz: no register of that name; `positioner map` lists all"),
        (["get", "daemon.toml"], "daemon.toml: no register, but a file; the daemon's is given as --config FILE"),
        (["fleet", "plant.csv", "--since", "noon"], "--since: must be a date YYYY-MM-DD, or with a time, got 'noon'"),
        (
            ["valve", "--area-cm2", "700", "--range-bar", "3", "15", "--stroke-mm", "40", "-o", "none.toml"],
            "--range-bar: must be two gauge pressures, the lower first, up to 10 bar (3 to 15 psi are 0.207 to 1.034)",
        ),
        (["map", "--config", "none.toml"], "--config: goes with --format telegraf, modbus-exporter, home-assistant"),
        (["compare", "none.csv", "--valve", ""], "valve file: must be its path or the name of a shipped one, got ''"),
        (["set", "reference", "half"], "reference: allowed is a number, got 'half'"),
        (["set", "mode", "auto"], "mode: allowed is a number, hold, manual, automatic, got 'auto'"),
        (
            ["simulate", "none", "--input", "x.csv", "-o", "y.csv"],
            "none: no shipped valve of that name; there are: ordinary, rotary, seed",
        ),
    ],
)
def test_bad_words_are_one_line_and_exit_status_2(words: list[str], said: str, capsys: Capture) -> None:
    assert main(words) == 2
    assert said in one_line(capsys)


def test_no_command_takes_a_number_that_is_none() -> None:
    """NaN passes a comparison that is to refuse it, so that no option of any command lets it in."""
    commands = next(each for each in command_parser()._actions if isinstance(each, argparse._SubParsersAction))
    parsers: dict[str, argparse.ArgumentParser] = commands.choices
    options = [(parser, each) for parser in parsers.values() for each in parser._actions if each.type is float]
    assert len(options) > 30
    for parser, option in options:
        assert parser._get_value(option, "1.5") == 1.5
        for word in ("nan", "-inf", "1e400", "x"):
            with pytest.raises(argparse.ArgumentError, match="must be a finite number"):
                parser._get_value(option, word)


def test_the_map_is_complete_in_every_format(capsys: Capture) -> None:
    main(["map", "--format", "json"])
    rows = json.loads(capsys.readouterr().out)
    assert {row["name"] for row in rows} == {register.name for register in REGISTERS}
    assert [row["address"] for row in rows] == sorted(register.address for register in REGISTERS)
    assert all(row["address_from_1"] == row["address"] + 1 for row in rows)
    main(["map", "--format", "csv"])
    assert len(list(csv.DictReader(io.StringIO(capsys.readouterr().out)))) == len(rows)
    main(["map"])
    assert len(capsys.readouterr().out.splitlines()) == len(rows) + 2


def test_telegraf_reads_each_value_where_it_stands_of_every_valve(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "fleet.toml"
    path.write_text(
        "".join(
            f"[[valve]]\nname = 'FV-{n}'\nunit = {n}\nstroke_m = 0.1\n[valve.device]\nport = 50{n}\n" for n in (3, 4)
        )
        + "[supervisory]\nport = 5511\n"
    )
    assert main(["map", "--format", "telegraf", "--config", str(path)]) == 0
    inputs = tomllib.loads(capsys.readouterr().out)["inputs"]["modbus"]
    assert [each["name"] for each in inputs] == ["FV-3", "FV-4"]
    for unit, each in zip((3, 4), inputs, strict=True):
        assert each["controller"] == "tcp://127.0.0.1:5511"
        (request,) = each["request"]
        assert (request["slave_id"], request["tags"]) == (unit, {"valve": f"FV-{unit}"})
        assert (request["byte_order"], request["register"]) == ("ABCD", "input")
        for field, register in zip(request["fields"], REGISTERS, strict=True):
            letter = {"FLOAT32": "f", "UINT16": "H", "INT16": "h", "UINT32": "I", "UINT64": "Q"}[field["type"]]
            words = register.format.encode(1.0)
            assert (field["name"], field["address"]) == (register.name, register.address)
            assert struct.unpack(f">{letter}", struct.pack(f">{len(words)}H", *words)) == (1.0,)


READERS = {
    "telegraf": "Telegraf",
    "modbus-exporter": "modbus_exporter",
    "home-assistant": "Home",
    "node-red": "Node-RED",
}


def written_for(reader: str, folder: Path, capsys: Capture) -> str:
    path = folder / "fleet.toml"
    valve = "[[valve]]\nname = 'FV-{0}'\nunit = {0}\nstroke_m = 0.1\n[valve.device]\nport = 50{0}\n"
    path.write_text("".join(valve.format(n) for n in (3, 4)) + "[supervisory]\nport = 5511\n")
    assert main(["map", "--format", reader, "--config", str(path)]) == 0
    return capsys.readouterr().out


def test_modbus_exporter_reads_every_register_as_the_input_register_that_it_is(tmp_path: Path, capsys: Capture) -> None:
    text = written_for("modbus-exporter", tmp_path, capsys)
    assert "# FV-4: /modbus?target=127.0.0.1:5511&sub_target=4&module=positioner" in text
    (module,) = yaml.safe_load(text)["modules"]
    read = {each["name"]: (each["address"], each["dataType"], each["endianness"]) for each in module["metrics"]}
    assert read == {f"positioner_{each.name}": (300_000 + each.address, each.type, "big") for each in REGISTERS}


def test_home_assistant_has_a_hub_for_an_address_and_the_sensors_of_each_valve(tmp_path: Path, capsys: Capture) -> None:
    (hub,) = yaml.safe_load(written_for("home-assistant", tmp_path, capsys))["modbus"]
    assert (hub["type"], hub["host"], hub["port"]) == ("tcp", "127.0.0.1", 5511)
    sensors = {each["unique_id"]: each for each in hub["sensors"]}
    assert len(sensors) == len(hub["sensors"]), "two of one identity"
    position = sensors["positioner_fv_4_position"]
    assert (position["slave"], position["address"], position["input_type"]) == (4, 104, "input")
    assert (position["data_type"], position["unit_of_measurement"], position["precision"]) == ("float32", "p.u.", 6)


def test_node_reds_flow_asks_for_every_register_of_every_valve(tmp_path: Path, capsys: Capture) -> None:
    nodes = {each["id"]: each for each in json.loads(written_for("node-red", tmp_path, capsys))}
    wires = [to for each in nodes.values() for out in each.get("wires", []) for to in out]
    assert set(wires) <= nodes.keys()
    asks = [each for each in nodes.values() if each.get("name") == "ask"]
    assert [re.search(r"unit = (\d+)", each["func"])[1] for each in asks] == ["3", "4"]  # type: ignore[index]
    blocks = json.loads(re.search(r"blocks = (.*);", asks[0]["func"])[1])  # type: ignore[index]
    assert all(count <= 125 for _, count in blocks)
    for register in REGISTERS:
        assert any(start <= register.address and register.end <= start + count for start, count in blocks)


def test_the_data_sheet_is_the_one_that_is_shipped(capsys: Capture) -> None:
    assert main(["map", "--format", "eds"]) == 0
    assert capsys.readouterr().out == (Path(config.__file__).parent / "profiles" / "positioner.eds").read_text()


def test_a_daemon_whose_file_asks_for_certificates_is_not_asked_without(tmp_path: Path, capsys: Capture) -> None:
    """It closed the connection, and nothing said why."""
    path = tmp_path / "daemon.toml"
    tls = "authority = 'a.pem'\ncertificate = 'c.pem'\nkey = 'k.pem'\n"
    path.write_text(DAEMON.format(port=5020) + f"[supervisory.tls]\n{tls}")
    assert main(["get", "position", "--config", str(path)]) == 2
    assert "supervisory.tls: asks for a certificate of whoever connects: --tls" in one_line(capsys)


@pytest.mark.parametrize("reader", READERS)
def test_a_reader_needs_to_know_where_and_speaks_no_tls(reader: str, tmp_path: Path, capsys: Capture) -> None:
    assert main(["map", "--format", reader]) == 2
    assert "needs --config" in one_line(capsys)
    path = tmp_path / "daemon.toml"
    tls = "authority = 'a.pem'\ncertificate = 'c.pem'\nkey = 'k.pem'\n"
    path.write_text(DAEMON.format(port=5020) + f"[supervisory.tls]\n{tls}")
    assert main(["map", "--format", reader, "--config", str(path)]) == 2
    assert READERS[reader] in (said := one_line(capsys))
    assert "speaks no Modbus/TCP Security" in said


def test_simulate_holds_each_pressure_until_the_next_time(tmp_path: Path) -> None:
    """Far above break-away the stem settles where spring and Coulomb friction balance the pressure."""
    pressure = tmp_path / "pressure.csv"
    pressure.write_text("time_s,command_pa\n0,50000\n0.5,0\n1,0\n")
    assert main(["simulate", "seed", "--input", str(pressure), "-o", str(tmp_path / "out.csv")]) == 0
    recording = read_recording(tmp_path / "out.csv")
    np.testing.assert_array_equal(recording.time_s, [0, 0.5, 1])
    up, down = (0.0645 * 50e3 - 1423.4) / 52538, 1423.4 / 52538
    np.testing.assert_allclose(recording.position_m, [0, up, down], atol=2e-5)


def test_play_refuses_a_reference_outside_the_travel(tmp_path: Path, capsys: Capture) -> None:
    reference = tmp_path / "reference.csv"
    reference.write_text("time_s,reference_m\n0,0.05\n1,0.2\n")
    assert main(["play", "seed", "--reference", str(reference), "-o", str(tmp_path / "run.csv")]) == 2
    assert "reference_m: 0.2 m is outside the travel, allowed is 0 to 0.1016 m" in one_line(capsys)


@pytest.mark.parametrize("command", ["run", "probe", "doctor", "events", "metrics", "get", "identify", "page", "sim"])
def test_every_command_is_told_its_file_in_the_same_words(command: str, capsys: Capture) -> None:
    """`run` took it alone, `get` as --config, and neither the other's."""
    assert main([command, "--config", "nowhere.toml"]) == 2
    assert "nowhere.toml: cannot be read: No such file or directory" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["page", "workbench", "metrics", "opcua"])
def test_every_command_that_listens_says_where_in_the_same_words(command: str) -> None:
    said = command_parser().parse_args([command, "--listen-host", "::1", "--listen-port", "7"])
    assert (said.listen_host, said.listen_port) == ("::1", 7)


@pytest.mark.parametrize(("words", "given"), [(["probe"], "none"), (["run", "a.toml", "--config", "b.toml"], "2")])
def test_a_command_needs_its_file_once(words: list[str], given: str, capsys: Capture) -> None:
    assert main(words) == 2
    assert f"CONFIG.toml: one file is needed, got {given}" in capsys.readouterr().err


def test_a_process_that_may_open_no_more_files_says_so_in_a_line(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    def none_left(_: object) -> int:
        raise OSError(errno.EMFILE, "Too many open files", "somewhere.py")

    monkeypatch.setattr("positioner.cli.map.run", none_left)
    assert main(["map"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("may not have so many open files: `ulimit -n` says how many")
