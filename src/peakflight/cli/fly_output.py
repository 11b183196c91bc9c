"""What `peakflight fly` tells a person, and the files it writes."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from peakflight.cli.output import Printout
from peakflight.result import Plan
from peakflight.wording import seconds

if TYPE_CHECKING:
    from peakflight.flight import Conditions, Flight, SpreadResult
    from peakflight.flight.spread import SpreadFlight

SUMMARIES = {
    "flight.npz": "every sample, for peakflight.Flight.load",
    "flight.csv": "the same, as a table",
    "flight.html": "an animation: open it in a browser",
    "flight_path.png": "the path flown and the planned one",
    "flight_error.png": "error, and thrusts of the rotors, against time",
    "spread.png": "errors of the vehicles that differ",
}
"""Name of file to what it is."""
LABELS = {
    "mass_scale": "mass",
    "thrust_scale": "thrust",
    "inertia_scale": "inertia",
    "motor_lag_scale": "lag",
}


def write_files(
    flight: "Flight",
    plan: Plan,
    spread: "SpreadResult | None",
    folder: Path,
    *,
    on_stage: Callable[[str], object],
) -> list[str]:
    """Write samples, animation and, where matplotlib is installed, pictures; hand back names."""
    from peakflight.animation import write_animation
    from peakflight.formats.flight_samples import write_flight_samples

    on_stage("writing the samples")
    names = ["flight.npz", "flight.csv", "flight.html"]
    flight.save(folder / names[0])
    write_flight_samples(flight, folder / names[1])
    write_animation(flight, folder / names[2], plan=plan)
    if find_spec("matplotlib") is None:
        return names
    on_stage("drawing")
    from peakflight.figures import write_figure
    from peakflight.figures.flight import flight_error_figure, flight_path_figure, spread_figure

    figures = {
        "flight_path.png": flight_path_figure(flight, plan),
        "flight_error.png": flight_error_figure(flight),
    }
    if spread is not None:
        figures["spread.png"] = spread_figure(spread)
    for name, figure in figures.items():
        write_figure(figure, folder / name)
    return [*names, *figures]


def verdict(flight: "Flight", error: float | None) -> str:
    """What came of it, in words."""
    if flight.crash is not None:
        return f"crashed after {seconds(flight.crash.time)} s: {flight.crash.cause}"
    if error is not None and not flight.within(error):
        return f"flew, but its RMS error of {flight.rms_error:.4f} m is above {error:g} m"
    return "flew" if error is None else f"flew within {error:g} m"


def as_dict(
    flight: "Flight", flew: bool, spread: "SpreadResult | None", files: Mapping[str, Path]
) -> dict[str, Any]:
    """As `--json` prints it."""
    crash = flight.crash
    return {
        "flew": flew,
        "rms_error": flight.rms_error,
        "top_error": flight.top_error,
        "saturation_share": flight.saturation_share,
        "crash": None if crash is None else {"cause": crash.cause, "time": crash.time},
        "duration": flight.duration,
        "vehicle": flight.vehicle.name,
        "controller": flight.controller,
        "conditions": flight.conditions.to_dict(),
        "spread": None if spread is None else spread.to_dict(),
        "files": {name: str(path) for name, path in files.items()},
    }


def print_flight(
    flight: "Flight",
    *,
    file: Path,
    error: float | None,
    spread: "SpreadResult | None",
    files: Mapping[str, Path],
) -> None:
    """Print how a plan was flown, and where its files are."""
    out = Printout()
    out.path(
        f"{file}: {seconds(flight.duration)} s, flown by {flight.vehicle.name} under the "
        f"{flight.controller} controller"
    )
    told = _told(flight.conditions)
    if told:
        out.line(f"conditions: {told}")
    good = flight.flew if error is None else flight.within(error)
    out.line(verdict(flight, error), "good" if good else "bad")
    out.line()
    out.pairs(
        [
            ("RMS error", f"{flight.rms_error:.4f} m"),
            ("top error", f"{flight.top_error:.4f} m"),
            ("saturation", f"{flight.saturation_share:.1%} of the time a rotor at its end"),
        ]
    )
    if spread is not None:
        _print_spread(out, spread)
    if files:
        out.line()
        for name, path in files.items():
            out.path(f"  {path}  {SUMMARIES[name]}")
    out.show()


def _print_spread(out: Printout, spread: "SpreadResult") -> None:
    low, high = spread.interval
    count = len(spread.flights)
    out.line()
    out.line(
        f"{count} vehicles that differ: {spread.share:.1%} flew within {spread.error:g} m "
        f"({low:.1%} to {high:.1%} with a confidence of 95 %)",
        "title",
    )
    rows = []
    rms = spread.rms_errors
    if len(rms):
        middle, late = np.quantile(rms, (0.5, 0.95))
        rows.append(
            ("RMS error", f"half below {middle:.4f} m, 95 % below {late:.4f} m, of those that flew")
        )
    if spread.crashes:
        told = "; ".join(f"{number} {cause}" for cause, number in spread.crashes.items())
        rows.append(("crashes", f"{sum(spread.crashes.values())}: {told}"))
    if rows:
        out.pairs(rows)
    columns = ("", *(f">{label}" for label in LABELS.values()), ">late ms", ">RMS m", "end")
    out.table("Worst of them", columns, _worst_rows(spread))


def _worst_rows(spread: "SpreadResult") -> Iterator[Sequence[str]]:
    for place, one in enumerate(spread.worst(), 1):
        yield (
            str(place),
            *(f"{getattr(one.conditions, name):.3f}" for name in LABELS),
            f"{1e3 * one.conditions.latency:.1f}",
            f"{one.rms_error:.4f}",
            _end(one),
        )


def _end(one: "SpreadFlight") -> str:
    return "flew" if one.crash is None else f"{one.crash}, {one.flown:.2f} s"


def _told(conditions: "Conditions") -> str:
    """What differs from the nominal world."""
    usual = type(conditions)().to_dict()
    parts = []
    for name, value in conditions.to_dict().items():
        if value != usual[name] and name != "seed":
            parts.append(f"{name.replace('_', ' ')} {value}")
    if conditions.disturbed:
        parts.append(f"seed {conditions.seed}")
    return ", ".join(parts)
