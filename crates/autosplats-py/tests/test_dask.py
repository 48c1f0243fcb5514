"""The example of Dask in the documentation."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import scans
from dask.distributed import Client, LocalCluster
from distributed.protocol.pickle import cloudpickle
from scans import contents, ground, in_tiles, spoil

from autosplats import jobs

TEXT = Path(__file__).parents[3] / "docs/CLUSTER.md"


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    cloudpickle.register_pickle_by_value(scans)
    cluster = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with cluster, Client(cluster) as client:
        yield client


def test_the_example_runs_a_job(client, tmp_path):
    blocks = re.findall(r"```python\n(.*?)```", TEXT.read_text(encoding="utf-8"), re.DOTALL)
    (example,) = (block for block in blocks if "dask" in block)
    assert len(example.splitlines()) <= 15
    names: dict[str, object] = {}
    exec(example, names)
    run = names["run"]
    tiles = in_tiles(ground(30_000), tmp_path / "tiles")
    (tiles / "bad.laz").write_bytes(b"no points")
    jobs.tile_normals(tiles, tmp_path / "alone").run()
    job = spoil(jobs.tile_normals(tiles, tmp_path / "out"), {"t01.laz": "flaky"})
    report = run(job, client)
    assert [row.task for row in report.failed] == ["bad.laz"]
    assert contents(tmp_path / "out") == contents(tmp_path / "alone")
    again = run(jobs.tile_normals(tiles, tmp_path / "out"), client)
    assert (len(again.rows), again.kept) == (1, 9), "what failed is tried again"
