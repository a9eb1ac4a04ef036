"""``python -m proof``: threads are pinned before anything numerical is imported."""

import os
import sys

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

if __name__ == "__main__":
    from .benchmark.command import COMMANDS
    from .benchmark.command import main as benchmark
    from .run import main

    sys.exit(benchmark(sys.argv[1:]) if sys.argv[1:2] and sys.argv[1] in COMMANDS else main())
