"""Jobs: what is to be done, what is done already, and the report."""

from __future__ import annotations

import json
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Union

from . import _core
from ._errors import ArgumentError, Error
from ._task import Row, Task, run_task, told

#: None or False for silence, True for a line on standard error, or a function of the finished fraction, 0 to 1.
Progress = Union[bool, Callable[[float], object], None]

#: Seconds between two lines of progress.
_STEP = 0.5
#: Failed tasks that a report names.
_NAMED = 10


class JobError(Error):
    """Tasks of a job have failed; `report` tells which."""

    def __init__(self, report: Report) -> None:
        super().__init__(str(report))
        self.report = report


@dataclass(frozen=True)
class Report:
    """What a run of a job has done."""

    #: What has become of the tasks that this run performed.
    rows: Sequence[Row]
    #: Number of tasks whose outputs were there.
    kept: int
    seconds: float
    #: What the job's points are: "points", or "pictures".
    unit: str = "points"

    @property
    def failed(self) -> Sequence[Row]:
        """Rows of the tasks that failed."""
        return [row for row in self.rows if row.error is not None]

    @property
    def in_doubt(self) -> int:
        """Number of points whose neighbours may not all be known."""
        return sum(row.in_doubt for row in self.rows)

    def raise_if_failed(self) -> None:
        """Raises:
        JobError: If a task has failed.
        """
        if self.failed:
            raise JobError(self)

    def __str__(self) -> str:
        failed = self.failed
        points = sum(row.points for row in self.rows)
        doubt = f", {self.in_doubt} in doubt" if self.unit == "points" else ""
        kept = f", {self.kept} were there" if self.kept else ""
        lost = f", {len(failed)} failed" if failed else ""
        done = len(self.rows) - len(failed)
        lines = [f"{done} tasks done{kept}{lost}; {points} {self.unit}{doubt}; {self.seconds:.1f} s"]
        lines += [f"{row.task}: {row.error}" for row in failed[:_NAMED]]
        if len(failed) > _NAMED:
            lines.append(f"and {len(failed) - _NAMED} more")
        return "\n".join(lines)


class Job:
    """Tasks, in steps that follow each other, and the manifest that tells what is done.

    Made by the functions of `autosplats.jobs`. A job that is run again does only what is missing.
    """

    def __init__(
        self,
        kind: str,
        settings: Mapping[str, Any],
        manifest: Path,
        steps: Sequence[Sequence[Task]],
        *,
        prepare: Callable[[], None] = lambda: None,
        unit: str = "points",
    ) -> None:
        self.kind = kind
        #: What all outputs share; other settings over old outputs are refused.
        self.settings = {"autosplats": _core.VERSION, "kind": kind, **settings}
        #: File beside the outputs: the settings, then a row per task, as lines of JSON.
        self.manifest = manifest
        self.steps = steps
        self.unit = unit
        self._prepare = prepare

    @property
    def tasks(self) -> Sequence[Task]:
        """The tasks that write the outputs."""
        return self.steps[-1]

    @property
    def work(self) -> Path:
        """Folder for unfinished files, which goes when the job is done."""
        return work_of(self.manifest)

    def run(self, *, retries: int = 3, progress: Progress = None) -> Report:
        """Runs the job in this process, one task after another.

        Args:
            retries: How often a task is tried again if a file cannot be read or written for now.
            progress: True for a line on standard error, or a function of the finished fraction.

        Raises:
            ArgumentError: If there are outputs of other settings, or of unknown ones.
            OSError: If the manifest cannot be written.
        """
        with self.begin(progress) as run:
            for tasks in run.steps():
                for task in tasks:
                    run.add(_attempt(task, retries))
        return run.report()

    def begin(self, progress: Progress = None) -> Run:
        """A run of the job by whatever performs tasks; see `Run`."""
        return Run(self, progress)

    def prepare(self) -> None:
        """Writes what tasks read."""
        self.manifest.parent.mkdir(parents=True, exist_ok=True)
        self._prepare()

    def __repr__(self) -> str:
        return f"<autosplats.jobs.Job {self.kind} of {len(self.tasks)} tasks>"


def work_of(manifest: Path) -> Path:
    """The folder for unfinished files of the job with this manifest."""
    return manifest.with_suffix(".work")


def _attempt(task: Task, retries: int) -> Row:
    for left in reversed(range(retries + 1)):
        try:
            return run_task(task)
        except OSError as error:
            if left == 0:
                return failed(task, error)
    raise AssertionError("there is at least one attempt")


def failed(task: Task, error: BaseException) -> Row:
    """The row of a task that failed for good: its engine has given up."""
    return Row(task=task.name, inputs=task.inputs, error=told(error))


class Run:
    """A run of a job: hands out the tasks that are missing, and keeps account.

    >>> with job.begin() as run:                        # doctest: +SKIP
    ...     for tasks in run.steps():                   # each step when the one before is done
    ...         for row in map(run_task, tasks):        # by any engine, in any order
    ...             run.add(row)
    >>> run.report().raise_if_failed()                  # doctest: +SKIP
    """

    def __init__(self, job: Job, progress: Progress) -> None:
        self._job = job
        self._began = time.perf_counter()
        self._rows: list[Row] = []
        self._missing: list[list[Task]] = []
        self._last: set[str] = set()
        self._kept = 0
        self._file: IO[str] | None = None
        self._told = _Teller(job.kind, progress)

    def __enter__(self) -> Run:
        job = self._job
        known = self._open()
        try:
            folder = job.manifest.parent
            there = {entry.name for entry in os.scandir(folder)}
            last = [task for task in job.tasks if not _is_done(task, known.get(task.name), there)]
            self._last = {task.name for task in last}
            self._kept = len(job.tasks) - len(last)
            steps = [last]
            for earlier in reversed(job.steps[:-1]):
                wanted = {path for task in steps[0] for path in task.needs()}
                made = [task for task in earlier if wanted.intersection(task.outputs())]
                steps.insert(0, [task for task in made if not all(map(os.path.exists, task.outputs()))])
            if last:
                job.work.mkdir(exist_ok=True)
                job.prepare()
            self._missing = [sorted(step, key=lambda task: -task.points) for step in steps]
            self._told.begin([task for step in self._missing for task in step])
        except BaseException:
            self._close()
            raise
        return self

    def _open(self) -> dict[str, Row]:
        """Opens the manifest for this run alone, and returns the rows that it has."""
        job = self._job
        job.manifest.parent.mkdir(parents=True, exist_ok=True)
        if not job.manifest.exists():
            there = next((path for task in job.tasks for path in task.outputs() if os.path.exists(path)), None)
            if there is not None:
                remedy = "choose another output, or remove it"
                raise ArgumentError(f"{there} is there, and no manifest tells of it; {remedy}")
        self._file = file = open(job.manifest, "a+", encoding="utf-8")
        try:
            _lock(file)
            file.seek(0)
            lines = file.read().splitlines(keepends=True)
            if lines and not lines[-1].endswith("\n"):
                # A run that was killed has not finished its last line.
                file.truncate(sum(len(line.encode()) for line in lines[:-1]))
                lines.pop()
            if not lines:
                return self._anew()
            try:
                settings, *rows = map(json.loads, lines)
                known = {row["task"]: Row(**{**row, "notes": tuple(row["notes"])}) for row in rows}
            except (ValueError, TypeError, KeyError) as error:
                raise ArgumentError(f"{job.manifest}: not the manifest of a job ({error}); remove it") from error
            differ = _difference(settings, json.loads(json.dumps(job.settings)))
            if not differ:
                return known
            if not any(os.path.exists(path) for task in job.tasks for path in task.outputs()):
                # All has failed, perhaps by these settings.
                file.truncate(0)
                return self._anew()
            remedy = "choose another output, or remove them"
            raise ArgumentError(f"{job.manifest}: the outputs there have {differ}; {remedy}")
        except BaseException:
            self._close()
            raise

    def _anew(self) -> dict[str, Row]:
        """Begins the manifest, and removes what is left of a job of other settings."""
        for step in self._job.steps[:-1]:
            for path in (path for task in step for path in task.outputs()):
                Path(path).unlink(missing_ok=True)
        self._write(self._job.settings)
        return {}

    def steps(self) -> Iterator[Sequence[Task]]:
        """The missing tasks of each step, the largest first. All of a step are to be performed before the next."""
        yield from (step for step in self._missing if step)

    def add(self, row: Row) -> None:
        """Takes down what has become of a task."""
        if self._file is None:
            raise RuntimeError("the run has ended")
        # Of earlier steps only failures are told: their results go with the job.
        if row.task in self._last or row.error is not None:
            self._rows.append(row)
        if row.task in self._last:
            self._write(asdict(row))
        self._told.add(row)

    def report(self) -> Report:
        """What has been done so far."""
        return Report(tuple(self._rows), self._kept, time.perf_counter() - self._began, self._job.unit)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._told.end()
        # What is done is kept for the next run, if this one is interrupted.
        folder = self._job.work if kind is None else self._job.work / "unfinished"
        shutil.rmtree(folder, ignore_errors=True)
        self._close()

    def _write(self, value: Mapping[str, Any]) -> None:
        assert self._file is not None
        self._file.write(json.dumps(value) + "\n")
        self._file.flush()

    def _close(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None


def _is_done(task: Task, row: Row | None, there: set[str]) -> bool:
    """Whether a task's outputs are there, of what is read now."""
    if row is not None:
        if row.error is not None or row.inputs != task.inputs or row.in_doubt:
            return False
        if row.points == 0:
            return True
    return all(os.path.basename(path) in there for path in task.outputs())


def _difference(old: object, new: dict[str, object]) -> str:
    """What differs in settings, in words; empty if nothing does."""
    known = old if isinstance(old, dict) else {}
    names = [name for name in {**known, **new} if known.get(name) != new.get(name)]
    return ", ".join(f"{name} {json.dumps(known.get(name))}, not {json.dumps(new.get(name))}" for name in names)


def _lock(file: IO[str]) -> None:
    """Keeps other runs away for as long as the file is open."""
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise ArgumentError(f"{file.name}: another run works on this job") from None
    except OSError:
        # Some shares have no locks.
        return


def _effort(task: Task) -> int:
    """A measure of the time that a task takes: its points, and what each task costs whatever its size."""
    return task.points + 10_000


class _Teller:
    """Tells the progress of a run."""

    def __init__(self, kind: str, progress: Progress) -> None:
        if not (progress is None or isinstance(progress, bool) or callable(progress)):
            given = type(progress).__name__
            raise TypeError(f"progress: {given} given; None, True or a function of the finished fraction is wanted")
        self._kind, self._progress = kind, progress
        self._began = self._last = time.monotonic()
        self._efforts: dict[str, int] = {}
        self._all = self._done = self._failed = 0

    def begin(self, tasks: Sequence[Task]) -> None:
        self._efforts = {task.name: _effort(task) for task in tasks}
        self._all = sum(self._efforts.values())

    def add(self, row: Row) -> None:
        self._done += self._efforts.pop(row.task, 0)
        self._failed += row.error is not None
        fraction = self._done / max(self._all, 1)
        if callable(self._progress):
            self._progress(fraction)
        elif self._progress and (time.monotonic() - self._last > _STEP or not self._efforts):
            self._last = time.monotonic()
            left = (self._last - self._began) * (1 - fraction) / max(fraction, 1e-9)
            failed = f", {self._failed} failed" if self._failed else ""
            line = f"{self._kind}: {len(self._efforts)} tasks left{failed}, {100 * fraction:.0f} %, {_clock(left)} left"
            print(f"\r{line:<78}", end="", file=sys.stderr, flush=True)

    def end(self) -> None:
        if self._progress is True and self._all:
            print(file=sys.stderr)


def _clock(seconds: float) -> str:
    minutes = int(seconds) // 60
    return f"{minutes // 60}:{minutes % 60:02}:{int(seconds) % 60:02}"
