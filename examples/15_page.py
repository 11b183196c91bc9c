"""The planner page, served from Python: open its address in a browser while it is served."""

import peakflight as pf
from peakflight.page import Edited
from peakflight.page.server import PageServer

course = pf.read_course("examples/courses/tight_then_fast.csv")
edited = Edited.of_course(course, vehicle=pf.find_vehicle("crazyflie-2.1-upgrade"))

server = PageServer(edited.limit({"speed": 3.0}), port=0)
print(f"served at {server.url}")
server.close()  # here one would wait: threading.Event().wait()
