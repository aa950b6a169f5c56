import asyncio
from collections.abc import Sequence
from typing import Any

import pytest

from config.passwords import MOST_WRONG, PAUSE_S, Password, SignIn
from webpage.gate import Gate, Message, Receive, Send, TooMuch

KEY, COOKIE, MOST = "the-key", "positioner_1", 1000


async def page(scope: Message, receive: Receive, send: Send) -> None:
    """Reads all it is sent, and answers."""
    while scope["type"] == "http" and (await receive()).get("more_body"):
        pass
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"the page"})


class Visitor:
    """Asks as a browser does, and keeps the cookie that it is given."""

    def __init__(self, sign_in: SignIn | None = None) -> None:
        self.gate = Gate(page, "a page", COOKIE, KEY, sign_in, MOST)
        self.cookie = ""

    def asks(
        self, path: str = "/", *, body: Sequence[bytes] = (b"",), kind: str = "http", **said: str
    ) -> tuple[int, str]:
        headers = {
            "host": "here:1",
            "cookie": self.cookie,
            **{key.replace("_", "-"): text for key, text in said.items()},
        }
        path, _, query = path.partition("?")
        scope = {
            "type": kind,
            "path": path,
            "query_string": query.encode(),
            "method": "POST" if any(body) else "GET",
            "headers": [(key.encode(), text.encode()) for key, text in headers.items()],
        }
        parts = [{"type": "http.request", "body": each, "more_body": True} for each in body]
        parts[-1]["more_body"] = False
        answers: list[Message] = []

        async def receive() -> Message:
            return parts.pop(0)

        async def send(message: Message) -> None:
            answers.append(message)

        asyncio.run(self.gate(scope, receive, send))
        first: dict[str, Any] = dict(answers[0])
        for name, value in first.get("headers", ()):
            if name == b"set-cookie":
                assert b"HttpOnly" in value
                self.cookie = value.decode().partition(";")[0]
        return first.get("status", first.get("code", 0)), answers[-1].get("body", b"").decode()


def test_without_the_key_nobody_comes_in() -> None:
    for path in ("/", "/?key=wrong", "/_nicegui/anything"):
        assert Visitor().asks(path)[0] == 403
    assert Visitor().asks(kind="websocket")[0] == 1008


def test_the_key_buys_a_session() -> None:
    visitor = Visitor()
    assert visitor.asks(f"/?key={KEY}")[0] == 303
    assert visitor.asks("/") == (200, "the page")
    visitor.cookie = f"{COOKIE}=another"
    assert visitor.asks("/")[0] == 403


def test_another_site_may_ask_nothing() -> None:
    visitor = Visitor()
    visitor.asks(f"/?key={KEY}")
    assert visitor.asks("/", origin="http://elsewhere.example")[0] == 403
    assert visitor.asks("/", origin="http://here:2")[0] == 403
    assert visitor.asks("/", kind="websocket", origin="http://elsewhere.example")[0] == 1008
    assert visitor.asks("/", origin="http://here:1")[0] == 200


def test_a_body_that_is_too_long_is_not_read() -> None:
    visitor = Visitor()
    visitor.asks(f"/?key={KEY}")
    assert visitor.asks("/", body=[b"x"], content_length=str(MOST + 1))[0] == 413
    with pytest.raises(TooMuch):
        visitor.asks("/", body=[b"x" * MOST, b"x"])


def test_a_password_in_the_place_of_the_key() -> None:
    visitor = Visitor(SignIn({"": Password.of("open sesame")}))
    status, form = visitor.asks("/")
    assert (status, "password" in form) == (401, True)
    status, form = visitor.asks("/sign-in", body=[b"password=nonsense"])
    assert (status, "wrong password" in form) == (403, True)
    assert visitor.asks("/sign-in", body=[b"password=open+sesame"])[0] == 303
    assert visitor.asks("/")[0] == 200


def test_after_five_wrong_ones_no_password_is_looked_at() -> None:
    now_s = 0.0
    sign_in = SignIn({"operator": Password.of("right")}, clock=lambda: now_s)
    for _ in range(MOST_WRONG):
        assert sign_in.refused("operator", "wrong") == "wrong password"
    assert "30 s" in sign_in.refused("operator", "right")
    now_s = PAUSE_S
    assert sign_in.refused("engineer", "right") == "wrong password"
    assert sign_in.refused("operator", "right") == ""
