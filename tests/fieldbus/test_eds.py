"""The electronic data sheet: made from the table of quantities, and valid for readers that are not ours."""

import warnings
from pathlib import Path
from typing import Any

import canopen
import pytest
from canopen.objectdictionary import ODVariable
from dcf.device import Device as DcfDevice
from dcf.lint import lint
from dcf.parse import parse_file

from config.canopen_device import SHIPPED_EDS, SIMULATED_OBJECTS, CanopenDevice
from config.errors import InputError
from config.loading import validate
from config.modbus_map import SIMULATED_MAP
from config.quantities import QUANTITIES, WRITABLE
from fieldbus.canopen.eds import DATA_TYPE, eds_text, read_eds
from fieldbus.canopen.objects import MOST_PDOS, first_fit

NODE = 5


def test_the_shipped_file_is_the_one_the_table_gives() -> None:
    assert SHIPPED_EDS.read_text() == eds_text(), "run: python -m fieldbus.canopen.eds > config/profiles/positioner.eds"


def test_every_quantity_of_the_modbus_map_is_an_object_of_the_same_type_and_access() -> None:
    sheet = read_eds(SHIPPED_EDS, NODE)
    assert list(SIMULATED_OBJECTS.places) == list(SIMULATED_MAP.places) == [each.name for each in QUANTITIES]
    for quantity in QUANTITIES:
        entry = SIMULATED_OBJECTS.places[quantity.name]
        found = sheet.get_variable(entry.index, entry.subindex)
        assert found is not None
        assert (found.name, found.data_type) == (quantity.name, DATA_TYPE[quantity.type])
        assert len(found) == 16 * SIMULATED_MAP.places[quantity.name].format.words
        assert found.writable == (quantity.name in WRITABLE)
        assert found.pdo_mappable == (quantity.name in {**SIMULATED_OBJECTS.sampled, **SIMULATED_OBJECTS.commanded})


def test_the_pdos_carry_one_sample_and_the_command_by_default() -> None:
    sheet: Any = read_eds(SHIPPED_EDS, NODE)

    def mapped(first: int, n: int) -> list[str]:
        entries = (sheet[first + n][k].default for k in range(1, sheet[first + n][0].default + 1))
        return [sheet.get_variable(each >> 16, each >> 8 & 0xFF).name for each in entries]

    names = [name for n in range(MOST_PDOS) for name in mapped(0x1A00, n)]
    assert sorted(names) == sorted(SIMULATED_OBJECTS.sampled)
    assert mapped(0x1600, 0) == list(SIMULATED_OBJECTS.commanded)
    assert [sheet[0x1800 + n][1].default for n in range(MOST_PDOS)] == [0x185, 0x285, 0x385, 0x80000485]


def test_an_independent_checker_finds_no_fault() -> None:
    parsed = parse_file(str(SHIPPED_EDS))
    assert lint(parsed)
    device = DcfDevice(parsed, {"NODEID": NODE})
    assert device[0x1400][1].parse_value() == 0x200 + NODE
    assert device[SIMULATED_OBJECTS.command_pa.index][0].name == "command_pa"


def objects_of(sheet: Any) -> dict[tuple[int, int], tuple[object, ...]]:
    """Return what a data sheet says of each object and sub-entry."""
    whole = [sheet[index] for index in sheet]
    each = [one for found in whole for one in ([found] if isinstance(found, ODVariable) else found.values())]
    return {
        (one.index, one.subindex): (one.name, one.data_type, one.access_type, one.default, one.pdo_mappable)
        for one in each
    }


def test_the_kept_library_would_write_the_same_objects(tmp_path: Path) -> None:
    sheet, path = read_eds(SHIPPED_EDS, NODE), tmp_path / "exported.eds"
    with path.open("w") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # it asks datetime.utcnow
        canopen.export_od(sheet, file, "eds")
    assert lint(parse_file(str(path)))
    assert objects_of(read_eds(path, NODE)) == objects_of(sheet)
    assert len(objects_of(sheet)) > 80


def test_the_checker_would_find_one(tmp_path: Path) -> None:
    broken = tmp_path / "broken.eds"
    broken.write_text(SHIPPED_EDS.read_text().replace("SubNumber=5", "SubNumber=7", 1))
    with pytest.warns(UserWarning, match="missing sub-object"):
        assert not lint(parse_file(str(broken)))


@pytest.mark.parametrize("text", ["", "plain words", "[1018]\nParameterName=x\n", "\xff\xfe"])
def test_what_is_no_data_sheet_is_refused_in_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.eds"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match="is not an electronic data sheet") as caught:
        read_eds(path, NODE)
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read_eds(tmp_path / "none.eds", NODE)


def test_first_fit_never_exceeds_a_pdo_and_keeps_everything() -> None:
    assert first_fit({"a": 4, "b": 8, "c": 2, "d": 4, "e": 2}) == [["a", "c", "e"], ["b"], ["d"]]


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"node": 0}, "node: Input should be greater than or equal to 1, got 0"),
        ({"map": {"position_m": {"index": 0x2000}}}, "map.command_pa: is required"),
        ({"map": {"position_m": {"index": 0x2000, "scale": 0}, "command_pa": {"index": 1}}}, "scale must not be 0"),
        ({"chanel": "can0"}, "chanel: unknown key"),
    ],
)
def test_a_device_table_that_cannot_work_is_refused(table: dict[str, object], said: str) -> None:
    with pytest.raises(InputError) as caught:
        validate(CanopenDevice, table, "daemon.toml")
    assert said in str(caught.value)


def test_any_interface_of_python_can_is_named_with_what_it_wants() -> None:
    device = CanopenDevice(
        interface="udp_multicast",
        channel="239.74.163.2",
        bitrate_bit_per_s=500_000,
        options={"port": 4000, "hop_limit": 0},
    )
    assert device.bus_arguments == {
        "interface": "udp_multicast",
        "channel": "239.74.163.2",
        "ignore_config": True,
        "bitrate": 500_000,
        "port": 4000,
        "hop_limit": 0,
    }
