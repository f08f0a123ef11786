"""Benchmarks: `python -m benchmarks` runs them all. Figures are for one core, so the linear algebra gets one thread."""

import os

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
