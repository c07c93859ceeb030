"""People are told once when kernels are compiled, and not where the cache holds them."""

import numba

from engine.kernels.compiling import WORDS, told_of_compiling


def test_it_is_told_once_and_only_when_something_is_compiled() -> None:
    said: list[str] = []
    with told_of_compiling(said.append):
        assert said == []
        for step in (1.0, 2.0):
            numba.njit(lambda x, step=step: x + step)(1.0)
    assert said == [WORDS] and "for this kind of scene" in WORDS  # others have kernels of their own
