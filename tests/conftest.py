"""Settings for all tests: kernels are compiled once per user cache, figures need no screen."""

import os

# many small matrices: threads of the linear algebra library would only wait for each other
for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
os.environ.setdefault("MPLBACKEND", "Agg")
