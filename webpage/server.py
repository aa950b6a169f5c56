"""The server of one page: listens, says its address, serves until it is told to end.

Everything that the browser gets comes from this machine: NiceGUI brings its scripts, styles and fonts along.
"""

import secrets
import socket
import webbrowser
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from ipaddress import ip_address

import uvicorn
from fastapi import FastAPI
from nicegui import app, ui

from config.errors import InputError
from config.passwords import Password, SignIn
from webpage.gate import KEY, Gate

PORT = 8765
"""Where a page listens if nothing is said; taken, another free one."""
MOST_BYTES = 256 << 20
"""Of a file dropped on a page."""
RECONNECT_S = 60.0
"""A browser that was away shorter finds its page as it was."""
LOOPBACK = "127.0.0.1"


@dataclass(frozen=True, slots=True)
class Listening:
    """Where a page listens; the port 0 is any free one. `password` is what another address than this machine's asks."""

    host: str = LOOPBACK
    port: int | None = None
    password: str = ""

    @property
    def is_own(self) -> bool:
        """Whether it is reached from this machine alone."""
        try:
            return ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"


def serve(title: str, build: Callable[[], Awaitable[None]], where: Listening, *, opens_browser: bool) -> None:
    """Serve a page until the process is told to end; the first line printed is its address.

    Args:
        title: of the page.
        build: builds it, once for each tab that opens it.
        where: it listens.
        opens_browser: at its address.

    Raises:
        InputError: the address cannot be had, or needs a password and has none.
    """
    if not where.password and not where.is_own:
        raise InputError(where.host, "can be reached by others: to listen there needs a password, --password-file FILE")
    bound = _bind(where)
    port = bound.getsockname()[1]
    key = secrets.token_urlsafe(24)
    ui.page("/", title=title)(build)
    outer = FastAPI(openapi_url=None)
    ui.run_with(
        outer, title=title, dark=None, tailwind=False, reconnect_timeout=RECONNECT_S, show_welcome_message=False
    )
    sign_in = SignIn({"": Password.of(where.password)}) if where.password else None
    gate = Gate(outer, title, f"positioner_{port}", key, sign_in, MOST_BYTES)
    address = f"http://{_spell_host(where.host)}:{port}/" + ("" if sign_in else f"?{KEY}={key}")
    print(f"{title}: {address}", flush=True)
    if opens_browser:
        app.on_startup(lambda: webbrowser.open(address))
    config = uvicorn.Config(gate, log_level="warning", lifespan="on", timeout_graceful_shutdown=1)
    uvicorn.Server(config).run([bound])


def _bind(where: Listening) -> socket.socket:
    ports = [PORT, 0] if where.port is None else [where.port]
    for port in ports:
        try:
            family = socket.AF_INET6 if ":" in where.host else socket.AF_INET
            return socket.create_server((where.host, port), family=family)
        except OSError as error:
            if port == ports[-1]:
                raise InputError(f"{where.host}:{port}", f"cannot be listened on: {error.strerror}") from None
    raise AssertionError


def _spell_host(host: str) -> str:
    return f"[{host}]" if ":" in host else host
