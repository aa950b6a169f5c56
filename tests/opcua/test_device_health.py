"""NE 107 in DI's numbers: those that the nodeset of the OPC Foundation says, not ours."""

from importlib.resources import files
from xml.etree import ElementTree

import pytest

from config.codes import Ne107Status
from northbound.opcua.device_health import DeviceHealth, device_health

UA = "{http://opcfoundation.org/UA/2011/03/UANodeSet.xsd}"


def test_the_numbers_are_those_of_the_nodeset() -> None:
    text = files("northbound.opcua").joinpath("nodesets", "Opc.Ua.Di.NodeSet2.xml").read_text("utf-8")
    (health,) = (
        each
        for each in ElementTree.fromstring(text).iter(f"{UA}UADataType")
        if each.get("BrowseName") == "1:DeviceHealthEnumeration"
    )
    said = {field.get("Name"): int(field.get("Value", "")) for field in health.iter(f"{UA}Field")}
    assert said == {each.name: each.value for each in DeviceHealth}


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (Ne107Status.GOOD, 0),
        (Ne107Status.FAILURE, 1),
        (Ne107Status.FUNCTION_CHECK, 2),
        (Ne107Status.OUT_OF_SPECIFICATION, 3),
        (Ne107Status.MAINTENANCE_REQUIRED, 4),
    ],
)
def test_each_class_is_its_own(ours: Ne107Status, theirs: int) -> None:
    assert device_health(float(ours)) == theirs


@pytest.mark.parametrize("unknown", [5.0, -1.0, float("nan")])
def test_what_is_not_known_is_none(unknown: float) -> None:
    assert device_health(unknown) is None
