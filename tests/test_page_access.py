"""Who may look at the page."""

import http.client
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from urllib.parse import urlsplit

import numpy as np
import pytest

import peakflight as pf

pytest.importorskip("viser")

import viser
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from peakflight.page import Edited
from peakflight.page.header import badge
from peakflight.page.server import PageServer

COURSE = pf.Course(np.array([[0.0, 0, 1], [2, 0, 1], [2, 2, 1.5]]))
PROTOCOL = f"viser-v{viser.__version__}"


@pytest.fixture(scope="module")
def local() -> Iterator[PageServer]:
    server = PageServer(Edited.of_course(COURSE), port=0)
    yield server
    server.close()


@pytest.fixture(scope="module")
def wide() -> Iterator[PageServer]:
    server = PageServer(Edited.of_course(COURSE), host="0.0.0.0", port=0)
    yield server
    server.close()


def get(server: PageServer, path: str = "/", **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection("127.0.0.1", server.viser.get_port(), timeout=20)
    with closing(connection):
        connection.request("GET", path, headers=headers)
        response = connection.getresponse()
        response.read()
        return response


def socket_status(server: PageServer, **headers: str) -> int:
    """Of the handshake of a WebSocket: 101 if it is open."""
    origin = headers.pop("Origin", None)
    try:
        with connect(
            f"ws://127.0.0.1:{server.viser.get_port()}",
            subprotocols=[PROTOCOL],  # type: ignore[list-item]
            origin=origin,  # type: ignore[arg-type]
            additional_headers=headers,
        ) as connection:
            assert connection.recv(timeout=20)
            return 101
    except InvalidStatus as refused:
        return refused.response.status_code


def test_this_machine_may(local: PageServer) -> None:
    address = f"127.0.0.1:{local.viser.get_port()}"
    assert local.url == f"http://{address}"
    assert get(local).status == 200
    assert socket_status(local) == 101
    assert socket_status(local, Origin=f"http://{address}") == 101


@pytest.mark.parametrize("origin", ["http://evil.example", "http://127.0.0.1:1", "null"])
def test_another_sites_page_may_not(local: PageServer, origin: str) -> None:
    assert socket_status(local, Origin=origin) == 403


@pytest.mark.parametrize(
    "name", ["evil.example", "127.evil.example", "127.0.0.1.evil.example", "[::1", ""]
)
def test_another_name_for_this_machine_may_not(local: PageServer, name: str) -> None:
    assert get(local, Host=name).status == 403
    assert get(local, Host=f"{name}:{local.viser.get_port()}").status == 403


@pytest.mark.parametrize("name", ["localhost", "LOCALHOST", "127.0.0.1", "[::1]"])
def test_this_machine_may_be_named_in_each_way(local: PageServer, name: str) -> None:
    assert get(local, Host=f"{name}:{local.viser.get_port()}").status == 200


def test_beyond_this_machine_the_token_is_needed(wide: PageServer) -> None:
    token = wide.access.token
    assert token is not None
    assert wide.url.endswith(f"/?token={token}")
    assert len(token) >= 32
    assert get(wide).status == 403
    assert get(wide, "/?token=wrong").status == 403
    assert socket_status(wide) == 403
    name = f"peakflight_token_{wide.viser.get_port()}"
    assert socket_status(wide, Cookie=f"{name}=wrong") == 403
    assert socket_status(wide, Cookie=f"{name}=\xff") == 403
    assert socket_status(wide, Cookie=f"{name}") == 403
    entered = get(wide, urlsplit(wide.url).path + "?" + urlsplit(wide.url).query)
    assert entered.status == 303
    assert entered.headers["Location"] == "/"
    cookie = entered.headers["Set-Cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert get(wide, Cookie=cookie.split(";")[0]).status == 200
    assert socket_status(wide, Cookie=cookie.split(";")[0]) == 101
    assert socket_status(wide, Cookie=cookie.split(";")[0], Origin="http://evil.example") == 403
    assert token not in repr(wide.access)


def entered(server: PageServer) -> str:
    """The cookie that the address with the token gives, as a browser sends it back."""
    response = get(server, "/?" + urlsplit(server.url).query)
    assert response.status == 303
    return response.headers["Set-Cookie"].split(";")[0]


@pytest.mark.parametrize("foreign", ['a={"x":1}', "a=[1, 2]", "a", '"', "a b=c", "=", "\xff=\xff"])
def test_cookies_of_others_are_no_matter(wide: PageServer, foreign: str) -> None:
    cookie = entered(wide)
    for both in (f"{foreign}; {cookie}", f"{cookie}; {foreign}"):
        assert get(wide, Cookie=both).status == 200
        assert socket_status(wide, Cookie=both) == 101
    assert get(wide, Cookie=foreign).status == 403


def test_two_servers_on_a_host_keep_their_cookies_apart(wide: PageServer) -> None:
    other = PageServer(Edited.of_course(COURSE), host="0.0.0.0", port=0)
    try:
        cookies = [entered(server) for server in (wide, other)]
        kept = dict(cookie.split("=", 1) for cookie in cookies)  # as the browser does, by name
        sent = "; ".join(f"{name}={value}" for name, value in kept.items())
        assert get(wide, Cookie=sent).status == 200
        assert get(other, Cookie=sent).status == 200
        assert get(other, Cookie=cookies[0]).status == 403
    finally:
        other.close()


def test_what_was_stopped_is_not_called_certified(
    local: PageServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = local.page
    end = time.monotonic() + 300.0  # the first plan of a machine compiles
    while badge(page.summary)[0] != "certified" or not page.planner.idle:
        assert time.monotonic() < end
        time.sleep(0.01)
    monkeypatch.setattr(page.planner, "ask", lambda edited, rests=True: None)  # nobody plans
    page.limit("speed", 1.0, True)
    assert page.thread.settle()
    assert page.edited.problem.limits.speed == 1.0
    assert badge(page.summary)[0] == "earlier plan"
    page.undo()
    assert page.thread.settle()
    assert badge(page.summary)[0] == "certified"  # of what is drawn, and again what is edited


def test_tokens_differ() -> None:
    from peakflight.page.access import Access

    assert Access.to("0.0.0.0").token != Access.to("0.0.0.0").token
    assert Access.to("127.0.0.1").token is None


def test_a_port_in_use_is_said_in_a_line(local: PageServer) -> None:
    with pytest.raises(pf.InvalidProblem, match="--port"):
        PageServer(Edited.of_course(COURSE), port=local.viser.get_port())


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "peakflight", "page", *arguments, "--no-browser"]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)


def test_bad_courses_end_as_those_of_plan(tmp_path: object) -> None:
    done = run("nowhere.csv")
    assert done.returncode == 2
    assert done.stderr == "peakflight: nowhere.csv: no such file\n"


def test_the_port_in_use_ends_the_command() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        done = run("--port", str(taken.getsockname()[1]))
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "in use" in done.stderr


def as_from_a_terminal() -> None:
    """Without what `nohup` or a shell's background has signals ignored for."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.mark.skipif(os.name == "nt", reason="no signals")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_signals_end_it_and_its_processes(name: str) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "peakflight", "page", "--port", "0", "--no-browser", "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=as_from_a_terminal,  # noqa: PLW1509
    )
    assert process.stdout is not None
    url = json.loads(process.stdout.readline())["url"]
    assert url.startswith("http://127.0.0.1:")
    process.send_signal(getattr(signal, name))
    out, err = process.communicate(timeout=60)  # until its processes have ended as well
    assert process.returncode == 130
    assert out == ""
    assert err.strip().splitlines()[-1] == "peakflight: interrupted"
    assert "Traceback" not in err
