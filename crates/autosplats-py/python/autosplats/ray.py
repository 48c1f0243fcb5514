"""Jobs on many machines, by Ray: `pip install autosplats[ray]`.

>>> from autosplats import jobs, ray
>>> job = jobs.tile_normals("tiles/*.laz", "normals")          # doctest: +SKIP
>>> ray.run(job, address="auto").raise_if_failed()             # doctest: +SKIP

or, from the shell, `python -m autosplats.ray normals 'tiles/*.laz' -o normals --address auto`.

All machines need the same paths, by a shared file system, and this package in the same version.
"""

from __future__ import annotations

import _thread
import math
import os
import signal
import statistics
import sys
import threading
import time
import uuid
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from . import _core
from ._errors import ArgumentError, Error
from ._job import Job, Progress, Report, Run, failed
from ._task import Row, Task, run_task, unfinished_of, unseen
from ._threads import set_num_threads

#: Tasks that wait for each that can run at once, so that no machine waits for the driver.
_AHEAD = 2
#: Seconds between two looks at stragglers and at the size of the cluster, and of a worker at whether it is to go on.
_STEP = 1.0
#: How many times as long as others a task takes before it is started once more, and at least how many seconds.
_SLOW, _SLOW_SECONDS = 3.0, 10.0
#: Fewest finished tasks that tell how long others take.
_KNOWN = 3
#: Seconds in which cancelled tasks are waited for.
_END = 5.0


def run(
    job: Job,
    *,
    address: str | None = None,
    num_cpus: float = 2,
    num_gpus: float = 0,
    memory: int | None = None,
    retries: int = 3,
    speculate: bool = True,
    progress: Progress = None,
) -> Report:
    """Runs a job on a cluster of Ray.

    A task is tried again if its worker or its machine is lost, or if a file cannot be read or written for now; not if a
    file is malformed. A task that takes much longer than others is started a second time when all else is done; the
    first to finish counts, which is the same. Ctrl-C cancels all tasks and keeps what is done.

    Args:
        job: The job.
        address: Of the cluster: "auto" for the one that this machine belongs to, or "HOST:PORT". By default the cluster
            that this process is connected to, that of the variable RAY_ADDRESS, or else this machine alone.
        num_cpus: Processor cores per task, and its threads.
        num_gpus: Graphics cards per task; parts are allowed. Pictures are then rendered on the card that Ray assigns.
        memory: Memory per task in bytes; by default by the number of its points.
        retries: How often a task is tried again.
        speculate: Whether slow tasks are started a second time.
        progress: True for a line on standard error, or a function of the finished fraction.

    Raises:
        ArgumentError: If there are outputs of other settings, or of unknown ones.
        ImportError: If Ray is not installed.
        ConnectionError: If there is no cluster at the address.
    """
    ray = _ray()
    ours = not ray.is_initialized()
    if not ours and address is not None:
        raise ArgumentError(f"address is '{address}', but this process is connected to a cluster already; leave it out")
    with job.begin(progress) as started:
        steps = list(started.steps())
        if not steps:
            return started.report()
        if ours:
            _connect(ray, address)
        try:
            if ours and address is None:
                # This machine may have fewer, and no other will come.
                num_cpus = min(num_cpus, ray.cluster_resources().get("CPU", num_cpus))
            engine = _Engine(ray, started, num_cpus, num_gpus, memory, retries, speculate)
            for tasks in steps:
                engine.perform(tasks)
        finally:
            if ours:
                ray.shutdown()
    return started.report()


def _ray() -> Any:
    try:
        import ray
    except ImportError as error:
        raise ImportError("Ray is not installed; pip install autosplats[ray], or run the job by job.run()") from error
    return ray


def _connect(ray: Any, address: str | None) -> None:
    options: dict[str, Any] = {"logging_level": "ERROR", "log_to_driver": False}
    if address is None and not os.environ.get("RAY_ADDRESS"):
        # A cluster of this machine, without what a person would look at.
        options |= {"include_dashboard": False, "object_store_memory": 100 << 20}
    ray.init(address=address, **options)


@dataclass
class _Running:
    """A task that is handed out."""

    task: Task
    #: When it has begun, as far as is known: when there was room for it.
    begun: float | None = None
    copies: list[Any] = field(default_factory=list)


class _Engine:
    """Hands out tasks, a few more than run at once."""

    def __init__(
        self,
        ray: Any,
        started: Run,
        num_cpus: float,
        num_gpus: float,
        memory: int | None,
        retries: int,
        speculate: bool,
    ) -> None:
        self._ray, self._run, self._speculate = ray, started, speculate
        self._memory = memory
        self._threads = max(int(num_cpus), 1)
        #: What a task takes, by Ray's names.
        self._wanted = {"num_cpus": num_cpus, "num_gpus": num_gpus}
        self._remote = ray.remote(max_retries=retries, retry_exceptions=[OSError])(_on_worker)
        #: A file for each copy of a task, which is to be done while the file is there. Ray's own way to cancel a task
        #: can end this process, if the task is done at that moment.
        self._marks: dict[Any, Path] = {}
        #: Seconds per effort of finished tasks.
        self._paces: list[float] = []
        self._nodes: list[dict[str, float]] = []

    def perform(self, tasks: Sequence[Task]) -> None:
        """Performs all tasks of a step."""
        ray = self._ray
        waiting = list(reversed(tasks))
        running: dict[str, _Running] = {}
        of_copy: dict[Any, str] = {}
        late: list[Any] = []
        self._paces.clear()
        looked = -math.inf
        slots = 0

        def start(one: _Running) -> None:
            options = {**self._wanted, "memory": self._bytes(one.task)}
            mark = unfinished_of(one.task.work) / f"{uuid.uuid4().hex}-wanted"
            mark.touch()
            copy = self._remote.options(**options).remote(one.task, self._threads, _core.VERSION, str(mark))
            self._marks[copy] = mark
            one.copies.append(copy)
            of_copy[copy] = one.task.name

        try:
            while waiting or running:
                now = time.monotonic()
                if now - looked >= _STEP:
                    looked = now
                    self._nodes = [node["Resources"] for node in ray.nodes() if node["Alive"]]
                    slots = self._slots()
                while waiting and len(running) < _AHEAD * slots:
                    one = _Running(waiting.pop())
                    running[one.task.name] = one
                    start(one)
                for one in list(running.values())[:slots]:
                    one.begun = one.begun or now
                free = slots - len(of_copy)
                if self._speculate and not waiting and free > 0:
                    for one in self._slow(running.values(), now)[:free]:
                        start(one)
                finished, _ = ray.wait(list(of_copy), num_returns=1, timeout=_STEP)
                for copy in finished:
                    self._unmark(copy)
                    name = of_copy.pop(copy)
                    one = running[name]
                    one.copies.remove(copy)
                    row = self._row(one, copy)
                    if row is None:
                        continue
                    del running[name]
                    for other in one.copies:
                        of_copy.pop(other)
                        self._unmark(other)
                    late += one.copies
                    self._run.add(row)
        except BaseException:
            self._cancel([*of_copy, *late])
            raise
        self._cancel(late)

    def _row(self, one: _Running, copy: Any) -> Row | None:
        """What has become of a task, by one of its copies; None if another may still do it."""
        try:
            row: Row = self._ray.get(copy)
        except self._ray.exceptions.RayError as error:
            if one.copies:
                return None
            return failed(one.task, _cause(error))
        self._paces.append(row.seconds / (one.task.points + 1))
        return row

    def _cancel(self, copies: Sequence[Any]) -> None:
        """Ends tasks, and waits until they have ended, since they write files."""
        for copy in copies:
            self._unmark(copy)
        if copies:
            self._ray.wait(list(copies), num_returns=len(copies), timeout=_END)

    def _unmark(self, copy: Any) -> None:
        mark = self._marks.pop(copy, None)
        if mark is not None:
            # A share that fails keeps no other task from its end; the file goes with its folder.
            with suppress(OSError):
                mark.unlink(missing_ok=True)

    def _slots(self) -> int:
        """How many tasks can run at once."""
        names = {"CPU": self._wanted["num_cpus"], "GPU": self._wanted["num_gpus"]}

        def of_node(node: dict[str, float]) -> int:
            return min(int(node.get(name, 0) / count) for name, count in names.items() if count > 0)

        return max(sum(map(of_node, self._nodes)), 1)

    def _bytes(self, task: Task) -> int:
        """Memory to ask for: no more than the largest machine has, else the task would wait for ever."""
        most = max((int(node.get("memory", 0)) for node in self._nodes), default=0)
        return min(task.memory if self._memory is None else self._memory, most)

    def _slow(self, running: Any, now: float) -> list[_Running]:
        """Tasks with one copy that takes much longer than others, the slowest first."""
        if len(self._paces) < _KNOWN:
            return []
        pace = statistics.median(self._paces)

        def lateness(one: _Running) -> float:
            usual = max(_SLOW * pace * (one.task.points + 1), _SLOW_SECONDS)
            return 0.0 if one.begun is None else (now - one.begun) / usual

        late = [one for one in running if len(one.copies) == 1 and lateness(one) > 1]
        return sorted(late, key=lateness, reverse=True)


def _on_worker(task: Task, threads: int, version: str, mark: str) -> Row:
    """Performs a task in a worker of Ray while there is the file `mark`."""
    import ray

    set_num_threads(threads)
    cards = ray.get_gpu_ids()
    try:
        with _while_there(mark):
            return run_task(task, device=_device(int(cards[0])) if cards else None, version=version)
    except KeyboardInterrupt:
        raise Error("the job has ended") from None


@contextmanager
def _while_there(path: str) -> Iterator[None]:
    """Interrupts what it encloses, as Ctrl-C does, when a file is gone."""
    if not _is_there(path):
        raise unseen(path, "the job has ended, or this machine does not share its folder")
    over, main_thread = threading.Event(), threading.get_ident()

    def watch() -> None:
        while not over.wait(_STEP):
            if not _is_there(path):
                _interrupt(main_thread)
                return

    thread = threading.Thread(target=watch, daemon=True)
    # Ray starts its workers with this signal blocked.
    can_mask = hasattr(signal, "pthread_sigmask")
    before = signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT}) if can_mask else set()
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
        if can_mask:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _interrupt(main_thread: int) -> None:
    """Interrupts the main thread, as Ctrl-C does."""
    if sys.platform == "win32":
        _thread.interrupt_main()
    else:
        # This ends waiting of the system too.
        signal.pthread_kill(main_thread, signal.SIGINT)


def _is_there(path: str) -> bool:
    """Whether there is a file, as the share itself knows: by opening it, since what is known of names may be old."""
    try:
        with open(path, "rb"):
            return True
    except FileNotFoundError:
        return False
    except OSError:
        # The share cannot tell for now.
        return True


def _device(card: int) -> str | int:
    """The graphics device that is a card of Ray's count: by place on the bus, as drivers count cards of one kind."""
    from ._render import devices

    found = sorted((device.pci_bus_id, device.number) for device in devices() if not device.software)
    if card >= len(found):
        raise Error(f"Ray assigns graphics card {card}, but this machine shows {len(found)}")
    return found[card][1]


def _cause(error: BaseException) -> BaseException:
    """The task's own exception, if there is one."""
    cause = getattr(error, "cause", None)
    if isinstance(cause, BaseException):
        return cause
    first = str(error).strip().splitlines()
    return Error(f"the worker was lost, and so were its retries ({type(error).__name__}: {first[0] if first else ''})")


if __name__ == "__main__":
    from ._jobs_command import main

    sys.exit(main("ray"))
