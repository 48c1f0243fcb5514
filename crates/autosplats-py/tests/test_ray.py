"""Jobs on a cluster of Ray, and what goes wrong there."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import ray
import scans
from scans import Threads, contents, ground, in_tiles, spoil

import autosplats
from autosplats import jobs
from autosplats import ray as engine

DATA = Path(__file__).parents[4] / "shared/data"

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals are different there")


@pytest.fixture(scope="module")
def cluster() -> Iterator[object]:
    """A cluster of one machine with two cores, that this process is connected to."""
    from ray.cluster_utils import Cluster

    head = {"num_cpus": 2, "include_dashboard": False, "object_store_memory": 80 << 20}
    found = Cluster(initialize_head=True, head_node_args=head)
    ray.init(address=found.address, logging_level="ERROR", log_to_driver=False)
    # Workers have no folder of tests.
    ray.cloudpickle.register_pickle_by_value(scans)
    yield found
    ray.shutdown()
    found.shutdown()


@pytest.fixture(scope="module")
def tiles(tmp_path_factory) -> Path:
    return in_tiles(ground(30_000), tmp_path_factory.mktemp("scan") / "tiles")


@pytest.fixture(scope="module")
def alone(tiles, tmp_path_factory) -> dict[str, bytes]:
    """The outputs of the job in this process."""
    folder = tmp_path_factory.mktemp("alone") / "out"
    jobs.tile_normals(tiles, folder).run().raise_if_failed()
    return contents(folder)


def run(job: jobs.Job, **options: object) -> jobs.Report:
    return engine.run(job, **{"num_cpus": 1, **options})


def test_tiles_are_as_alone(cluster, tiles, alone, tmp_path):
    report = run(jobs.tile_normals(tiles, tmp_path / "out"))
    report.raise_if_failed()
    assert contents(tmp_path / "out") == alone
    assert len(report.rows) == 9 and report.in_doubt == 0
    again = run(jobs.tile_normals(tiles, tmp_path / "out"))
    assert (len(again.rows), again.kept) == (0, 9)


def test_frames_are_as_alone(cluster, tmp_path):
    for name, perform in [("a", run), ("b", jobs.Job.run)]:
        source, output = DATA / "sequences/kitti_drive_pcd", tmp_path / f"{name}_%d.png"
        perform(jobs.frames(source, output, size=(160, 100), chunk=2, backend="cpu")).raise_if_failed()
    for frame in range(5):
        assert (tmp_path / f"a_{frame}.png").read_bytes() == (tmp_path / f"b_{frame}.png").read_bytes()


def test_threads_are_those_of_the_task(cluster, tmp_path):
    for cores in (1, 2):
        task = Threads("threads", 1, "", str(tmp_path / f"{cores}/job.work"))
        report = run(jobs.Job("threads", {}, tmp_path / f"{cores}/job.jsonl", [[task]]), num_cpus=cores)
        assert [row.points for row in report.rows] == [cores]


def test_a_worker_is_killed(cluster, tiles, alone, tmp_path):
    job = spoil(jobs.tile_normals(tiles, tmp_path / "out"), {"t11.laz": "kill", "border of t00": "kill"})
    run(job).raise_if_failed()
    assert contents(tmp_path / "out") == alone


def test_a_worker_is_killed_once_too_often(cluster, tiles, alone, tmp_path):
    job = spoil(jobs.tile_normals(tiles, tmp_path / "out"), {"t11.laz": "kill"})
    report = run(job, retries=0)
    assert [row.task for row in report.failed] == ["t11.laz"]
    assert "the worker was lost" in report.failed[0].error and "\n" not in report.failed[0].error
    assert contents(tmp_path / "out") == {name: data for name, data in alone.items() if name != "t11.laz"}


def test_flaky_shares_are_tried_again(cluster, tiles, alone, tmp_path):
    job = spoil(jobs.tile_normals(tiles, tmp_path / "out"), {"t01.laz": "flaky"})
    run(job).raise_if_failed()
    assert contents(tmp_path / "out") == alone
    (tmp_path / "out/t01.laz").unlink()
    report = run(spoil(jobs.tile_normals(tiles, tmp_path / "out"), {"t01.laz": "flaky"}), retries=0)
    assert [row.error for row in report.failed] == [f"{tmp_path}/out/t01.laz: Connection timed out"]


def test_a_malformed_tile_fails_alone(cluster, tmp_path):
    tiles = in_tiles(ground(30_000), tmp_path / "tiles")
    (tiles / "t11.laz").write_bytes((tiles / "t11.laz").read_bytes()[:3000])
    report = run(jobs.tile_normals(tiles, tmp_path / "out"))
    assert {row.task for row in report.failed} == {"t11.laz", "border of t11"}
    assert len(contents(tmp_path / "out")) == 8 and report.in_doubt > 0
    rows = [json.loads(line) for line in (tmp_path / "out/job.jsonl").read_text().splitlines()[1:]]
    assert "t11.laz" in next(row["error"] for row in rows if row["task"] == "t11.laz")


def test_a_straggler_is_started_once_more(cluster, tiles, alone, tmp_path, monkeypatch):
    monkeypatch.setattr(engine, "_SLOW_SECONDS", 8.0)
    job = spoil(jobs.tile_normals(tiles, tmp_path / "out"), {"t11.laz": "hang", "t20.laz": "slow"})
    marks = {}

    def look(fraction: float) -> None:
        marks.update({path.name: path.read_text() for path in job.work.glob("begun *")})

    began = time.monotonic()
    run(job, progress=look).raise_if_failed()
    assert time.monotonic() - began < 100, "the first copy takes longer"
    assert contents(tmp_path / "out") == alone
    assert marks == {"begun t11.laz": "xx", "begun t20.laz": "x"}, "slow is not too slow"


def test_a_machine_is_lost(cluster, tiles, alone, tmp_path):
    head = ray.get_runtime_context().get_node_id()
    job = spoil(jobs.tile_normals(tiles, tmp_path / "out"), dict.fromkeys(alone, head))
    node = cluster.add_node(num_cpus=2, object_store_memory=80 << 20)
    cluster.wait_for_nodes()
    lost = []

    def lose() -> None:
        for _ in range(1200):
            if (job.work / "hanging").exists():
                lost.append(node)
                cluster.remove_node(node, allow_graceful=False)
                return
            time.sleep(0.1)

    thread = threading.Thread(target=lose)
    thread.start()
    run(job, speculate=False).raise_if_failed()
    thread.join()
    assert lost and contents(tmp_path / "out") == alone


def start(cluster: object, tiles: Path, output: Path) -> subprocess.Popen:
    """The command, in a process of its own, connected to the cluster."""
    arguments = ["normals", tiles, "-o", output, "--num-cpus", 1, "--address", cluster.address]
    command = [sys.executable, "-m", "autosplats.ray", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def when_begun(driver: subprocess.Popen, output: Path) -> None:
    """Waits until some outputs are there."""
    for _ in range(600):
        if len(list(output.glob("*.laz"))) >= 2:
            return
        assert driver.poll() is None, driver.communicate()
        time.sleep(0.05)
    raise AssertionError(driver.communicate())


@pytest.fixture(scope="module")
def many(tmp_path_factory) -> tuple[Path, dict[str, bytes]]:
    """Tiles that take some seconds, and what becomes of them."""
    folder = tmp_path_factory.mktemp("many")
    tiles = in_tiles(ground(400_000), folder / "tiles")
    jobs.tile_normals(tiles, folder / "out").run().raise_if_failed()
    return tiles, contents(folder / "out")


def test_the_driver_is_killed(cluster, many, tmp_path):
    tiles, whole = many
    driver = start(cluster, tiles, tmp_path / "out")
    when_begun(driver, tmp_path / "out")
    driver.kill()
    driver.wait()
    done = {path.name for path in (tmp_path / "out").glob("*.laz")}
    assert len(done) < 9, "it was killed too late"
    second = start(cluster, tiles, tmp_path / "out")
    said, errors = second.communicate(timeout=120)
    assert second.returncode == 0 and f"{len(done)} were there" in said.replace("tasks done, ", ""), said + errors
    assert contents(tmp_path / "out") == whole


def test_ctrl_c_keeps_what_is_done(cluster, many, tmp_path):
    tiles, whole = many
    driver = start(cluster, tiles, tmp_path / "out")
    when_begun(driver, tmp_path / "out")
    driver.send_signal(signal.SIGINT)
    began = time.monotonic()
    said, errors = driver.communicate(timeout=100)
    assert driver.returncode == 130 and "error: interrupted" in errors, said + errors
    assert time.monotonic() - began < 60
    left = {path.name for path in (tmp_path / "out").iterdir()}
    done = {name for name in left if name.endswith(".laz")}
    assert len(done) < 9
    assert not list((tmp_path / "out/job.work/unfinished").glob("*"))
    report = run(jobs.tile_normals(tiles, tmp_path / "out"))
    report.raise_if_failed()
    assert report.kept >= len(done)
    assert contents(tmp_path / "out") == whole


def test_a_task_ends_with_its_mark(tmp_path):
    mark = tmp_path / "mark"
    with pytest.raises(OSError, match="does not share its folder"), engine._while_there(str(mark)):
        raise AssertionError("it was not wanted from the start")
    mark.touch()
    threading.Timer(0.2, mark.unlink).start()
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt), engine._while_there(str(mark)):
        time.sleep(30)
    assert time.monotonic() - began < 15


def test_a_task_ends_with_its_mark_in_a_worker(cluster, tmp_path):
    mark, begun = tmp_path / "mark", tmp_path / "begun"
    mark.touch()

    @ray.remote(max_retries=0)
    def is_interrupted() -> bool:
        try:
            with engine._while_there(str(mark)):
                begun.touch()
                time.sleep(60)
        except KeyboardInterrupt:
            return True
        return False

    running = is_interrupted.remote()
    while not begun.exists():
        time.sleep(0.05)
    mark.unlink()
    assert ray.get(running, timeout=30)


def test_bad_usage(cluster, tiles, tmp_path):
    with pytest.raises(autosplats.ArgumentError, match="connected to a cluster already"):
        run(jobs.tile_normals(tiles, tmp_path / "out"), address="auto")
