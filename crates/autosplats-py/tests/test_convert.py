"""Whatever people hold goes in, and gives what plain arrays give."""

from __future__ import annotations

import sys
import types

import numpy as np
import pytest

import autosplats
from autosplats import Cloud


def same(cloud: Cloud, points: np.ndarray) -> None:
    assert len(cloud) == len(points)
    np.testing.assert_array_equal(cloud.xyz, points)


@pytest.mark.parametrize("dtype", ["f4", "f8", ">f4", ">f8", "f2", "i2", "u1", "i8", "g"])
def test_every_type_of_number(dtype):
    points = np.arange(12).reshape(4, 3).astype(dtype)
    same(Cloud(points), points.astype("f8"))


def test_any_strides_and_order(points):
    wide = np.zeros((len(points), 7))
    wide[:, 1:6:2] = points
    views = [
        np.asfortranarray(points),
        wide[:, 1:6:2],
        np.repeat(points, 2, axis=0)[::2],
        points[::-1][::-1],
        np.ascontiguousarray(points.T).T,
    ]
    for view in views:
        same(Cloud(view), points)
    same(Cloud(points[::-1]), points[::-1])
    same(Cloud(points.tolist()), points)
    same(Cloud(np.broadcast_to(points[:1], (5, 3))), np.repeat(points[:1], 5, axis=0))


def test_unaligned_and_read_only():
    raw = np.zeros(3 * 13 + 1, dtype=np.uint8)
    packed = raw[1:].view(np.dtype({"names": ["x", "y", "z"], "formats": ["<f4"] * 3, "offsets": [0, 4, 8], "itemsize": 13}))
    packed["x"], packed["y"], packed["z"] = [1, 2, 3], [4, 5, 6], [7, 8, 9]
    assert not packed["x"].flags.aligned or packed["x"].strides == (13,)
    same(Cloud(packed), np.array([[1, 4, 7], [2, 5, 8], [3, 6, 9]]))
    points = np.arange(9.0).reshape(3, 3)
    points.flags.writeable = False
    same(Cloud(points), points)


def test_the_input_is_copied(points):
    mine = points.copy()
    cloud = Cloud(mine)
    mine[:] = 0
    same(cloud, points)


def test_survey_coordinates_keep_every_digit():
    far = np.random.default_rng(3).random((1000, 3)) * [800, 900, 60] + [512_345, 5_412_345, 300]
    # As files of millimetres and of micrometres have them.
    for step in (1e-3, 1e-6):
        stepped = np.round(far / step) * step
        cloud = Cloud(stepped)
        np.testing.assert_array_equal(cloud.xyz, stepped)
        assert np.abs(cloud.origin).max() > 1e6, "an origin as readers choose it"
    # 48 binary digits about the origin, of the 53 that float64 has about zero.
    near = np.random.default_rng(4).normal(size=(1000, 3))
    np.testing.assert_allclose(Cloud(near).xyz, near, rtol=2**-47, atol=0)
    coarse = Cloud(far, exact=False)
    assert 0 < np.abs(coarse.xyz - far).max() < 1e-4
    assert coarse.nbytes == 12 * len(far)


def test_a_point_cloud_2_as_ros_hands_it_out(points, colors):
    dtype = np.dtype({
        "names": ["x", "y", "z", "rgb", "intensity", "ring"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<f4", "<u2"],
        "offsets": [0, 4, 8, 16, 20, 24],
        "itemsize": 32,
    })
    message = np.zeros(len(points), dtype)
    for axis, name in enumerate("xyz"):
        message[name] = points[:, axis]
    bits = colors.astype(np.uint32)
    message["rgb"] = (bits[:, 0] << 16 | bits[:, 1] << 8 | bits[:, 2]).view("<f4")
    message["intensity"] = np.arange(len(points))
    cloud = Cloud(message)
    same(cloud, points.astype("f4").astype("f8"))
    np.testing.assert_array_equal(cloud.colors, colors)
    np.testing.assert_array_equal(cloud.field("intensity"), np.arange(len(points)))
    assert list(cloud.fields) == ["Intensity", "ring"]
    assert cloud.fields["ring"].dtype == np.uint16


def test_structured_arrays_go_there_and_back(points, colors):
    cloud = Cloud(points, colors, fields={"Intensity": np.arange(len(points), dtype=np.uint16)})
    again = Cloud(cloud.to_structured())
    same(again, points)
    np.testing.assert_array_equal(again.colors, colors)
    assert again.fields["Intensity"].dtype == np.uint16


def test_data_frames(points):
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(points, columns=["X", "Y", "Z"])
    frame["intensity"] = np.arange(len(points), dtype=np.int16)
    frame["name"] = "a"
    cloud = Cloud(frame)
    same(cloud, points)
    assert list(cloud.fields) == ["Intensity"], "words are left out"
    same(Cloud(frame[["X", "Y", "Z"]].rename(columns=str.lower)), points)
    same(Cloud(pandas.DataFrame(points)), points)


def test_laspy(points, colors, tmp_path):
    laspy = pytest.importorskip("laspy")
    header = laspy.LasHeader(point_format=2, version="1.2")
    header.scales, header.offsets = [1e-4] * 3, [0] * 3
    las = laspy.LasData(header)
    las.x, las.y, las.z = points.T
    las.red, las.green, las.blue = colors.T.astype(np.uint16) * 257
    las.intensity = np.arange(len(points))
    cloud = Cloud(las)
    np.testing.assert_allclose(cloud.xyz, las.xyz, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(cloud.colors, colors)
    assert "Intensity" in cloud.fields
    las.write(tmp_path / "a.las")
    read = autosplats.read(tmp_path / "a.las")
    np.testing.assert_allclose(read.xyz, cloud.xyz, rtol=0, atol=1e-9)


def test_objects_by_what_they_look_like(points, colors):
    """The shapes of the objects of libraries that are too large to be installed for a test."""
    open3d = types.SimpleNamespace(
        points=points,
        colors=colors / 255,
        normals=points,
        has_colors=lambda: True,
        has_normals=lambda: True,
    )
    cloud = Cloud(open3d)
    same(cloud, points)
    np.testing.assert_array_equal(cloud.colors, colors)
    assert list(cloud.fields) == ["NormalX", "NormalY", "NormalZ"]

    class Tensors(dict):
        @property
        def positions(self):
            return self["positions"]

    tensor = types.SimpleNamespace(numpy=lambda: points, device="CPU:0")
    same(Cloud(types.SimpleNamespace(point=Tensors(positions=tensor))), points)
    away = types.SimpleNamespace(point=Tensors(positions=types.SimpleNamespace(device="CUDA:0")))
    with pytest.raises(TypeError, match=r"graphics card.*cpu\(\)"):
        Cloud(away)
    pyvista = types.SimpleNamespace(points=points, point_data={"Intensity": points[:, 0], "RGB": colors})
    cloud = Cloud(pyvista)
    same(cloud, points)
    np.testing.assert_array_equal(cloud.colors, colors)
    same(Cloud({"points": points, "time": points[:, 0]}), points)
    for name in ("open3d", "pyvista", "laspy"):
        assert name not in sys.modules or name == "laspy", "nothing is imported"


def test_tensors_of_a_processor(points):
    class Tensor:
        """What tensors offer."""

        requires_grad = True

        def detach(self):
            return Plain()

        def __dlpack_device__(self):
            return (1, 0)

    class Plain(Tensor):
        requires_grad = False

        def __array__(self, dtype=None, copy=None):
            return points

    same(Cloud(Tensor()), points)


@pytest.mark.parametrize("device", [2, 10, 14])
def test_tensors_of_graphics_cards_are_refused(device):
    class Tensor:
        def __dlpack_device__(self):
            return (device, 0)

    class WithGradient(Tensor):
        requires_grad = True

        @property
        def __cuda_array_interface__(self):
            raise RuntimeError("tensors that require a gradient have none")

        def detach(self):
            return Tensor()

    for given in (Tensor(), WithGradient()):
        with pytest.raises(TypeError, match=r"points: .*graphics card.*tensor\.cpu\(\)"):
            autosplats.render(given)


def test_colors_of_every_kind(points, colors):
    for given in (colors, colors / 255, (colors / 255).astype("f4"), colors.astype(np.uint16) * 257, colors.astype(int)):
        np.testing.assert_array_equal(Cloud(points, given).colors, colors)
    four = np.concatenate([colors, colors[:, :1]], axis=1)
    np.testing.assert_array_equal(Cloud(points, four).colors, colors)
    np.testing.assert_array_equal(Cloud(points, colors[:, ::-1]).colors, colors[:, ::-1])


def test_results_are_views(points, colors):
    cloud = Cloud(points.astype("f4"), colors, fields={"A": np.arange(len(points))})
    for array in (cloud.positions, cloud.colors, cloud.field("a")):
        assert not array.flags.writeable and not array.flags.owndata
        with pytest.raises(ValueError):
            array.setflags(write=True)
    assert np.shares_memory(cloud.positions, cloud.positions)
    positions = cloud.positions
    first = positions[0].copy()
    del cloud
    np.testing.assert_array_equal(positions[0], first), "the view keeps the memory"


def test_parts_of_clouds(points, colors):
    cloud = Cloud(points, colors, fields={"A": np.arange(len(points))}, sensor=(0, 0, 9))
    mask = points[:, 0] > 0
    same(cloud[mask], points[mask])
    assert cloud[mask].scans[0].stop == mask.sum()
    same(cloud[10:20:3], points[10:20:3])
    same(cloud[::-1], points[::-1])
    chosen = cloud[np.array([5, 5, -1])]
    same(chosen, points[[5, 5, -1]])
    np.testing.assert_array_equal(chosen.field("A"), [5, 5, len(points) - 1])
    np.testing.assert_array_equal(chosen.colors, colors[[5, 5, -1]])
    both = Cloud.merge([cloud[:5], points[5:9]])
    same(both, points[:9])
    assert len(cloud.thin(0.5)) < 1000
    np.testing.assert_allclose(cloud.bounds, [points.min(axis=0), points.max(axis=0)])
    with pytest.raises(IndexError):
        cloud[np.array([len(points)])]
    with pytest.raises(TypeError, match="index"):
        cloud[0.5]
