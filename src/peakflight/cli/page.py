"""`peakflight page`: the planner page."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from peakflight.cli.options import PAPERS, common_options, limits_option, vehicle_option
from peakflight.cli.output import print_json
from peakflight.course import Course
from peakflight.limits import Limits
from peakflight.vehicle import Vehicle

FIRST_COURSE = (
    (0.0, 0.0, 1.0),
    (2.0, 1.0, 1.5),
    (3.0, 3.0, 1.0),
    (1.0, 4.0, 2.0),
    (-1.0, 2.0, 1.2),
)
"""m, what the page begins with where no course is named."""

WAKING = 1.0
"""How often the main thread looks for signals at the latest, s."""
ENDING = ("SIGTERM", "SIGHUP")
"""Signals that end the page as Ctrl-C does, where the system has them: from whoever stops a
service, and from a terminal that is closed."""


@click.command(short_help="Edit a course in the browser, and see the fastest flight change.")
@click.argument("course", type=click.Path(path_type=Path), required=False)
@vehicle_option
@limits_option(
    "Limits to begin with.",
    otherwise=f"those of the plan or vehicle, else {PAPERS}",
)
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="Address to serve at. Beyond this machine, whoever opens the page needs the token in the "
    "address that is printed; the connection is not encrypted.",
)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=8080,
    show_default=True,
    help="Port to serve at; 0 for any that is free.",
)
@click.option("--open/--no-browser", "browse", default=True, help="Open the page in a browser.")
@common_options
def page(
    course: Path | None,
    vehicle: Vehicle | None,
    limits: Limits | None,
    host: str,
    port: int,
    browse: bool,
    as_json: bool,
) -> int:
    """Serve a page on which COURSE is edited by hand and planned at every change.

    COURSE is a CSV, YAML or JSON file of waypoints, or a plan.json; without one, the page begins
    with a small course. Everyone who opens the page sees and edits the same course. Ctrl-C ends it.

    \b
    Example:
      peakflight page course.csv
      peakflight page course.csv --vehicle crazyflie-2.1-upgrade --port 8100
    """  # noqa: D301
    from peakflight.page.edited import Edited
    from peakflight.page.files import load

    if course is None:
        edited = Edited.of_course(Course(FIRST_COURSE, name="course"))  # type: ignore[arg-type]
        notes: tuple[str, ...] = ()
    else:
        edited, notes = load(course)
    if vehicle is not None:
        edited = edited.fly(vehicle)
    if limits is not None:
        given = {kind.name: getattr(limits, kind.name) for kind in limits.active}
        if vehicle is None:
            given = {kind.name: None for kind in edited.problem.limits.active} | given
        edited = edited.limit(given)
    from peakflight.page.server import PageServer

    with _ended_by_signals():
        server = PageServer(edited, host=host, port=port)
        try:
            _announce(server.url, server.is_local, notes, as_json)
            if browse:
                click.launch(server.url)
            never = threading.Event()
            while not never.wait(WAKING):  # a signal just before it waits would not wake it
                pass
        finally:
            server.close()
    return 0


@contextmanager
def _ended_by_signals() -> Iterator[None]:
    """Within it, signals that would end this process at once end it as Ctrl-C does.

    One that is ignored, as by `nohup`, stays so.
    """
    numbers = [getattr(signal, name) for name in ENDING if hasattr(signal, name)]
    before = {
        number: signal.signal(number, signal.default_int_handler)
        for number in numbers
        if signal.getsignal(number) is signal.SIG_DFL
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _announce(url: str, local: bool, notes: tuple[str, ...], as_json: bool) -> None:
    """Say where the page is."""
    if as_json:
        print_json({"url": url, "notes": list(notes)})
        return
    for note in notes:
        click.echo(f"note: {note}")
    click.echo(f"the page is at {url}")
    if not local:
        click.echo("whoever has this address can edit; the connection is not encrypted")
    click.echo("Ctrl-C ends it")
