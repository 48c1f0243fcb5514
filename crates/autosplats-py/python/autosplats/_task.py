"""Tasks: a part of a job that one process does alone. They hold paths and settings, never points."""

from __future__ import annotations

import errno
import hashlib
import json
import logging
import os
import socket
import threading
import time
import uuid
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from . import _core
from ._errors import Error

#: Memory that a task takes whatever it does, in bytes: an interpreter with its libraries.
_BASE_MEMORY = 200 << 20

#: Errors of the system that may pass: those of disks of others. An error without a number is one of the network.
_FLAKY = (
    errno.EAGAIN,
    errno.ECONNABORTED,
    errno.ECONNREFUSED,
    errno.ECONNRESET,
    errno.EHOSTUNREACH,
    errno.EIO,
    errno.ENETDOWN,
    errno.ENETUNREACH,
    errno.ESTALE,
    errno.ETIMEDOUT,
    None,
)


@dataclass(frozen=True)
class Row:
    """What has become of a task."""

    #: Name of the task, mostly that of its output.
    task: str
    #: Digest of what was read, so that other files are told from these.
    inputs: str = ""
    #: Number of points written, of files read, or of pictures. 0 if there was nothing to write.
    points: int = 0
    #: Number of points whose neighbours may not all be known, since a neighbouring tile could not be read.
    in_doubt: int = 0
    #: Size of the outputs in bytes.
    bytes: int = 0
    seconds: float = 0.0
    #: Name of the machine.
    host: str = ""
    #: What reading left out or guessed.
    notes: tuple[str, ...] = ()
    #: Why the task failed, in one line; None if it did not.
    error: str | None = None


@dataclass(frozen=True)
class Task(ABC):
    """A part of a job. It can be pickled, and performed anywhere where its paths lead to the same files."""

    #: Name within the job.
    name: str
    #: Number of points that headers state, for the order, the memory and the time left.
    points: int
    #: Digest of what is read.
    inputs: str
    #: Folder for unfinished files and for what later tasks read.
    work: str

    #: Memory per point in bytes.
    bytes_per_point = 300

    @property
    def memory(self) -> int:
        """Memory that the task takes, in bytes."""
        return _BASE_MEMORY + self.bytes_per_point * self.points

    @abstractmethod
    def outputs(self) -> Sequence[str]:
        """The files that the task writes."""

    def needs(self) -> Sequence[str]:
        """The files that it reads and that tasks of an earlier step write."""
        return ()

    @abstractmethod
    def run(self, device: int | str | None) -> tuple[int, int]:
        """Does the work. Returns how many points it wrote, and how many of them are in doubt."""


def run_task(task: Task, *, device: int | str | None = None, version: str = _core.VERSION) -> Row:
    """Performs a task, whose outputs appear whole or not at all.

    Args:
        task: The task.
        device: The graphics device for pictures; see `autosplats.devices`.
        version: Version of the package that planned the job.

    Returns:
        What has become of it. Malformed files and the like are told in `Row.error`.

    Raises:
        OSError: If a file cannot be read or written for now. It is worth another try.
    """
    began = time.perf_counter()
    notes: list[str] = []
    points = in_doubt = size = 0
    error: str | None = None
    try:
        if version != _core.VERSION:
            raise Error(f"autosplats {_core.VERSION} is installed here, but the job is of {version}; install that one")
        with _listening(notes):
            points, in_doubt = task.run(device)
        size = sum(os.path.getsize(path) for path in task.outputs() if os.path.exists(path))
    except Exception as failure:
        if is_flaky(failure):
            raise
        error = told(failure)
    return Row(
        task=task.name,
        inputs=task.inputs,
        points=points,
        in_doubt=in_doubt,
        bytes=size,
        seconds=round(time.perf_counter() - began, 3),
        host=socket.gethostname(),
        notes=tuple(notes),
        error=error,
    )


def is_flaky(failure: BaseException) -> bool:
    """Whether another try may succeed."""
    return isinstance(failure, OSError) and failure.errno in _FLAKY


def unseen(path: str, why: str) -> OSError:
    """An error for a file of an earlier step that is not there. Shares may show it to this machine later."""
    return OSError(errno.ESTALE, why, path)


def told(failure: BaseException) -> str:
    """An exception in one line."""
    if isinstance(failure, OSError) and failure.strerror:
        return f"{failure.filename or 'a file'}: {failure.strerror}"
    said = " ".join(str(failure).split())
    return said if isinstance(failure, (Error, OSError)) and said else f"{type(failure).__name__}: {said}"


def digest(values: object) -> str:
    """A short text that differs if the values do."""
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]


def unfinished_of(work: str) -> Path:
    """The folder for what is of no use when the run ends; made if it is not there."""
    folder = Path(work) / "unfinished"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@contextmanager
def unfinished(output: str, work: str) -> Iterator[str]:
    """A path for a file that becomes `output` once it is whole. Should the process die, it is left in `work`, which
    goes when the job ends."""
    path = unfinished_of(work) / f"{uuid.uuid4().hex}-{os.path.basename(output)}"
    try:
        yield str(path)
        os.replace(path, output)
    finally:
        path.unlink(missing_ok=True)


@contextmanager
def _listening(notes: list[str]) -> Iterator[None]:
    """Collects what this thread's reading notes."""
    thread = threading.get_ident()

    class Handler(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if record.thread == thread:
                notes.append(record.getMessage())

    logger = logging.getLogger("autosplats")
    handler, level = Handler(logging.INFO), logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.setLevel(level)
        logger.removeHandler(handler)
