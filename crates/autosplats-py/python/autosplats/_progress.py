"""Progress: what a caller's `progress` means."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any, Union

#: None or False for silence, True for a bar, or a function of the finished fraction, 0 to 1.
ProgressLike = Union[bool, Callable[[float], object], None]


@contextmanager
def reporting(progress: ProgressLike, title: str) -> Iterator[Callable[[float], object] | None]:
    """What the work shall call with its finished fraction, for as long as the work takes."""
    if progress is None or progress is False:
        yield None
    elif progress is True:
        bar = _bar(title)
        try:
            yield bar.send
        finally:
            bar.close()
    elif callable(progress):
        yield progress
    else:
        given = type(progress).__name__
        raise TypeError(f"progress: {given} given; None, True or a function of the finished fraction is wanted")


class _Bar:
    """A bar of tqdm, or a line on standard error where tqdm is not installed."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._told = -1
        self._tqdm: Any = None
        try:
            tqdm = import_module("tqdm.auto").tqdm
        except ImportError:
            return
        self._tqdm = tqdm(total=100, desc=title, unit="%", bar_format="{desc}: {percentage:3.0f}%|{bar}| {elapsed}")

    def send(self, fraction: float) -> None:
        percent = int(100 * fraction)
        if percent <= self._told:
            return
        if self._tqdm is not None:
            self._tqdm.update(percent - max(self._told, 0))
        else:
            print(f"\r{self._title}: {percent} %", end="", file=sys.stderr, flush=True)
        self._told = percent

    def close(self) -> None:
        if self._tqdm is not None:
            self._tqdm.close()
        elif self._told >= 0:
            print(file=sys.stderr)


def _bar(title: str) -> _Bar:
    return _Bar(title)
