"""Entry point: runs the suites, prints Markdown, writes JSON."""

import argparse
import os
import sys
import time
import traceback
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.machine import describe, load
from benchmarks.report import Table, as_markdown, missed, write_json
from benchmarks.scope import Scope

SUITES = (
    "startup", "flight_time", "methods", "random_joint", "unseen_bound", "rotor_limits",
    "few_pieces", "comparison", "speed", "peers", "simulation", "flight_check", "tuning", "memory",
    "batches", "page",
)  # fmt: skip
"""Modules of this folder, imported when they run: a quick run chooses the cache of kernels first,
and what the first plan of all compiles is there for the rest."""
OUTPUT = Path("out/bench.json")


def main() -> int:
    """Run what the command line asks for; 1 if a benchmark itself crashed, else 0."""
    arguments = _parse()
    scope = Scope(quick=arguments.quick, full=arguments.full)
    with TemporaryDirectory() as folder:
        if scope.quick:
            os.environ["NUMBA_CACHE_DIR"] = folder
        chosen = [name for name in SUITES if name in (arguments.only or SUITES)]
        return _run(scope, chosen, arguments.output)


def _run(scope: Scope, names: Sequence[str], output: Path) -> int:
    machine = describe()
    tables: list[Table] = []
    crashes = []
    print(f"# Benchmarks\n\n{machine.line}\n", flush=True)
    for name in names:
        began = time.perf_counter()
        before = load()
        print(f"[bench] {name} ...", file=sys.stderr, flush=True)
        try:
            found = import_module(f"benchmarks.{name}").run(scope)
        except Exception:  # one suite that fails does not take the others along
            crashes.append(name)
            traceback.print_exc()
            continue
        seconds = time.perf_counter() - began
        for table in found:
            table.about |= {"suite": name, "suite_seconds": round(seconds, 1)}
            table.about |= {"load_before": before, "load_after": load()}
            print(as_markdown(table), flush=True)
        tables += found
        print(f"[bench] {name}: {seconds:.0f} s", file=sys.stderr, flush=True)
    print(missed(tables))
    for name in crashes:
        print(f"\n**Crashed: {name}** (see the traceback on the error stream)")
    write_json(output, machine, scope, tables, crashes)
    print(f"\nWritten to {output}")
    return 1 if crashes else 0


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    size = parser.add_mutually_exclusive_group()
    size.add_argument("--quick", action="store_true", help="few of each: does it all run?")
    size.add_argument("--full", action="store_true", help="also peak at 100,000 legs")
    parser.add_argument(
        "--only", action="append", choices=SUITES, help="one suite; may be repeated"
    )
    parser.add_argument("-o", "--output", type=Path, default=OUTPUT, help="the JSON file")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
