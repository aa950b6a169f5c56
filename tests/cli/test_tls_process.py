"""Slave and daemon as processes with Modbus/TCP Security on both sides; `certificates`, and `get`, `set` with roles."""

import json
import socket
import ssl
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from modbus_tk.modbus_tcp import TcpQuery

from config.codes import Mode
from config.daemon_file import load_daemon
from config.errors import CommandFailed
from config.registers import BY_NAME
from config.roles import Role
from config.tls_table import Tls
from northbound.observer.watched_valves import Place, watching
from positioner.cli import doctor
from positioner.cli.main import main
from positioner.cli.parts.children import port_in
from positioner.cli.parts.trial_authority import Authority, Owner
from positioner.dcs import Dcs
from tests.children import ended, running
from tests.daemon_files import LAW
from tests.waiting import until

pytestmark = pytest.mark.real_time

ROLES = ("observer", "operator", "engineer")


@dataclass
class Site:
    """A slave and a daemon that run, and the certificates of all."""

    folder: Path
    port: int

    def files(self, name: str) -> list[str]:
        return [str(self.folder / "pki" / each) for each in ("authority.pem", f"{name}.pem", f"{name}.key")]

    def tls(self, name: str) -> Tls:
        authority, certificate, key = map(Path, self.files(name))
        return Tls(authority=authority, certificate=certificate, key=key, handshake_timeout_s=5.0)

    def refusals(self) -> list[str]:
        lines = [json.loads(line) for line in (self.folder / "daemon.log").read_text().splitlines()]
        return [json.dumps(line) for line in lines if "refused" in json.dumps(line)]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("secured")
    assert main(["certificates", "-o", str(folder / "pki")]) == 0

    def table(name: str) -> str:
        return (
            f'authority = "pki/authority.pem"\ncertificate = "pki/{name}.pem"\nkey = "pki/{name}.key"\n'
            "handshake_timeout_s = 2.0\n"
        )

    (folder / "slave.toml").write_text(
        "[initial]\nposition_m = 0.03\npressure_pa = 24000.0\n[sensor]\nnoise_std_m = 1e-5\n"
        f"[bus.tls]\n{table('device')}"
    )
    with running("sim", folder / "slave.toml", "--listen-port", "0") as slave:
        (folder / "daemon.toml").write_text(
            f"[valve]\nname = 'FV-101'\nstroke_m = 0.1016\n[device]\nport = {port_in(slave)}\n"
            "reply_timeout_s = 0.5\n[device.tls]\n"
            f"{table('daemon')}[supervisory]\nport = 0\n[supervisory.tls]\n{table('daemon')}"
            f"[cycle]\nperiod_s = 2e-3\n{LAW}"
        )
        with running("run", folder / "daemon.toml") as daemon:
            yield Site(folder, port_in(daemon))


def test_each_role_may_write_what_is_its_own_and_a_refusal_is_exception_1_and_one_line(site: Site) -> None:
    values = {"reference": 0.3, "reference_scaled": 3000, "heartbeat": 7, "acknowledge": 0, "eta_1": 1, "mode": 0}
    values |= {
        "eta_2": 1,
        "eta_3": 1,
        "manual_pressure": 24000,
        "alpha": 44126,
        "beta": 13238,
        "omega": 1,
        "experiment_veto": 0,
    }
    operators = {"reference", "reference_scaled", "heartbeat", "acknowledge", "experiment_veto"}
    operators |= {"alarm_acknowledge", "alarm_shelve", "alarm_shelve_time"}
    allowed = {"observer": set[str](), "operator": operators}
    for register in BY_NAME.values():
        assert (register.writer is Role.ENGINEER) == (register.name not in operators), register
    for role in ROLES:
        with Dcs("127.0.0.1", site.port, tls=site.tls(role)) as dcs:
            before, lines = dcs.get_all(*values), len(site.refusals())
            for name, value in values.items():
                if name in allowed.get(role, values):
                    dcs.set(name, value)
                    continue
                with pytest.raises(CommandFailed, match="exception 1, illegal function"):
                    dcs.set(name, 1)
                lines += 1
                until(lambda n=lines: len(site.refusals()) == n, "the line")  # type: ignore[misc]
                needed = BY_NAME[name].writer.name.lower()
                assert f"function 16 needs the role {needed}" in site.refusals()[-1]
                assert f"{role} ({role}) at 127.0.0.1:" in site.refusals()[-1]
            if role == "observer":
                settings = values.keys() - {"reference", "reference_scaled", "manual_pressure"}  # these follow the stem
                assert {name: dcs.get(name) for name in settings} == {name: before[name] for name in settings}


def test_a_write_of_several_registers_needs_the_highest_role_and_is_refused_whole(site: Site) -> None:
    with Dcs("127.0.0.1", site.port, tls=site.tls("engineer")) as engineer:
        engineer.set_all({"reference": 0.3, "mode": 0})
    with Dcs("127.0.0.1", site.port, tls=site.tls("operator")) as operator:
        with pytest.raises(CommandFailed, match="exception 1"):
            operator.set_all({"reference": 0.5, "reference_scaled": 5000, "mode": Mode.AUTOMATIC})
        assert operator.get("reference") == pytest.approx(0.3)
        operator.set_all({"reference": 0.35, "reference_scaled": 3500})
        assert operator.get("reference") == pytest.approx(0.35)


def test_get_and_set_move_the_valve_with_the_certificates_of_the_command(
    site: Site, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(*words: str, role: str) -> tuple[int, str]:
        status = main([*words, "--port", str(site.port), "--tls", *site.files(role)])
        captured = capsys.readouterr()
        return status, captured.out + captured.err

    assert run("set", "mode", "automatic", role="operator")[0] == 1
    assert run("set", "mode", "automatic", role="engineer") == (0, "")
    assert run("set", "reference", "0.6", role="operator") == (0, "")
    until(lambda: abs(float(run("get", "position", role="observer")[1]) - 0.6) < 0.005, "the stem at the reference")
    assert run("set", "mode", "hold", role="engineer") == (0, "")
    status, said = run("get", "position", role="device")
    assert (status, said.count("\n")) == (1, 1)
    assert "unsupported certificate" in said
    assert main(["get", "position", "--port", str(site.port)]) == 1
    assert "cannot be read" in capsys.readouterr().err


def test_an_independent_client_gets_in_by_the_same_certificates(site: Site) -> None:
    """TLS by the standard library alone, frames by modbus-tk."""
    context = ssl.create_default_context(cafile=site.tls("observer").authority)
    context.load_cert_chain(site.tls("observer").certificate, site.tls("observer").key)
    with (
        socket.create_connection(("127.0.0.1", site.port), timeout=60) as plain,
        context.wrap_socket(plain, server_hostname="127.0.0.1") as line,
    ):

        def ask(pdu: bytes) -> bytes:
            query = TcpQuery()
            line.sendall(query.build_request(pdu, 1))
            answer: bytes = query.parse_response(line.recv(260))
            return answer

        read = struct.pack(">BHH", 4, BY_NAME["float_test"].address, 2)
        assert ask(read) == b"\4\4" + struct.pack(">f", 1234.5)
        assert ask(struct.pack(">BHHBHH", 16, 0, 2, 4, 0, 0)) == b"\x90\1"


def test_handshakes_and_refused_clients_do_not_touch_the_cycle(site: Site) -> None:
    with Dcs("127.0.0.1", site.port, tls=site.tls("observer")) as dcs:
        before = dcs.get_all("cycles", "lost_replies", "fault")
        for _ in range(30):
            with Dcs("127.0.0.1", site.port, tls=site.tls("operator")) as other:
                other.set("heartbeat", 1)
        until(lambda: dcs.get("cycles") > before["cycles"] + 200, "cycles")
        assert dcs.get_all("lost_replies", "fault") == {name: before[name] for name in ("lost_replies", "fault")}


def test_doctor_watches_the_certificates(site: Site, tmp_path: Path) -> None:
    file = load_daemon(site.folder / "daemon.toml")
    assert doctor.check_certificates(file, site.folder).startswith("device.tls until 20")
    (tmp_path / "short").mkdir()
    authority = Authority(tmp_path / "short", days=doctor.LEAST_DAYS)
    authority.sign(Owner("daemon", ("127.0.0.1",), Role.OPERATOR))
    short = {
        name: tmp_path / "short" / f"{stem}"
        for name, stem in {"authority": "authority.pem", "certificate": "daemon.pem", "key": "daemon.key"}.items()
    }
    assert file.supervisory.tls is not None
    tls = file.supervisory.tls.model_copy(update=short)
    changed = file.model_copy(update={"supervisory": file.supervisory.model_copy(update={"tls": tls})})
    with pytest.raises(doctor.FailedCheck, match=r"daemon\.pem or its authority's ends on 20"):
        doctor.check_certificates(changed, tmp_path)
    gone = tls.model_copy(update={"key": tmp_path / "gone.key"})
    changed = file.model_copy(update={"supervisory": file.supervisory.model_copy(update={"tls": gone})})
    with pytest.raises(doctor.FailedCheck, match=r"gone\.key: cannot be read"):
        doctor.check_certificates(changed, tmp_path)


def test_certificates_are_never_written_over_and_bad_input_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pki = tmp_path / "pki"
    assert main(["certificates", "-o", str(pki), "--host", "gateway-7", "--host", "10.0.0.7", "--days", "2"]) == 0
    assert {path.name for path in pki.iterdir()} == {
        f"{name}.{kind}" for name in ("authority", "device", "daemon", *ROLES) for kind in ("pem", "key")
    }
    assert all(path.stat().st_mode & 0o077 == 0 for path in pki.glob("*.key")), "keys are the owner's alone"
    before = {path: path.read_bytes() for path in pki.iterdir()}
    for words, said in {
        ("-o", str(pki)): "must be a new or empty folder",
        ("-o", str(tmp_path / "new"), "--host", "no host"): "must be a host name or an IP address",
        ("-o", "/proc/none"): "cannot be written",
    }.items():
        capsys.readouterr()
        assert main(["certificates", *words]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert said in error
    assert before == {path: path.read_bytes() for path in pki.iterdir()}
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("there", [False, True])
def test_certificates_that_are_broken_off_leave_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: bool
) -> None:
    def interrupted(self: Authority, owner: Owner) -> None:
        raise KeyboardInterrupt

    pki = tmp_path / "keys" / "pki"
    if there:
        pki.mkdir(parents=True)
    monkeypatch.setattr(Authority, "sign", interrupted)
    assert main(["certificates", "-o", str(pki)]) == 130
    assert list(tmp_path.rglob("*")) == ([pki.parent, pki] if there else [])


def test_a_missing_certificate_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "daemon.toml").write_text(
        "[valve]\nstroke_m = 0.1016\n[device.tls]\nauthority = 'a.pem'\ncertificate = 'b.pem'\nkey = 'b.key'\n"
    )
    (tmp_path / "slave.toml").write_text(
        "[bus.tls]\nauthority = 'a.pem'\ncertificate = 'b.pem'\nkey = 'b.key'\n[clock]\nmode = 'lockstep'\n"
    )
    for command, name in (("run", "daemon.toml"), ("sim", "slave.toml")):
        done = ended(command, tmp_path / name)
        assert (done.status, done.log.count("\n")) == (2, 1), done.log
        assert f"{tmp_path / 'a.pem'}: cannot be read: No such file" in done.log


def test_the_operators_page_reads_as_an_observer_and_writes_with_the_certificate_of_the_role(site: Site) -> None:
    tls_of = {Role.OPERATOR: site.tls("operator"), Role.ENGINEER: site.tls("observer")}
    place = Place("FV-101", "127.0.0.1", site.port, 1, 0.1016, None, site.tls("observer"), tls_of)
    with watching([place]) as (valve,):
        until(lambda: valve.picture().freshness.live, "a live picture")
        known = len(site.refusals())
        done = valve.commands.set_reference(Role.OPERATOR, 0.31)
        assert done.done, done.text
        until(lambda: valve.picture().value("reference") == pytest.approx(0.31), "the reference")
        # The page grants what it may; the daemon asks the certificate, and this one is not an engineer's.
        refused = valve.commands.set_mode(Role.ENGINEER, Mode.HOLD)
        assert not refused.done
        assert "illegal function" in refused.text
        until(lambda: len(site.refusals()) == known + 1, "the line")
