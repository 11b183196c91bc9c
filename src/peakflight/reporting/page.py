"""The page of a report: one HTML file that opens without a server and asks nothing of any other."""

import json
import math
import platform
import shlex
from collections.abc import Iterator, Mapping
from importlib.metadata import version as version_of
from importlib.resources import files
from typing import Any

import numpy as np

from peakflight.files import PathLike, write_atomically
from peakflight.problem import derivative_name
from peakflight.reporting import markup, tables
from peakflight.reporting.closeness import closeness, power_of_ten
from peakflight.reporting.commands import plan_command, plan_in_python
from peakflight.reporting.findings import Findings, find
from peakflight.reporting.leg_plots import legs_plot
from peakflight.reporting.panel_plots import panels_plot
from peakflight.reporting.panels import limit_panels, yaw_panels
from peakflight.reporting.path_plots import above_plot, path_plot
from peakflight.reporting.plots import Plot
from peakflight.reporting.themes import THEMES, style_sheet
from peakflight.result import JOINT_TOLERANCE, Plan, allowed_miss
from peakflight.version import __version__
from peakflight.wording import rotor_notes, seconds

POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; " + (
    "img-src data: blob:"
)
"""What a browser lets the page do: whatever is in it, and nothing that is elsewhere."""
LIBRARIES = ("numpy", "numba", "plotly")
"""Whose versions the page names."""


def report_html(
    plan: Plan,
    *,
    title: str = "Flight plan",
    file: str = "plan.json",
    claims: Mapping[str, Any] | None = None,
) -> str:
    """A plan as one page of HTML: plots, tables, certificate, vehicle, how to make it again.

    The certificate is not copied: the plan is proven again, from its coefficients. The same plan
    gives the same page.

    Parameters
    ----------
    title
        What stands on top.
    file
        The plan file, for the commands that the page shows.
    claims
        What the plan file says, which the page then compares with the proof; by default what the
        plan itself says.
    """
    return report_page(find(plan, claims), title=title, file=file)


@np.errstate(over="ignore", invalid="ignore")  # a file may be far from a flight
def report_page(findings: Findings, *, title: str, file: str) -> str:
    """The page of what has been found of a plan; title and file as of `report_html`."""
    plan = findings.plan
    plots = _plots(findings)
    sections = list(_sections(findings, plots, file))
    values = _without_infinity({"plots": plots, "themes": THEMES})
    # "<" is written so that no text ends the script that holds it
    data = json.dumps(values, allow_nan=False, separators=(",", ":"))
    page = _template().format(
        policy=POLICY,
        title=markup.text(f"{title}: {seconds(plan.duration)} s"),
        style=style_sheet(),
        header=_header(findings, title),
        contents=_contents(sections),
        sections="\n".join(body for _, _, body in sections),
        footer=markup.text(_versions(plan)),
        data=data.replace("<", "\\u003c"),
        plotly=_plotly(),
        script=_resource("page.js"),
    )
    # half of a pair of surrogates, which JSON and names of files may have, is no text
    return page.encode(errors="replace").decode()


def write_report(plan: Plan, path: PathLike, **options: Any) -> None:
    """Write what `report_html` gives, with its options.

    Raises
    ------
    InvalidFile
        If the file cannot be written; one that was there before is then as it was.
    """
    write_atomically(path, report_html(plan, **options))


def _without_infinity(value: Any) -> Any:
    """The same with null, a gap in a plot, for numbers that JSON cannot hold."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, list):
        return [_without_infinity(one) for one in value]
    if isinstance(value, Mapping):
        return {name: _without_infinity(one) for name, one in value.items()}
    return value


def _plots(findings: Findings) -> dict[str, Plot]:
    plan = findings.plan
    plots = {
        "path": path_plot(plan),
        "above": above_plot(plan),
        "limits-plot": panels_plot(limit_panels(plan), plan),
        "legs-plot": legs_plot(findings),
    }
    yaw = yaw_panels(plan)
    if yaw is not None:
        plots["yaw-plot"] = panels_plot(yaw, plan)
    return plots


def _sections(
    findings: Findings, plots: Mapping[str, Plot], file: str
) -> Iterator[tuple[str, str, str]]:
    """Name, title and body of each part of the page."""
    plan = findings.plan

    def part(name: str, title: str, lead: str, *blocks: str) -> tuple[str, str, str]:
        return name, title, markup.section(name, title, blocks, lead)

    def place(name: str, label: str) -> str:
        return markup.plot(name, plots[name]["height"], label)

    yield part(
        "path-section",
        "Path",
        "Drag to turn it; point at it for time, leg and speed. Pointing at a curve below moves "
        "the red dot along the path.",
        '<div class="switch" role="group" aria-label="View">'
        '<button type="button" data-view="path" aria-pressed="true">in space</button>'
        '<button type="button" data-view="above" aria-pressed="false">from above</button></div>',
        place("path", "The path in space, coloured by speed"),
        place("above", "The path from above, coloured by speed"),
    )
    yield part(
        "limits",
        "Limits",
        "How near the flight comes to each limit: proven bounds, not samples.",
        tables.limit_table(findings),
        markup.points(rotor_notes(plan.problem)),
        place("limits-plot", "What is limited, against time"),
        markup.paragraph(
            "Dashed: limits. A ring marks the peak of a polynomial piece that a limit binds, a "
            "cross one that exceeds it. Drag across a plot to enlarge a part of it, click twice "
            "to see all again.",
            tone="note",
        ),
    )
    yield part(
        "legs",
        "Legs",
        "A leg goes from one waypoint to the next; both are numbered from 0.",
        place("legs-plot", "The time of each leg, and which limit binds it"),
        tables.leg_table(findings),
    )
    if "yaw-plot" in plots:
        follows = f"It is up to {np.degrees(plan.yaw_deviation):.1f}° off what it follows."
        heading = plan.problem.heading
        lead = f"Asked for: {heading.policy}. " if heading is not None else ""
        lead += follows if heading is not None and heading.follows else ""
        yield part("yaw", "Yaw", lead, place("yaw-plot", "Yaw and how it turns, against time"))
    yield part("certificate", "Certificate", "", *_certificate(findings))
    yield part(
        "waypoints",
        "Waypoints",
        "How far the path is off each, as its polynomials say.",
        tables.waypoint_table(findings),
    )
    vehicle = plan.vehicle
    if vehicle is not None:
        yield part(
            "vehicle",
            "Vehicle",
            f"{vehicle.name}: what its figures are, and where they are from.",
            tables.vehicle_table(vehicle),
            tables.reason_table(findings),
        )
    yield part("made", "How it was made", "", *_made(plan, file))


def _header(findings: Findings, title: str) -> str:
    plan = findings.plan
    proven = plan.report.feasible
    lines = [*plan.report.problems, *(f"the file {line}" for line in findings.false_claims)]
    said = (
        "Every limit is kept at every instant, every joint is smooth and every waypoint is passed: "
        "proven from the coefficients when this page was made."
        if proven
        else "Not everything that the plan should keep could be proven when this page was made."
    )
    return (
        f'<p class="eyebrow">peakflight report</p>\n<h1>{markup.text(title)}</h1>\n'
        '<div class="hero"><p class="total" title="Total time, from first waypoint to last">'
        f'<span id="total">{seconds(plan.duration)}</span><span class="unit">s</span></p>'
        f'<div class="verdict {"good" if proven else "bad"}" id="verdict">'
        f"<strong>{'Certified' if proven else 'NOT certified'}</strong>{markup.paragraph(said)}"
        f"{markup.points(lines)}</div></div>\n"
        f'<ul class="tiles">{"".join(_tiles(findings))}</ul>'
    )


def _tiles(findings: Findings) -> Iterator[str]:
    plan = findings.plan
    guess = findings.guess
    if guess is not None:
        gain = 100.0 * (1.0 - plan.duration / guess.duration)
        yield markup.tile(
            "shorter by" if gain >= 0.0 else "longer by",
            f"{abs(gain):.1f} %",
            f"than the proportional guess, {seconds(guess.duration)} s",
            hint="The proportional guess: each leg takes time in proportion to its length, slowed "
            "down until every limit is kept",
        )
    waypoints = len(plan.problem.waypoints)
    yield markup.tile(
        "course",
        f"{findings.leg_lengths.sum():.2f} m",
        f"{waypoints} waypoints, {waypoints - 1} legs",
        hint="Length of the path",
    )
    mean = float(findings.leg_lengths.sum()) / plan.duration
    yield markup.tile("mean speed", f"{mean:.2f} m/s", hint="Length of the path over total time")
    worst = max(findings.limits, key=lambda one: one.ratio)
    binding = sum(leg.binds for leg in findings.legs)
    yield markup.tile(
        "closest limit",
        worst.kind.label,
        f"a limit binds {binding} of {len(findings.legs)} legs",
        hint="The limit that the flight comes closest to",
    )
    yield markup.tile("method", plan.method, f"status: {plan.status}")
    if plan.vehicle is not None:
        yield markup.tile("vehicle", plan.vehicle.name, f"{plan.vehicle.mass:g} kg")


def _certificate(findings: Findings) -> Iterator[str]:
    plan, report = findings.plan, findings.plan.report
    verdict = "Certified" if report.feasible else "NOT certified"
    yield markup.paragraph(verdict, tone="good strong" if report.feasible else "bad strong")
    yield markup.points(report.problems, tone="bad")
    names = ", ".join(one.kind.label for one in findings.limits)
    smooth = derivative_name(plan.problem.spline_class.continuity)
    rows = [
        (
            "limits",
            f"{names}: the largest value of each on every polynomial piece is bounded from above; "
            "nothing is sampled",
        ),
        (
            "joints",
            f"smooth up to {smooth}: the largest jump is {report.joint_residual:.1e} of the size "
            f"around it, {power_of_ten(JOINT_TOLERANCE)} is allowed",
        ),
        (
            "waypoints",
            f"missed by {report.waypoint_error:.1e} m at most, "
            f"{allowed_miss(plan.problem.waypoints):.1e} m is allowed",
        ),
    ]
    if plan.problem.fixed:
        rows.append(
            (
                "fixed motion",
                f"off by {report.state_error:.1e} of its size at most at the waypoints where it is "
                f"fixed, {power_of_ten(JOINT_TOLERANCE)} is allowed",
            )
        )
    rows.append(
        (
            "the file",
            "; ".join(findings.false_claims) or "what it claims agrees with the proof",
        )
    )
    yield markup.pairs(rows)
    yield markup.paragraph(
        "How near the bounds of limits are to what is reached, unless a piece needs more "
        "subdivisions than there are; a bound is never below:"
    )
    yield markup.points(closeness(plan.problem))
    yield tables.joint_table(findings)


def _made(plan: Plan, file: str) -> Iterator[str]:
    problem = plan.problem
    pieces = len(plan.trajectory)
    chosen = ", ".join(f"{name} = {value}" for name, value in plan.settings.items())
    minimizes = problem.minimize if isinstance(problem.minimize, str) else "a sum of squares"
    rows = [
        ("method", plan.method),
        ("status", str(plan.status)),
        ("settings", chosen or "the defaults of the method"),
        ("polynomials", f"{pieces} of degree {plan.trajectory.degree}"),
        ("minimizes", f"{minimizes}, where the method has a choice"),
        ("iterations", str(plan.iterations)),
        ("planning time", f"{plan.wall_time_s:.3g} s"),
        ("message", plan.message or "none"),
    ]
    yield markup.pairs(rows)
    quoted = shlex.quote(file)
    command = plan_command(plan, file)
    python = plan_in_python(plan, file)
    if command is not None:
        yield markup.paragraph("Plan it again, from the plan file as the course:")
        yield markup.code(command)
    if python is not None:
        yield markup.paragraph("Plan it again in Python:")
        yield markup.code(python)
    yield markup.paragraph("Prove it again, and make this page again:")
    yield markup.code(f"peakflight check {quoted}\npeakflight report {quoted} -o report.html")


def _contents(sections: list[tuple[str, str, str]]) -> str:
    return " ".join(f'<a href="#{name}">{markup.text(title)}</a>' for name, title, _ in sections)


def _versions(plan: Plan) -> str:
    others = ", ".join(f"{name} {version_of(name)}" for name in LIBRARIES)
    made = plan.version or "an unknown version"
    return (
        f"Planned by peakflight {made}; page and proof by peakflight {__version__} with "
        f"Python {platform.python_version()}, {others}."
    )


def _template() -> str:
    return _resource("page.html")


def _resource(name: str) -> str:
    return files("peakflight.reporting").joinpath(name).read_text(encoding="utf-8")


def _plotly() -> str:
    """Plotly's own code, so that the page needs no other place."""
    from plotly.offline import get_plotlyjs

    return str(get_plotlyjs()).replace("</script", "<\\/script")
