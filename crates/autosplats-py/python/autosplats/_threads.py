"""The number of threads."""

from __future__ import annotations

from . import _core
from ._errors import ArgumentError


def checked(threads: int | None, name: str = "num_threads") -> int | None:
    """The number, if it is one of threads."""
    if threads is None:
        return None
    if isinstance(threads, bool) or not hasattr(threads, "__index__"):
        raise TypeError(f"{name}: {type(threads).__name__} given, a whole number or None is wanted")
    number = threads.__index__()
    if not 1 <= number <= 1024:
        raise ArgumentError(f"{name} is {number}, must be within 1 to 1024")
    return number


def num_threads() -> int:
    """The number of threads of calls that name none.

    This is what `set_num_threads` was given, else the first of the variables AUTOSPLATS_NUM_THREADS,
    RAYON_NUM_THREADS and OMP_NUM_THREADS, else the number of cores that this process may use by its affinity and its
    control group.
    """
    return _core.num_threads()


def set_num_threads(threads: int | None) -> None:
    """Sets the number of threads, 1 to 1024, of later calls that name none. None undoes it.

    Results do not depend on the number of threads.
    """
    _core.set_num_threads(checked(threads, "threads"))
