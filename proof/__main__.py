"""``python -m proof``: threads are pinned before anything numerical is imported."""

import os
import sys

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

if __name__ == "__main__":
    from .benchmark.command import COMMANDS
    from .benchmark.command import main as benchmark
    from .register_command import COMMANDS as REGISTER
    from .register_command import main as register
    from .run import main

    asked = sys.argv[1] if len(sys.argv) > 1 else ""
    sys.exit(benchmark(sys.argv[1:]) if asked in COMMANDS else register(sys.argv[1:]) if asked in REGISTER else main())
