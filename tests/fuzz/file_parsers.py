"""Files that people or programs give: configurations, recordings, exports, data sheets, what is kept, certificates."""

import atexit
import hashlib
import json
import os
import shutil
import sqlite3
import tempfile
from base64 import encodebytes
from collections.abc import Callable
from contextlib import closing
from datetime import UTC, datetime
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import Encoding

from config.canopen_device import SHIPPED_EDS
from config.daemon_file import load_valves
from config.errors import InputError
from config.loading import SHIPPED
from config.recording import Recording, read_recording
from config.role_passwords import read_passwords
from config.roles import Role
from config.slave_file import load_slave
from config.valve_file import load_valve, shipped_valve
from fieldbus.canopen.eds import read_eds
from fieldbus.modbus.client_roles import ROLE_OID, identity_in, role_extension
from fieldbus.modbus.tls import Guard, expiry
from positioner.daemon.health.health_file import HealthRecord, read_record, write_record
from positioner.daemon.memory.memory_file import KEYS, VERSION, read_memory, write_memory
from positioner.history.entries import Event
from positioner.history.history_file import FILE_NAME, HistoryFile
from positioner.history.history_reader import HistoryReader
from tests.certificates import folder as certificates
from tests.certificates import revoke, tls
from tests.daemon.memory.test_memory_file import KNOWLEDGE, NOW
from tests.fuzz.parser import Later, Parser, refused_in_one_line, require_line
from workbench.imports.column_mapping import read_mapping
from workbench.imports.export_mapping import read_mapping_file
from workbench.imports.export_preview import preview
from workbench.imports.historian_export import read_export
from workbench.imports.own_format import own_recording

NODE = 5


@cache
def folder() -> Path:
    """Return a folder in memory, if there is such."""
    shared = Path("/dev/shm")
    made = Path(tempfile.mkdtemp(prefix="fuzz-", dir=shared if os.access(shared, os.W_OK) else None))
    maker = os.getpid()
    atexit.register(lambda: shutil.rmtree(made, ignore_errors=True) if os.getpid() == maker else None)
    return made


def written(name: str, data: bytes) -> Path:
    """Return a file that holds an input."""
    path = folder() / name
    path.write_bytes(data)
    return path


def of_file(name: str, *reads: Callable[[Path], object]) -> Callable[[bytes], None]:
    """Return a parser of files."""

    def parse(data: bytes) -> None:
        path = written(name, data)
        for read in reads:
            refused_in_one_line(lambda read=read: read(path), InputError)  # type: ignore[misc]

    return parse


def memory(data: bytes) -> None:
    """Read a file that is none, and one that is whole but for what it says is known."""
    for text in (data, _as_memory(data)):
        path = written("fuzz.memory.json", text)
        kept = read_memory(path, "FV-1", NOW)
        require_line(kept.problem)


def _as_memory(data: bytes) -> bytes:
    try:
        knowledge = json.loads(data)
        content = {"valve": "FV-1", "written": "", "conditions": dict(NOW), "digest": _digest(dict(NOW))}
        content["knowledge"] = knowledge["content"]["knowledge"] if "content" in knowledge else knowledge
        assert content.keys() == KEYS
        return json.dumps({"version": VERSION, "sha256": _digest(content), "content": content}).encode()
    except (ValueError, TypeError, KeyError, RecursionError):
        return data


def _digest(content: Any) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def health(data: bytes) -> None:
    """Read a valve's counts."""
    problem = read_record(written("fuzz.health.json", data), "FV-1", {"scale": "1.0"}).problem
    require_line(problem)


def pem(data: bytes) -> None:
    """Take the files of a server's TLS: certificate, key, authority, list of revoked ones; bytes are made PEM, too."""
    for kinds, text in (
        (("authority", "certificate", "key"), data),
        (("authority", "certificate"), _pem(b"CERTIFICATE", data)),
        (("revoked",), _pem(b"X509 CRL", data)),
    ):
        path = written("fuzz.pem", text)
        for kind in kinds:
            table = tls("daemon").model_copy(update={kind: path})
            refused_in_one_line(lambda table=table: Guard(table, lambda _: Role.ENGINEER), InputError)  # type: ignore[misc]
            refused_in_one_line(lambda table=table: expiry(table), InputError)  # type: ignore[misc]


def _pem(label: bytes, data: bytes) -> bytes:
    return b"-----BEGIN %b-----\n%b-----END %b-----\n" % (label, encodebytes(data), label)


def _hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w", track_order=True) as file:
        for name, values in COLUMNS.items():
            made = file.create_dataset(f"log/{name}", data=values)
            made.attrs["units"] = "s"
        file.create_dataset("matrix", data=np.ones((4, 2)), compression="gzip")
        file.create_dataset("rows", data=np.zeros(4, dtype=[("t", "<f8"), ("x", "<i2")]))


def _tdms(path: Path) -> None:
    import nptdms

    wave = {"unit_string": "%", "wf_increment": 0.1, "wf_start_offset": 0.0}
    with nptdms.TdmsWriter(str(path)) as file:
        file.write_segment([nptdms.ChannelObject("log", name, values, wave) for name, values in COLUMNS.items()])


def _history(path: Path) -> None:
    with HistoryReader(path) as history:
        history.events(limit=20)
        history.events("FV-1", since_s=0.0)


def certificate(data: bytes) -> None:
    """Take who a certificate says its owner is; only what is none of them at all is refused."""
    refused_in_one_line(lambda: identity_in(data), ConnectionAbortedError)


def _preview(path: Path) -> None:
    preview(path).summary()


def _own(path: Path) -> None:
    own_recording(path)


def _import(path: Path) -> None:
    read_export(path, _MAPPING, 0.1)


def _saved(make: Callable[[Path], object], name: str) -> bytes:
    path = folder() / name
    make(path)
    data = path.read_bytes()
    path.unlink()
    return data


def _workbook() -> bytes:
    import openpyxl

    book, file = openpyxl.Workbook(), BytesIO()
    for row in (("time_s", "command_pa", "position_m"), (0.0, 4e4, 0.01), (0.1, 4e4, 0.02)):
        book.active.append(row)
    book.save(file)
    return file.getvalue()


def _history_file() -> bytes:
    with tempfile.TemporaryDirectory() as made:
        history = HistoryFile(Path(made), 30.0, 10)
        history.append([Event("FV-1", n, 1e9 + n, 1, "fault", 2, 1, "no reply") for n in range(30)])
        history.close()
        with closing(sqlite3.connect(Path(made) / FILE_NAME)) as file:
            file.execute("PRAGMA journal_mode = DELETE")
        return (Path(made) / FILE_NAME).read_bytes()


def _certificate() -> bytes:
    key = Ed25519PrivateKey.from_private_bytes(bytes(32))
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "dcs")])
    role = x509.UnrecognizedExtension(x509.ObjectIdentifier(ROLE_OID), role_extension(Role.OPERATOR))
    begin, end = (datetime(year, 1, 1, tzinfo=UTC) for year in (2026, 2027))
    made = x509.CertificateBuilder(name, name, key.public_key(), 7, begin, end)
    return made.add_extension(role, critical=False).sign(key, None).public_bytes(Encoding.DER)


SMALL_SHEET = b"""[DeviceInfo]
VendorNumber=1
[MandatoryObjects]
SupportedObjects=1
1=0x1018
[1018]
ParameterName=Identity
ObjectType=0x9
SubNumber=1
[1018sub1]
ParameterName=Vendor
ObjectType=0x7
DataType=0x0007
AccessType=ro
DefaultValue=$NODEID+0x1
LowLimit=0
"""
RECORDING = Recording(
    {name: np.linspace(0.0, 1.0, 5) for name in ("time_s", "command_pa", "position_m")}, {"valve": "FV-1"}
)
CSV = b"# valve: FV-1\ntime_s,command_pa,position_m\n0,4e4,0.01\n0.1,4.1e4,\n0.2,4e4,0.02\n"
EXPORTS = (
    b'"Time","PV [%]","OUT (kPa)"\n"2026-01-01 00:00:00","1,5","40"\n"2026-01-01 00:00:01","1,6","41"\n',
    "Zeit;PV;OUT\ns;%;bar\n0,1;1;0,4\n0,2;2;0,5\nMittel;3;\n".encode("utf-16"),
)
PASSWORDS = b'{"operator": {"salt": "00ff", "digest": "0011"}}'
COLUMNS = {"t": np.arange(4.0), "x": np.linspace(0.0, 1.0, 4), "u": np.full(4, 4e4)}
MAPPING = b"""[export]
column = ["time_s=Time", "position_m=PV:%", "command_pa=OUT:bar"]
stroke_m = 0.04
range_pa = [2e4, 1e5]
decimal = ","
time_format = "%Y"
status = ["Quality=Good"]
"""
_MAPPING = read_mapping(["time_s=#1", "position_m=#2:%", "command_pa=#3:kPa"])


def file_parsers() -> dict[str, Parser]:
    """Return every parser of files by its name."""
    profiles = {name: (SHIPPED / "profiles" / f"{name}.toml").read_bytes() for name in ("daemon", "fleet", "slave")}
    canopen = tuple((SHIPPED / "profiles" / f"{name}_canopen.toml").read_bytes() for name in ("daemon", "slave"))
    parquet, workbook = Later(lambda: _saved(RECORDING.write, "good.parquet")), Later(_workbook)
    kept = _saved(lambda path: write_memory(path, "FV-1", NOW, KNOWLEDGE), "good.json")
    counts = _saved(
        lambda path: write_record(path, "FV-1", HealthRecord(1.5, 3, 0.5, 7, 2e3), {"scale": "1.0"}), "good.json"
    )
    valves = tuple(shipped_valve(name).read_bytes() for name in ("seed", "ordinary"))
    sheets, daemons = (SHIPPED_EDS.read_bytes(), SMALL_SHEET), (profiles["daemon"], profiles["fleet"], canopen[0])
    certificate_pem, revoked = (certificates() / "daemon.pem").read_bytes(), folder() / "revoked.pem"
    revoke(revoked, "observer")
    return {
        "daemon file": Parser(of_file("d.toml", load_valves), daemons, 4, True),
        "slave file": Parser(of_file("s.toml", load_slave), (profiles["slave"], canopen[1]), 4, True),
        "valve file": Parser(of_file("v.toml", load_valve), valves, 4, True),
        "data sheet": Parser(of_file("e.eds", lambda path: read_eds(path, NODE)), sheets, 1, True),
        "recording": Parser(of_file("r.csv", read_recording, Recording.read), (CSV,), 8, True),
        "recording, Parquet": Parser(of_file("r.parquet", Recording.read, _preview), parquet, 2),
        "export": Parser(of_file("x.txt", _own, _preview, _import), (CSV, *EXPORTS), 2, True),
        "export, HDF5": Parser(of_file("x.h5", _preview, _import), Later(lambda: _saved(_hdf5, "good.h5")), 0.3),
        "export, TDMS": Parser(of_file("x.tdms", _preview, _import), Later(lambda: _saved(_tdms, "good.tdms")), 0.3),
        "mapping file": Parser(of_file("m.toml", read_mapping_file), (MAPPING,), 4, True),
        "export, workbook": Parser(of_file("x.xlsx", _preview, _import), workbook, 0.3),
        "memory file": Parser(memory, (kept,), 2, True),
        "health file": Parser(health, (counts,), 8, True),
        "history file": Parser(of_file("h.sqlite", _history), (_history_file(),), 1),
        "certificate": Parser(certificate, (_certificate(),), 8),
        "certificate files": Parser(pem, (certificate_pem, revoked.read_bytes()), 1, True),
        "passwords": Parser(of_file("p.json", read_passwords), (PASSWORDS,), 8, True),
    }
