"""Scans in tiles, and tasks that go wrong, for the tests of jobs."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import autosplats
from autosplats.jobs import Job, Task
from autosplats.jobs import run_task as perform

#: Side of the ground, in metres, and tiles along each side.
SIDE, TILES = 120.0, 3


def ground(count: int, seed: int = 3) -> autosplats.Cloud:
    """Points on wavy ground with a hole, far from zero, numbered by the field id."""
    random = np.random.default_rng(seed)
    xy = random.random((count, 2)) * SIDE
    # Points near a corner of tiles have far neighbours.
    xy = xy[np.linalg.norm(xy - [40, 42], axis=1) > 9]
    z = 4 * np.sin(xy[:, 0] / 7) * np.cos(xy[:, 1] / 9) + random.normal(size=len(xy)) * 0.02
    xyz = np.column_stack([xy, z])
    # A bird, high above a border.
    xyz[5] = [81.0, 60.0, 25.0]
    xyz = np.round(xyz + [512_000, 5_400_000, 300], 3)
    return autosplats.Cloud(xyz, fields={"id": np.arange(len(xyz), dtype=np.uint32)})


def in_tiles(cloud: autosplats.Cloud, folder: Path) -> Path:
    """Writes the points as LAZ files side by side."""
    folder.mkdir()
    place = np.floor((cloud.xyz[:, :2] - [512_000, 5_400_000]) / (SIDE / TILES)).clip(0, TILES - 1)
    for x in range(TILES):
        for y in range(TILES):
            autosplats.write(cloud[(place == [x, y]).all(axis=1)], folder / f"t{x}{y}.laz")
    return folder


def merged(folder: Path) -> autosplats.Cloud:
    """The points of all files of a folder, in the order of their numbers."""
    cloud = autosplats.Cloud.merge([autosplats.read(path) for path in sorted(folder.glob("*.laz"))])
    return cloud[np.argsort(cloud.fields["id"])]


def angles(cloud: autosplats.Cloud, truth: autosplats.Normals) -> np.ndarray:
    """Angles in degrees between the normals of a cloud's points and those of all points, by number."""
    normals = np.column_stack([cloud.fields[f"Normal{axis}"] for axis in "XYZ"])
    cosines = (normals * truth.normals[cloud.fields["id"]]).sum(axis=1)
    return np.degrees(np.arccos(cosines.clip(-1, 1)))


def contents(folder: Path) -> dict[str, bytes]:
    """The bytes of the outputs in a folder. There is nothing else beside them but the manifest."""
    names = sorted(path.name for path in folder.iterdir() if path.name != "job.jsonl")
    assert all(name.endswith(".laz") for name in names), names
    return {name: (folder / name).read_bytes() for name in names}


@dataclass(frozen=True)
class Spoiled(Task):
    """A task that something happens to in its first attempt."""

    task: Task
    #: "kill" for the process's end with a file begun, "flaky" for a share that fails, "hang", "slow", or the machine
    #: of Ray that will not be lost: others hang, and this one waits for the first that does.
    fault: str

    def outputs(self) -> Sequence[str]:
        return self.task.outputs()

    def needs(self) -> Sequence[str]:
        return self.task.needs()

    def run(self, device: int | str | None) -> tuple[int, int]:
        mark = Path(self.work) / f"begun {self.name}"
        with mark.open("a") as file:
            file.write("x")
        if mark.stat().st_size == 1:
            if self.fault == "kill":
                folder = Path(self.work) / "unfinished"
                folder.mkdir(exist_ok=True)
                (folder / "half.laz").write_bytes(b"LASF")
                os.kill(os.getpid(), signal.SIGKILL)
            if self.fault == "flaky":
                raise TimeoutError(110, "Connection timed out", self.outputs()[0])
            if self.fault in ("hang", "slow"):
                time.sleep({"hang": 120.0, "slow": 2.0}[self.fault])
            else:
                self.wait_for_loss()
        row = perform(self.task)
        assert row.error is None, row.error
        return row.points, row.in_doubt

    def wait_for_loss(self) -> None:
        import ray

        sign = Path(self.work) / "hanging"
        is_lost = ray.get_runtime_context().get_node_id() != self.fault
        if is_lost:
            sign.touch()
        for _ in range(1200):
            if sign.exists() and not is_lost:
                return
            time.sleep(0.1)


@dataclass(frozen=True)
class Threads(Task):
    """A task whose points are the number of its threads."""

    def outputs(self) -> Sequence[str]:
        return [f"{self.work}.output"]

    def run(self, device: int | str | None) -> tuple[int, int]:
        Path(self.outputs()[0]).touch()
        return autosplats.num_threads(), 0


def spoil(job: Job, faults: dict[str, str]) -> Job:
    """The job with faults in tasks of these names."""

    def spoiled(task: Task) -> Task:
        fault = faults.get(task.name)
        return task if fault is None else Spoiled(task.name, task.points, task.inputs, task.work, task, fault)

    job.steps = [[spoiled(task) for task in step] for step in job.steps]
    return job
