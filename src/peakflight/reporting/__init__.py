"""A plan as one page of HTML: plots to turn and to read, tables, certificate, vehicle.

Plotly is used here and nowhere else in the package.
"""

from importlib.util import find_spec

from peakflight.errors import MissingExtra

if find_spec("plotly") is None:
    raise MissingExtra(
        "reports need plotly, which is not installed; "
        "install it with: pip install 'peakflight[page]'"
    )

from peakflight.reporting.findings import Findings, find
from peakflight.reporting.page import report_html, report_page, write_report

__all__ = ["Findings", "find", "report_html", "report_page", "write_report"]
