"""The paper's figures of its experiment, drawn from flights in simulation."""

from collections.abc import Iterator

from peakflight.figures import FlownPlan, flown_figures
from peakflight.paper_flights import FlownComparison
from peakflight.paper_pictures import Drawn

CAPTIONS = {
    "paths": "The paper's Fig. TrajRes, {}: flown trajectories; a red cross where one crashed.",
    "derivatives": "The paper's Fig. DerRes, {}: motion derivatives of the flown positions by "
    "differences and means of five; limits dashed, a red cross when one crashed.",
    "errors": "The paper's Fig. Error, {}: distance from the plan while it lasts; a red cross when "
    "one crashed.",
}


def flight_pictures(one: FlownComparison) -> Iterator[Drawn]:
    """Draw a comparison as flown: its part of Figs. TrajRes, DerRes and Error."""
    flown = {
        name: FlownPlan(found.plan, found.analysis, crash.time if crash else None)
        for name, found in one.flown.items()
        if found.analysis is not None
        for crash in (found.flight.crash,)
    }
    if not flown:
        return
    printed = one.comparison.printed
    for kind, figure in flown_figures(flown, title=f"{printed.title}, flown").items():
        said = CAPTIONS[kind].format(printed.title.lower())
        yield Drawn(f"flown-{printed.name}-{kind}", said, figure)
