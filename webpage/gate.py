"""The gate before a page (ASGI): who comes in, from where, and with how much.

- A session comes by the key that stands in the address the command prints, or by the password where there is one.
  After wrong ones in a row all wait (`config.passwords.SignIn`).
  Every other request, the web socket's too, carries it in a cookie that no script reads (HttpOnly, SameSite).
- A request that says where it comes from (Origin) comes from this page or is refused: no other site's script acts here.
- A body is as long as `most_bytes` at most.
- Answers tell the browser to fetch nothing from anywhere else (Content-Security-Policy), hence no network is needed.
"""

from collections.abc import Awaitable, Callable, MutableMapping
from dataclasses import dataclass, field
from hmac import compare_digest
from html import escape
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

from config.passwords import SignIn
from webpage.sessions import Sessions

Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Application = Callable[[Message, Receive, Send], Awaitable[None]]

KEY = "key"
"""In the address."""
SIGN_IN = "/sign-in"
LONGEST_FORM = 4096  # bytes of a sign-in form
POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self' ws: wss:; frame-ancestors 'none'; "
    "form-action 'self'; base-uri 'none'"
)
HEADERS = [
    (b"content-security-policy", POLICY.encode()),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
]
FORM = """<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<meta name="color-scheme" content="light dark"><title>{title}</title>
<style>body{{font:16px system-ui,sans-serif;max-width:24rem;margin:15vh auto;padding:0 1rem}}
input,button{{font:inherit;padding:.5rem;width:100%;box-sizing:border-box;margin:.4rem 0}}</style>
<h1>{title}</h1><p role="alert">{said}</p>{form}</html>"""
PASSWORD = (
    f'<form method="post" action="{SIGN_IN}"><label>Password<input name="password" type="password" '
    'autocomplete="current-password" autofocus required></label><button>Sign in</button></form>'
)


class TooMuch(Exception):
    """A body is longer than allowed."""


@dataclass(slots=True)
class Gate:
    """Lets requests through to `app`.

    Args:
        app: the page.
        title: of the page.
        cookie: name of its cookie; cookies know no ports, so each page has a name of its own.
        key: opens the page, in the address.
        sign_in: with the password for role "", where there is one.
        most_bytes: of a request's body.
    """

    app: Application
    title: str
    cookie: str
    key: str
    sign_in: SignIn | None
    most_bytes: int
    sessions: Sessions = field(default_factory=Sessions)

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """Answer a request, or let it through."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        headers = {name.lower(): value.decode("latin-1") for name, value in scope["headers"]}
        if not _from_here(headers):
            await _refuse(scope, send, HTTPStatus.FORBIDDEN, self._answer_page("This request comes from another site."))
        elif self.sessions.holds(_cookie(headers, self.cookie)):
            await self._through(scope, receive, send, headers)
        elif scope["type"] == "http":
            await self._knock(scope, receive, send)
        else:
            await _refuse(scope, send, HTTPStatus.FORBIDDEN, b"")

    async def _knock(self, scope: Message, receive: Receive, send: Send) -> None:
        """Answer somebody who has no session yet."""
        given = parse_qs(scope["query_string"].decode("latin-1")).get(KEY, [""])[0]
        if given and compare_digest(given.encode(), self.key.encode()):
            await self._let_in(send)
        elif self.sign_in is None:
            said = "Open the address that the command printed: the key in it opens this page."
            await _refuse(scope, send, HTTPStatus.FORBIDDEN, self._answer_page(said))
        elif scope["path"] == SIGN_IN and scope["method"] == "POST":
            text = parse_qs((await _body(receive)).decode("utf-8", "replace")).get("password", [""])[0]
            if said := self.sign_in.refused("", text):
                await _refuse(scope, send, HTTPStatus.FORBIDDEN, self._answer_page(said, PASSWORD))
            else:
                await self._let_in(send)
        else:
            await _refuse(scope, send, HTTPStatus.UNAUTHORIZED, self._answer_page("", PASSWORD))

    async def _let_in(self, send: Send) -> None:
        cookie = f"{self.cookie}={self.sessions.begin()}; Path=/; HttpOnly; SameSite=Lax"
        headers = [(b"location", b"/"), (b"set-cookie", cookie.encode())]
        await _answer(send, HTTPStatus.SEE_OTHER, headers, b"")

    async def _through(self, scope: Message, receive: Receive, send: Send, headers: dict[bytes, str]) -> None:
        if int(headers.get(b"content-length") or 0) > self.most_bytes:
            said = f"At most {self.most_bytes >> 20} MiB at once."
            await _refuse(scope, send, HTTPStatus.REQUEST_ENTITY_TOO_LARGE, self._answer_page(said))
            return
        read = 0

        async def count_body() -> Message:
            nonlocal read
            message = await receive()
            if message["type"] == "http.request":
                read += len(message.get("body", b""))
                if read > self.most_bytes:
                    raise TooMuch
            return message

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", ()), *HEADERS]
            await send(message)

        await self.app(scope, count_body, with_headers)

    def _answer_page(self, said: str, form: str = "") -> bytes:
        return FORM.format(title=escape(self.title), said=escape(said), form=form).encode()


def _from_here(headers: dict[bytes, str]) -> bool:
    origin = headers.get(b"origin")
    return origin is None or urlsplit(origin).netloc == headers.get(b"host", "")


def _cookie(headers: dict[bytes, str], name: str) -> str:
    try:
        found = SimpleCookie(headers.get(b"cookie", "")).get(name)
    except CookieError:
        return ""
    return found.value if found else ""


async def _body(receive: Receive) -> bytes:
    whole = b""
    while len(whole) < LONGEST_FORM:
        message = await receive()
        whole += message.get("body", b"")
        if not message.get("more_body"):
            break
    return whole[:LONGEST_FORM]


async def _refuse(scope: Message, send: Send, status: HTTPStatus, page: bytes) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008})
        return
    await _answer(send, status, [(b"content-type", b"text/html; charset=utf-8")], page)


async def _answer(send: Send, status: HTTPStatus, headers: list[tuple[bytes, bytes]], page: bytes) -> None:
    length = [(b"content-length", str(len(page)).encode())]
    await send({"type": "http.response.start", "status": status, "headers": [*headers, *length, *HEADERS]})
    await send({"type": "http.response.body", "body": page})
