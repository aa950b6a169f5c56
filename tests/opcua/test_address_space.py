"""The nodes of a valve against the OPC Foundation's nodesets: every mandatory child of its types is there."""

import asyncio
from collections.abc import Iterator
from importlib.resources import files
from xml.etree import ElementTree

import pytest
from asyncua import Node, Server, ua

from config.daemon_file import DaemonFile
from northbound.observer.watched_valves import Place
from northbound.opcua.address_space import NODESETS, OURS, ValveSpace, add_valve, load_types
from northbound.opcua.valve_nodes import HEALTH, SETPOINT, SIGNAL

pytestmark = pytest.mark.patient

UA = "{http://opcfoundation.org/UA/2011/03/UANodeSet.xsd}"
MANDATORY = "i=78"
Rules = dict[str, dict[str, str]]
"""By the address of a type or of a child of one: its mandatory children's names, and their addresses."""


def full(uris: list[str], text: str) -> str:
    """Return an address with the name of its namespace, as each nodeset numbers them by itself."""
    space, _, rest = text.rpartition(";")
    return f"{uris[int(space[3:])]};{rest}" if space.startswith("ns=") else text


def rules() -> tuple[Rules, dict[str, str]]:
    """Return what the nodesets ask for, and the supertype of each type."""
    children: Rules = {}
    above: dict[str, str] = {}
    for name in NODESETS:
        text = files("northbound.opcua").joinpath("nodesets", f"Opc.Ua.{name}.NodeSet2.xml").read_text("utf-8")
        root = ElementTree.fromstring(text)
        uris = ["http://opcfoundation.org/UA/", *(each.text or "" for each in root.iter(f"{UA}Uri"))]
        for node in root:
            if "NodeId" not in node.attrib:
                continue
            refs = [
                (each.get("ReferenceType"), each.get("IsForward"), each.text or "")
                for each in node.iter(f"{UA}Reference")
            ]
            address = full(uris, node.attrib["NodeId"])
            for kind, forward, to in refs:
                if kind == "HasSubtype" and forward == "false":
                    above[address] = full(uris, to)
            if ("HasModellingRule", None, MANDATORY) in refs and "ParentNodeId" in node.attrib:
                space, _, called = node.attrib["BrowseName"].rpartition(":")
                named = f"{uris[int(space)] if space else uris[0]}:{called}"
                children.setdefault(full(uris, node.attrib["ParentNodeId"]), {})[named] = address
    return children, above


OF_ITS_TRAVEL = {"FV-102": ({"stroke_m": 0.04}, "Pa/m"), "FV-103": ({"travel_deg": 90.0}, "Pa/rad")}
"""Valves described by their travel, and the unit of what is counted by it."""
Made = tuple[Server, dict[str, ValveSpace], asyncio.AbstractEventLoop]


@pytest.fixture(scope="module")
def served() -> Iterator[Made]:
    """One server, as a site has it, with a valve of which little is known and those of each travel."""
    loop = asyncio.new_event_loop()
    places = [Place("FV-101", "127.0.0.1", 1, 1, range_pa=(0.0, 300e3))]
    for name, (travel, _) in OF_ITS_TRAVEL.items():
        settings = DaemonFile.model_validate({"valve": {"name": name, **travel}})
        places.append(Place(name, "127.0.0.1", 1, 1, settings=settings))

    async def make() -> tuple[Server, dict[str, ValveSpace]]:
        server = Server()
        await server.init()
        spaces, event_type = await load_types(server)
        return server, {each.name: await add_valve(server, spaces, event_type, each) for each in places}

    server, valves = loop.run_until_complete(make())
    yield server, valves, loop
    loop.close()


@pytest.fixture
def made(served: Made) -> tuple[Server, ValveSpace, asyncio.AbstractEventLoop]:
    server, valves, loop = served
    return server, valves["FV-101"], loop


@pytest.mark.parametrize("name", OF_ITS_TRAVEL)
def test_what_is_counted_by_the_travel_has_the_unit_of_the_valves_own(name: str, served: Made) -> None:
    server, valves, loop = served

    async def said() -> str:
        node = server.get_node(valves[name].node_id("Estimates.BOverC.EngineeringUnits"))
        return str((await node.read_value()).DisplayName.Text)

    assert loop.run_until_complete(said()) == OF_ITS_TRAVEL[name][1]


def test_every_mandatory_child_of_its_types_is_there(
    made: tuple[Server, ValveSpace, asyncio.AbstractEventLoop],
) -> None:
    server, valve, loop = made
    asked, above = rules()

    async def missing() -> tuple[list[str], int]:
        uris = await server.get_namespace_array()
        found: list[str] = []
        looked = 0

        async def look(node: Node, address: str) -> None:
            nonlocal looked
            named = {
                f"{uris[name.NamespaceIndex]}:{name.Name}": each
                for each in await node.get_children()
                for name in [await each.read_browse_name()]
            }
            while address:
                for name, child in asked.get(address, {}).items():
                    looked += 1
                    if name in named:
                        await look(named[name], child)
                    else:
                        found.append(f"{node.nodeid.to_string()}: {name}")
                address = above.get(address, "")

        async def look_through(node: Node) -> None:
            of = await node.read_type_definition()
            await look(node, f"{uris[of.NamespaceIndex]};i={of.Identifier}")
            for each in await node.get_children():
                if await each.read_node_class() in (ua.NodeClass.Object, ua.NodeClass.Variable):
                    await look_through(each)

        await look_through(server.get_node(valve.node_id()))
        return found, looked

    found, looked = loop.run_until_complete(missing())
    assert found == []
    assert looked > 30, "nothing was asked for"


def test_the_health_is_of_dis_type_and_the_signal_has_unit_and_range(
    made: tuple[Server, ValveSpace, asyncio.AbstractEventLoop],
) -> None:
    server, valve, loop = made

    async def seen() -> None:
        uris = await server.get_namespace_array()
        health = await server.get_node(valve.node_id(HEALTH)).read_data_type()
        assert (uris[health.NamespaceIndex], health.Identifier) == ("http://opcfoundation.org/UA/DI/", 6244)
        unit = await server.get_node(valve.node_id(f"{SIGNAL}.EngineeringUnits")).read_value()
        assert (unit.UnitId, unit.DisplayName.Text) == (20529, "%")
        span = await server.get_node(valve.node_id("SignalSet.Pressure.AnalogSignal.EURange")).read_value()
        assert (span.Low, span.High) == (0.0, 300e3)
        assert valve.node_id(SETPOINT).to_string() == f"ns={uris.index(OURS)};s=FV-101.{SETPOINT}"

    loop.run_until_complete(seen())


def test_every_node_that_is_shown_is_there(made: tuple[Server, ValveSpace, asyncio.AbstractEventLoop]) -> None:
    server, valve, loop = made
    loop.run_until_complete(asyncio.wait_for(_read_all(server, valve), 60))


async def _read_all(server: Server, valve: ValveSpace) -> None:
    for path in valve.types:
        await server.get_node(valve.node_id(path)).read_data_type()
