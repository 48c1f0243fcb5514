"""Jobs: work on many files or frames, divided into tasks that any machine can do.

>>> from autosplats import jobs
>>> job = jobs.tile_normals("tiles/*.laz", "normals")          # doctest: +SKIP
>>> job.run(progress=True).raise_if_failed()                   # doctest: +SKIP

A job runs in this process (from the shell: `python -m autosplats.jobs`), or on many machines by `autosplats.ray`.

Tasks hold paths and settings, so all machines need the same paths. Outputs appear whole or not at all, are the same
bytes whoever makes them, and are left alone if they are there. A manifest beside them, job.jsonl, has the settings and
a row for each task. A job that is run again does what is missing, and what has changed. Other settings over old outputs
are refused.

Whatever maps a function over a list can run a job:

>>> with job.begin() as run:                                   # doctest: +SKIP
...     for tasks in run.steps():
...         for row in map(jobs.run_task, tasks):
...             run.add(row)
>>> print(run.report())                                        # doctest: +SKIP
"""

from __future__ import annotations

from ._frame_jobs import fly, frames, turntable
from ._job import Job, JobError, Report, Run, failed
from ._task import Row, Task, run_task
from ._tile_jobs import copc_tiles, thin_tiles, tile_normals

__all__ = [
    "Job",
    "JobError",
    "Report",
    "Row",
    "Run",
    "Task",
    "copc_tiles",
    "failed",
    "fly",
    "frames",
    "run_task",
    "thin_tiles",
    "tile_normals",
    "turntable",
]

if __name__ == "__main__":
    import sys

    from ._jobs_command import main

    sys.exit(main("here"))
