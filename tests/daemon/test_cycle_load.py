"""What the cycles of all valves cost is known before they are served: doctor and run refuse more than there is."""

from pathlib import Path

import pytest

from config.daemon_file import DaemonFile, ServiceTable, load_valves
from positioner.cli.main import main
from positioner.daemon import cycle_load as module
from positioner.daemon.cycle_load import ON_THE_WIRE, USABLE, cycle_load, in_memory_s


def file(period_s: float, pace: str = "real_time") -> DaemonFile:
    return DaemonFile.model_validate({"valve": {"stroke_m": 0.1}, "cycle": {"period_s": period_s, "pace": pace}})


def fleet(folder: Path, valves: int, period_s: float) -> Path:
    path = folder / "fleet.toml"
    each = "".join(
        f"[[valve]]\nname = 'V{unit}'\nunit = {unit}\nstroke_m = 0.1\ndevice = {{ port = 1, unit = {unit} }}\n"
        for unit in range(1, valves + 1)
    )
    path.write_text(f"[cycle]\nperiod_s = {period_s}\n[supervisory]\nport = 0\n" + each)
    return path


def test_loads_add_up_and_as_many_fit_as_are_said_to() -> None:
    load = cycle_load([file(0.01), file(0.02), file(0.01, "device")], cost_s=1e-3)
    assert load is not None
    assert (load.valves, load.fits) == (2, True)
    assert load.share == pytest.approx(0.15)
    for valves in (load.most, load.most + 1):
        more = cycle_load([file(0.01), file(0.02)] * (valves // 2) + [file(0.04 / 3)] * (valves % 2), cost_s=1e-3)
        assert more is not None
        assert more.fits == (valves == load.most)
        assert more.share == pytest.approx(valves * load.share / 2)
    assert cycle_load([file(0.01, "device")]) is None


@pytest.mark.parametrize(
    ("cost_s", "asked", "needed", "fits"),
    [
        (1e-3, None, 1, True),
        (9e-3, None, 2, True),
        (30e-3, None, 4, True),
        (90e-3, None, 4, False),
        (9e-3, 1, 1, False),
    ],
)
def test_as_many_processes_as_the_cycles_need_and_no_more_than_processors(
    cost_s: float, asked: int | None, needed: int, *, fits: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "processors", lambda: 4)
    one = file(0.01).model_copy(update={"service": ServiceTable(processes=asked)})
    load = cycle_load([one], cost_s=cost_s)
    assert load is not None
    assert (load.needed, load.fits) == (needed, fits)


def test_more_lines_than_one_process_takes_are_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "processors", lambda: 2)
    for lines, needed in ((100, 1), (101, 2)):
        named = [file(0.1).valve.model_copy(update={"name": f"V{each}"}) for each in range(lines)]
        load = cycle_load([file(0.1).model_copy(update={"valve": each}) for each in named], cost_s=1e-4)
        assert load is not None
        assert load.needed == needed


def test_a_cycle_on_this_machine_takes_some_ten_microseconds_to_a_millisecond_in_memory() -> None:
    cost_s = in_memory_s(file(0.01))
    assert 5e-6 < cost_s < 2e-3
    load = cycle_load([file(0.1)])
    assert load is not None
    assert load.fits
    assert 0.25 < load.cost_s / cost_s / ON_THE_WIRE < 4.0


def test_more_valves_than_any_machine_runs_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "processors", lambda: 2)
    path = fleet(tmp_path, valves=64, period_s=1e-3)
    load = cycle_load(load_valves(path))
    assert load is not None
    assert load.most < 64
    assert load.share > 2 * USABLE
    assert main(["run", str(path)]) == 2
    said = capsys.readouterr().err
    assert "64 valves need" in said
    assert "cycle.period_s" in said
    assert len(said.strip().splitlines()) == 1
