"""LabVIEW's measurement files, MATLAB of level 4, Simulink's scopes, rows as signals, pandas' stores by name."""

import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from workbench.imports.column_mapping import read_mapping
from workbench.imports.export_preview import preview
from workbench.imports.historian_export import read_export

TIME_S = np.arange(0.0, 20.0, 0.1)
STEM_MM = np.round(20.0 + 10.0 * np.sin(TIME_S), 4)
ASKED_BAR = np.round(0.6 + 0.2 * np.cos(TIME_S), 5)


def labview(path: Path, x_columns: str, decimal: str = ".", separator: str = "\t") -> None:
    """Write as LabVIEW's express block does: two headers, a comment's column, the time in one column, each, or none."""
    name = {"\t": "Tab", ",": "Comma"}[separator]
    said = [("Separator", name), ("Decimal_Separator", decimal), ("X_Columns", x_columns), ("Date", "2024/03/05")]
    lines = ["LabVIEW Measurement\t", *(separator.join(each) for each in said), "***End_of_Header***", ""]
    for key, first, second in (
        ("Channels", "2", ""),
        ("Samples", "200", "200"),
        ("Y_Unit_Label", "bar", "mm"),
        ("X0", "0", "0"),
        ("Delta_X", "0.1", "0.1"),
    ):
        lines.append(separator.join([key, first, second, ""]).replace(".", decimal))
    named = ["X_Value", "Pressure", *(["X_Value"] if x_columns == "Multi" else []), "Stem", "Comment"]
    lines += ["***End_of_Header***", separator.join(named)]
    for t, u, x in zip(TIME_S, ASKED_BAR, STEM_MM, strict=True):
        time = "" if x_columns == "No" else f"{t:.3f}"
        cells = [time, f"{u:.5f}", *([time] if x_columns == "Multi" else []), f"{x:.4f}", ""]
        lines.append(separator.join(cells).replace(".", decimal))
    path.write_bytes("\r\n".join([*lines, ""]).encode())


def matlab_4(path: Path) -> None:
    from scipy.io import savemat

    savemat(path, {"t": TIME_S, "stem": STEM_MM, "cmd": ASKED_BAR}, format="4")


def scope(path: Path) -> None:
    """Write as Simulink's block To Workspace, structure with time, and a scope of two axes do."""
    from scipy.io import savemat

    signals = [
        {"values": ASKED_BAR[:, None], "label": "cmd", "dimensions": 1.0},
        {"values": STEM_MM[:, None], "label": "stem", "dimensions": 1.0},
    ]
    savemat(
        path, {"out": {"time": TIME_S[:, None], "signals": np.array(signals, dtype=object), "blockName": "m/Scope"}}
    )


def rows_as_signals(path: Path) -> None:
    from scipy.io import savemat

    savemat(path, {"data": np.vstack([TIME_S, ASKED_BAR, STEM_MM])})


def store(path: Path, *, table: bool) -> None:
    """Write as `DataFrame.to_hdf(path, key="run")` does, in either format, with stamps as the index."""
    import h5py

    names = ["cmd", "stem"]
    values = np.column_stack([ASKED_BAR, STEM_MM])
    index = np.datetime64("2026-03-05T08:15:00").astype("datetime64[ns]").astype(np.int64)
    index = index + np.round(TIME_S * 1e9).astype(np.int64)
    with h5py.File(path, "w") as file:
        run = file.create_group("run")
        run.attrs["pandas_type"] = np.bytes_(b"frame_table" if table else b"frame")
        if table:
            kind = np.dtype([("index", "<i8"), ("values_block_0", "<f8", (2,))])
            rows = np.empty(len(index), dtype=kind)
            rows["index"], rows["values_block_0"] = index, values
            made = run.create_dataset("table", data=rows)
            made.attrs["index_kind"] = np.bytes_(b"datetime64[ns]")
            made.attrs["values_block_0_kind"] = np.bytes_(pickle.dumps(names, protocol=0))
            return
        run.attrs["nblocks"] = 1
        run["axis0"] = np.array(names, dtype="S4")
        run["axis1"] = index
        run["axis1"].attrs["kind"] = np.bytes_(b"datetime64")
        run["block0_items"] = np.array(names, dtype="S4")
        run["block0_values"] = values


FILES: dict[str, tuple[str, Callable[[Path], None], tuple[str, str, str]]] = {
    "LabVIEW, one time": (
        "a.lvm",
        lambda path: labview(path, "One"),
        ("time_s=X_Value", "position_m=Stem", "command_pa=Pressure"),
    ),
    "LabVIEW, a time a channel": (
        "a.lvm",
        lambda path: labview(path, "Multi", ","),
        ("time_s=X_Value", "position_m=Stem", "command_pa=Pressure"),
    ),
    "LabVIEW, no time, commas": (
        "a.lvm",
        lambda path: labview(path, "No", separator=","),
        ("time_s=X_Value", "position_m=Stem", "command_pa=Pressure"),
    ),
    "MATLAB of level 4": ("a.mat", matlab_4, ("time_s=t", "position_m=stem:mm", "command_pa=cmd:bar")),
    "Simulink's structure with time": (
        "a.mat",
        scope,
        ("time_s=out.time", "position_m=out.stem:mm", "command_pa=out.cmd:bar"),
    ),
    "signals as rows of a matrix": (
        "a.mat",
        rows_as_signals,
        ("time_s=data(1,:)", "position_m=data(3,:):mm", "command_pa=data(2,:):bar"),
    ),
    "pandas' fixed store": (
        "a.h5",
        lambda path: store(path, table=False),
        ("time_s=index", "position_m=stem:mm", "command_pa=cmd:bar"),
    ),
    "pandas' table store": (
        "a.h5",
        lambda path: store(path, table=True),
        ("time_s=index", "position_m=stem:mm", "command_pa=cmd:bar"),
    ),
}


@pytest.mark.parametrize("kind", FILES)
def test_it_is_read(kind: str, tmp_path: Path) -> None:
    name, write, words = FILES[kind]
    write(tmp_path / name)
    recording = read_export(tmp_path / name, read_mapping(words), None)
    np.testing.assert_allclose(recording.time_s, TIME_S, rtol=0.0, atol=2e-6)
    np.testing.assert_allclose(recording.position_m, 1e-3 * STEM_MM)
    np.testing.assert_allclose(recording.command_pa, 1e5 * ASKED_BAR)


@pytest.mark.parametrize("kind", [each for each in FILES if "rows" not in each])
def test_its_columns_are_proposed(kind: str, tmp_path: Path) -> None:
    name, write, words = FILES[kind]
    write(tmp_path / name)
    proposed = {word.partition("=")[0] for word in preview(tmp_path / name).words if "=" in word}
    assert proposed == {"time_s", "position_m", "command_pa"}
    assert {each.partition("=")[0] for each in words} == proposed


def test_the_names_in_a_store_are_read_without_running_what_is_pickled_there(tmp_path: Path) -> None:
    import h5py

    store(tmp_path / "a.h5", table=True)
    trap = b"cposix\nsystem\n(S'touch " + str(tmp_path / "ran").encode() + b"'\ntR."
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file["run/table"].attrs["values_block_0_kind"] = np.bytes_(trap)
    assert preview(tmp_path / "a.h5").columns
    assert not (tmp_path / "ran").exists()
