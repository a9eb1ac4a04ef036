"""``python -m proof.drives``: threads are pinned before anything numerical is imported."""

import os
import sys

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

if __name__ == "__main__":
    from .command import main

    sys.exit(main())
