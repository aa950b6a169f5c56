"""The OPC UA server of several valves: their nodes on a port, written anew as their daemons are polled."""

import asyncio
import logging
import signal
import socket
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version

from asyncua import Server, ua

from config.errors import InputError
from config.passwords import SignIn
from northbound.observer.watched_valves import WatchedValve
from northbound.opcua.address_space import (
    ACKNOWLEDGE,
    ADJUST,
    BREAK_OFF,
    IDENTIFY,
    OURS,
    ValveSpace,
    add_valve,
    load_types,
)
from northbound.opcua.application_keys import ApplicationKeys
from northbound.opcua.guarded_session import Door, GuardedServer
from northbound.opcua.recorded_history import BY_HOUR, BY_IDENTIFICATION, Recorded, RecordedHistory, event_of
from northbound.opcua.told_events import ToldEvents
from northbound.opcua.valve_desk import ValveDesk
from northbound.opcua.valve_nodes import IDENTIFICATION, POSITION, SETPOINT, Shown, Why, show_picture, show_refusals

PUBLISH_EVERY_S = 0.25
SERVER = ua.NodeId(ua.ObjectIds.Server)
"""Where a client subscribes that wants the events of all valves."""
SAID_BETTER = ("sending service fault", "Rejected active session")
"""Of what asyncua logs: the session says who was turned away and why."""
POLICIES = [
    ua.SecurityPolicyType.Aes256Sha256RsaPss_SignAndEncrypt,
    ua.SecurityPolicyType.Aes128Sha256RsaOaep_SignAndEncrypt,
    ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt,
]


def application_uri() -> str:
    """Return what this server is called among applications: it stands in its certificate."""
    return f"urn:{socket.gethostname()}:positioner"


@dataclass(frozen=True, slots=True)
class Listening:
    """Where the server listens; port 0 is any free one."""

    host: str
    port: int


async def serve_opcua(
    valves: Sequence[WatchedValve],
    where: Listening,
    keys: ApplicationKeys,
    sign_in: SignIn,
    ready: Callable[[int], None],
) -> None:
    """Serve valves that are being watched until SIGTERM or Ctrl-C.

    Args:
        valves: their pollers have begun.
        where: it listens.
        keys: its certificate, and whom it trusts.
        sign_in: the passwords of the roles.
        ready: called with the port.

    Raises:
        InputError: it cannot listen there.
    """
    stop = asyncio.Event()
    with suppress(NotImplementedError):  # on Windows a process is ended without being asked
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, stop.set)
    logger = logging.getLogger("asyncua")
    logger.propagate = False
    logger.setLevel(logging.CRITICAL)  # it complains of the nodesets
    door = Door(keys, sign_in, _say)
    server = Server(iserver=GuardedServer(door))
    await server.init()
    spaces, event_type = await _prepare_server(server, valves, where, keys)
    desks = [_desk(server, door, valve, space) for valve, space in zip(valves, spaces, strict=True)]
    logger.handlers = [_OneLine()]
    try:
        await server.start()
    except OSError as error:
        said = error.strerror or str(error)
        raise InputError(f"{where.host}:{where.port}", f"cannot listen there: {said}") from None
    logger.setLevel(logging.ERROR)
    assert server.bserver is not None
    ready(server.bserver.port)
    try:
        await _keep_writing(server, valves, spaces, event_type, stop)
    finally:
        for desk in desks:
            await desk.end()
        await server.stop()


async def _prepare_server(
    server: Server, valves: Sequence[WatchedValve], where: Listening, keys: ApplicationKeys
) -> tuple[list[ValveSpace], ua.NodeId]:
    """Prepare the server, up to its start; return the nodes of each valve, and the type of its events."""
    server.name, server.product_uri, server.manufacturer_name = "positioner", OURS, "positioner"
    server.application_type = ua.ApplicationType.Server
    await server.set_application_uri(application_uri())
    await server.set_build_info(OURS, "positioner", "positioner", version("positioner"), "0", datetime.now(UTC))
    server.set_endpoint(f"opc.tcp://{where.host}:{where.port}")
    server.set_security_policy(POLICIES)
    server.set_identity_tokens([ua.UserNameIdentityToken])
    await server.load_certificate(keys.certificate, "pem")
    await server.load_private_key(keys.key, format="pem")
    namespaces, event_type = await load_types(server)
    spaces = [await add_valve(server, namespaces, event_type, valve.place) for valve in valves]
    recorded: dict[ua.NodeId, Recorded] = {}
    for valve, space in zip(valves, spaces, strict=True):
        await server.get_node(space.node_id()).set_event_notifier({ua.EventNotifier.SubscribeToEvents})
        if valve.place.history is None:
            continue
        for path in (*BY_HOUR, *BY_IDENTIFICATION):
            recorded[space.node_id(path)] = Recorded(valve.place.history, space.name, path, space.types[path])
            node = server.get_node(space.node_id(path))
            for attribute in (ua.AttributeIds.AccessLevel, ua.AttributeIds.UserAccessLevel):
                await node.set_attr_bit(attribute, ua.AccessLevel.HistoryRead)
        recorded[space.node_id()] = Recorded(valve.place.history, space.name, "", ua.VariantType.Null)
        await server.get_node(space.node_id()).set_event_notifier(
            {ua.EventNotifier.SubscribeToEvents, ua.EventNotifier.HistoryRead}
        )
    server.iserver.history_manager.set_storage(RecordedHistory(recorded, event_type.nodeid))
    return spaces, event_type.nodeid


def _desk(server: Server, door: Door, valve: WatchedValve, space: ValveSpace) -> ValveDesk:
    """Open a valve's desk: what may be written and called."""
    loop = asyncio.get_running_loop()
    said: set[asyncio.Task[None]] = set()

    def tell(text: str) -> None:
        value = ua.DataValue(ua.Variant(text, ua.VariantType.String))
        said.add(task := loop.create_task(server.write_attribute_value(space.node_id(IDENTIFICATION), value)))
        task.add_done_callback(said.discard)

    desk = ValveDesk(valve, tell)
    door.writes[space.node_id(SETPOINT)] = desk.write_setpoint
    device, position = space.node_id(), space.node_id(POSITION)
    door.methods[device, space.node_id(IDENTIFY)] = (lambda role, _: desk.identify(role), True)
    door.methods[device, space.node_id(BREAK_OFF)] = (lambda role, _: desk.break_off(role), True)
    door.methods[device, space.node_id(ACKNOWLEDGE)] = (lambda role, _: desk.acknowledge(role), True)
    door.methods[position, space.node_id(ADJUST)] = (
        lambda role, values: desk.auto_adjust(role, values[0] if values else None),
        False,
    )
    return desk


async def _keep_writing(
    server: Server,
    valves: Sequence[WatchedValve],
    spaces: Sequence[ValveSpace],
    event_type: ua.NodeId,
    stop: asyncio.Event,
) -> None:
    """Write what has changed into the nodes, and tell subscribers what has happened, until told to end."""
    told = [ToldEvents(space.name, valve.place.history) for valve, space in zip(valves, spaces, strict=True)]
    before: dict[tuple[str, str], Shown] = {}
    while not stop.is_set():
        for valve, space, events in zip(valves, spaces, told, strict=True):
            picture = valve.picture()
            news = await asyncio.to_thread(events.newer, picture.served) if events.has_news(picture.served) else []
            for event in news:
                for emitted_by in (space.node_id(), SERVER):
                    made = event_of(event, space.node_id(), event_type, emitted_by)
                    await server.iserver.subscription_service.trigger_event(made)
            for each in (*show_picture(picture), *show_refusals(picture)):
                if before.get((space.name, each.node)) != each:
                    before[space.name, each.node] = each
                    await server.write_attribute_value(space.node_id(each.node), _data_value(each, space))
        try:
            await asyncio.wait_for(stop.wait(), PUBLISH_EVERY_S)
        except TimeoutError:
            continue


def _data_value(each: Shown, space: ValveSpace) -> ua.DataValue:
    now = datetime.now(UTC)
    value = ua.Variant(None) if each.why is not Why.GOOD else ua.Variant(each.value, space.types[each.node])
    status = ua.StatusCode(getattr(ua.StatusCodes, each.why.value))
    return ua.DataValue(Value=value, StatusCode=status, SourceTimestamp=now, ServerTimestamp=now)


class _OneLine(logging.Handler):
    """Says what asyncua complains of in one line, without a traceback."""

    def emit(self, record: logging.LogRecord) -> None:
        if str(record.msg).startswith(SAID_BETTER):
            return
        error = record.exc_info[1] if record.exc_info else None
        _say(record.getMessage() + (f": {type(error).__name__}: {error}" if error else ""))


def _say(line: str) -> None:
    print("".join(each if each.isprintable() else "?" for each in line), file=sys.stderr, flush=True)
