"""The entry point of the command line, which works even where its libraries are missing."""

import gc
import json
import sys
import threading
import warnings
from _thread import interrupt_main
from importlib.util import find_spec
from typing import NoReturn

from peakflight.cli.exit_codes import BAD_INPUT, INTERRUPTED

LIBRARIES = ("click", "rich")
"""What the extra `cli` brings and the command line cannot do without."""
GARBAGE = 100_000
"""Allocations between collections: most of what a short run makes lives until it ends."""
INSISTENCE = 0.02
"""How soon a lost Ctrl-C is repeated, s."""


def main() -> NoReturn:
    """Run the command line on the arguments of this process, and exit."""
    gc.set_threshold(GARBAGE)
    sys.unraisablehook = _insist
    if not sys.warnoptions:  # results tell what a user should know; python -W shows the rest
        warnings.simplefilter("ignore")
    try:
        code = _run(sys.argv[1:])
    except KeyboardInterrupt:
        print("peakflight: interrupted", file=sys.stderr)
        code = INTERRUPTED
    gc.freeze()  # spares the last collection at exit, which costs 0.2 s after numba and matplotlib
    sys.exit(code)


def _insist(lost: "sys.UnraisableHookArgs") -> None:
    """Repeat a Ctrl-C that fell into a callback of compiled code, where it has no effect."""
    if lost.exc_type is KeyboardInterrupt:
        timer = threading.Timer(INSISTENCE, interrupt_main)
        timer.daemon = True
        timer.start()
    else:
        sys.__unraisablehook__(lost)


def _run(arguments: list[str]) -> int:
    missing = [name for name in LIBRARIES if find_spec(name) is None]
    if missing:
        line = (
            f"the command line needs {' and '.join(missing)}; "
            "install it with: pip install 'peakflight[cli]'"
        )
        print(f"peakflight: {line}", file=sys.stderr)
        if "--json" in arguments:
            print(json.dumps({"error": line}))
        return BAD_INPUT
    for stream in (sys.stdout, sys.stderr):  # no name of a file is too odd to be printed
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    from peakflight.cli.application import application

    return application.run(arguments)
