"""The nodes of the valves: PA-DIM's types from the OPC Foundation's own nodesets, ours beside them in our namespace.

A valve stands in DI's DeviceSet under its name, and its nodes are `ns=U;s=NAME.PATH`: the same after every restart.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from importlib.resources import files

from asyncua import Node, Server, ua

from northbound.observer.watched_valves import Place
from northbound.opcua.valve_nodes import (
    ESTIMATES,
    HEALTH,
    IDENTIFICATION,
    NUMBERS,
    POSITION,
    PRESSURE,
    PRESSURE_SIGNAL,
    SETPOINT,
    SIGNAL,
    STATES,
    state_texts,
    unit_of,
)

NODESETS = ("Di", "IRDI", "PADIM")
DI = "http://opcfoundation.org/UA/DI/"
PADIM = "http://opcfoundation.org/UA/PADIM/"
OURS = "urn:positioner:valves"
DEVICE_SET, PADIM_TYPE, SIGNAL_SET_TYPE, CONTROL_SIGNAL_TYPE, ANALOG_SIGNAL_TYPE = 5001, 1009, 1021, 1023, 1022
"""Node numbers of the nodesets."""
EXECUTION_MODE = 1158  # node number of the nodeset
UNECE = "http://www.opcfoundation.org/UA/units/un/cefact"
UNITS = {"%": "P1", "Pa": "PAL", "s": "SEC", "1": "C62", "1/s": "C97", "Pa/m": "H42", "m/s^2": "MSK"}
"""UN/ECE's codes; what has none is named as it is."""
SIGNAL_RANGE_PA = (0.0, 420e3)
IDENTIFY, BREAK_OFF, ACKNOWLEDGE, ADJUST = "Identify", "BreakOff", "Acknowledge", f"{POSITION}.AutoAdjustPositioner"


@dataclass(slots=True)
class ValveSpace:
    """The nodes of one valve by their names, and of which type their values are."""

    name: str
    index: int
    types: dict[str, ua.VariantType] = field(default_factory=dict)

    def node_id(self, path: str = "") -> ua.NodeId:
        """Return the address of a node."""
        return ua.NodeId(f"{self.name}.{path}" if path else self.name, self.index)


@dataclass(frozen=True, slots=True)
class Namespaces:
    """Where the namespaces stand in this server."""

    di: int
    padim: int
    ours: int


async def load_types(server: Server) -> tuple[Namespaces, Node]:
    """Load the nodesets; return where their namespaces are, and the type of our events."""
    for name in NODESETS:
        text = files("northbound.opcua").joinpath("nodesets", f"Opc.Ua.{name}.NodeSet2.xml").read_text("utf-8")
        await server.import_xml(xmlstring=text)
    ours = await server.register_namespace(OURS)
    spaces = Namespaces(await server.get_namespace_index(DI), await server.get_namespace_index(PADIM), ours)
    fields = [("Number", ua.VariantType.UInt32), ("Kind", ua.VariantType.String), ("Cause", ua.VariantType.Int32)]
    event_type = await server.create_custom_event_type(
        ours, "ValveEventType", ua.ObjectIds.BaseEventType, properties=fields
    )
    return spaces, event_type


async def add_valve(server: Server, spaces: Namespaces, event_type: Node, place: Place) -> ValveSpace:
    """Add the nodes of a valve, without values as yet."""
    valve = ValveSpace(place.name, spaces.ours)
    device_set = server.get_node(ua.NodeId(DEVICE_SET, spaces.di))
    device = await _object(device_set, valve, "", ua.QualifiedName(place.name, spaces.ours), PADIM_TYPE, spaces)
    await _fill_nameplate(server, valve, place)
    valve.types[HEALTH] = ua.VariantType.Int32
    signals = await _object(
        device, valve, "SignalSet", ua.QualifiedName("SignalSet", spaces.padim), SIGNAL_SET_TYPE, spaces
    )
    await _add_signals(server, signals, valve, place, spaces)
    turns = place.settings is not None and place.settings.valve.kind.turns
    await _add_numbers(device, valve, turns=turns)
    await _add_states(device, valve)
    await _add_estimates(device, valve, turns=turns)
    await _variable(device, valve, IDENTIFICATION, "none was asked for here yet", ua.VariantType.String)
    await _add_methods(server, device, valve, spaces)
    await device.add_reference(event_type, ua.ObjectIds.GeneratesEvent)
    return valve


async def _object(
    parent: Node, valve: ValveSpace, path: str, name: ua.QualifiedName, of: int, spaces: Namespaces
) -> Node:
    type_id = ua.NodeId(of, spaces.padim)
    return await parent.add_object(valve.node_id(path), name, objecttype=type_id, instantiate_optional=False)


async def _fill_nameplate(server: Server, valve: ValveSpace, place: Place) -> None:
    texts: Mapping[str, object] = {
        "Manufacturer": ua.LocalizedText("positioner"),
        "ManufacturerUri": OURS,
        "Model": ua.LocalizedText("positioner"),
        "SerialNumber": place.name,
        "SoftwareRevision": version("positioner"),
        "HardwareRevision": "",
        "ProductCode": "",
        "AssetId": place.name,
        "ProductInstanceUri": f"{OURS}:{place.name}",
    }
    for name, value in texts.items():
        await server.get_node(valve.node_id(name)).write_value(value)
    not_counted = ua.Variant(-1, ua.VariantType.Int32)  # as DI has it where nobody counts
    await server.get_node(valve.node_id("RevisionCounter")).write_value(not_counted)


async def _add_signals(server: Server, signals: Node, valve: ValveSpace, place: Place, spaces: Namespaces) -> None:
    named = {POSITION: CONTROL_SIGNAL_TYPE, PRESSURE: ANALOG_SIGNAL_TYPE}
    for path, of in named.items():
        name = path.rpartition(".")[2]
        await _object(signals, valve, path, ua.QualifiedName(name, spaces.ours), of, spaces)
        tag = f"{place.name}.{name}" if path == PRESSURE else place.name
        await server.get_node(valve.node_id(f"{path}.SignalTag")).write_value(tag)
    await _scale(server, valve, SIGNAL, "%", (0.0, 100.0))
    await _scale(server, valve, PRESSURE_SIGNAL, "Pa", place.range_pa or SIGNAL_RANGE_PA)
    await server.get_node(valve.node_id(PRESSURE_SIGNAL)).write_attribute(
        ua.AttributeIds.DataType, ua.DataValue(ua.Variant(ua.NodeId(ua.ObjectIds.Double), ua.VariantType.NodeId))
    )
    valve.types |= {
        SIGNAL: ua.VariantType.Float,
        SETPOINT: ua.VariantType.Float,
        PRESSURE_SIGNAL: ua.VariantType.Double,
    }
    for path in (
        f"{SIGNAL}.ActuatorType",
        f"{SIGNAL}.OperatingDirection",
    ):  # sliding stem, direct: what PA-DIM begins with
        await server.get_node(valve.node_id(path)).set_read_only()
    await server.get_node(valve.node_id(SIGNAL)).set_read_only()


async def _scale(server: Server, valve: ValveSpace, path: str, unit: str, span: tuple[float, float]) -> None:
    """Write the unit and range of a signal, made where the type's copy has none."""
    signal = server.get_node(valve.node_id(path))
    values = {"EngineeringUnits": engineering_unit(unit), "EURange": ua.Range(*span)}
    there = {(await each.read_browse_name()).Name for each in await signal.get_children()}
    for name, value in values.items():
        if name in there:
            await server.get_node(valve.node_id(f"{path}.{name}")).write_value(value)
        else:
            await signal.add_property(valve.node_id(f"{path}.{name}"), ua.QualifiedName(name, 0), value)


async def _add_numbers(device: Node, valve: ValveSpace, *, turns: bool) -> None:
    for folder, names in NUMBERS.items():
        parent = await device.add_folder(valve.node_id(folder), ua.QualifiedName(folder, valve.index))
        for name, register in names.items():
            node = await _variable(parent, valve, f"{folder}.{name}", 0.0, ua.VariantType.Double)
            await _add_unit(node, valve, f"{folder}.{name}", unit_of(register, turns=turns))


async def _add_states(device: Node, valve: ValveSpace) -> None:
    parent = await device.add_folder(valve.node_id("Status"), ua.QualifiedName("Status", valve.index))
    for name, register in STATES.items():
        path = f"Status.{name}"
        node = await _variable(parent, valve, path, 0, ua.VariantType.UInt16)
        texts = [ua.EnumValueType(value, ua.LocalizedText(text)) for value, text in state_texts(register).items()]
        enums = ua.Variant(texts, ua.VariantType.ExtensionObject)
        await node.add_property(valve.node_id(f"{path}.EnumValues"), ua.QualifiedName("EnumValues", 0), enums)
    await _variable(parent, valve, "Status.Connection", "", ua.VariantType.String)


async def _add_estimates(device: Node, valve: ValveSpace, *, turns: bool) -> None:
    parent = await device.add_folder(valve.node_id("Estimates"), ua.QualifiedName("Estimates", valve.index))
    for register, name in ESTIMATES.items():
        path = f"Estimates.{name}"
        node = await _variable(parent, valve, path, 0.0, ua.VariantType.Double)
        await _add_unit(node, valve, path, unit_of(f"{register}_e", turns=turns))
        await _variable(node, valve, f"{path}.StandardDeviation", 0.0, ua.VariantType.Double)
        await _variable(node, valve, f"{path}.Refusal", "", ua.VariantType.String)


async def _variable(parent: Node, valve: ValveSpace, path: str, value: object, of: ua.VariantType) -> Node:
    name = ua.QualifiedName(path.rpartition(".")[2], valve.index)
    valve.types[path] = of
    return await parent.add_variable(valve.node_id(path), name, ua.Variant(value, of))


async def _add_unit(node: Node, valve: ValveSpace, path: str, unit: str) -> None:
    name = ua.QualifiedName("EngineeringUnits", 0)
    await node.add_property(valve.node_id(f"{path}.EngineeringUnits"), name, engineering_unit(unit))


def engineering_unit(unit: str) -> ua.EUInformation:
    """Return a unit as OPC UA has it: UN/ECE's code as a number, and how it is written.

    >>> engineering_unit("%").UnitId, engineering_unit("p.u.").UnitId
    (20529, -1)
    """
    code = UNITS.get(unit)
    return ua.EUInformation(
        NamespaceUri=UNECE if code else OURS,
        UnitId=int.from_bytes(code.encode("ascii")) if code else -1,
        DisplayName=ua.LocalizedText(unit),
        Description=ua.LocalizedText(unit),
    )


async def _add_methods(server: Server, device: Node, valve: ValveSpace, spaces: Namespaces) -> None:
    done = _argument("Done", ua.NodeId(ua.ObjectIds.Boolean), "whether it was obeyed")
    said = _argument("Text", ua.NodeId(ua.ObjectIds.String), "what became of it")
    for name in (IDENTIFY, BREAK_OFF, ACKNOWLEDGE):
        called = ua.QualifiedName(name, valve.index)
        await device.add_method(valve.node_id(name), called, _only_through_a_session, [], [done, said])
    mode = _argument("ExecutionMode", ua.NodeId(EXECUTION_MODE, spaces.padim), "2 starts, 255 aborts")
    position = server.get_node(valve.node_id(POSITION))
    called = ua.QualifiedName("AutoAdjustPositioner", spaces.padim)
    await position.add_method(valve.node_id(ADJUST), called, _only_through_a_session, [mode], [])


def _argument(name: str, of: ua.NodeId, text: str) -> ua.Argument:
    return ua.Argument(name, of, ValueRank=ua.ValueRank.Scalar, Description=ua.LocalizedText(text))


async def _only_through_a_session(_parent: ua.NodeId, *_arguments: ua.Variant) -> ua.StatusCode:
    """Refuse: `GuardedSession` answers calls, for it knows whose they are."""
    return ua.StatusCode(ua.StatusCodes.BadUserAccessDenied)
