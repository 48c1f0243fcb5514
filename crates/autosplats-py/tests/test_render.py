"""Pictures are the command's, and the same whatever threads do."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import autosplats
from autosplats import Camera, Cloud


def command(*arguments: object) -> None:
    subprocess.run([sys.executable, "-m", "autosplats", *map(str, arguments)], check=True, capture_output=True)


@pytest.fixture(scope="module")
def file(tmp_path_factory, points, colors) -> Path:
    path = tmp_path_factory.mktemp("files") / "torus.ply"
    fields = {"Intensity": np.arange(len(points), dtype=np.uint16)}
    autosplats.write(Cloud(points.astype("f4"), colors, fields=fields), path)
    return path


@pytest.mark.parametrize(
    ("options", "typed"),
    [
        ({}, []),
        ({"view": "top", "color": "height", "legend": True}, ["--view", "top", "--color", "height", "--legend"]),
        ({"color": "intensity", "color_map": "turbo"}, ["--color", "intensity", "--color-map", "turbo"]),
        ({"background": "transparent", "color": "plain"}, ["--background", "transparent", "--color", "plain"]),
        ({"k": 16, "occlusion": 2}, ["-k", "16", "--occlusion", "2"]),
        ({"axes": "y-up", "lighting": False}, ["--axes", "y-up", "--no-lighting"]),
        ({"supersample": 1, "value_range": (0, 1), "color": "normal"}, ["--supersample", "1", "--color", "normal"]),
    ],
)
def test_pictures_are_the_commands_bytes(file, tmp_path, options, typed):
    picture = autosplats.render(file, size=(240, 160), backend="cpu", **options)
    command("render", file, "-o", tmp_path / "a.png", "--size", "240x160", "--backend", "cpu", *typed)
    assert picture.encode("png") == (tmp_path / "a.png").read_bytes()
    picture.save(tmp_path / "b.png")
    assert (tmp_path / "b.png").read_bytes() == (tmp_path / "a.png").read_bytes()
    # From arrays, as from the file.
    read = autosplats.read(file)
    again = autosplats.render(read, size=(240, 160), backend="cpu", **options)
    np.testing.assert_array_equal(again.array, picture.array)


@pytest.mark.parametrize("name", ["scene:statue:20K", "scene:figure:10K@0.5"])
def test_scenes_are_seen_by_their_own_camera(name, tmp_path):
    picture = autosplats.render(name, size=(160, 120), backend="cpu")
    command("render", name, "-o", tmp_path / "a.png", "--size", "160x120", "--backend", "cpu")
    assert picture.encode("png") == (tmp_path / "a.png").read_bytes()
    cloud = autosplats.scene(name)
    np.testing.assert_array_equal(autosplats.render(cloud, size=(160, 120), backend="cpu").array, picture.array)
    again = pickle.loads(pickle.dumps(cloud))
    np.testing.assert_array_equal(autosplats.render(again, size=(160, 120), backend="cpu").array, picture.array)


def test_layers_are_the_bits_of_the_exr(file, tmp_path):
    OpenEXR = pytest.importorskip("OpenEXR")
    camera = tmp_path / "camera.json"
    command("render", file, "-o", tmp_path / "a.exr", "--size", "240x160", "--backend", "cpu", "--save-camera", camera)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as written:
        channels = {name: channel.pixels for name, channel in written.channels().items()}
    picture = autosplats.render(file, size=(240, 160), backend="cpu", layers=True)
    assert picture.camera == Camera.from_json(camera.read_text())
    for name, layer in [
        ("Z", picture.depth),
        ("N.X", picture.normals[:, :, 0]),
        ("N.Y", picture.normals[:, :, 1]),
        ("N.Z", picture.normals[:, :, 2]),
        ("radius", picture.radius),
        ("kradius", picture.k_radius),
        ("curvature", picture.curvature),
    ]:
        np.testing.assert_array_equal(channels[name].view("u4"), np.ascontiguousarray(layer).view("u4"), name)
    index = channels["index"].astype(np.int64)
    index[index == 2**32 - 1] = -1
    np.testing.assert_array_equal(picture.points, index)
    assert picture.encode("exr") == (tmp_path / "a.exr").read_bytes()
    again = pickle.loads(pickle.dumps(picture))
    assert again.encode("exr") == picture.encode("exr")
    np.testing.assert_array_equal(again.array, picture.array)
    np.testing.assert_array_equal(again.points, picture.points)


def test_layers_are_where_the_points_are(points):
    picture = autosplats.render(points, size=(320, 240), layers=True)
    world = picture.xyz()
    seen = picture.points >= 0
    assert seen.sum() == np.isfinite(picture.depth).sum() > 5000
    nearest = points[picture.points[seen]]
    assert np.quantile(np.linalg.norm(world[seen] - nearest, axis=1), 0.99) < 0.1
    np.testing.assert_allclose(np.linalg.norm(picture.normals[seen], axis=1), 1, atol=1e-5)
    # The torus itself is the truth: distance of the surface from it.
    ring = np.hypot(world[seen][:, 0], world[seen][:, 1]) - 2
    off = np.abs(np.hypot(ring, world[seen][:, 2]) - 0.7)
    assert np.quantile(off, 0.95) < 0.01


def test_pictures_are_arrays(points):
    picture = autosplats.render(points, size=(64, 48))
    assert np.asarray(picture) is picture.array or np.shares_memory(np.asarray(picture), picture.array)
    assert np.asarray(picture).shape == picture.shape == (48, 64, 4)
    assert np.array(picture).flags.writeable
    assert np.asarray(picture, dtype=float).dtype == float
    assert picture.size == (64, 48)
    assert picture._repr_png_().startswith(b"\x89PNG")
    assert picture.timings["frame"] > 0 and picture.counts["points"] == len(points)
    with pytest.raises(KeyError, match="layers=True"):
        picture.depth
    assert "64x48" in repr(picture)
    assert Cloud(points)._repr_png_().startswith(b"\x89PNG")


def test_files_of_pictures(points, tmp_path):
    picture = autosplats.render(points, size=(64, 48), background="transparent")
    for name, kind in [("a.jpg", ValueError), ("a.gif", ValueError), ("a", ValueError), ("a.exr", KeyError)]:
        with pytest.raises(kind):
            picture.save(tmp_path / name)
        assert not (tmp_path / name).exists()
    picture.save(tmp_path / "a.png")
    with pytest.raises(FileExistsError):
        picture.save(tmp_path / "a.png", overwrite=False)
    with pytest.raises(FileNotFoundError):
        picture.save(tmp_path / "none" / "a.png")
    autosplats.render(points, size=(64, 48)).save(tmp_path / "a.jpg")
    assert (tmp_path / "a.jpg").read_bytes().startswith(b"\xff\xd8")


def test_threads_change_nothing(points):
    camera = Camera.fit(points)
    pictures = [autosplats.render(points, size=(200, 150), camera=camera, num_threads=n).array for n in (1, 2, 5)]
    for picture in pictures[1:]:
        np.testing.assert_array_equal(picture, pictures[0])
    found = []
    work = lambda: found.append(autosplats.render(points, size=(200, 150), camera=camera).array)  # noqa: E731
    threads = [threading.Thread(target=work) for _ in range(4)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert len(found) == 4
    for picture in found:
        np.testing.assert_array_equal(picture, pictures[0])


def test_a_renderer_is_shared_and_pickled(points):
    renderer = autosplats.Renderer("cpu")
    camera = Camera.fit(points)
    first = renderer.render(points, size=(200, 150), camera=camera).array
    found = []
    work = lambda: found.append(renderer.render(points, size=(200, 150), camera=camera).array)  # noqa: E731
    threads = [threading.Thread(target=work) for _ in range(4)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    for picture in found:
        np.testing.assert_array_equal(picture, first)
    again = pickle.loads(pickle.dumps(renderer))
    np.testing.assert_array_equal(again.render(points, size=(200, 150), camera=camera).array, first)
    assert renderer.device is None and "processor" in repr(renderer)


def test_devices_are_named():
    devices = autosplats.devices()
    for number, device in enumerate(devices):
        assert device.number == number and device.name and device.api
    with pytest.raises(RuntimeError, match=f"no device is called '{len(devices)}'"):
        autosplats.Renderer(device=len(devices))
    if not devices:
        with pytest.raises(RuntimeError, match="there is none"):
            autosplats.Renderer("gpu")
        pytest.skip("no graphics device")
    by_index = autosplats.Renderer(device=0)
    assert by_index.device == devices[0]
    if devices[0].pci_bus_id:
        assert autosplats.Renderer(device=devices[0].pci_bus_id).device == devices[0]
    picture = by_index.render("scene:statue:20K", size=(160, 120))
    on_cpu = autosplats.render("scene:statue:20K", size=(160, 120), backend="cpu")
    differs = np.abs(picture.array.astype(int) - on_cpu.array).max(axis=2) > 2
    assert differs.mean() < 0.001


def test_the_camera_of_a_picture_is_the_commands(file, tmp_path):
    camera = Camera.fit(file, "left", size=(240, 160))
    (tmp_path / "camera.json").write_text(camera.to_json())
    typed = ["--camera", tmp_path / "camera.json", "--size", "240x160", "--backend", "cpu"]
    command("render", file, "-o", tmp_path / "a.png", *typed)
    picture = autosplats.render(file, size=(240, 160), camera=camera, backend="cpu")
    assert picture.encode("png") == (tmp_path / "a.png").read_bytes()
    assert json.loads(picture._core.camera) == json.loads(camera.to_json())
