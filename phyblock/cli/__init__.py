"""The command line: the only place that imports click and rich."""

import os

# Threads of BLAS wait for one another on small matrices; numpy reads this when it is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
