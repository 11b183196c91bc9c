"""Starting and ending the server of the page."""

import contextlib
import logging
import socket
import warnings
from collections.abc import Iterator
from typing import Any

from peakflight.errors import InvalidProblem, MissingExtra

try:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import viser
except ImportError:
    raise MissingExtra(
        "the page needs viser; install it with: pip install 'peakflight[page]'"
    ) from None

from peakflight.page.access import Access, guarded, is_loopback
from peakflight.page.edited import Edited
from peakflight.page.planner_page import Page

BRAND = (43, 108, 176)


class _Server(viser.ViserServer):  # type: ignore[misc]
    """Without the share button of viser, which would go through a server elsewhere."""

    def request_share_url(self, verbose: bool = True) -> None:
        """Nothing leaves this machine."""
        del verbose


class PageServer:
    """A page that is served, and the address that it has."""

    def __init__(self, edited: Edited, *, port: int, host: str = "127.0.0.1") -> None:
        """Serve a course.

        Raises
        ------
        InvalidProblem
            If the host is unknown or the port in use.
        """
        _check_free(host, port)
        self.access = Access.to(host)
        logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
        with guarded(self.access) as started, _silence():
            self.viser = _Server(host=host, port=port, label="peakflight", verbose=False)
        if not started:
            self.viser.stop()
            raise RuntimeError("viser has started its server in a way that cannot be guarded")
        self.viser.gui.configure_theme(
            show_logo=False, show_share_button=False, brand_color=BRAND, control_width="medium"
        )
        self.page = Page(self.viser, edited)

    @property
    def url(self) -> str:
        """What to open in a browser, with the token if one is needed."""
        host = self.access.host
        shown = f"[{host}]" if ":" in host else host
        if host in ("0.0.0.0", "::"):
            shown = socket.gethostname()
        token = "" if self.access.token is None else f"/?token={self.access.token}"
        return f"http://{shown}:{self.viser.get_port()}{token}"

    @property
    def is_local(self) -> bool:
        """Whether only this machine can reach it."""
        return is_loopback(self.access.host)

    def close(self) -> None:
        """End the server, its threads and processes."""
        self.page.close()
        with _silence():
            self.viser.stop()


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Keep viser from printing where it is and that it has stopped."""
    import rich

    console: Any = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before


def _check_free(host: str, port: int) -> None:
    """Refuse a port that is taken; viser would quietly take the next."""
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
    except socket.gaierror:
        raise InvalidProblem(f"host {host!r} is unknown") from None
    except (OSError, OverflowError) as error:
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        raise InvalidProblem(
            f"{host}:{port} cannot be served ({reason}); name another port with --port"
        ) from None
