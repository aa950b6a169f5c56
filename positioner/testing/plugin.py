"""pytest's fixtures for projects that talk to a positioner or to its valve (entry point `pytest11`).

    valve_slave          a simulated valve on Modbus TCP, in lockstep unless its table [clock] says otherwise
    fault_proxy          a wire to it that can be spoilt; the daemon is on it where a test asks for it
    positioner_daemon    a daemon on that valve

`valve_slave` and `positioner_daemon` are parametrised indirectly, by the tables of their files (docs/pytest.md).
"""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from positioner.testing import site_files
from positioner.testing.child_process import NotStarted
from positioner.testing.handles import (
    FaultProxy,
    PositionerDaemon,
    ValveSlave,
    daemon_running,
    proxy_running,
    slave_running,
)

__all__ = ["fault_proxy", "positioner_daemon", "valve_slave"]


@pytest.fixture
def valve_slave(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[ValveSlave]:
    """A simulated valve in a process; its parameter is the slave file's tables, `effect` being the valve's."""
    given: site_files.Tables = getattr(request, "param", {})
    with ExitStack() as stack:
        with _or_failed("valve_slave"):
            here = request.path.parent
            (tmp_path / "slave.toml").write_text(site_files.slave_text(given, tmp_path, here), encoding="utf-8")
            stroke_m = site_files.stroke_in(site_files.valve_path(str(given.get("valve", "seed")), here))
            lockstep = site_files.merge_tables(site_files.LOCKSTEP, given)["clock"].get("mode") == "lockstep"
            slave = stack.enter_context(slave_running(tmp_path, stroke_m, lockstep))
        yield slave


@pytest.fixture
def fault_proxy(valve_slave: ValveSlave, tmp_path: Path) -> Iterator[FaultProxy]:
    """A wire to the valve that can be spoilt."""
    with proxy_running(tmp_path, valve_slave.port) as proxy:
        yield proxy


@pytest.fixture
def positioner_daemon(
    request: pytest.FixtureRequest, valve_slave: ValveSlave, tmp_path: Path
) -> Iterator[PositionerDaemon]:
    """A daemon in a process; its parameter is the daemon file's tables."""
    given: site_files.Tables = getattr(request, "param", {})
    on_proxy = "fault_proxy" in request.fixturenames
    port = request.getfixturevalue("fault_proxy").port if on_proxy else valve_slave.port
    text = site_files.daemon_text(given, valve_slave.stroke_m, port, valve_slave.lockstep)
    (tmp_path / "daemon.toml").write_text(text, encoding="utf-8")
    with ExitStack() as stack:
        with _or_failed("positioner_daemon"):
            daemon = stack.enter_context(daemon_running(tmp_path))
        yield daemon


@contextmanager
def _or_failed(fixture: str) -> Iterator[None]:
    """Fail in one line where a process of ours does not start."""
    said = ""
    try:
        yield
    except NotStarted as error:
        said = str(error)
    if said:
        pytest.fail(f"{fixture}: {said}", pytrace=False)
