"""One thread of linear algebra: its matrices are small here, and idle threads that spin take the processors' time."""

from __future__ import annotations

import os

for _library in ("OPENBLAS", "OMP", "MKL"):  # before numpy is imported, and for processes that tests start
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
