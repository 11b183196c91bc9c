"""How fast peakflight is, how good its answers are, and how both compare: `python -m benchmarks`.

Nothing here is imported by the package. Numerical libraries get one thread each, before any of
them is imported: every figure is about one thread.
"""

import os

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

for _name in THREADS:
    os.environ[_name] = "1"
