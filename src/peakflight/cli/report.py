"""`peakflight report`: a plan as one page to look at, to keep and to send."""

from pathlib import Path

import click

from peakflight.cli.inputs import keep_inputs
from peakflight.cli.options import common_options
from peakflight.cli.output import Printout, print_json
from peakflight.cli.progress import Progress
from peakflight.files import write_atomically
from peakflight.result import Plan
from peakflight.wording import seconds

USUAL_NAME = "plan"
"""Of a plan file, without .json: the folder then says more about it."""


@click.command(short_help="A plan as one HTML page: plots, tables, certificate.")
@click.argument("file", metavar="PLAN", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="FILE.html",
    help="The page; by default report.html beside PLAN.",
)
@click.option("--title", help="What stands on top; by default the name of the plan.")
@common_options
def report(file: Path, output: Path | None, title: str | None, as_json: bool) -> int:
    """Write PLAN, a plan.json, as one page that a browser opens without a server or a network.

    The page proves the plan again, and says clearly if it could not. Ends with 0 if everything is
    proven and what the file claims is true, 1 if not (the page is written then too), 2 if it is
    not a plan.

    \b
    Example:
      peakflight report course-plan/plan.json -o report.html
    """  # noqa: D301
    with Progress() as progress:
        progress.stage(f"reading {file.name}")
        plan, values = Plan.load_with_claims(file)
        path = output or file.parent / "report.html"
        keep_inputs(path, [file])
        progress.stage("loading the planner")
        from peakflight.reporting import find, report_page

        progress.stage("proving it again")
        findings = find(plan, claims=values)
        progress.stage("drawing the page")
        write_atomically(path, report_page(findings, title=title or _name(file), file=str(file)))
    wrong = [*findings.plan.report.problems, *findings.false_claims]
    if as_json:
        print_json(
            {
                "report": str(path),
                "feasible": findings.plan.report.feasible,
                "duration": plan.duration,
                "problems": list(findings.plan.report.problems),
                "false_claims": list(findings.false_claims),
            }
        )
    else:
        out = Printout()
        proof = "certified" if findings.plan.report.feasible else "NOT certified"
        out.path(f"{file}: {seconds(plan.duration)} s by {plan.method}, {proof}")
        out.path(f"wrote {path}: open it in a browser")
        out.show()
    if wrong:
        verdict = "false claim" if findings.plan.report.feasible else "not feasible"
        click.echo(f"peakflight: {file}: {verdict}: {wrong[0]}", err=True)
    return 1 if wrong else 0


def _name(file: Path) -> str:
    """What a plan is called: its file, or if that is called as all are, its folder."""
    stem = file.stem
    return (file.resolve().parent.name or stem) if stem == USUAL_NAME else stem
