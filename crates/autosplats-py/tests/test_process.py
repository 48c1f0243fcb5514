"""A good citizen of its process: other threads run, Ctrl-C ends work, forks live, nothing starts at import."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest

import autosplats

linux = pytest.mark.skipif(sys.platform != "linux", reason="Linux only")


def test_other_threads_run():
    points = np.random.rand(400_000, 3)
    counted = 0
    stop = threading.Event()

    def count() -> None:
        nonlocal counted
        while not stop.is_set():
            counted += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    start = time.perf_counter()
    autosplats.estimate_normals(points, k=64, num_threads=1)
    took = time.perf_counter() - start
    stop.set()
    thread.join()
    # A millisecond of sleep takes some more on a busy machine.
    assert counted > 20 * took, f"{counted} in {took:.2f} s"


@linux
@pytest.mark.parametrize(
    "work",
    [
        "autosplats.estimate_normals(points, k=300)",
        "autosplats.render(points, size=(3840, 2160), k=64)",
        "[autosplats.render(points, size=(640, 400)) for _ in range(1000)]",
        "cloud.thin(1e-4)",
        "autosplats.write(cloud, path, overwrite=True)",
    ],
)
def test_interrupts_end_work(work, tmp_path):
    text = f"""
        import os, sys, time, threading, signal, numpy as np, autosplats
        points = np.random.default_rng(0).random((3_000_000, 3))
        cloud = autosplats.Cloud(points)
        path = {str(tmp_path / "a.e57")!r}
        sent = []
        def interrupt():
            time.sleep(0.15)
            sent.append(time.perf_counter())
            os.kill(os.getpid(), signal.SIGINT)
        threading.Thread(target=interrupt).start()
        try:
            while True:
                {work}
        except KeyboardInterrupt:
            print(time.perf_counter() - sent[0])
        autosplats.estimate_normals(points[:1000])
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(text)], capture_output=True, text=True, timeout=100, check=False
    )
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) < 0.3 + slack(), done.stdout
    assert not list(tmp_path.glob("*.tmp*")), "no partial file is left"


def slack() -> float:
    """Seconds that a busy machine may take more: what a thread waits for its turn."""
    start = time.perf_counter()
    time.sleep(0.05)
    return 4 * (time.perf_counter() - start - 0.05) + (0.7 if os.environ.get("CI") else 0.2)


FORK = """
    import os, sys, numpy as np, autosplats
    points = np.random.default_rng(0).random((20_000, 3))
    def work():
        normals = autosplats.estimate_normals(points).normals
        picture = autosplats.render(points, size=(64, 48)).array
        info = autosplats.info("scene:statue:1K")["points"]
        return [int(normals.view("u4").sum()), int(picture.sum()), info]
"""


@linux
def test_forks_before_and_after_use(python):
    done = python(
        FORK
        + """
    def child():
        pid = os.fork()
        if pid == 0:
            print(work(), flush=True)
            os._exit(0)
        assert os.waitpid(pid, 0)[1] == 0
    child()
    print(work(), flush=True)
    for _ in range(5):
        child()
    pid = os.fork()
    if pid == 0:
        child()
        os._exit(0)
    assert os.waitpid(pid, 0)[1] == 0
    print(work())
    """
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == 9 and len(set(lines)) == 1, done.stdout


@linux
def test_forks_during_use(python):
    done = python(
        FORK
        + """
    import threading, warnings
    warnings.simplefilter("ignore")
    autosplats.estimate_normals(points)
    stop = threading.Event()
    def busy():
        while not stop.is_set():
            autosplats.estimate_normals(points)
    threads = [threading.Thread(target=busy) for _ in range(2)]
    [thread.start() for thread in threads]
    for _ in range(20):
        pid = os.fork()
        if pid == 0:
            autosplats.estimate_normals(points[:2000])
            os._exit(0)
        assert os.waitpid(pid, 0)[1] == 0
    stop.set()
    [thread.join() for thread in threads]
    """
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("method", ["fork", "spawn", "forkserver"])
def test_open3d_5165_multiprocessing(method, tmp_path):
    """isl-org/Open3D#5165: normals in a pool of processes never end."""
    import multiprocessing

    if method not in multiprocessing.get_all_start_methods():
        pytest.skip(f"no {method} here")
    script = tmp_path / "pool.py"
    script.write_text(
        textwrap.dedent(
            f"""
            import multiprocessing, numpy as np, autosplats
            def work(seed):
                points = np.random.default_rng(seed).random((5000, 3))
                return autosplats.estimate_normals(points).normals.sum()
            if __name__ == "__main__":
                alone = [work(seed) for seed in range(4)]
                with multiprocessing.get_context("{method}").Pool(2) as pool:
                    assert pool.map(work, range(4)) == alone
                    clouds = pool.map(autosplats.Cloud, [np.ones((5, 3))])
                    assert len(clouds[0]) == 5
                    pictures = pool.map(autosplats.render, ["scene:statue:1K"])
                    assert pictures[0].shape == (800, 1280, 4)
            """
        )
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr


@linux
def test_a_device_is_not_taken_through_a_fork(python):
    if not autosplats.devices():
        pytest.skip("no graphics device")
    done = python(
        """
        import os, autosplats
        renderer = autosplats.Renderer("gpu")
        renderer.render("scene:statue:1K", size=(64, 48))
        pid = os.fork()
        if pid == 0:
            try:
                renderer.render("scene:statue:1K", size=(64, 48))
            except autosplats.DeviceError as error:
                os._exit(0 if "process" in str(error) else 1)
            os._exit(2)
        assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0
        os._exit(0)
        """
    )
    assert done.returncode == 0, done.stderr


def test_everything_is_pickled(points, colors):
    fields = {"Intensity": np.arange(len(points), dtype=np.uint16), "Time": points[:, 0]}
    far = points + [512_345.0, 5_412_345.0, 310.0]
    cloud = autosplats.Cloud(far, colors, fields=fields, axes="z-up", sensor=(1, 2, 3))
    for protocol in (2, 4, 5):
        again = pickle.loads(pickle.dumps(cloud, protocol))
        np.testing.assert_array_equal(again.xyz, cloud.xyz)
        np.testing.assert_array_equal(again.colors, cloud.colors)
        assert list(again.fields) == list(cloud.fields) and again.axes == "z-up"
        for name, values in cloud.fields.items():
            np.testing.assert_array_equal(again.fields[name], values)
        np.testing.assert_array_equal(again.scans[0].world_from_sensor, cloud.scans[0].world_from_sensor)
        assert again.crs == cloud.crs
    buffers = []
    small = pickle.dumps(cloud, 5, buffer_callback=buffers.append)
    assert len(small) < 10_000 and pickle.loads(small, buffers=buffers).nbytes == cloud.nbytes
    normals = autosplats.estimate_normals(points)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(normals)).normals, normals.normals)


#: Number of threads of the process that are the package's.
USED = (
    "sum(open(f'/proc/self/task/{task}/comm').read().startswith('autosplats-') "
    "for task in os.listdir('/proc/self/task'))"
)


def threads_with(python, number: str, before: str = "", **variables: str) -> int:
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    text = f"import os, autosplats\n{before}\nprint({number})"
    done = python(text, env={**environment, **variables})
    assert done.returncode == 0, done.stderr
    return int(done.stdout)


@linux
def test_the_number_of_threads(python):
    number = "autosplats.num_threads()"
    assert threads_with(python, number, OMP_NUM_THREADS="3") == 3
    assert threads_with(python, number, OMP_NUM_THREADS="5,2") == 5
    assert threads_with(python, number, OMP_NUM_THREADS="3", RAYON_NUM_THREADS="4") == 4
    assert threads_with(python, number, RAYON_NUM_THREADS="4", AUTOSPLATS_NUM_THREADS="6") == 6
    assert threads_with(python, number, "autosplats.set_num_threads(7)", AUTOSPLATS_NUM_THREADS="6") == 7
    assert threads_with(python, number, OMP_NUM_THREADS="many") == len(os.sched_getaffinity(0))
    one = f"os.sched_setaffinity(0, {{{min(os.sched_getaffinity(0))}}})"
    assert threads_with(python, number, one) == 1
    # What a call takes is what was asked for.
    call = "autosplats.estimate_normals([[0.0, 0, 0]] * 50, num_threads=3)"
    # A thread that starts gives itself its name.
    wait = "import time; time.sleep(0.3)"
    assert threads_with(python, USED, f"{call}; {wait}") == 3
    assert threads_with(python, USED, wait, OMP_NUM_THREADS="3") == 0, "nothing starts at import"
    done = python("import autosplats; autosplats.num_threads()", env={**os.environ, "AUTOSPLATS_NUM_THREADS": "x"})
    assert "AUTOSPLATS_NUM_THREADS is 'x'" in done.stderr


def test_import_starts_nothing(python):
    done = python(
        """
        import sys, threading, time
        start = time.perf_counter()
        import autosplats
        took = time.perf_counter() - start
        assert threading.active_count() == 1
        assert "numpy" not in sys.modules and "autosplats._core" not in sys.modules
        for name in autosplats.__all__:
            getattr(autosplats, name)
        import os
        if sys.platform == "linux":
            names = [open(f"/proc/self/task/{task}/comm").read() for task in os.listdir("/proc/self/task")]
            assert not any(name.startswith("autosplats") for name in names), names
        print(took)
        """
    )
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) < 0.03


def test_progress_is_told_in_order():
    told = []
    autosplats.estimate_normals(np.random.rand(500_000, 3), k=100, progress=told.append)
    assert told[-1] == 1.0 and told == sorted(told) and len(told) > 2
    told.clear()
    autosplats.render("scene:statue:1K", size=(64, 48), progress=told.append)
    assert told[-1] == 1.0


def test_progress_bars(capsys):
    autosplats.estimate_normals(np.random.rand(1000, 3), progress=True)
    assert "normals" in capsys.readouterr().err
    autosplats.estimate_normals(np.random.rand(1000, 3), progress=False)
    assert capsys.readouterr().err == ""


def test_notes_are_logged(caplog, tmp_path):
    (tmp_path / "a.xyz").write_text("0 0 0\n1 2 3\n4 5 6\n7 8 9\n")
    with caplog.at_level("INFO", logger="autosplats"):
        autosplats.read(tmp_path / "a.xyz")
    assert [record.name for record in caplog.records] == ["autosplats"] * len(caplog.records)
