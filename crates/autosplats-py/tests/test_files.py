"""Reading, writing and describing files."""

from __future__ import annotations

import io
import os

import numpy as np
import pytest

import autosplats
from autosplats import Cloud, EmptyError, FormatError


@pytest.mark.parametrize("extension", ["ply", "pcd", "las", "laz", "copc.laz", "e57", "xyz"])
def test_files_there_and_back(points, colors, tmp_path, extension):
    path = tmp_path / f"a.{extension}"
    cloud = Cloud(np.round(points * 1e4) / 1e4, colors)
    autosplats.write(cloud, path)
    read = autosplats.read(path)
    assert len(read) == len(cloud)
    order = [np.lexsort(np.round(c.xyz * 1e4).T) for c in (read, cloud)]
    np.testing.assert_allclose(read.xyz[order[0]], cloud.xyz[order[1]], rtol=0, atol=1e-4)
    np.testing.assert_array_equal(np.sort(read.colors.sum(axis=1)), np.sort(colors.sum(axis=1, dtype=np.uint64)))
    info = autosplats.info(path)
    assert info["points"] == len(cloud)
    np.testing.assert_allclose(info["bounds"]["min"], cloud.bounds[0], atol=1e-3)


def test_bytes_and_open_files(points, tmp_path):
    path = tmp_path / "a.ply"
    autosplats.write(points, path)
    whole = path.read_bytes()
    for source in (whole, bytearray(whole), memoryview(whole), io.BytesIO(whole), open(path, "rb")):
        np.testing.assert_array_equal(autosplats.read(source).xyz, points)
    text = b"1 2 3 40\n4 5 6 50\n"
    cloud = autosplats.read(text, name="a.txt", columns=["x", "y", "z", "Intensity"])
    np.testing.assert_array_equal(cloud.field("Intensity"), [40, 50])
    np.testing.assert_array_equal(autosplats.read(text, columns="x,y,z,-", name="a.txt").xyz, [[1, 2, 3], [4, 5, 6]])


def test_digits_are_kept(tmp_path):
    (tmp_path / "a.xyz").write_text("512345.123456 5412345.654321 310.111111\n" * 3)
    exact = autosplats.read(tmp_path / "a.xyz")
    np.testing.assert_array_equal(exact.xyz[0], [512345.123456, 5412345.654321, 310.111111])
    assert autosplats.read(tmp_path / "a.xyz", exact=False).nbytes < exact.nbytes


def test_bad_files(tmp_path, points):
    with pytest.raises(FileNotFoundError) as caught:
        autosplats.read(tmp_path / "none.ply")
    assert caught.value.filename == str(tmp_path / "none.ply") and caught.value.errno == 2
    with pytest.raises(FileNotFoundError):
        autosplats.info(tmp_path / "none.ply")
    with pytest.raises(FileNotFoundError):
        autosplats.render(tmp_path / "none.ply")
    (tmp_path / "bad.ply").write_bytes(b"ply\nformat binary_little_endian 1.0\nelement vertex 5\nproperty float x\nend_header\n")
    for call in (autosplats.read, autosplats.info, autosplats.render):
        with pytest.raises(FormatError, match=r"bad\.ply"):
            call(tmp_path / "bad.ply")
    with pytest.raises(FormatError):
        autosplats.read(b"\x00\x01\x02" * 100)
    with pytest.raises(TypeError, match="source: int given"):
        autosplats.read(5)
    with pytest.raises(TypeError, match="StringIO given"):
        autosplats.read(io.StringIO("1 2 3"))
    with pytest.raises(ValueError, match="unknown output format"):
        autosplats.write(points, tmp_path / "a.docx")
    with pytest.raises(FileNotFoundError):
        autosplats.write(points, tmp_path / "none" / "a.ply")
    autosplats.write(points, tmp_path / "a.ply")
    with pytest.raises(FileExistsError) as caught:
        autosplats.write(points, tmp_path / "a.ply")
    assert "overwrite=True" in str(caught.value)
    autosplats.write(points[:5], tmp_path / "a.ply", overwrite=True)
    assert len(autosplats.read(tmp_path / "a.ply")) == 5
    with pytest.raises(ValueError, match="keep|class"):
        autosplats.read(tmp_path / "a.ply", keep="ground")
    assert sorted(os.listdir(tmp_path)) == ["a.ply", "bad.ply"], "no partial file is left"


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="root may read everything")
def test_files_that_must_not_be_read(tmp_path):
    (tmp_path / "a.ply").write_bytes(b"ply")
    (tmp_path / "a.ply").chmod(0)
    with pytest.raises(PermissionError):
        autosplats.read(tmp_path / "a.ply")


def test_scenes():
    assert len(autosplats.scene("statue", 1234)) == 1234
    assert len(autosplats.scene("scene:figure:1K@0.5")) == 1000
    with pytest.raises(ValueError, match="(?s)no scene.*statue"):
        autosplats.scene("unicorn")
    with pytest.raises(ValueError):
        autosplats.render("scene:statue:0")
    info = autosplats.info("scene:statue:2K", scan=True)
    assert info["points"] == 2000 and info["spacing"] is not None
    with pytest.raises(ValueError, match="no scene"):
        autosplats.info("scene:unicorn")


def test_classes_of_noise_are_not_shown(tmp_path, points):
    classes = np.full(len(points), 2, dtype=np.uint8)
    classes[:100] = 7
    autosplats.write(Cloud(points, fields={"Classification": classes}), tmp_path / "a.las")
    assert autosplats.render(tmp_path / "a.las", size=(64, 48)).counts["points"] == len(points) - 100
    assert len(autosplats.read(tmp_path / "a.las")) == len(points)
    assert len(autosplats.read(tmp_path / "a.las", keep="7")) == 100
    with pytest.raises(EmptyError):
        autosplats.read(tmp_path / "a.las", keep="9")


def test_degrees_are_shown_in_metres(tmp_path):
    random = np.random.default_rng(2).random((5000, 3))
    (tmp_path / "a.csv").write_text(
        "longitude,latitude,z\n" + "".join(f"{11 + 1e-3 * x:.9f},{48 + 1e-3 * y:.9f},{z}\n" for x, y, z in random)
    )
    picture = autosplats.render(tmp_path / "a.csv", size=(64, 48))
    assert picture.counts["covered"] > 100
    cloud = autosplats.read(tmp_path / "a.csv")
    assert cloud.crs.unit == "degree"
    normals = autosplats.estimate_normals(cloud, orient="up").normals
    assert np.median(normals[:, 2]) > 0.95, "flat in metres"


def test_bounds_of_files_and_octrees(tmp_path):
    points = np.random.default_rng(5).random((60_000, 3)) * [200, 200, 10]
    points[7] = [50, 60, 5]
    for name in ("a.laz", "a.copc.laz", "a.xyz"):
        autosplats.write(autosplats.Cloud(points), tmp_path / name)
        whole = autosplats.read(tmp_path / name).xyz
        for low, high in [([50, 60, 2], [90, 70, 5]), ([-np.inf, 60, -np.inf], [90, np.inf, np.inf]), ([300] * 3, [301] * 3)]:
            inside = whole[((whole >= low) & (whole <= high)).all(axis=1)]
            found = autosplats.read(tmp_path / name, bounds=[low, high]).xyz
            assert len(found) == len(inside)
            # Readers of octrees choose another origin for a part.
            np.testing.assert_allclose(np.sort(found, axis=0), np.sort(inside, axis=0), rtol=0, atol=1e-6)
        assert len(autosplats.read((tmp_path / name).read_bytes(), bounds=[[0, 0, 0], [90, 90, 5]])) < 30_000
    for bounds in ([0, 1], [[1, 1, 1], [0, 2, 2]], [[np.nan, 0, 0], [1, 1, 1]]):
        with pytest.raises(autosplats.ArgumentError, match="bounds"):
            autosplats.read(tmp_path / "a.laz", bounds=bounds)


def test_what_a_file_has_lost_is_told(tmp_path, caplog):
    path = tmp_path / "half.las"
    autosplats.write(autosplats.Cloud(np.random.default_rng(1).random((1000, 3))), path)
    path.write_bytes(path.read_bytes()[:-10_000])
    with caplog.at_level("WARNING", logger="autosplats"):
        left = len(autosplats.read(path))
    assert left < 1000 and any(f"{1000 - left} of 1000 points are lost" in record.message for record in caplog.records)
    with pytest.raises(autosplats.FormatError, match="are lost"):
        autosplats.read(path, whole=True)
