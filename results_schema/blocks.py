"""Numbers in slices of their first axis, of which one at a time is in memory."""

import math
from collections.abc import Iterator

IN_MEMORY = 2**26  # bytes of results that are put together, or read, as a whole
CHUNK_BYTES = 2**20  # of a compressed chunk in an archive
BLOCK_BYTES = 2**24
APART = 32  # numbers of a variant, such as errors of its results, at most


def chunk_shape(shape: tuple[int, ...], itemsize: int) -> tuple[int, ...]:
    """Chunks of about a megabyte that keep the last axes whole, so that one variant's rows lie together; a few numbers
    of each of very many variants lie apart, as they are asked for.

    >>> chunk_shape((1000, 400, 200), 8)
    (1, 400, 200)
    >>> chunk_shape((1_000_000,), 8), chunk_shape((1_000_000, 12), 8)
    ((131072,), (131072, 1))
    >>> chunk_shape((1000, 1000, 12), 8)
    (131, 1000, 1)
    """
    left = max(1, CHUNK_BYTES // itemsize)
    if len(shape) > 1 and shape[-1] <= APART and math.prod(shape[:-1]) >= left:
        return (*chunk_shape(shape[:-1], itemsize), 1)
    chunks = []
    for size in reversed(shape):
        chunks.append(min(size, left))
        left = max(1, left // max(1, size))
    return tuple(reversed(chunks))


def slices(shape: tuple[int, ...], itemsize: int) -> Iterator[slice]:
    """The first axis of numbers in blocks of whole chunks.

    >>> list(slices((5_000_000,), 8))
    [slice(0, 2097152, None), slice(2097152, 4194304, None), slice(4194304, 5000000, None)]
    """
    chunk = max(1, chunk_shape(shape, itemsize)[0])
    step = chunk * max(1, BLOCK_BYTES // max(1, chunk * math.prod(shape[1:]) * itemsize))
    for first in range(0, shape[0], step):
        yield slice(first, min(first + step, shape[0]))
