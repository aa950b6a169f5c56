"""`positioner page`: what it is told wrong is one line; whom it connects to, and as whom."""

import io
from pathlib import Path

import pytest

from config.errors import CommandFailed, InputError
from config.roles import Role
from northbound.observer.watched_valves import Place
from northbound.operator_page import command as page
from positioner.cli.main import command_parser, main
from tests.certificates import folder

VALVE = "[valve]\nname = '{name}'\nstroke_m = 0.1\n[supervisory]\nport = {port}\n[recorder]\nfolder = 'rec'\n"


def places(*words: str) -> list[Place]:
    return list(page.daemon_places(command_parser().parse_args(["page", *words])))


def daemon(path: Path, name: str, port: int) -> str:
    path.write_text(VALVE.format(name=name, port=port))
    return str(path)


def test_every_valve_of_every_file_is_watched(tmp_path: Path) -> None:
    first = daemon(tmp_path / "a.toml", "FV-101", 5601)
    second = daemon(tmp_path / "b.toml", "FV-102", 5602)
    a, b = places("--config", first, "--config", second)
    assert (a.name, a.port, a.stroke_m, a.recordings) == ("FV-101", 5601, 0.1, tmp_path / "rec")
    assert (b.name, b.port) == ("FV-102", 5602)


def test_without_a_file_an_address_is_enough() -> None:
    (place,) = places("--host", "gateway-7", "--port", "802", "--unit", "3")
    assert (place.name, place.host, place.port, place.unit) == ("gateway-7:802", "gateway-7", 802, 3)
    assert place.stroke_m is None


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--config", "nowhere.toml"], "nowhere.toml"),
        (["--config", "a.toml", "--config", "a.toml"], "a.toml: valve.name: 'FV-101' is also in another file"),
        (["--config", "a.toml", "--port", "802"], "--port: names the daemon, and so does --config"),
        (["--port", "99999"], "the daemon: port: "),
        (["--roles", "nowhere.json"], "nowhere.json: cannot be read"),
        (["--set-password", "operator"], "--set-password: needs --roles FILE"),
        (["--write-tls", "a.pem", "a.key"], "--write-tls: needs --tls"),
        (["--listen-host", "0.0.0.0"], "0.0.0.0: can be reached by others: to listen there needs a password"),
    ],
)
def test_what_is_wrong_is_one_line(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    daemon(tmp_path / "a.toml", "FV-101", 5601)
    assert main(["page", "--no-open", *words]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_a_password_is_read_from_standard_input_where_nobody_sits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("valves-and-more\n"))
    assert main(["page", "--set-password", "engineer", "--roles", str(tmp_path / "roles.json")]) == 0
    assert (tmp_path / "roles.json").exists()


def test_each_role_connects_with_its_own_certificate_and_none_with_anothers() -> None:
    pki = folder()
    observer = [str(pki / each) for each in ("authority.pem", "observer.pem", "observer.key")]
    operator = [str(pki / each) for each in ("operator.pem", "operator.key")]
    (place,) = places("--tls", *observer, "--write-tls", *operator)
    assert set(place.tls_of) == {Role.OPERATOR}
    assert place.connection(Role.OBSERVER)
    assert place.connection(Role.OPERATOR)
    with pytest.raises(CommandFailed, match="the page has no certificate of the role engineer"):
        place.connection(Role.ENGINEER)
    with pytest.raises(InputError, match="is no certificate in PEM form"):
        places("--tls", *observer, "--write-tls", operator[1], operator[1])
