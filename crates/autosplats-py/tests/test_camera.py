"""Cameras by matrices, against what matrices say and against ray-cast spheres."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import autosplats
from autosplats import ArgumentError, Camera

SIZE = (320, 240)


def pose(seed: int = 4) -> np.ndarray:
    random = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(random.normal(size=(3, 3)))
    if np.linalg.det(rotation) < 0:
        rotation[:, 0] *= -1
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = random.normal(size=3) * 10 + [512_000, 5_400_000, 300]
    return matrix


def intrinsics(fx=300.0, fy=300.0, cx=159.5, cy=119.5) -> np.ndarray:
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])


@pytest.mark.parametrize("k", [intrinsics(), intrinsics(310, 305, 140.25, 131.5), intrinsics(900, 900, -40, 500)])
def test_matrices_go_there_and_back(k):
    world_from_camera = pose()
    camera = Camera.from_matrix(world_from_camera, k, SIZE)
    back, k_back = camera.matrix(SIZE)
    np.testing.assert_allclose(back, world_from_camera, rtol=0, atol=1e-8)
    np.testing.assert_allclose(k_back, k, rtol=0, atol=1e-9)
    assert Camera.from_json(camera.to_json()) == camera == pickle.loads(pickle.dumps(camera))
    opengl = world_from_camera @ np.diag([1, -1, -1, 1])
    np.testing.assert_allclose(Camera.from_matrix(opengl, k, SIZE, convention="opengl").matrix(SIZE)[0], back, atol=1e-8)


@pytest.mark.parametrize("k", [intrinsics(), intrinsics(310, 305, 140.25, 131.5)])
def test_points_are_where_the_matrices_say(k):
    world_from_camera = pose()
    camera = Camera.from_matrix(world_from_camera, k, SIZE)
    in_camera = np.random.default_rng(5).normal(size=(100, 3)) + [0, 0, 6]
    world = in_camera @ world_from_camera[:3, :3].T + world_from_camera[:3, 3]
    pixels, depths = camera.project(world, SIZE)
    wanted = in_camera @ k.T
    np.testing.assert_allclose(pixels, wanted[:, :2] / wanted[:, 2:], atol=1e-5)
    np.testing.assert_allclose(depths, in_camera[:, 2], atol=1e-8)
    np.testing.assert_allclose(camera.unproject(pixels, depths, SIZE), world, rtol=0, atol=1e-7)
    behind = world_from_camera[:3, 3] - world_from_camera[:3, 2]
    pixels, depths = camera.project(behind[None], SIZE)
    assert np.isnan(pixels).all() and np.isnan(depths).all()


@pytest.mark.parametrize(
    "k", [intrinsics(), intrinsics(300, 300, 100.25, 150.75), intrinsics(306, 300, 140.3, 131.6)], ids=str
)
@pytest.mark.parametrize("backend", ["cpu", "gpu"])
def test_maps_of_a_calibrated_camera_are_the_truth(k, backend):
    """Depth and normals of a sphere's points, against lines of sight cast on the sphere."""
    if backend == "gpu" and not autosplats.devices():
        pytest.skip("no graphics device")
    random = np.random.default_rng(6)
    points = random.normal(size=(200_000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    world_from_camera = np.eye(4)
    world_from_camera[:3, 3] = [0.3, -0.2, -4]
    camera = Camera.from_matrix(world_from_camera, k, SIZE)
    picture = autosplats.render(points, camera=camera, size=SIZE, layers=True, backend=backend)
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    rays = np.stack([(x - k[0, 2]) / k[0, 0], (y - k[1, 2]) / k[1, 1], np.ones_like(x, dtype=float)], axis=2)
    eye = world_from_camera[:3, 3]
    a, b, c = (rays**2).sum(axis=2), rays @ eye, eye @ eye - 1
    root = b**2 - a * c
    hit = root > 0
    depth = np.where(hit, (-b - np.sqrt(np.maximum(root, 0))) / a, np.inf)
    normals = eye + rays * np.where(hit, depth, 0)[:, :, None]
    seen = np.isfinite(picture.depth)
    assert (seen != hit).mean() < 0.01, "the silhouette is in its place"
    # Away from the rim, where a normal is steep.
    both = seen & hit & (root > 0.2 * root.max())
    assert both.sum() > 5000
    assert np.abs(picture.depth[both] - depth[both]).max() < 0.01
    angles = np.degrees(np.arccos(np.clip((picture.normals * normals).sum(axis=2)[both], -1, 1)))
    assert np.median(angles) < 1 and np.quantile(angles, 0.99) < 5


def test_an_axis_aside_only_moves_the_picture(points):
    """The picture of a lens that is shifted by whole pixels is a part of a larger one."""
    camera = Camera.fit(points, "iso", size=(300, 200))
    world_from_camera, k = camera.matrix((300, 200))
    large = autosplats.render(points, camera=camera, size=(300, 200), layers=True, backend="cpu")
    part = Camera.from_matrix(world_from_camera, k - [[0, 0, 60], [0, 0, 30], [0, 0, 0]], (200, 140))
    small = autosplats.render(points, camera=part, size=(200, 140), layers=True, backend="cpu")
    cut = np.s_[30:170, 60:260]
    both = np.isfinite(small.depth) & np.isfinite(large.depth[cut])
    assert (np.isfinite(small.depth) == np.isfinite(large.depth[cut])).mean() > 0.999
    close = np.isclose(small.depth, large.depth[cut], atol=1e-4)
    assert close[both].mean() > 0.99


def test_cameras_are_fitted(points):
    for view in ("auto", "iso", "front", "back", "left", "right", "top", "bottom"):
        camera = Camera.fit(points, view, size=SIZE)
        pixels, depths = camera.project(points, SIZE)
        assert (depths > 0).all() and (pixels > 0).all() and (pixels < SIZE).all(), view
    assert Camera.fit(points, orthographic=True).height > 1
    assert Camera.fit(points, fov=10).fov == 10
    with pytest.raises(autosplats.EmptyError):
        Camera.fit(np.zeros((0, 3)))


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Camera((0, 0, 0), (0, 0, 0)), "same point"),
        (lambda: Camera((0, 0, 0), (0, 0, 1)), "line of sight"),
        (lambda: Camera((0, 0, 0), (0, 1, 0), fov=180), "field of view"),
        (lambda: Camera((0, 0, 0), (0, 1, 0), height=-1), "height"),
        (lambda: Camera((0, 0, 0), (0, 1, 0), fov=20, height=1), "one of"),
        (lambda: Camera((0, 0), (0, 1, 0)), "eye"),
        (lambda: Camera((0, np.nan, 0), (0, 1, 0)), "finite"),
        (lambda: Camera.from_matrix(np.eye(3), np.eye(3), SIZE), r"world_from_camera: shape \(3, 3\)"),
        (lambda: Camera.from_matrix(np.diag([1, 1, -1, 1]), intrinsics(), SIZE), "no rotation"),
        (lambda: Camera.from_matrix(2 * np.eye(4), intrinsics(), SIZE), "no rotation"),
        (lambda: Camera.from_matrix(np.eye(4), np.eye(4), SIZE), "K: shape"),
        (lambda: Camera.from_matrix(np.eye(4), -intrinsics(), SIZE), "K"),
        (lambda: Camera.from_matrix(np.eye(4), intrinsics(400, 300), SIZE), "5 %"),
        (lambda: Camera.from_json("{}"), "not the text"),
        (lambda: Camera((0, 0, 0), (0, 1, 0), height=2).matrix(SIZE), "orthographic"),
        (lambda: Camera((0, 0, 0), (0, 1, 0)).unproject([[1, 2]], [1, 2], SIZE), "depths"),
    ],
)
def test_bad_cameras(make, says):
    with pytest.raises(ArgumentError, match=says):
        make()
