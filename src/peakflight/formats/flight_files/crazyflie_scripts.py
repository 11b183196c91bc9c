"""Scripts that upload a flight to a Crazyflie and fly it: by cflib, or by Crazyswarm2."""

from collections.abc import Sequence

import numpy as np

from peakflight.errors import InvalidProblem
from peakflight.formats.flight_files import compressed, crazyswarm
from peakflight.formats.flight_files.flight_format import (
    Encoded,
    FlightFormat,
    Reading,
    single,
)
from peakflight.formats.flight_files.rounded import MILLI
from peakflight.formats.flight_files.script import (
    HEIGHT,
    described,
    rows_text,
    script,
    template_text,
    value_in,
)
from peakflight.result import Plan

ROW = f"({', '.join(['%.9g'] * crazyswarm.NUMBERS)}),"

FLYING = "cflib_flying.py.in"
"""Take-off to landing, the same however a flight was uploaded."""


def encode_cflib(plan: Plan, name: str = "") -> Encoded:
    """A script for cflib; the name does not appear in it."""
    del name
    rows, notes = crazyswarm.pieces_of(plan)
    return Encoded(
        script(
            "cflib.py.in",
            described=described(plan, CFLIB.held),
            pieces=rows_text(rows),
            height=f"{_height(plan):.9g}",
            flying=template_text(FLYING),
        ),
        notes,
    )


def decode_cflib(data: bytes) -> tuple[Reading, ...]:
    """What a Crazyflie flies of a script for cflib."""
    return (crazyswarm.reading_of(np.array(value_in(data, "PIECES"), dtype=float)),)


def encode_compressed(plan: Plan, name: str = "") -> Encoded:
    """A script for cflib that uploads compressed pieces; the name does not appear in it."""
    del name
    curves, notes = compressed.curves_of(plan)
    data = compressed.packed(curves)
    return Encoded(
        script(
            "cflib_compressed.py.in",
            described=described(plan, CFLIB_COMPRESSED.held),
            memory="\n".join(f'    "{data[i : i + 32].hex()}"' for i in range(0, len(data), 32)),
            count=len(curves.milliseconds),
            start=tuple((curves.points[0, 0, :3] * MILLI).round(3).tolist()),
            yaw=f"{curves.points[0, 0, 3] * compressed.ANGLE:.9g}",
            duration=curves.milliseconds.sum() * MILLI,
            height=f"{_height(plan):.9g}",
            flying=template_text(FLYING),
        ),
        notes,
    )


def decode_compressed(data: bytes) -> tuple[Reading, ...]:
    """What a Crazyflie flies of a script with compressed pieces."""
    return compressed.decode(bytes.fromhex(value_in(data, "MEMORY")))


def encode_crazyswarm2(plans: Sequence[Plan], names: Sequence[str]) -> Encoded:
    """A script for Crazyswarm2, a robot for each plan.

    Raises
    ------
    InvalidProblem
        If the plans do not start at the same time.
    """
    starts = {plan.trajectory.start_time for plan in plans}
    if len(starts) > 1:
        raise InvalidProblem(
            f"the plans start at {', '.join(f'{start:g}' for start in sorted(starts))} s; "
            "Crazyswarm2 starts all at once"
        )
    flights, notes = [], []
    for plan, name in zip(plans, names, strict=True):
        rows, said = crazyswarm.pieces_of(plan)
        lines = "\n".join(f"        {ROW % tuple(row)}" for row in rows.tolist())
        flights.append(f"    {name!r}: [\n{lines}\n    ],")
        notes += [f"{name}: {note}" for note in said]
    return Encoded(
        script(
            "crazyswarm2.py.in",
            described="; ".join(described(plan, CRAZYSWARM2.held) for plan in plans),
            flights="\n".join(flights),
            height=f"{max(_height(plan) for plan in plans):.9g}",
        ),
        tuple(notes),
    )


def decode_crazyswarm2(data: bytes) -> tuple[Reading, ...]:
    """What Crazyflies fly of a script for Crazyswarm2."""
    flights = value_in(data, "FLIGHTS").values()
    return tuple(crazyswarm.reading_of(np.array(rows, dtype=float)) for rows in flights)


def _height(plan: Plan) -> float:
    """How high to hover before flying to the start, m."""
    return max(HEIGHT, float(plan.trajectory.coefficients[0, 0, 2]))


CFLIB = FlightFormat(
    filename="fly_cflib.py",
    summary="a script that uploads to a Crazyflie by cflib and flies",
    consumer="Crazyflie by cflib (GPL, imported by the script alone)",
    numbers=crazyswarm.FORMAT.numbers,
    rules=crazyswarm.FORMAT.rules,
    encode=single(encode_cflib),
    decode=decode_cflib,
    precision=crazyswarm.FORMAT.precision,
    tolerance=crazyswarm.FORMAT.tolerance,
    from_rest=True,
    from_ground=True,
    most_pieces=crazyswarm.room,
)
CFLIB_COMPRESSED = FlightFormat(
    filename="fly_cflib_compressed.py",
    summary="the same with compressed pieces, of which memory holds more",
    consumer="Crazyflie by cflib (GPL, imported by the script alone)",
    numbers=compressed.FORMAT.numbers,
    rules=compressed.FORMAT.rules,
    encode=single(encode_compressed),
    decode=decode_compressed,
    precision=compressed.FORMAT.precision,
    tolerance=compressed.FORMAT.tolerance,
    coarse=True,
    from_rest=True,
    from_ground=True,
    most_pieces=compressed.room,
)
CRAZYSWARM2 = FlightFormat(
    filename="fly_crazyswarm2.py",
    summary="a script that flies one Crazyflie or several by Crazyswarm2",
    consumer="Crazyswarm2's crazyflie_py, in ROS 2",
    numbers=crazyswarm.FORMAT.numbers,
    rules="degree 7; 31 pieces a drone",
    encode=encode_crazyswarm2,
    decode=decode_crazyswarm2,
    precision=crazyswarm.FORMAT.precision,
    tolerance=crazyswarm.FORMAT.tolerance,
    several=True,
    from_rest=True,
    from_ground=True,
    most_pieces=crazyswarm.room,
)
