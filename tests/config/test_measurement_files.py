"""MATLAB, HDF5, MATLAB 7.3, TDMS and MDF4 as their own libraries write them: the same recording out of each."""

import shutil
import struct
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from config.errors import InputError
from tests.cases import few_always
from workbench.imports import matlab_reader, mdf4_reader, reader_process
from workbench.imports.column_mapping import ExportOptions, read_mapping
from workbench.imports.export_preview import preview
from workbench.imports.historian_export import read_export

TIME_S = np.arange(0.0, 2.0, 0.01)
POSITION_MM = 20.0 + 10.0 * np.sin(TIME_S)
COMMAND_BAR = 0.6 + 0.2 * np.cos(TIME_S)
LINKS = 24
"""Where the links of a block of MDF 4 begin; the first is that to the next."""
NAME_TYPE = 128 + 6 * 8
"""Where a MATLAB file says of what type the name of its first matrix is: behind its head, and six times eight bytes."""


def write_hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        group = file.create_group("run 1")
        for name, values, unit in (("t", TIME_S, "s"), ("PV", POSITION_MM, "mm"), ("OUT", COMMAND_BAR, "bar")):
            group[name] = values
            group[name].attrs["units"] = unit
        group["note"] = "by nobody"
        group["image"] = np.zeros((3, 4, 5))
        file["calibration"] = np.arange(7.0)


def write_old_matlab(path: Path) -> None:
    from scipy.io import savemat

    savemat(path, {"t": TIME_S, "log": {"PV": POSITION_MM, "OUT": COMMAND_BAR}, "grid": np.zeros((3, 4, 5))})


def write_matlab(path: Path) -> None:
    """As `save -v7.3` writes a structure of column vectors: 512 bytes before, turned round, classes as attributes."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        log = file.create_group("log")
        log.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, values in (("t", TIME_S), ("PV", POSITION_MM), ("OUT", COMMAND_BAR)):
            log.create_dataset(name, data=values[None, :]).attrs["MATLAB_class"] = np.bytes_("double")
        text = log.create_dataset("who", data=np.frombuffer(b"nobody", np.uint8).astype(np.uint16)[:, None])
        text.attrs["MATLAB_class"] = np.bytes_("char")
        file.create_group("#refs#")["a"] = np.arange(9.0)
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Nov 23 06:00:00 2026 HDF5 schema 1.00 ."
    with path.open("r+b") as file:
        file.write(head.ljust(124) + b"\x00\x02IM")


def write_tdms(path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    told = {"wf_increment": 0.01, "wf_start_offset": 0.0, "wf_samples": len(TIME_S)}
    with TdmsWriter(path) as writer:
        writer.write_segment(
            [
                ChannelObject("rig", "PV", POSITION_MM, properties={"unit_string": "mm", **told}),
                ChannelObject("rig", "OUT", COMMAND_BAR, properties={"unit_string": "bar", **told}),
                ChannelObject("slow", "temperature", np.arange(3.0)),
            ]
        )


def write_mdf(path: Path) -> None:
    import asammdf

    with asammdf.MDF(version="4.10") as file:
        signals = [
            asammdf.Signal(samples=values, timestamps=TIME_S, name=name, unit=unit)
            for name, values, unit in (("PV", POSITION_MM, "mm"), ("OUT", COMMAND_BAR, "bar"))
        ]
        file.append(signals)
        file.append([asammdf.Signal(samples=np.arange(3.0), timestamps=np.arange(3.0), name="temperature")])
        file.save(path, overwrite=True)


FILES: dict[str, tuple[Callable[[Path], None], list[str]]] = {
    "run.h5": (write_hdf5, ["time_s=run 1.t", "position_m=run 1.PV", "command_pa=run 1.OUT"]),
    "old.mat": (write_old_matlab, ["time_s=t:s", "position_m=log.PV:mm", "command_pa=log.OUT:bar"]),
    "run.mat": (write_matlab, ["time_s=log.t", "position_m=log.PV:mm", "command_pa=log.OUT:bar"]),
    "run.tdms": (write_tdms, ["time_s=time", "position_m=PV", "command_pa=OUT"]),
    "run.mf4": (write_mdf, ["time_s=time", "position_m=PV", "command_pa=OUT"]),
}
each_file = pytest.mark.parametrize("name", FILES)


@pytest.fixture
def read_in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process of its own loads its library for seconds; files that are damaged, or marked, are read in one."""
    for reader in (matlab_reader, mdf4_reader):
        read_here = reader.read_here
        monkeypatch.setattr(reader, "read_apart", lambda path, _module, _kind, read_here=read_here: read_here(path))


@each_file
@pytest.mark.usefixtures("read_in_this_process")
def test_what_is_proposed_reads_it_as_it_was_measured(name: str, tmp_path: Path) -> None:
    write, words = FILES[name]
    write(tmp_path / name)
    proposed = [word for word in preview(tmp_path / name).words if "=" in word]
    assert [word.partition("=")[0] for word in proposed] == ["time_s", "position_m", "command_pa"]
    says_units = ":" not in words[1]
    recording = read_export(tmp_path / name, read_mapping(proposed if says_units else words), 0.04)
    np.testing.assert_allclose(recording.time_s, TIME_S, atol=1e-12)
    np.testing.assert_allclose(recording.position_m, 1e-3 * POSITION_MM)
    np.testing.assert_allclose(recording.columns["command_pa"], 1e5 * COMMAND_BAR)


@each_file
@pytest.mark.parametrize("kept", few_always([0.5, 0.1, 0.9]))
def test_a_torn_file_is_one_line_or_what_is_left_of_it(name: str, kept: float, tmp_path: Path) -> None:
    write, words = FILES[name]
    write(tmp_path / name)
    content = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(content[: round(kept * len(content))])
    assert said_of(tmp_path / name, words).count("\n") == 0


def test_a_file_that_ends_its_reader_or_keeps_it_for_ever_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a channel group whose second channel is followed by the first again asammdf reads channels without end."""
    write_mdf(tmp_path / "run.mf4")
    content = bytearray((tmp_path / "run.mf4").read_bytes())
    first, second = [at for at in range(len(content)) if content[at : at + 4] == b"##CN"][:2]
    content[second + LINKS : second + LINKS + 8] = struct.pack("<Q", first)
    (tmp_path / "run.mf4").write_bytes(content)
    monkeypatch.setattr(reader_process, "LONGEST_READ_S", 1.0)
    with pytest.raises(InputError, match="is a damaged MDF file: its reader comes to no end in 1 s"):
        preview(tmp_path / "run.mf4")
    monkeypatch.setattr(reader_process, "sys", SimpleNamespace(executable=shutil.which("false")))
    with pytest.raises(InputError, match="is a damaged MDF file: its reader breaks down, status 1"):
        preview(tmp_path / "run.mf4")


def test_a_matlab_file_that_ends_its_reader_is_one_line(tmp_path: Path) -> None:
    """A name of a type that there is none of ends scipy 1.17's reader by a signal."""
    write_old_matlab(tmp_path / "old.mat")
    content = bytearray((tmp_path / "old.mat").read_bytes())
    content[NAME_TYPE] = 255
    (tmp_path / "old.mat").write_bytes(content)
    with pytest.raises(InputError, match=r"is a damaged MATLAB file: [^\n]*$"):
        preview(tmp_path / "old.mat")


def test_what_mdf_marks_invalid_is_missing_and_moves_no_other_row(tmp_path: Path) -> None:
    """asammdf leaves them out of each channel by itself: as many here and there made a table of shifted rows."""
    import asammdf

    invalid = {"PV": slice(20, 30), "OUT": slice(150, 160)}
    with asammdf.MDF(version="4.10") as file:
        signals = []
        for name, values, unit in (("PV", POSITION_MM, "mm"), ("OUT", COMMAND_BAR, "bar")):
            bits = np.zeros(len(TIME_S), dtype=bool)
            bits[invalid[name]] = True
            signals.append(asammdf.Signal(values, TIME_S, name=name, unit=unit, invalidation_bits=bits))
        file.append(signals)
        file.save(tmp_path / "run.mf4", overwrite=True)
    recording = read_export(tmp_path / "run.mf4", read_mapping(FILES["run.mf4"][1]), None)
    expected_m, expected_pa = 1e-3 * POSITION_MM, 1e5 * COMMAND_BAR
    expected_m[invalid["PV"]], expected_pa[invalid["OUT"]] = np.nan, np.nan
    np.testing.assert_allclose(recording.time_s, TIME_S, atol=1e-12)
    np.testing.assert_allclose(recording.position_m, expected_m)
    np.testing.assert_allclose(recording.columns["command_pa"], expected_pa)


@pytest.mark.usefixtures("read_in_this_process")
def test_an_angle_by_which_mdf_goes_is_no_time(tmp_path: Path) -> None:
    """Degrees of a crank were offered, and read, as seconds."""
    import asammdf

    angle = ("crank", asammdf.blocks.v4_constants.SYNC_TYPE_ANGLE)
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(POSITION_MM, TIME_S, name="PV", unit="mm", master_metadata=angle)])
        file.save(tmp_path / "run.mf4", overwrite=True)
    shown = preview(tmp_path / "run.mf4")
    assert [each.name for each in shown.columns] == ["crank [deg]", "PV [mm]"]
    assert not any(word.startswith("time_s") for word in shown.words)


@pytest.mark.parametrize(
    "other",
    [
        {"wf_increment": 0.02},
        {"wf_start_offset": 0.3},
        {"wf_start_time": np.datetime64("2026-01-01T00:00:01")},
    ],
    ids=lambda other: next(iter(other)),
)
def test_waveforms_of_tdms_of_other_times_are_joined_each_by_its_own(other: dict[str, object], tmp_path: Path) -> None:
    """As many samples of twice the spacing stood beside one another as if they were of the same time."""
    from nptdms import ChannelObject, TdmsWriter

    told = {"wf_start_time": np.datetime64("2026-01-01T00:00:00"), "wf_start_offset": 0.0, "wf_increment": 0.01}
    of_command = told | other
    with TdmsWriter(tmp_path / "run.tdms") as writer:
        writer.write_segment(
            [
                ChannelObject("rig", "PV", POSITION_MM, properties={"unit_string": "mm", **told}),
                ChannelObject("rig", "OUT", COMMAND_BAR, properties={"unit_string": "bar", **of_command}),
            ]
        )
    recording = read_export(tmp_path / "run.tdms", read_mapping(FILES["run.tdms"][1]), None)
    late_s = float((of_command["wf_start_time"] - told["wf_start_time"]) / np.timedelta64(1, "s"))  # type: ignore[operator]
    own_s = late_s + of_command["wf_start_offset"] + of_command["wf_increment"] * np.arange(200)  # type: ignore[operator]
    np.testing.assert_allclose(recording.position_m, 1e-3 * np.interp(recording.time_s, TIME_S, POSITION_MM))
    held = COMMAND_BAR[np.searchsorted(own_s, recording.time_s + 1e-9, side="right") - 1]
    np.testing.assert_allclose(recording.command_pa, 1e5 * held)
    assert recording.time_s[0] == pytest.approx(max(0.0, own_s[0]))


def test_what_netcdf_packs_is_unpacked_and_what_it_marks_as_missing_is(tmp_path: Path) -> None:
    """16 bits of 0.004 mm were read as so many mm, and the mark of a missing value as a position."""
    import h5py

    write_hdf5(tmp_path / "run.h5")
    packed = np.round((POSITION_MM - 15.0) / 0.004).astype(np.int16)
    packed[7] = -32768
    with h5py.File(tmp_path / "run.h5", "a") as file:
        del file["run 1/PV"]
        file["run 1/PV"] = packed
        told = {"units": "mm", "scale_factor": 0.004, "add_offset": [15.0], "_FillValue": np.int16(-32768)}
        file["run 1/PV"].attrs.update(told)
    read = read_export(tmp_path / "run.h5", read_mapping(FILES["run.h5"][1]), None).position_m
    assert np.flatnonzero(np.isnan(read)).tolist() == [7]
    np.testing.assert_allclose(np.delete(read, 7), 1e-3 * np.delete(POSITION_MM, 7), atol=2.1e-6)


def write_runs(path: Path, *commands: str) -> None:
    """Write two groups of the same channels, but for what the second calls the command."""
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        for group, name in zip(("run 1", "run 2"), commands, strict=True):
            writer.write_segment(
                [
                    ChannelObject(group, "t", TIME_S, properties={"unit_string": "s"}),
                    ChannelObject(group, "PV", POSITION_MM, properties={"unit_string": "mm"}),
                    ChannelObject(group, name, COMMAND_BAR, properties={"unit_string": "bar"}),
                ]
            )


def test_of_several_groups_that_have_the_columns_a_person_says_which(tmp_path: Path) -> None:
    write_runs(tmp_path / "run.tdms", "OUT", "OUT")
    mapping = read_mapping(["time_s=t", "position_m=PV", "command_pa=OUT"])
    with pytest.raises(InputError, match="the groups 'run 1', 'run 2' all have these columns: say which, --sheet NAME"):
        read_export(tmp_path / "run.tdms", mapping, None)
    assert len(read_export(tmp_path / "run.tdms", mapping, None, options=ExportOptions(sheet="run 2"))) == len(TIME_S)
    with pytest.raises(InputError, match=r"--sheet: .*run.tdms has no group 'run 3'; it has: run 1, run 2"):
        read_export(tmp_path / "run.tdms", mapping, None, options=ExportOptions(sheet="run 3"))


def test_columns_of_several_groups_are_joined_each_by_its_own_time(tmp_path: Path) -> None:
    write_runs(tmp_path / "run.tdms", "Cmd", "OUT")
    words = ["time_s=t", "position_m=PV", "command_pa=Cmd", "pressure_pa=OUT"]
    recording = read_export(tmp_path / "run.tdms", read_mapping(words), None)
    np.testing.assert_allclose(recording.columns["pressure_pa"], 1e5 * COMMAND_BAR)
    assert "clocks" not in recording.metadata, "both groups are of the same instants"
    assert (
        "of other times, not shown: run 2, 200 rows: t [s], PV [mm], OUT [bar]"
        in preview(tmp_path / "run.tdms").proposal.open
    )


def said_of(path: Path, words: list[str]) -> str:
    try:
        return f"{len(read_export(path, read_mapping(words), None))} rows"
    except InputError as error:
        return str(error)


def test_without_vectors_it_says_so(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "none.h5", "w") as file:
        file["note"] = "nothing"
    with pytest.raises(InputError, match="holds no vectors of numbers"):
        preview(tmp_path / "none.h5")
