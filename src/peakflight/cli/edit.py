"""`peakflight edit`: slower, delayed, turned, moved, joined; and proven again."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from peakflight.cli.options import common_options, limits_option
from peakflight.cli.output import Printout, print_json
from peakflight.cli.progress import Progress
from peakflight.cli.verdict import as_dict, change, end, print_verdict
from peakflight.errors import InvalidFile, InvalidProblem, quoted
from peakflight.limits import Limits
from peakflight.numerals import as_number
from peakflight.result import Plan

ORDER = "peakflight.order"
"""Where the command keeps the names of its options in the order in which they were given."""


class InOrder(click.Command):
    """A command that knows in which order its options were given."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse once for the order, once as ever."""
        if not ctx.resilient_parsing:
            _, _, order = self.make_parser(ctx).parse_args(args=list(args))
            ctx.meta[ORDER] = [parameter.name for parameter in order]
        return super().parse_args(ctx, args)


def _number(text: str, what: str) -> float:
    try:
        number = as_number(text)
    except ValueError:
        raise InvalidProblem(f"{what} is {quoted(text)}; it must be a number") from None
    if not math.isfinite(number):
        raise InvalidProblem(f"{what} is {number}; it must be finite")
    return number


def _part(text: str) -> float:
    """0.8 of `80%` or `0.8`."""
    is_percent = text.endswith("%")
    number = _number(text.removesuffix("%").strip(), "the pace")
    return number / 100.0 if is_percent else number


def _seconds(text: str) -> float:
    return _number(text.removesuffix("s").strip(), "the time")


def _angle(text: str) -> float:
    """Rad of `90`, `90deg` or `1.57rad`."""
    if text.endswith("rad"):
        return _number(text.removesuffix("rad"), "the angle")
    return math.radians(_number(text.removesuffix("deg"), "the angle"))


def _vector(text: str) -> list[float]:
    parts = text.split(",")
    if len(parts) != 3:
        raise InvalidProblem(f"{quoted(text)} has {len(parts)} numbers; it must have 3, as 1,0,0.5")
    return [_number(part, "a number") for part in parts]


def _factors(text: str) -> float | list[float]:
    return _vector(text) if "," in text else _number(text, "the factor")


def _axis(text: str) -> str:
    if text not in ("x", "y"):
        raise InvalidProblem(f"the axis is {quoted(text)}; it must be x or y")
    return text


def _plan(text: str) -> Plan:
    return Plan.load(text)


def _nothing(text: str) -> None:
    del text


PARSERS: dict[str, Callable[[str], Any]] = {
    "slow": _part,
    "duration": _seconds,
    "delay": _seconds,
    "rotate": _angle,
    "mirror": _axis,
    "move": _vector,
    "scale": _factors,
    "reverse": _nothing,
    "retime": _nothing,
    "join": _plan,
}
"""Verb to what becomes of its text."""


def _verb(name: str, metavar: str, help: str) -> Callable[[Any], Any]:
    return click.option(f"--{name}", multiple=True, metavar=metavar, help=help)


@click.command(cls=InOrder, short_help="Slow down, delay, turn, move, join plans; proven again.")
@click.argument("file", metavar="PLAN", type=click.Path(path_type=Path))
@_verb("slow", "PERCENT", "Fly at this part of the pace: 80% or 0.8.")
@_verb("duration", "SECONDS", "Fly the path in this time.")
@_verb("delay", "SECONDS", "Hover at the first waypoint before the flight.")
@_verb("rotate", "DEGREES", "Turn about the vertical through the origin, counterclockwise from "
       "above; also as 1.57rad.")  # fmt: skip
@_verb("mirror", "x|y", "Change the sign of x, or of y.")
@_verb("move", "X,Y,Z", "Move by so many m.")
@_verb("scale", "FACTOR|X,Y,Z", "Make larger about the origin, alike or by a factor for each axis.")
@click.option("--reverse", count=True, help="Fly backwards.")
@click.option("--retime", count=True, help="Fly the path as fast as the limits allow.")
@_verb("join", "PLAN", "Fly another plan afterwards, after a transition that keeps the limits.")
@limits_option("Limits to keep from now on.")
@click.option(
    "--keep-limits", is_flag=True, help="In the end, slow down as far as the limits need it."
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="NEW.json",
    help="Where the new plan goes; without it nothing is written.",
)
@common_options
@click.pass_context
def edit(
    context: click.Context,
    /,
    file: Path,
    limits: Limits | None,
    keep_limits: bool,
    output: Path | None,
    as_json: bool,
    **verbs: Any,
) -> int:
    """Change PLAN, a plan.json, by verbs in the order given, and prove the result.

    Ends with 0 if the new plan is proven to keep every limit, 1 if not, 2 if the input is wrong.

    \b
    Example:
      peakflight edit plan.json --slow 80% --rotate 90 --move 1,0,0.5 -o new.json
      peakflight edit a.json --join b.json --reverse -o there_and_back.json
    """  # noqa: D301
    steps = _steps(context, verbs)
    if not (steps or limits or keep_limits):
        raise click.UsageError("say what to do with the plan, such as --slow 80%", context)
    with Progress() as progress:
        progress.stage(f"reading {file.name}")
        old = Plan.load(file)
        plan = _edited(old, steps, limits, keep_limits, progress)
        if output is not None:
            plan.save(output)
    done = plan.message.split("; ")[len(_said(old)) :]
    done = [line for line in done if line and line not in plan.report.problems]
    if as_json:
        written = None if output is None else str(output)
        print_json(
            {**as_dict(plan), "duration_before": old.duration, "done": done, "file": written}
        )
    else:
        out = Printout()
        out.path(f"{file}: {'; '.join(done) or 'as it was'}")
        out.pairs([("total time", change(old.duration, plan.duration))])
        print_verdict(out, plan)
        out.line()
        out.path("nothing written; -o NEW.json keeps it" if output is None else f"wrote {output}")
        out.show()
    return end(output or file, plan)


def _steps(context: click.Context, verbs: dict[str, Any]) -> list[tuple[str, Any]]:
    """Verbs in the order given, each with what it was given."""
    waiting = {
        name: list(given) if isinstance(given, tuple) else [] for name, given in verbs.items()
    }
    steps = []
    for name in context.meta[ORDER]:
        if name not in PARSERS:
            continue
        text = waiting[name].pop(0) if waiting[name] else ""
        try:
            steps.append((name, PARSERS[name](text)))
        except InvalidFile:
            raise
        except InvalidProblem as error:
            raise click.BadParameter(str(error), context, param_hint=f"--{name}") from None
    return steps


def _edited(
    plan: Plan,
    steps: list[tuple[str, Any]],
    limits: Limits | None,
    keep_limits: bool,
    progress: Progress,
) -> Plan:
    from peakflight import editing
    from peakflight.joining import join

    actions: dict[str, Callable[[Plan, Any], Plan]] = {
        "slow": editing.slow,
        "duration": editing.to_duration,
        "delay": editing.delay,
        "rotate": editing.rotate,
        "mirror": editing.mirror,
        "move": editing.move,
        "scale": editing.scale,
        "reverse": lambda whole, _: editing.reverse(whole),
        "retime": lambda whole, _: editing.retime(whole),
        "join": lambda whole, other: join(whole, other, limits=limits),
    }
    if limits is not None:
        plan = editing.under_limits(plan, limits)
    for index, (name, value) in enumerate(steps):
        progress.stage(f"{name}", index / len(steps))
        plan = actions[name](plan, value)
    return editing.keep_limits(plan) if keep_limits else plan


def _said(plan: Plan) -> list[str]:
    """What the plan said before; edits leave out what was wrong with it."""
    return [line for line in plan.message.split("; ") if line and line not in plan.report.problems]
