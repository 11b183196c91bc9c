"""What stands on top of the panel: total time, what is proven, what was gained. Plain HTML."""

from dataclasses import dataclass
from html import escape

from peakflight.page import colours
from peakflight.page.drawing import Held, Leg
from peakflight.result import Plan

MOST_ROWS = 250
"""Legs in the table: of more, the first."""
SMALL = f"font-size:12px;line-height:1.45;color:{colours.QUIET}"


@dataclass(frozen=True, eq=False, kw_only=True)
class Summary:
    """What the header says."""

    plan: Plan | None
    """What is drawn; the badge is computed from its report and nothing else."""
    fresh: bool
    """Whether that answers the course as it is."""
    follows: bool = False
    """Whether it answers what the course was a moment ago, while something is dragged."""
    pending: bool = False
    """Whether an answer is on its way."""
    whole: bool
    """Whether it is the last word; else a draft."""
    error: str = ""
    """Why there is no plan of the course as it is."""
    refused: str = ""
    """Why the last change was not made."""
    busy: float | None = None
    """How long planning has been going on, s."""
    notice: str = ""
    """What the planner says meanwhile."""
    guess: float | None = None
    """Total time of the paper's initial guess, s."""
    accepted: float | None = None
    """Total time of the accepted plan, s."""
    seconds: float = 0.0
    """What planning took."""


def badge(summary: Summary) -> tuple[str, str, str]:
    """Word, colour and explanation of what is proven about the plan that is drawn."""
    plan = summary.plan
    if plan is None:
        return ("no plan", colours.BAD, "") if summary.error else ("planning", colours.BUSY, "")
    if not plan.report.feasible:
        why = plan.message or "; ".join(plan.report.problems)
        return "not certified", colours.BAD, why
    if summary.fresh and not summary.error:
        return "certified", colours.GOOD, "every limit is proven, not sampled"
    if summary.follows:
        return (
            "draft, proven",
            colours.QUIET,
            "what is drawn is proven, and follows what is dragged",
        )
    if summary.pending:
        return "planning", colours.BUSY, "what is drawn answers the course before the last change"
    return EARLIER, colours.QUIET, "what is drawn does not answer the course as it is"


def header(summary: Summary) -> str:
    """The top of the panel."""
    plan = summary.plan
    time = "\u2013" if plan is None else f"{plan.duration:.3f}"
    word, colour, why = badge(summary)
    mark = "\u2713 " if word == "certified" else ""
    lines = [
        f'<div style="display:flex;align-items:baseline;justify-content:space-between;gap:8px">'
        f'<div><span data-total style="font-size:38px;font-weight:700;letter-spacing:-0.5px;'
        f'font-variant-numeric:tabular-nums;color:{colours.INK}">{time}</span>'
        f'<span style="font-size:16px;color:{colours.QUIET}"> s total</span></div>'
        f'<span data-badge title="{escape(why, quote=True)}" style="background:{colour};'
        f"color:white;border-radius:10px;padding:2px 10px;font-size:12.5px;"
        f'font-weight:600;white-space:nowrap">'
        f"{mark}{word}</span></div>",
    ]
    if plan is not None:
        gains = _gain(plan.duration, summary.guess, "the proportional guess")
        gains += _gain(plan.duration, summary.accepted, "the accepted plan")
        lines.append(f'<div style="{SMALL}">{"<br>".join(gains) or "&nbsp;"}</div>')
    lines.append(f'<div data-state style="{SMALL}">{_state(summary)}</div>')
    if summary.error or summary.refused or (why and word == "not certified"):
        text = escape(summary.refused or summary.error or why)
        lines.append(
            f'<div data-error style="margin-top:4px;padding:6px 8px;border-left:3px solid '
            f'{colours.BAD};background:#fdf1f0;color:{colours.BAD};font-size:12.5px">{text}</div>'
        )
    return f'<div style="padding:2px 12px 4px">{"".join(lines)}</div>'


def legs_table(legs: tuple[Leg, ...]) -> str:
    """Time and nearest limit of each leg, as a table."""
    shown = legs
    note = ""
    if len(legs) > MOST_ROWS:
        shown = legs[:MOST_ROWS]
        note = f'<p style="{SMALL}">the first {MOST_ROWS} of {len(legs)} legs</p>'
    rows = "".join(
        f'<tr style="border-top:1px solid #edf0f3"><td>{leg.index}</td>'
        f'<td style="{RIGHT}">{leg.duration:.3f}</td><td style="{RIGHT}">{leg.length:.2f}</td>'
        f"<td>{_held(leg)}</td></tr>"
        for leg in shown
    )
    return (
        f'<div style="padding:0 12px;max-height:560px;overflow-y:auto">'
        f'<table data-legs style="width:100%;border-collapse:collapse;font-size:12.5px;'
        f'color:{colours.INK};font-variant-numeric:tabular-nums">'
        f'<tr style="text-align:left;color:{colours.QUIET}"><th style="padding-right:6px">leg</th>'
        f'<th style="{RIGHT}">time (s)</th><th style="{RIGHT}">length (m)</th>'
        f"<th>held back by</th></tr>{rows}</table>{note}</div>"
    )


def course_line(name: str, count: int, length: float) -> str:
    """What is edited, and how."""
    return (
        f'<div style="padding:2px 12px;font-size:13.5px;line-height:1.5;color:{colours.INK};'
        f'overflow-wrap:anywhere"><b>{escape(name)}</b>: {count} waypoints, {length:.1f} m. Drag a '
        "ball: it stays at its height; with Shift, up and down. The arrows move the chosen one "
        "along an axis.</div>"
    )


def message(text: str, *, good: bool) -> str:
    """What became of a file."""
    colour = colours.GOOD if good else colours.BAD
    return (
        f'<div data-file style="margin:2px 12px;padding:6px 8px;border-left:3px solid {colour};'
        f'color:{colour};font-size:12.5px;overflow-wrap:anywhere">{escape(text)}</div>'
    )


def speed_legend(top: float) -> str:
    """The scale of colours of the path."""
    middle = f"{top / 2.0:.3g}"
    return (
        f'<div style="padding:2px 12px;font-size:12px;color:{colours.QUIET}">path, by speed (m/s)'
        f'<div style="height:9px;border-radius:5px;margin:3px 0;background:{colours.gradient()}">'
        f'</div><div style="display:flex;justify-content:space-between"><span>0</span>'
        f"<span>{middle}</span><span>{top:.3g}</span></div></div>"
    )


EARLIER = "earlier plan"
RIGHT = "text-align:right;padding-right:10px;white-space:nowrap"


def _gain(duration: float, other: float | None, what: str) -> list[str]:
    """A line on how much shorter this is."""
    if other is None:
        return []
    part = 100.0 * (duration / other - 1.0)
    if abs(part) < 0.005:
        return [f"as long as {what} ({other:.3f} s)"]
    word, colour = ("shorter", colours.GOOD) if part < 0.0 else ("longer", colours.BAD)
    return [f'<b style="color:{colour}">{abs(part):.1f} % {word}</b> than {what} ({other:.3f} s)']


def _state(summary: Summary) -> str:
    """What is going on, in a line."""
    if summary.busy is not None:
        return f"planning, {summary.busy:.1f} s. {escape(summary.notice)}"
    plan = summary.plan
    if plan is None:
        return "&nbsp;"
    pieces = len(plan.trajectory)
    kind = "" if summary.whole else "draft: "
    counted = f"{pieces} polynomial{'' if pieces == 1 else 's'}"
    return f"{kind}{escape(plan.method)}, {counted}, planned in {1e3 * summary.seconds:.0f} ms"


def _held(leg: Leg) -> str:
    """Which limits are reached, each with the part of the time; or which comes nearest."""
    reached = [one for one in leg.held if one.binds]
    if not reached:
        nearest = leg.held[0]
        return (
            f'<span style="color:{colours.QUIET}">{escape(nearest.label)}, '
            f"{100.0 * nearest.ratio:.1f} % of it</span>"
        )
    first, *others = reached
    text = f"<b>{escape(first.label)}</b> {_share(first)}"
    if others:
        names = ", ".join(f"{escape(one.label)} {_share(one)}" for one in others)
        text += f'<div style="font-size:11.5px;color:{colours.QUIET}">{names}</div>'
    return text


def _share(one: Held) -> str:
    """Part of the time that a limit is flown at."""
    return f"{100.0 * one.share:.0f} %" if one.share >= 0.005 else "for a moment"
