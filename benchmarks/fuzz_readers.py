"""Mutated trajectory files: each must give a finite trajectory or one clear error.

`python -m benchmarks.fuzz_readers [COUNT] [SEED]`; 10,000 by default. Ends with 1 if any gave
another exception, a warning, or a number that is not finite.
"""

import random
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

import peakflight as pf
from peakflight.formats import write_crazyflie, write_samples

TOKENS = (
    "nan", "inf", "-inf", "1e400", "-1e308", "1e-320", "0", "-0.0", "1e9", "-1", "1_0", "", " ",
    "x^0", "t", "null", "true", "[]", "{}", '"', "#", ";", ",", ",,", "\t", "\r", "\n", "\n\n",
    "\0", "é", "9" * 400, "1e10", "1e-10", "[[[[", "--5", "0x10", "٣",
)  # fmt: skip
"""What mutations put into a file."""
DIGITS = b"0123456789.-e"
LONGEST = 60
"""Characters that one mutation removes, repeats or moves."""


def originals(folder: Path) -> list[bytes]:
    """A small file of each form that is read."""
    waypoints = np.array([[0, 0, 1], [1, 0.5, 1.3], [2, -0.5, 1.0]])
    limits = pf.Limits(speed=3.0, jerk=50.0)
    plan = pf.plan(waypoints, limits=limits, method="proportional", yaw=[0.0, 1.0, 2.0])
    plan.save(folder / "plan.json")
    write_crazyflie(plan, folder / "pieces.csv")
    write_samples(plan, folder / "samples.csv", rate=10.0)
    racing = replace(plan, problem=replace(plan.problem, vehicle="racing-quad"))
    write_samples(racing, folder / "states.csv", rate=10.0)
    times = np.linspace(0.0, plan.duration, 20)
    rows = [
        f"{t:.6f} {x:.6f} {y:.6f} {z:.6f}"
        for t, (x, y, z) in zip(times, plan.trajectory(times), strict=True)
    ]
    (folder / "plain.csv").write_text("\n".join(rows))
    names = "t," + ",".join(f"{what}_{axis}" for what in ("p", "v", "a_lin") for axis in "xyz")
    states = np.hstack([plan.trajectory(times, order) for order in range(3)])
    lines = [
        ",".join(f"{value:.6f}" for value in (t, *row))
        for t, row in zip(times, states, strict=True)
    ]
    (folder / "agilicious.csv").write_text("\n".join([names, *lines]))
    bare = {key: plan.to_dict()[key] for key in ("coefficients", "segment_times")}
    (folder / "bare.json").write_text(str(bare).replace("'", '"'))
    found = [path.read_bytes() for path in sorted(folder.iterdir())]
    return [*found, b"\n".join((folder / "pieces.csv").read_bytes().split(b"\n")[1:])]


def mutated(data: bytes, chance: random.Random) -> bytes:
    """The data with one to four changes; half of the time of digits alone."""
    text = data
    only_digits = chance.random() < 0.5
    for _ in range(chance.randint(1, 4)):
        place = chance.randrange(len(text) + 1)
        length = chance.randint(1, LONGEST)
        if only_digits:
            digits = [k for k in range(place, min(place + LONGEST, len(text))) if text[k] in DIGITS]
            if digits:
                spot = chance.choice(digits)
                text = text[:spot] + bytes([chance.choice(DIGITS)]) + text[spot + 1 :]
            continue
        kind = chance.randrange(7)
        if kind == 0:  # a byte
            text = text[:place] + bytes([chance.randrange(256)]) + text[place + 1 :]
        elif kind == 1:  # a token in place of a field
            end = place
            while end < len(text) and text[end : end + 1] not in b",; \t\n[]{}:":
                end += 1
            text = text[:place] + chance.choice(TOKENS).encode() + text[end:]
        elif kind == 2:  # a token between
            text = text[:place] + chance.choice(TOKENS).encode() + text[place:]
        elif kind == 3:  # something missing
            text = text[:place] + text[place + length :]
        elif kind == 4:  # something twice
            text = text[: place + length] + text[place:]
        elif kind == 5:  # cut off
            text = text[:place]
        else:  # lines in another order
            lines = text.split(b"\n")
            one, two = chance.randrange(len(lines)), chance.randrange(len(lines))
            lines[one], lines[two] = lines[two], lines[one]
            text = b"\n".join(lines)
    return text


def outcome(path: Path) -> str:
    """Either "read" or "refused", or what went wrong, for one file."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = pf.read_trajectory_file(path)
        except pf.InvalidFile as error:
            clear = str(error).startswith(str(path)) and "\n" not in str(error)
            return "refused" if clear else f"unclear: {error}"
        except Exception:  # what a reader must never raise, and what is looked for here
            return traceback.format_exc()
        for motion in (found.trajectory, found.yaw):
            if motion is not None and not np.isfinite(motion.sample(5)).all():
                return "not finite"
    return "read"


def run(count: int, seed: int) -> tuple[Counter[str], list[tuple[bytes, str]]]:
    """How many of so many mutated files had which outcome, and those that went wrong."""
    chance = random.Random(seed)
    counts: Counter[str] = Counter()
    wrong = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files = originals(folder)
        path = folder / "mutated"
        for _ in range(count):
            data = mutated(chance.choice(files), chance)
            path.write_bytes(data)
            said = outcome(path)
            counts[said if said in ("read", "refused") else "wrong"] += 1
            if said not in ("read", "refused"):
                wrong.append((data, said))
    return counts, wrong


def main() -> int:
    """Run and report."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    began = time.perf_counter()
    counts, wrong = run(count, seed)
    print(f"{count} mutated files in {time.perf_counter() - began:.0f} s: {dict(counts)}")
    for data, said in wrong[:5]:
        print(data[:400], said, sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
