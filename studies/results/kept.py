"""What sentences and tables ask of the same results again and again."""

from collections.abc import Callable
from functools import lru_cache, partial, wraps
from typing import Concatenate, ParamSpec, TypeVar

from studies.results.results import Results

P = ParamSpec("P")
T = TypeVar("T")
#: Last answers that are kept of each question: those of the sensors of one unit, in most studies. Of a million variants
#: an answer takes 8 or 16 MB.
LAST = 4


def kept(find: Callable[Concatenate[Results, P], T]) -> Callable[Concatenate[Results, P], T]:
    """A question to results and what goes with them (names), the last few answers to which these keep; answers are not
    to be changed."""

    @wraps(find)
    def found(results: Results, /, *args: P.args, **kwargs: P.kwargs) -> T:
        name = f"_kept_{find.__module__}.{find.__qualname__}"
        if name not in vars(results):
            vars(results)[name] = lru_cache(LAST)(partial(find, results))
        answer: T = vars(results)[name](*args, **kwargs)
        return answer

    return found
