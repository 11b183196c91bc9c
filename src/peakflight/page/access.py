"""Who may look: the same machine, or whoever has the token; never another site's page.

A page of any site can open a connection to a server on this machine. So every request must name
this server as its host, and as the site that it comes from, if it says one. When the server is
bound wider, a token is needed as well, by the address that is printed and then by a cookie.
"""

import ipaddress
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qs, urlsplit

import websockets.asyncio.server
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

COOKIE = "peakflight_token"
"""How the name of the cookie begins; the port follows, since a browser keeps the cookies of all
servers of a host together."""
HTTP_PORT = 80
"""Port of an address that names none."""
TOKEN_BYTES = 24


def is_loopback(host: str) -> bool:
    """Whether a host is this machine as only this machine can name it.

    Of names that is `localhost` alone: any other can be made to lead here, whatever it begins with.
    """
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


@dataclass(frozen=True)
class Access:
    """What is asked of a request."""

    host: str
    """What the server is bound to."""
    token: str | None = field(default=None, repr=False)
    """None where none is needed."""

    @classmethod
    def to(cls, host: str) -> "Access":
        """For a server bound to a host: with a new token, unless it is this machine alone."""
        return cls(host, None if is_loopback(host) else secrets.token_urlsafe(TOKEN_BYTES))

    def refusal(self, request: Request) -> Response | None:
        """Why a request is not answered; or None. A token in the address becomes a cookie."""
        named = _named(request.headers.get("Host", ""))
        if is_loopback(self.host) and not is_loopback(named):
            return _answer(HTTPStatus.FORBIDDEN, "this page is for this machine alone")
        origin = request.headers.get("Origin")
        if origin is not None and urlsplit(origin).netloc != request.headers.get("Host"):
            return _answer(HTTPStatus.FORBIDDEN, "another site's page may not use this one")
        if self.token is None:
            return None
        path = urlsplit(request.path)
        given = parse_qs(path.query).get("token", [""])[0]
        if given:
            if not _same(given, self.token):
                return _answer(HTTPStatus.FORBIDDEN, "the token is wrong")
            name = _cookie_name(request.headers)
            cookie = f"{name}={self.token}; Path=/; HttpOnly; SameSite=Strict"
            return _answer(
                HTTPStatus.SEE_OTHER, "", {"Location": path.path or "/", "Set-Cookie": cookie}
            )
        if not any(_same(value, self.token) for value in _cookies(request.headers)):
            return _answer(HTTPStatus.FORBIDDEN, "open the address that peakflight page printed")
        return None


@contextmanager
def guarded(access: Access) -> Iterator[list[Any]]:
    """Within it, servers of websockets that start ask `access` first; yields what has started.

    viser starts its server itself and passes no such thing on, and a proxy before it would leave
    its own port open.
    """
    serve = websockets.asyncio.server.serve
    started: list[Any] = []

    def serve_guarded(*args: Any, process_request: Any, **options: Any) -> Any:
        def first(connection: Any, request: Request) -> Any:
            return access.refusal(request) or process_request(connection, request)

        started.append(first)
        return serve(*args, process_request=first, **options)

    websockets.asyncio.server.serve = serve_guarded
    try:
        yield started
    finally:
        websockets.asyncio.server.serve = serve


def _named(host: str) -> str:
    """The host of a `Host` header, without its port; nothing if there is none to be read."""
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""


def _cookie_name(headers: Headers) -> str:
    """What the cookie is called at the port by which the browser knows this server."""
    try:
        port = urlsplit(f"//{headers.get('Host', '')}").port
    except ValueError:
        port = None
    return f"{COOKIE}_{port or HTTP_PORT}"


def _cookies(headers: Headers) -> list[str]:
    """Values of the cookies by our name; whatever others of this host there are, and however made.

    Those of `http.cookies` are none at all once one of them is against its rules.
    """
    name = _cookie_name(headers)
    every = ";".join(headers.get_all("Cookie")).split(";")
    pairs = [one.strip().partition("=") for one in every]
    return [value for key, _, value in pairs if key == name]


def _same(given: str, token: str) -> bool:
    """Whether two are alike, in a time that does not tell how much of them is."""
    return secrets.compare_digest(given.encode(errors="surrogatepass"), token.encode())


def _answer(status: HTTPStatus, text: str, headers: dict[str, str] | None = None) -> Response:
    body = f"{text}\n".encode()
    told = {"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body))}
    return Response(status, status.phrase, Headers({**told, **(headers or {})}), body)
