"""Bad input gives the exception that one expects, which names the argument, what came and what is wanted."""

from __future__ import annotations

import contextlib
import os
import sys
import threading

import numpy as np
import pytest

import autosplats
from autosplats import ArgumentError, Cloud, EmptyError, FormatError, MissingFieldError, OutOfMemoryError

linux = pytest.mark.skipif(sys.platform != "linux", reason="Linux only")


@pytest.mark.parametrize(
    ("points", "kind", "says"),
    [
        (np.zeros(3), ValueError, r"points: an array of shape \(3,\) given, \(n, 3\) is wanted"),
        (np.zeros((5, 2)), ValueError, r"shape \(5, 2\)"),
        (np.zeros((5, 4)), ValueError, r"points\[:, :3\]"),
        (np.zeros((3, 5)), ValueError, r"points\.T"),
        (np.zeros((4, 5, 3)), ValueError, r"reshape"),
        (np.zeros((5, 3), dtype=bool), TypeError, "points: bool given, numbers are wanted"),
        (np.zeros((5, 3), dtype=complex), TypeError, "complex128"),
        (np.zeros((5, 3), dtype=object), TypeError, "object"),
        (np.array([["a", "b", "c"]]), TypeError, "numbers are wanted"),
        ([[1, 2, 3], [1, 2]], TypeError, "points"),
        (None, TypeError, "points"),
        (7, ValueError, r"shape \(\)"),
        (np.zeros(5, dtype=[("a", "f4")]), ValueError, "points: a given, fields x, y and z are wanted"),
        ({"x": [1.0], "y": [1.0, 2.0], "z": [1.0]}, ValueError, "1, 2, 1 values"),
        (b"bytes", TypeError, "bytes given"),
    ],
)
def test_points(points, kind, says):
    for call in (autosplats.render, autosplats.estimate_normals, Cloud):
        with pytest.raises(kind, match=says):
            call(points)


@pytest.mark.parametrize(
    ("colors", "kind", "says"),
    [
        (np.zeros((4, 3)), ValueError, r"colors: an array of shape \(4, 3\) given, \(5, 3\) or \(5, 4\) is wanted"),
        (np.zeros((5, 2)), ValueError, r"\(5, 2\)"),
        (np.full((5, 3), 255.0), ValueError, "colors: floats from 255.0 to 255.0 given, 0 to 1.*uint8"),
        (np.full((5, 3), np.nan), ValueError, "colors"),
        (np.full((5, 3), -1), ValueError, "whole numbers from -1"),
        (np.full((5, 3), 70_000), ValueError, "uint16"),
        ("red", TypeError, "colors"),
    ],
)
def test_colors(colors, kind, says):
    with pytest.raises(kind, match=says):
        autosplats.render(np.random.rand(5, 3), colors)


@pytest.mark.parametrize(
    ("options", "kind", "says"),
    [
        ({"size": (0, 10)}, ValueError, "size: 0x10 given"),
        ({"size": (10, 20_000)}, ValueError, "16384"),
        ({"size": 10}, TypeError, "size: 10 given"),
        ({"size": (1.5, 3)}, TypeError, "size"),
        ({"k": 0}, ValueError, "k is 0, must be within 1 to 64"),
        ({"k": 65}, ValueError, "k is 65"),
        ({"k": "ten"}, TypeError, "k: 'ten'"),
        ({"view": "above"}, ValueError, "view is 'above', must be one of auto"),
        ({"axes": "up"}, ValueError, "axes is 'up', must be one of z-up"),
        ({"color": "hight"}, KeyError, "hight"),
        ({"color": "rgb"}, KeyError, "colours"),
        ({"color": ""}, ValueError, "color"),
        ({"color": np.zeros((5, 3))}, TypeError, "colors="),
        ({"color_map": "jet"}, ValueError, "color_map is 'jet', must be one of viridis"),
        ({"value_range": (2, 1)}, ValueError, "range"),
        ({"background": "no colour"}, ValueError, "background|CSS"),
        ({"exposure": 0}, ValueError, "exposure is 0"),
        ({"occlusion": 11}, ValueError, "occlusion is 11"),
        ({"supersample": 0}, ValueError, "supersample is 0"),
        ({"supersample": 2, "layers": True}, ValueError, "supersample"),
        ({"camera": "front"}, TypeError, "camera: str given, an autosplats.Camera"),
        ({"backend": "cuda"}, ValueError, "backend is 'cuda', must be one of auto, cpu, gpu"),
        ({"device": "99"}, RuntimeError, "no device is called '99'"),
        ({"device": 0, "backend": "cpu"}, ValueError, "device"),
        ({"num_threads": 0}, ValueError, "num_threads is 0, must be within 1 to 1024"),
        ({"num_threads": -3}, ValueError, "num_threads is -3"),
        ({"num_threads": "2"}, TypeError, "num_threads: str given"),
        ({"progress": 3}, TypeError, "progress: int given"),
        ({"settings": {"points_per_pixel": 3}}, ValueError, "points_per_pixel is 3"),
        ({"settings": {"k": "x"}}, ValueError, "settings"),
    ],
)
def test_options(options, kind, says):
    with pytest.raises(kind, match=says):
        autosplats.render(np.random.rand(50, 3), **{"size": (64, 48), **options})


def test_exceptions_are_ours_and_builtin():
    for ours, builtin in [
        (ArgumentError, ValueError),
        (FormatError, ValueError),
        (EmptyError, ValueError),
        (MissingFieldError, KeyError),
        (autosplats.DeviceError, RuntimeError),
        (OutOfMemoryError, MemoryError),
    ]:
        assert issubclass(ours, builtin) and issubclass(ours, autosplats.Error)
        assert ours.__module__ == "autosplats"
    assert str(MissingFieldError("a sentence")) == "a sentence", "not in quotes"


def test_points_without_a_place():
    for points in (np.zeros((0, 3)), np.full((10, 3), np.nan), np.full((10, 3), np.inf)):
        with pytest.raises(EmptyError, match="nothing to show"):
            autosplats.render(points)
        normals = autosplats.estimate_normals(points)
        assert normals.normals.shape == (len(points), 3) and np.isnan(normals.normals).all()
    camera = autosplats.Camera((0, -5, 0), (0, 0, 0))
    picture = autosplats.render(np.zeros((0, 3)), camera=camera, size=(64, 48))
    assert picture.counts["covered"] == 0


def test_poison_changes_no_other_point(points):
    camera = autosplats.Camera.fit(points, size=(200, 120))
    poison = np.array([[np.nan, 0, 0], [0, np.inf, 0], [1e300, 0, 0], [0, 0, -np.inf]])
    clean = autosplats.render(points, camera=camera, size=(200, 120))
    mixed = autosplats.render(np.concatenate([points, poison]), camera=camera, size=(200, 120))
    np.testing.assert_array_equal(mixed.array, clean.array)


def test_more_points_than_there_can_be():
    for count in (2**31, 2**32, 2**33):
        many = np.broadcast_to(np.zeros((1, 3), dtype=np.float32), (count, 3))
        with pytest.raises(MemoryError, match="points|out of memory"):
            autosplats.render(many)


def test_pictures_larger_than_memory():
    with pytest.raises((MemoryError, ValueError)):
        autosplats.render(np.random.rand(50, 3), size=(16_384, 16_384), supersample=16)


@linux
def test_no_memory(python):
    done = python(
        """
        import resource, numpy as np, autosplats
        points = np.random.default_rng(0).random((3_000_000, 3), dtype=np.float32)
        cloud = autosplats.Cloud(points)
        def threads_start():
            autosplats.estimate_normals(points[:1000])
        threads_start()
        taken = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (taken + (30 << 20), resource.RLIM_INFINITY))
        for call in (
            lambda: autosplats.Cloud(points),
            lambda: autosplats.estimate_normals(cloud),
            lambda: autosplats.render(cloud, size=(4096, 4096), backend="cpu"),
            lambda: autosplats.read("scene:statue:9M"),
        ):
            try:
                print("done", call())
            except autosplats.OutOfMemoryError as error:
                print(error)
        threads_start()
        """
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == 4 and all("memory" in line for line in lines), done.stdout


@linux
def test_no_device(python):
    done = python(
        """
        import autosplats
        assert autosplats.devices() == []
        assert autosplats.render("scene:statue:1K", size=(64, 48)).counts["covered"] > 0, "the processor renders"
        try:
            autosplats.render("scene:statue:1K", size=(64, 48), backend="gpu")
        except autosplats.DeviceError as error:
            print(error)
        """,
        # Vulkan finds its drivers by the first, by the second if it is old.
        env={**os.environ, "VK_DRIVER_FILES": "/none", "VK_ICD_FILENAMES": "/none"},
    )
    assert done.returncode == 0, done.stderr
    assert "there is none" in done.stdout and done.stdout.count("\n") == 1, done.stdout


def test_overlapping_arrays():
    # Rows that share numbers, and must not be written to.
    line = np.random.default_rng(0).random(5000)
    overlapping = np.lib.stride_tricks.as_strided(line, (4998, 3), (8, 8), writeable=False)
    apart = overlapping.copy()
    np.testing.assert_array_equal(Cloud(overlapping).xyz, Cloud(apart).xyz)
    for found, wanted in zip(autosplats.estimate_normals(overlapping), autosplats.estimate_normals(apart)):
        np.testing.assert_array_equal(found, wanted)
    colors = np.lib.stride_tricks.as_strided(np.arange(5000, dtype=np.uint8), (4998, 3), (1, 1), writeable=False)
    found = autosplats.render(overlapping, colors, size=(64, 48)).array
    np.testing.assert_array_equal(found, autosplats.render(apart, colors.copy(), size=(64, 48)).array)


def test_arrays_that_change_meanwhile(points):
    mine = np.tile(points, (10, 1))
    colors = np.zeros(mine.shape, dtype=np.uint8)
    stop = threading.Event()

    def change() -> None:
        while not stop.is_set():
            mine[:] = np.nan
            mine[:] = 1e30
            mine[:] = 0.5
            colors[:] += 1

    thread = threading.Thread(target=change)
    thread.start()
    try:
        for _ in range(20):
            autosplats.estimate_normals(mine)
            # Between two writes no point may have a place.
            with contextlib.suppress(EmptyError):
                autosplats.render(mine, colors, size=(64, 48))
    finally:
        stop.set()
        thread.join()


def test_fields(points):
    with pytest.raises(ValueError, match=r"field A: an array of shape \(3,\) given, \(20000,\) is wanted"):
        Cloud(points, fields={"A": [1, 2, 3]})
    with pytest.raises(TypeError, match="field A"):
        Cloud(points, fields={"A": ["a"] * len(points)})
    cloud = Cloud(points, fields={"A": points[:, 0]})
    with pytest.raises(KeyError, match="no field B; it has A"):
        cloud.field("B")
    with pytest.raises(KeyError, match="B"):
        autosplats.render(cloud, color="B", size=(64, 48))


def test_sensors(points):
    for sensor, kind in [((1, 2), ValueError), ("here", TypeError), ((np.nan, 0, 0), ValueError)]:
        with pytest.raises(kind):
            autosplats.estimate_normals(points, sensor=sensor)
    with pytest.raises(ValueError, match="state no sensor"):
        autosplats.estimate_normals(points, orient="sensor")
    with pytest.raises(ValueError, match="orient is 'in'"):
        autosplats.estimate_normals(points, orient="in")
    for k, kind in [(2, ValueError), (1025, ValueError), (1.5, TypeError), (True, TypeError)]:
        with pytest.raises(kind, match="k"):
            autosplats.estimate_normals(points, k=k)


def test_an_exception_in_the_progress_comes_out():
    class Enough(Exception):
        pass

    def progress(fraction: float) -> None:
        raise Enough(str(fraction))

    many = np.random.rand(300_000, 3)
    with pytest.raises(Enough):
        autosplats.estimate_normals(many, k=200, progress=progress)
    with pytest.raises(Enough):
        autosplats.render(many, size=(64, 48), progress=progress)
