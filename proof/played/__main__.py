"""``python -m proof.played make DIR --seed N --cases K``; `proof.drives` scores what it made, and prints the table."""

import os
import sys

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

if __name__ == "__main__":
    from .make import main

    sys.exit(main())
