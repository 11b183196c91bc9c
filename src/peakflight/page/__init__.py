"""The planner page: a course that is edited by hand in a browser, planned again at every change.

`peakflight page` serves it. What is edited (`edited`, `history`), planning (`asking`, `process`,
`solver`) and what is drawn from a plan (`drawing`, `header`) know nothing of the server.
"""

from peakflight.page.edited import Edited
from peakflight.page.history import History

__all__ = ["Edited", "History"]
