"""Jobs in this process."""

from __future__ import annotations

import hashlib
import json
import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scans import SIDE, angles, contents, ground, in_tiles, merged, spoil

import autosplats
from autosplats import jobs

DATA = Path(__file__).parents[4] / "shared/data"


@pytest.fixture(scope="module")
def cloud() -> autosplats.Cloud:
    return ground(30_000)


@pytest.fixture(scope="module")
def truth(cloud) -> autosplats.Normals:
    return autosplats.estimate_normals(cloud, orient="up")


@pytest.fixture(scope="module")
def tiles(cloud, tmp_path_factory) -> Path:
    return in_tiles(cloud, tmp_path_factory.mktemp("scan") / "tiles")


@pytest.fixture(scope="module")
def dense() -> autosplats.Cloud:
    return ground(200_000)


@pytest.fixture(scope="module")
def octree(dense, tmp_path_factory) -> Path:
    """An octree of several nodes."""
    path = tmp_path_factory.mktemp("octree") / "scan.copc.laz"
    autosplats.write(dense, path)
    return path


@pytest.fixture(scope="module")
def alone(tiles, tmp_path_factory) -> Path:
    """Normals of the tiles, by a job."""
    folder = tmp_path_factory.mktemp("alone") / "normals"
    jobs.tile_normals(tiles, folder).run().raise_if_failed()
    return folder


def are_exact(folder: Path, cloud: autosplats.Cloud, truth: autosplats.Normals) -> None:
    """Asserts that the normals in a folder are those of all points. Of neighbours at the same distance, rounding about
    another origin may choose others."""
    found = merged(folder)
    np.testing.assert_allclose(found.xyz, cloud.xyz, rtol=0, atol=1e-6)
    assert (angles(found, truth) > 0.1).sum() <= len(cloud) / 10_000 + 1
    np.testing.assert_allclose(found.fields["DensityRadius"], truth.radius, rtol=1e-3)


def test_normals_of_tiles_are_those_of_all_points(alone, cloud, truth):
    are_exact(alone, cloud, truth)
    rows = [json.loads(line) for line in (alone / "job.jsonl").read_text().splitlines()[1:]]
    assert sum(row["points"] for row in rows) == len(cloud) and not any(row["in_doubt"] for row in rows)
    assert {row["task"] for row in rows} == set(contents(alone))


@pytest.mark.parametrize("halo", [0.0, 0.5, 100.0])
def test_the_first_halo_changes_nothing(halo, tiles, cloud, truth, tmp_path):
    report = jobs.tile_normals(tiles, tmp_path / "out", halo=halo).run()
    report.raise_if_failed()
    assert report.in_doubt == 0
    are_exact(tmp_path / "out", cloud, truth)


def test_without_neighbours_normals_differ(tiles, cloud, truth, tmp_path):
    """What the tests above compare would be seen."""
    (tmp_path / "out").mkdir()
    for path in tiles.iterdir():
        tile = autosplats.read(path)
        normals = autosplats.estimate_normals(tile, orient="up")
        autosplats.write(tile.with_normals(normals), tmp_path / "out" / path.name)
    assert (angles(merged(tmp_path / "out"), truth) > 0.1).sum() > len(cloud) / 100


def test_normals_of_boxes_of_an_octree(octree, dense, tmp_path):
    job = jobs.tile_normals(octree, tmp_path / "out", box_points=30_000)
    assert len(job.tasks) >= 6
    report = job.run()
    report.raise_if_failed()
    assert not any(row.notes for row in report.rows)
    are_exact(tmp_path / "out", dense, autosplats.estimate_normals(dense, orient="up"))


def test_normals_of_boxes_of_an_ept(dense, tmp_path):
    write_ept(dense, tmp_path / "scan")
    job = jobs.tile_normals(tmp_path / "scan", tmp_path / "out", box_points=60_000)
    whole = jobs.tile_normals(tmp_path / "scan/ept.json", tmp_path / "out", box_points=60_000)
    assert job.tasks == whole.tasks
    assert len(job.tasks) >= 4 and all(task.name.startswith("scan_") for task in job.tasks)
    job.run().raise_if_failed()
    are_exact(tmp_path / "out", dense, autosplats.estimate_normals(dense, orient="up"))


def write_ept(cloud: autosplats.Cloud, folder: Path) -> None:
    """Writes an octree of a root and the nodes below it."""
    for name in ("ept-data", "ept-hierarchy"):
        (folder / name).mkdir(parents=True)
    low = np.floor(cloud.bounds[0])
    half = np.ceil((cloud.bounds[1] - low).max() / 2)
    octant = np.floor((cloud.xyz - low) / half).astype(int).clip(0, 1)
    is_root = np.arange(len(cloud)) % 9 == 0
    counts = {}
    for key in [None, *map(tuple, np.unique(octant, axis=0).tolist())]:
        which = is_root if key is None else (octant == key).all(axis=1) & ~is_root
        name = "0-0-0-0" if key is None else "1-{}-{}-{}".format(*key)
        autosplats.write(cloud[which], folder / f"ept-data/{name}.laz")
        counts[name] = int(which.sum())
    (folder / "ept-hierarchy/0-0-0-0.json").write_text(json.dumps(counts))
    bounds = [*low, *(low + 2 * half)]
    axes = [{"name": name, "type": "signed", "size": 4, "scale": 0.001, "offset": 0} for name in "XYZ"]
    facts = {"bounds": bounds, "boundsConforming": [*cloud.bounds[0], *cloud.bounds[1]], "dataType": "laszip"}
    facts |= {"hierarchyType": "json", "points": len(cloud), "span": 128, "version": "1.1.0", "srs": {}}
    facts["schema"] = [*axes, {"name": "id", "type": "unsigned", "size": 4}]
    (folder / "ept.json").write_text(json.dumps(facts))


def test_octrees_side_by_side_need_no_borders(tiles, cloud, truth, tmp_path):
    jobs.copc_tiles(tiles, tmp_path / "copc").run().raise_if_failed()
    job = jobs.tile_normals(f"{tmp_path}/copc/*.copc.laz", tmp_path / "out", values=["normals", "density"])
    assert [len(step) for step in job.steps] == [0, 9]
    job.run().raise_if_failed()
    are_exact(tmp_path / "out", cloud, truth)
    assert "Curvature" not in merged(tmp_path / "out").fields


def test_a_tile_with_fewer_points_than_neighbours(cloud, tmp_path):
    x = cloud.xyz[:, 0] - 512_000
    few = (x > 60) & (np.arange(len(cloud)) % 5000 != 7)
    names = {"most.laz": x <= 60, "few.laz": (x > 60) & ~few}
    (tmp_path / "tiles").mkdir()
    for name, which in names.items():
        autosplats.write(cloud[which], tmp_path / "tiles" / name)
    kept = cloud[~few]
    assert 1 <= names["few.laz"].sum() <= 10
    jobs.tile_normals(tmp_path / "tiles", tmp_path / "out").run().raise_if_failed()
    truth = autosplats.estimate_normals(kept, orient="up").normals
    found = merged(tmp_path / "out")
    normals = np.column_stack([found.fields[f"Normal{axis}"] for axis in "XYZ"])
    assert ((normals * truth).sum(axis=1) < 0.999).sum() <= 3


def test_sensors_orient_all_tiles(cloud, tiles, tmp_path):
    sensor = (512_060.0, 5_400_060.0, 250.0)
    jobs.tile_normals(tiles, tmp_path / "out", sensor=sensor).run().raise_if_failed()
    found = merged(tmp_path / "out")
    normals = np.column_stack([found.fields[f"Normal{axis}"] for axis in "XYZ"])
    assert (((sensor - found.xyz) * normals).sum(axis=1) >= 0).all()


def test_thinned_tiles_are_the_thinned_whole(tiles, octree, cloud, dense, tmp_path):
    for source, points in [(tiles, cloud), (octree, dense)]:
        folder = tmp_path / source.name
        whole = points.thin(2.5)
        jobs.thin_tiles(source, folder, 2.5, box_points=30_000).run().raise_if_failed()
        found = merged(folder)
        cubes = np.floor(found.xyz / 2.5)
        assert len(np.unique(cubes, axis=0)) == len(found) == len(whole), "one point a cube, also at borders"
        # Of two points, both are as near to their mean: then the first is kept, and octrees have another order.
        same = len(np.intersect1d(found.fields["id"], whole.fields["id"]))
        assert same >= (0.999 if source is tiles else 0.9) * len(whole)


@pytest.mark.parametrize("side", [None, 50.0])
def test_octrees_of_tiles(side, tiles, cloud, tmp_path):
    report = jobs.copc_tiles(tiles, tmp_path / "out", side=side).run()
    report.raise_if_failed()
    assert sum(row.points for row in report.rows) == len(cloud)
    for path in (tmp_path / "out").glob("*.laz"):
        assert autosplats.info(path)["format"].startswith("COPC")
        if side is not None:
            cells = np.floor(autosplats.read(path).xyz[:, :2] / side)
            assert "_".join(str(int(value)) for value in cells[0]) + ".copc.laz" == path.name
            assert (cells == cells[0]).all()
    np.testing.assert_allclose(merged(tmp_path / "out").xyz, cloud.xyz, rtol=0, atol=1e-6)
    assert set(contents(tmp_path / "out")), "nothing is left beside them"


def test_boxes_read_little_more_than_their_nodes(octree, dense):
    """Halos lie in nodes that boxes need anyway."""
    from autosplats._core import tree_nodes
    from autosplats._tiles import tiles_of

    low, high, points, size = tree_nodes(str(octree))
    boxes = tiles_of(octree, 30_000)
    assert len(boxes) >= 4
    halo = 8 * (SIDE**2 / len(dense) * 10 / np.pi) ** 0.5
    read = own = decoded = wanted = 0
    for box in boxes:
        ends = np.array(box.box).reshape(2, 2)
        meets = ((low[:, :2] <= ends[1]) & (high[:, :2] >= ends[0])).all(axis=1)
        wide = ((low[:, :2] <= ends[1] + halo) & (high[:, :2] >= ends[0] - halo)).all(axis=1)
        own, read = own + size[meets].sum(), read + size[wide].sum()
        wanted, decoded = wanted + points[meets].sum(), decoded + points[wide].sum()
    assert read <= 1.3 * own and decoded <= 1.2 * wanted


def test_a_second_run_does_what_is_missing(alone, tiles, tmp_path):
    folder = tmp_path / "out"
    first = jobs.tile_normals(tiles, folder)
    assert len(first.run().rows) == 9
    again = jobs.tile_normals(tiles, folder).run()
    assert (len(again.rows), again.kept) == (0, 9)
    before = {path.name: path.stat().st_mtime_ns for path in folder.glob("*.laz")}
    (folder / "t11.laz").unlink()
    again = jobs.tile_normals(tiles, folder).run()
    assert [row.task for row in again.rows] == ["t11.laz"]
    after = {path.name: path.stat().st_mtime_ns for path in folder.glob("*.laz")}
    assert {name for name in before if before[name] != after[name]} == {"t11.laz"}
    assert contents(folder) == contents(alone)


def test_what_is_read_may_change(cloud, truth, tmp_path):
    tiles = in_tiles(cloud, tmp_path / "tiles")
    corner = (tiles / "t22.laz").read_bytes()
    (tiles / "t22.laz").unlink()
    jobs.tile_normals(tiles, tmp_path / "out").run().raise_if_failed()
    (tiles / "t22.laz").write_bytes(corner)
    report = jobs.tile_normals(tiles, tmp_path / "out").run()
    # A tile more is a neighbour more of three others.
    assert {row.task for row in report.rows} == {"t22.laz", "t12.laz", "t21.laz", "t11.laz"}
    are_exact(tmp_path / "out", cloud, truth)


def test_other_settings_are_refused(tiles, alone, tmp_path):
    with pytest.raises(autosplats.ArgumentError, match="job.jsonl: the outputs there have k 10, not 12"):
        jobs.tile_normals(tiles, alone, k=12).run()
    (tmp_path / "t00.laz").write_bytes(b"something")
    with pytest.raises(autosplats.ArgumentError, match="t00.laz is there, and no manifest tells of it"):
        jobs.tile_normals(tiles, tmp_path).run()
    (tmp_path / "job.jsonl").write_text("what\n")
    with pytest.raises(autosplats.ArgumentError, match="not the manifest of a job"):
        jobs.tile_normals(tiles, tmp_path).run()
    assert (tmp_path / "t00.laz").read_bytes() == b"something"


def test_settings_by_which_all_failed_are_forgotten(tiles, alone, tmp_path):
    report = jobs.tile_normals(tiles, tmp_path / "out", keep="grund").run()
    assert len(report.failed) == 18 and "grund" in report.failed[0].error
    jobs.tile_normals(tiles, tmp_path / "out").run().raise_if_failed()
    assert contents(tmp_path / "out") == contents(alone)


def test_a_torn_line_of_the_manifest_is_left_out(tiles, alone, tmp_path):
    job = jobs.tile_normals(tiles, tmp_path / "out")
    job.run()
    lines = job.manifest.read_text().splitlines(keepends=True)
    job.manifest.write_text("".join(lines[:-1]) + lines[-1][:20])
    assert jobs.tile_normals(tiles, tmp_path / "out").run().kept == 9
    (tmp_path / "out/t00.laz").unlink()
    assert len(jobs.tile_normals(tiles, tmp_path / "out").run().rows) == 1
    assert all(json.loads(line) for line in job.manifest.read_text().splitlines())
    assert contents(tmp_path / "out") == contents(alone)


def test_a_malformed_tile_fails_alone(cloud, truth, tmp_path):
    tiles = in_tiles(cloud, tmp_path / "tiles")
    whole = (tiles / "t11.laz").read_bytes()
    (tiles / "t11.laz").write_bytes(whole[:3000])
    (tiles / "none.laz").write_bytes(b"no points")
    report = jobs.tile_normals(tiles, tmp_path / "out").run()
    failed = {row.task for row in report.failed}
    assert failed == {"t11.laz", "border of t11", "none.laz"}
    assert all("t11.laz" in row.error or "none.laz" in row.error for row in report.failed)
    assert all("\n" not in row.error for row in report.failed)
    assert set(contents(tmp_path / "out")) == {f"t{x}{y}.laz" for x in range(3) for y in range(3)} - {"t11.laz"}
    doubt = {row.task for row in report.rows if row.in_doubt}
    assert {"t01.laz", "t10.laz", "t12.laz", "t21.laz"} <= doubt, "what the lost points would tell"
    with pytest.raises(jobs.JobError, match="3 failed"):
        report.raise_if_failed()
    (tiles / "t11.laz").write_bytes(whole)
    (tiles / "none.laz").unlink()
    report = jobs.tile_normals(tiles, tmp_path / "out").run()
    report.raise_if_failed()
    assert report.in_doubt == 0
    are_exact(tmp_path / "out", cloud, truth)


def test_a_tile_that_is_cut_off_is_no_whole_tile(cloud, tmp_path):
    tiles = tmp_path / "tiles"
    tiles.mkdir()
    autosplats.write(cloud, tiles / "half.las")
    (tiles / "half.las").write_bytes((tiles / "half.las").read_bytes()[:-100_000])
    report = jobs.tile_normals(tiles, tmp_path / "out").run()
    assert [row.task for row in report.failed] == ["half.laz"] and "points are lost" in report.failed[0].error
    assert not contents(tmp_path / "out")


def test_borders_that_a_machine_does_not_see(tiles, alone, tmp_path):
    job = jobs.tile_normals(tiles, tmp_path / "out")
    job.steps = [[], job.tasks]
    job.run().raise_if_failed()
    assert contents(tmp_path / "out") == contents(alone), "whole tiles are read in their place"


def test_a_header_that_states_less_is_noted(cloud, tmp_path):
    tiles = in_tiles(cloud, tmp_path / "tiles")
    data = bytearray((tiles / "t11.laz").read_bytes())
    # The largest x of the header of LAS.
    struct.pack_into("<d", data, 179, struct.unpack_from("<d", data, 179)[0] - 10)
    (tiles / "t11.laz").write_bytes(data)
    report = jobs.tile_normals(tiles, tmp_path / "out").run()
    (row,) = (row for row in report.rows if row.task == "t11.laz")
    assert any("outside of the header's bounds" in note for note in row.notes)
    report = jobs.copc_tiles(tiles, tmp_path / "copc", side=5.0).run()
    errors = {row.task: row.error for row in report.failed}
    assert "points lie outside of the header's bounds" in errors["parts of t11"], "no point is lost without a word"
    assert all("t11.laz: its points are missing" in error for task, error in errors.items() if task != "parts of t11")


def test_flaky_shares_are_tried_again(tiles, alone, tmp_path):
    job = spoil(jobs.tile_normals(tiles, tmp_path / "out"), {"t01.laz": "flaky"})
    job.run().raise_if_failed()
    assert contents(tmp_path / "out") == contents(alone)
    (tmp_path / "out/t01.laz").unlink()
    report = spoil(jobs.tile_normals(tiles, tmp_path / "out"), {"t01.laz": "flaky"}).run(retries=0)
    assert [row.error for row in report.failed] == [f"{tmp_path}/out/t01.laz: Connection timed out"]


def test_an_interrupt_keeps_what_is_done(tiles, alone, tmp_path):
    def interrupt(fraction: float) -> None:
        if fraction > 0.7:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        jobs.tile_normals(tiles, tmp_path / "out").run(progress=interrupt)
    report = jobs.tile_normals(tiles, tmp_path / "out").run()
    assert 0 < report.kept < 9
    assert contents(tmp_path / "out") == contents(alone)


def test_one_run_at_a_time(tiles, tmp_path):
    with jobs.tile_normals(tiles, tmp_path / "out").begin():
        with pytest.raises(autosplats.ArgumentError, match="another run works on this job"):
            jobs.tile_normals(tiles, tmp_path / "out").run()


@pytest.mark.skipif(sys.platform != "linux", reason="tmpfs is Linux")
def test_a_full_disk_leaves_whole_outputs(tiles, alone, tmp_path):
    size = sum(map(len, contents(alone).values()))
    # A small disk, which nobody else sees.
    script = f"""
        mount -t tmpfs -o size={size * 2 // 3} none {tmp_path} &&
        {sys.executable} -m autosplats.jobs normals {tiles} -o {tmp_path}/out --quiet
        echo $?
        sha256sum {tmp_path}/out/*.laz
        find {tmp_path}/out ! -name '*.laz'
    """
    command = ["unshare", "--map-root-user", "--mount", "sh", "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    if done.returncode and not done.stdout:
        pytest.skip(f"no disk can be mounted: {done.stderr}")
    report, rest = done.stdout.split("\n1\n")
    assert "failed" in report and "No space left on device" in report, done.stdout
    whole = {name: hashlib.sha256(data).hexdigest() for name, data in contents(alone).items()}
    lines = rest.splitlines()
    sums = dict(reversed(line.split()) for line in lines if line.endswith(".laz"))
    assert 0 < len(sums) < 9
    assert all(whole[os.path.basename(name)] == found for name, found in sums.items())
    assert [line for line in lines if not line.endswith(".laz")] == [f"{tmp_path}/out", f"{tmp_path}/out/job.jsonl"]


def test_cells_of_a_malformed_tile(cloud, tmp_path):
    tiles = in_tiles(cloud, tmp_path / "tiles")
    cells = np.floor(autosplats.read(tiles / "t22.laz").xyz[:, :2] / 60).astype(int)
    lost = {f"{x}_{y}.copc.laz" for x, y in np.unique(cells, axis=0)}
    (tiles / "none.laz").write_bytes(b"no points")
    (tiles / "t22.laz").write_bytes((tiles / "t22.laz").read_bytes()[:3000])
    report = jobs.copc_tiles(tiles, tmp_path / "out", side=60.0).run(retries=0)
    failed = {row.task for row in report.failed}
    assert lost | {"parts of none", "parts of t22"} <= failed, "no cell lacks points without a word"
    assert contents(tmp_path / "out") and not failed & set(contents(tmp_path / "out"))


def test_bad_arguments(tiles, tmp_path):
    out = tmp_path / "out"
    for error, words, make in [
        (autosplats.ArgumentError, "k is 2, must be within 3 to 1024", lambda: jobs.tile_normals(tiles, out, k=2)),
        (autosplats.ArgumentError, "outputs cannot lie beside", lambda: jobs.tile_normals(tiles, tiles)),
        (autosplats.ArgumentError, "orient is 'outward'", lambda: jobs.tile_normals(tiles, out, orient="outward")),
        (autosplats.ArgumentError, "must be some of normals", lambda: jobs.tile_normals(tiles, out, values=["x"])),
        (autosplats.ArgumentError, "voxel is 0", lambda: jobs.thin_tiles(tiles, out, 0)),
        (autosplats.ArgumentError, "side is -1", lambda: jobs.copc_tiles(tiles, out, side=-1)),
        (FileNotFoundError, "none", lambda: jobs.tile_normals(tmp_path / "none.laz", out)),
        (FileNotFoundError, "there are no tiles", lambda: jobs.tile_normals(f"{tmp_path}/*.laz", out)),
        (autosplats.ArgumentError, "in degrees", lambda: jobs.tile_normals(DATA / "scans/latlon_degrees.las", out)),
        (autosplats.ArgumentError, "a name with a number", lambda: jobs.turntable("scene:statue:1K", "a.png", 3)),
        (autosplats.ArgumentError, "cameras: there is none", lambda: jobs.fly("scene:statue:1K", out / "a_%d.png", [])),
        (TypeError, "colour: there is no", lambda: jobs.turntable("scene:statue:1K", out / "%d.png", 3, colour="rgb")),
        (
            autosplats.ArgumentError,
            "frames_averaged",
            lambda: jobs.turntable("scene:statue:1K", out / "%d.png", 3, settings={"frames_averaged": 4}),
        ),
    ]:
        with pytest.raises(error, match=words):
            make()


def test_frames_are_those_of_the_command(tmp_path):
    source = DATA / "sequences/kitti_drive_pcd"
    job = jobs.frames(
        source, tmp_path / "ours_%03d.png", size=(160, 100), chunk=2, backend="cpu", color="height", legend=True
    )
    assert len(job.tasks) == 3
    report = job.run()
    report.raise_if_failed()
    assert sum(row.points for row in report.rows) == 5
    arguments = ["render", source, "-o", tmp_path / "theirs_%03d.png", "--size", "160x100", "--backend", "cpu"]
    command = [sys.executable, "-m", "autosplats", *map(str, arguments), "--color", "height", "--legend"]
    subprocess.run(command, check=True, capture_output=True)
    for frame in range(5):
        assert (tmp_path / f"ours_{frame:03}.png").read_bytes() == (tmp_path / f"theirs_{frame:03}.png").read_bytes()
    assert len(list(tmp_path.iterdir())) == 12, "two settings beside ten pictures"
    (tmp_path / "ours_003.png").unlink()
    again = jobs.frames(
        source, tmp_path / "ours_%03d.png", size=(160, 100), chunk=2, backend="cpu", color="height", legend=True
    ).run()
    assert [row.task for row in again.rows] == ["2..3"]
    assert (tmp_path / "ours_003.png").read_bytes() == (tmp_path / "theirs_003.png").read_bytes()


def test_a_turntable_goes_around(tiles, tmp_path):
    source = tiles / "t00.laz"
    jobs.turntable(source, tmp_path / "t_%d.png", 4, size=(80, 60), chunk=3, backend="cpu").run().raise_if_failed()
    pictures = [(tmp_path / f"t_{number}.png").read_bytes() for number in range(4)]
    assert len(set(pictures)) == 4
    start = autosplats.Camera.fit(source, size=(80, 60))
    middle = np.array(start.look_at)
    half = autosplats.Camera(tuple(middle + [-1, -1, 1] * (np.array(start.eye) - middle)), start.look_at, fov=start.fov)
    jobs.fly(source, tmp_path / "f_%d.png", [start, half], size=(80, 60), backend="cpu").run().raise_if_failed()
    flown = [autosplats.render(source, camera=camera, size=(80, 60), supersample=1) for camera in (start, half)]
    for number, place in enumerate((0, 2)):
        assert (tmp_path / f"f_{number}.png").read_bytes() == flown[number].encode()
        turned = pixels(pictures[place])
        assert np.abs(turned - pixels(flown[number].encode())).mean() < 1, "half around is behind"


def pixels(png: bytes) -> np.ndarray:
    from io import BytesIO

    from PIL import Image

    return np.asarray(Image.open(BytesIO(png)), dtype=float)


def test_the_command(tiles, alone, tmp_path):
    def run(*arguments: object) -> subprocess.CompletedProcess:
        command = [sys.executable, "-m", "autosplats.jobs", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)

    done = run("normals", tiles, "-o", tmp_path / "out")
    assert done.returncode == 0 and done.stdout.startswith("9 tasks done; "), done.stderr
    assert "0 tasks left, 100 %" in done.stderr
    assert contents(tmp_path / "out") == contents(alone)
    other = run("normals", tiles, "-o", tmp_path / "out", "-k", 12)
    assert other.returncode == 2 and other.stderr.startswith("error: ") and other.stderr.count("\n") == 1
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad/a.laz").write_bytes(b"LASF")
    bad = run("thin", tmp_path / "bad", "-o", tmp_path / "thin", "--voxel", 1, "--quiet")
    assert bad.returncode == 1 and "bad/a.laz" in bad.stdout, bad.stdout + bad.stderr
    assert run("frames", tmp_path / "none.mcap", "-o", tmp_path / "%d.png").returncode == 2
    assert run("nonsense").returncode == 2
