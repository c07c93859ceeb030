"""How often a process of our own looks for objects that refer to each other in circles."""

import gc

#: New objects between two looks, of which each tenth is at all objects of the process, and imports and compiling make
#: millions of these that stay: by Python's 700 the first run of a train takes 13.9 s in place of 12.2, and once its
#: kernels are compiled 2.9 in place of 2.5. By 10,000 to 200,000 it takes the same, and no more memory.
NEW_OBJECTS = 50_000


def collect_seldom() -> None:
    """Look less often than Python does."""
    gc.set_threshold(NEW_OBJECTS)
