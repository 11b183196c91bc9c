"""What `peakflight paper` writes: a page, its pictures, and its figures as CSV and JSON."""

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from peakflight.certificate import peak_ratios
from peakflight.document import (
    Block,
    Document,
    Picture,
    Points,
    Section,
    Table,
    as_code,
    as_html,
    as_markdown,
)
from peakflight.errors import MissingExtra
from peakflight.files import write_atomically
from peakflight.limits import KINDS, LABELS, Limits, plain_unit
from peakflight.methods.algorithm1 import Algorithm1Settings
from peakflight.paper import (
    ALGORITHM_1,
    COMPARED,
    DEFAULT_COURSE,
    GUESS,
    GUESS_DURATION,
    JOINT,
    MELLINGER,
    PEAK,
    RECONSTRUCTION,
    PaperComparison,
    Reproduction,
    figures_csv,
    is_same,
    leg_times_csv,
    methods_csv,
)
from peakflight.version import __version__

if TYPE_CHECKING:
    from peakflight.paper_flights import Experiment

NONE = "-"
"""What stands where there is no figure."""
PICTURE_FORMATS = ("png", "svg")
MOST_WAYPOINTS = 40
"""More are not listed on the page."""

TABLES = {
    "beside-paper.csv": figures_csv,
    "methods.csv": methods_csv,
    "leg-times.csv": leg_times_csv,
}


def write_paper(
    result: Reproduction,
    folder: Path,
    *,
    experiment: "Experiment | None" = None,
    on_stage: Callable[[str], None] | None = None,
) -> tuple[list[str], tuple[str, ...]]:
    """Write pictures, tables and the page into a folder that exists.

    Parameters
    ----------
    experiment
        The flights, if they are to be on the page (`peakflight.paper_flights.fly_paper`).
    on_stage
        Told what begins.

    Returns
    -------
    Names of the files, the page first; and notes on what is missing.

    Raises
    ------
    InvalidFile
        If a file cannot be written.
    """
    tell = on_stage or (lambda _: None)
    try:
        pictures, names = _draw(result, experiment, folder, tell)
        notes: tuple[str, ...] = ()
    except MissingExtra as error:
        pictures, names, notes = {}, [], (f"no pictures: {error}",)
    tell("writing the page")
    page = paper_document(result, pictures, notes, experiment=experiment)
    values = json.dumps(as_dict(result, experiment), allow_nan=False, indent=1, ensure_ascii=False)
    contents = {
        "paper.html": as_html(page),
        "paper.md": as_markdown(page),
        **{name: table(result) for name, table in TABLES.items()},
        "paper.json": f"{values}\n",
    }
    if experiment is not None:
        from peakflight.paper_flight_page import TABLES as FLIGHT_TABLES

        contents |= {name: table(experiment) for name, table in FLIGHT_TABLES.items()}
    for name, content in contents.items():
        write_atomically(folder / name, content)
    return [*contents, *names], notes


def as_dict(result: Reproduction, experiment: "Experiment | None" = None) -> dict[str, Any]:
    """Plain numbers, lists and names, with those of the flights as "experiment"."""
    values = result.to_dict()
    return values if experiment is None else {**values, "experiment": experiment.to_dict()}


def paper_document(
    result: Reproduction,
    pictures: dict[str, tuple[Picture, ...]],
    notes: Iterable[str] = (),
    *,
    experiment: "Experiment | None" = None,
) -> Document:
    """Say what was run, what came out, what the paper has, and why the two differ.

    Parameters
    ----------
    pictures
        Those of "example", of each comparison by its name, and of each as flown by its name after
        "flown-".
    """
    sections = [_course_section(result), _example_section(result, pictures.get("example", ()))]
    sections += [
        _comparison_section(one, pictures.get(one.printed.name, ())) for one in result.comparisons
    ]
    sections.append(Section("Where and why the figures differ", (Points(_reasons(result)),)))
    if experiment is not None:
        from peakflight.paper_flight_page import flight_sections

        names = [one.printed.name for one in result.comparisons]
        flown = {name: pictures.get(f"flown-{name}", ()) for name in names}
        sections += flight_sections(result, experiment, flown)
    if notes:
        sections.append(Section("Notes", (Points(tuple(notes)),)))
    return Document(
        title="The paper's figures and tables of planning"
        + (", run again" if experiment is None else " and of its flights, run again"),
        lead='"An alternating peak-optimization method for optimal trajectory generation of '
        'quadrotor drones" (de Vries, Li, Song, Sun). This page was made by `peakflight paper`, '
        f"version {__version__}. What the paper prints stands beside what came out here.",
        sections=tuple(sections),
    )


def beside_table(one: PaperComparison) -> Table:
    """Every figure that the paper prints of a comparison, beside ours."""
    rows = tuple(
        (figure.quantity, f"{figure.paper:g} {figure.unit}", _figure(figure.ours, figure.unit))
        for figure in one.beside_paper
    )
    return Table(
        title=f"{one.printed.title}: beside the paper",
        columns=("", ">paper", ">here"),
        rows=rows,
    )


def methods_table(one: PaperComparison) -> Table:
    """What each method made of a comparison."""
    rows = []
    for name, row in one.rows.items():
        rows.append(
            (
                name,
                _figure(row.duration, "s"),
                _difference(one, name, GUESS),
                _difference(one, name, MELLINGER),
                _figure(row.top_speed, "m/s"),
                "yes" if row.certified else "no",
                ", ".join(LABELS[name] for name in row.binding) or NONE,
            )
        )
    columns = ("method", ">total", ">vs guess", ">vs Mellinger", ">top speed")
    return Table(
        title=f"{one.printed.title}: every method",
        columns=(*columns, "certified", "limits that bind"),
        rows=tuple(rows),
    )


def _draw(
    result: Reproduction,
    experiment: "Experiment | None",
    folder: Path,
    tell: Callable[[str], None],
) -> tuple[dict[str, tuple[Picture, ...]], list[str]]:
    """Draw and write every picture; by part of the page, and the names of files."""
    from peakflight.figures import write_figure
    from peakflight.paper_pictures import comparison_pictures, example_pictures

    parts = {"example": example_pictures(result)}
    parts |= {one.printed.name: comparison_pictures(one) for one in result.comparisons}
    if experiment is not None:
        from peakflight.paper_flight_pictures import flight_pictures

        for flown in experiment.comparisons:
            parts[f"flown-{flown.comparison.printed.name}"] = flight_pictures(flown)
    pictures, names = {}, []
    for part, drawings in parts.items():
        found = []
        for name, caption, figure in drawings:
            tell(f"drawing {name}")
            files = [f"{name}.{kind}" for kind in PICTURE_FORMATS]
            png, *_ = [write_figure(figure, folder / file) for file in files]
            found.append(Picture(name=name, caption=caption, png=png))
            names += files
        pictures[part] = tuple(found)
    return pictures, names


def _course_section(result: Reproduction) -> Section:
    course = result.course
    if is_same(course, DEFAULT_COURSE):
        kind = (
            ", a course of our own of the kind that it describes: a tight section at the start, "
            "then long straight sections and gentle curves"
        )
    elif is_same(course, RECONSTRUCTION):
        kind = (
            ", a reconstruction: a course that was searched for so that the six total times come "
            "out near the paper's. That they agree is therefore no evidence of anything"
        )
    else:
        kind = ""
    text = (
        "The paper does not print its waypoints. In their place stands the course "
        f"{as_code(course.name)}{kind}. What can be looked at is the order of the methods, and "
        "about how much each gains; totals need not agree with the paper's."
    )
    if len(course) > MOST_WAYPOINTS:
        return Section("The course", (text, f"It has {len(course)} waypoints; see `paper.json`."))
    rows = tuple(
        (str(index), *(f"{value:.6g}" for value in point))
        for index, point in enumerate(course.waypoints)
    )
    table = Table(title="Waypoints", columns=("waypoint", ">x (m)", ">y (m)", ">z (m)"), rows=rows)
    return Section("The course", (text, table))


def _example_section(result: Reproduction, pictures: tuple[Picture, ...]) -> Section:
    example = result.example
    limits = example.printed.limits
    peaks = np.fmax.reduce(peak_ratios(result.guess, limits), axis=0)
    worst = int(np.nanargmax(peaks))
    exceeds = (
        f"Its {KINDS[worst].label} reaches {peaks[worst]:.3g} times its limit"
        if peaks[worst] > 1.0
        else "It keeps every limit"
    )
    row = example.rows[PEAK]
    if row.duration is None:
        outcome = f"Here `peak` has no certified plan ({row.status})."
    else:
        saved = GUESS_DURATION - row.duration
        outcome = (
            f"Here the optimised trajectory is certified and takes {row.duration:.4g} s, "
            f"{abs(saved):.3g} s {'less' if saved >= 0.0 else 'more'} than that guess."
        )
    text = (
        "Minimum jerk; the initial guess has segment times proportional to distance and a total "
        f"set to {GUESS_DURATION:g} s. Limits: {_limits(limits)}. {exceeds}. The paper calls its "
        'optimised trajectory "feasible and over a second faster than the infeasible initial '
        f'guess". {outcome}'
    )
    return Section("The example", (text, *pictures))


def _comparison_section(one: PaperComparison, pictures: tuple[Picture, ...]) -> Section:
    spline = one.problem.spline_class
    text = (
        f"{one.printed.title}, degree {spline.degree}, continuous up to derivative "
        f"{spline.continuity}. Limits: {_limits(one.printed.limits)}. The last two rows of the "
        "second table are not in the paper's comparison: its Algorithm 1 to the letter, and "
        "`joint`, which frees the coefficients too."
    )
    blocks: list[Block] = [text, beside_table(one), methods_table(one)]
    missing = tuple(
        f"{name} has no certified plan: {row.status}. {row.message}".strip()
        for name, row in one.rows.items()
        if not row.certified
    )
    if missing:
        blocks.append(Points(missing))
    return Section(one.printed.title, (*blocks, *pictures))


def _reasons(result: Reproduction) -> tuple[str, ...]:
    jerk, snap = result.comparisons
    rates = Algorithm1Settings()
    fitted = is_same(result.course, RECONSTRUCTION)
    reasons = [
        "The waypoints are others, as the paper does not print its own."
        + (" These were fitted to its total times, and to nothing else so closely." * fitted),
        "Every total here is that of a plan that is proven to keep every limit at every instant. "
        "The paper iterates until the largest ratio of peak to limit is from 0.95 to 1.05 in each "
        "segment. Of its minimum-snap run it says that it "
        '"does not meet these limits consistently" and was "stopped before the limit was reached '
        'for each segment".',
        "The paper names its limits for the peak optimization alone. Here all methods keep the "
        "same limits: initial guess and Mellinger are stretched uniformly until they do, and no "
        "further.",
        "`peak` here minimises the total time by descent with the exact gradient, so it is not "
        "the paper's Algorithm 1, which has a row of its own. The paper does not print its "
        f"learning rates; ours are {rates.learning_rate:g} and {rates.neighbour_rate:g}. "
        + " ".join(_algorithm_1(one) for one in (jerk, snap)),
        "Of Mellinger's method the paper says that its distribution of segment times is "
        '"not very different from the initial guess as it settled quickly at a local minima". '
        + "".join(_joined(_mellinger(one) for one in (jerk, snap))),
        *_joined(_speed(one) for one in (jerk, snap)),
        "`joint` goes beyond the paper, which states the complete problem and solves it by "
        "alternation. " + "".join(_joined(_joint(one) for one in (jerk, snap))),
    ]
    return tuple(reason.strip() for reason in reasons)


def _joined(sentences: Iterable[str]) -> tuple[str, ...]:
    """One text of what there is to say, or none."""
    text = " ".join(filter(None, sentences))
    return (text,) if text else ()


def _algorithm_1(one: PaperComparison) -> str:
    row, best = one.rows[ALGORITHM_1], one.rows[PEAK]
    title = one.printed.title
    if row.duration is None:
        return f"{title}: it has no certified plan ({row.status})."
    met = "met" if row.status == "solved" else "did not meet"
    against = (
        f", {100.0 * (row.duration / best.duration - 1.0):+.1f} % against `peak`"
        if best.duration
        else ""
    )
    return (
        f"{title}: it {met} its convergence rule in {row.iterations} iterations; stretched, "
        f"{row.duration:.4g} s{against}."
    )


def _mellinger(one: PaperComparison) -> str:
    guess, found = one.plans.get(GUESS), one.plans.get(MELLINGER)
    if guess is None or found is None or len(guess.pieces) == 1:
        return ""
    shares = [np.diff(plan.waypoint_times) / plan.duration for plan in (guess, found)]
    leg = int(np.abs(shares[1] - shares[0]).argmax())
    before, after = (100.0 * share[leg] for share in shares)
    return (
        f"{one.printed.title}: our descent ran {found.iterations} iterations and ended "
        f'"{found.status}"; leg {leg} changed most, from {before:.3g} % to {after:.3g} % of the '
        "total."
    )


def _joint(one: PaperComparison) -> str:
    row, best = one.rows[JOINT], one.rows[PEAK]
    if row.plan is None or row.duration is None or best.duration is None:
        return ""
    return (
        f"{one.printed.title}: {row.duration:.4g} s in {row.pieces} polynomials of degree "
        f"{row.plan.trajectory.degree}, {100.0 * (row.duration / best.duration - 1.0):+.1f} % "
        "against `peak`."
    )


def _speed(one: PaperComparison) -> str:
    """Which of the paper's methods reach the limit of speed, so that no gain is left between."""
    reached = [name for name in COMPARED if "speed" in one.rows[name].binding]
    if len(reached) < 2 or not one.printed.speed_gains:
        return ""
    return (
        f"{one.printed.title}: more than one method reaches the limit of speed here, "
        f"{one.printed.limits.speed:g} m/s ({', '.join(reached)}), which leaves no gain in top "
        "speed between them."
    )


def _difference(one: PaperComparison, name: str, other: str) -> str:
    reduction = one.reduction(name, other)
    return NONE if reduction is None or name == other else f"{-reduction:+.1f} %"


def _figure(value: float | None, unit: str) -> str:
    if value is None:
        return NONE
    return f"{round(value, 1) + 0.0:.1f} %" if unit == "%" else f"{value:.3f} {unit}"


def _limits(limits: Limits) -> str:
    return ", ".join(
        f"{kind.label} {getattr(limits, kind.name):g} {plain_unit(kind.unit)}"
        for kind in limits.active
    )
