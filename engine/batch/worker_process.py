"""A worker process of this machine: `python -m engine.batch.worker_process ADDRESS THREADS BYTES`.

It ends with the process that started it, whose end of its standard input closes then.
"""

from __future__ import annotations

import asyncio
import logging
import os
import resource
import signal
import sys
import threading


def main(address: str, threads: int, memory: int) -> None:
    """Work for the scheduler at an address, with so many threads and no more than so many bytes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to all processes of a terminal, and is the first one's
    resource.setrlimit(resource.RLIMIT_DATA, (memory, resource.getrlimit(resource.RLIMIT_DATA)[1]))
    threading.Thread(target=_end_with_parent, daemon=True).start()
    logging.disable(logging.CRITICAL)
    asyncio.run(_work(address, threads))


async def _work(address: str, threads: int) -> None:
    import dask
    from distributed import Worker

    dask.config.set({"distributed.worker.http.routes": []})
    async with Worker(address, nthreads=threads, host="127.0.0.1", memory_limit=0, dashboard=False) as worker:
        await worker.finished()


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(0)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
