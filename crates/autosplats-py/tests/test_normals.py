"""Normals against the truth, and where other libraries are known to fail."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import torus, torus_normals

import autosplats
from autosplats import Cloud


def angles(found: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    return np.degrees(np.arccos(np.clip(np.abs((found * wanted).sum(axis=1)), -1, 1)))


def test_normals_are_those_of_the_surface():
    points = torus(200_000)
    normals = autosplats.estimate_normals(points)
    assert all(values.dtype == np.float32 for values in normals)
    assert normals.normals.shape == (200_000, 3) and normals.curvature.shape == normals.radius.shape == (200_000,)
    off = angles(normals.normals, torus_normals(points))
    assert np.median(off) < 1 and np.quantile(off, 0.99) < 5
    assert (normals.curvature >= 0).all() and (normals.curvature <= 1 / 3).all()


def test_k_neighbours_are_the_exact_ones():
    points = np.random.default_rng(8).random((500, 3))
    distances = np.linalg.norm(points[:, None] - points[None], axis=2)
    for k in (3, 10, 30):
        found = autosplats.estimate_normals(points, k=k)
        order = np.argsort(distances, axis=1)[:, : k + 1]
        np.testing.assert_allclose(found.radius, 2 * np.sort(distances, axis=1)[:, k] / np.sqrt(k), rtol=1e-5)
        for i in range(0, 500, 17):
            values, vectors = np.linalg.eigh(np.cov(points[order[i]].T, bias=True))
            if values[1] > 1.05 * values[0]:
                assert angles(found.normals[i : i + 1], vectors[:, :1].T)[0] < 0.5


def test_open3d_6670_survey_coordinates():
    """isl-org/Open3D#6670: far from zero all normals become the same."""
    points = torus(50_000)
    near = autosplats.estimate_normals(points, orient="up")
    far = autosplats.estimate_normals(points + [512_345.0, 5_412_345.0, 310.0], orient="up")
    off = angles(near.normals, far.normals)
    assert np.quantile(off, 0.999) < 0.1
    assert np.ptp(far.normals, axis=0).min() > 0.9, "not all the same"


def test_sides(points):
    outward = torus_normals(points)

    def share(**options) -> float:
        return ((autosplats.estimate_normals(points, **options).normals * outward).sum(axis=1) > 0).mean()

    away = np.array([0, 0, 1000.0])
    up = autosplats.estimate_normals(points, orient="up").normals
    assert (up[:, 2] >= 0).all()
    seen = autosplats.estimate_normals(points, sensor=away).normals
    assert ((seen * (away - points)).sum(axis=1) >= 0).all()
    stated = autosplats.estimate_normals(Cloud(points, sensor=away), orient="sensor").normals
    np.testing.assert_array_equal(stated, seen)
    assert share(orient="outward") > 0.6


def test_every_form_gives_the_same_bits(points):
    wanted = autosplats.estimate_normals(points)
    for given in (np.asfortranarray(points), Cloud(points), points.tolist(), {"x": points[:, 0], "y": points[:, 1], "z": points[:, 2]}):
        for found, want in zip(autosplats.estimate_normals(given), wanted):
            np.testing.assert_array_equal(found.view("u4"), want.view("u4"))
    for threads in (1, 3):
        np.testing.assert_array_equal(autosplats.estimate_normals(points, num_threads=threads).normals, wanted.normals)


def test_results_take_no_copy(points):
    found = autosplats.estimate_normals(points)
    assert found.normals.flags.c_contiguous and found.normals.flags.writeable


def test_normals_are_written_as_fields(points, tmp_path):
    cloud = Cloud(points)
    normals = autosplats.estimate_normals(cloud)
    autosplats.write(cloud.with_normals(normals), tmp_path / "a.ply")
    read = autosplats.read(tmp_path / "a.ply")
    for axis, name in enumerate(("NormalX", "NormalY", "NormalZ")):
        np.testing.assert_array_equal(read.field(name), normals.normals[:, axis])
    np.testing.assert_array_equal(read.field("DensityRadius"), normals.radius)
    with pytest.raises(ValueError, match="normals"):
        cloud.with_normals((normals.normals[:5], normals.curvature, normals.radius))
