"""Points that move."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from typing import overload

import numpy as np
import numpy.typing as npt

from . import _core
from ._cloud import Cloud
from ._files import Source, reading
from ._progress import ProgressLike, reporting
from ._threads import checked


class Recording(Sequence[Cloud]):
    """Frames of points in the order of time, read when they are asked for.

    Any frame can be asked for; those after each other are read fastest. A live stream has no length: iterate over it.
    """

    def __init__(self, core: _core.Recording, num_threads: int | None) -> None:
        self._core = core
        self._threads = num_threads
        self._stamps = core.stamps

    @property
    def stamps(self) -> npt.NDArray[np.int64] | None:
        """Times (frames,) in nanoseconds; of a recording those of its messages. None for a live stream."""
        return None if self._stamps is None else np.array(self._stamps, dtype=np.int64)

    def __len__(self) -> int:
        if self._stamps is None:
            raise TypeError("a live stream has no length; iterate over it")
        return len(self._stamps)

    @overload
    def __getitem__(self, index: int) -> Cloud: ...
    @overload
    def __getitem__(self, index: slice) -> list[Cloud]: ...
    def __getitem__(self, index: int | slice) -> Cloud | list[Cloud]:
        """The points that are seen at a frame."""
        count = len(self)
        if isinstance(index, slice):
            return [self[frame] for frame in range(*index.indices(count))]
        frame = index.__index__()
        if not -count <= frame < count:
            raise IndexError(f"frame {frame} of {count}")
        return Cloud._of(self._core.frame(frame % count, self._threads))

    def __iter__(self) -> Iterator[Cloud]:
        if self._stamps is not None:
            yield from (self[frame] for frame in range(len(self)))
            return
        while (cloud := self._core.next()) is not None:
            yield Cloud._of(cloud)

    def __repr__(self) -> str:
        return f"<autosplats.Recording of {'live points' if self._stamps is None else f'{len(self)} frames'}>"


def play(
    source: Source,
    *,
    fps: float | None = None,
    topics: Sequence[str] = (),
    frame: str | None = None,
    decay: float | None = None,
    accumulate: bool = False,
    sample: int | None = None,
    scanners: int | None = None,
    columns: Sequence[str] | None = None,
    keep: str | None = None,
    exact: bool = False,
    progress: ProgressLike = None,
    num_threads: int | None = None,
) -> Recording:
    """Opens points that move.

    Args:
        source: A recording (.mcap, .bag, the folder of a ROS 2 bag), a folder or a pattern of files, an animated glTF,
            or an animated scene.
        fps: Frames per second of files (10 by default) and of animations (30 by default).
        topics: Topics of a recording; by default all with points.
        frame: Coordinate frame for the points of a recording.
        decay: Seconds for which older points stay visible.
        accumulate: Older points stay visible for ever.
        sample: Points sampled on the surface of a mesh, in place of its vertices.
        scanners: Number of simulated scanners whose points replace all others.
        columns: Names of the columns of text files.
        keep: Which points to keep, as in `read`.
        exact: Keep every digit of coordinates.
        progress: True for a bar, or a function of the finished fraction, while the source is opened.
        num_threads: Number of threads; see `num_threads`.

    Raises:
        EmptyError: If there is no frame.
        FileNotFoundError, OSError: If the system does not give a file.
        FormatError: If the recording is malformed.
    """
    playing = {
        "fps": None if fps is None else float(fps),
        "topics": list(topics),
        "frame": frame,
        "sample": sample,
        "scanners": scanners,
        "decay": None if decay is None else float(decay),
        "accumulate": accumulate,
    }
    options = reading(exact=exact, columns=columns, keep=keep)
    threads = checked(num_threads)
    with reporting(progress, "opening") as report:
        return Recording(_core.Recording(os.fspath(source), playing, options, threads, report), threads)
