"""PyTorch: tensors of the processor go in, and workers of a DataLoader render and estimate normals.

PyTorch takes more than all other packages of the tests together, so these tests run where it is installed. What a
worker does is tested without it in test_process.py: pools by fork, spawn and forkserver, and forks during use.
"""

from __future__ import annotations

import subprocess
import sys
import textwrap

import numpy as np
import pytest

import autosplats

torch = pytest.importorskip("torch", reason="PyTorch is not installed; it is too large for every run")


@pytest.mark.parametrize("kind", [torch.float64, torch.float32, torch.float16, torch.int32])
def test_tensors_are_points(points, colors, kind):
    tensor = torch.from_numpy(8 * points).to(kind)
    expected = autosplats.estimate_normals(tensor.numpy())
    for given in (tensor, tensor.clone().T.contiguous().T):
        for found, wanted in zip(autosplats.estimate_normals(given), expected):
            np.testing.assert_array_equal(found, wanted)
    if kind.is_floating_point:
        found = autosplats.estimate_normals(tensor.clone().requires_grad_())
        np.testing.assert_array_equal(found.normals, expected.normals)
    picture = autosplats.render(tensor, torch.from_numpy(colors), size=(64, 48))
    np.testing.assert_array_equal(picture.array, autosplats.render(tensor.numpy(), colors, size=(64, 48)).array)


def test_results_are_tensors(points):
    normals = autosplats.estimate_normals(points).normals
    tensor = torch.from_numpy(normals)
    assert tensor.data_ptr() == normals.ctypes.data, "no copy"
    assert torch.tensor(np.asarray(autosplats.render(points, size=(64, 48)))).shape == (48, 64, 4)


def test_tensors_elsewhere_are_refused(points):
    class OnACard(torch.Tensor):
        def __dlpack_device__(self):
            return (2, 0)

    there = torch.from_numpy(points).as_subclass(OnACard)
    for given in (there, there.clone().requires_grad_()):
        with pytest.raises(TypeError, match=r"points: .*graphics card; copy them first, as tensor\.cpu\(\)"):
            autosplats.estimate_normals(given)
    with pytest.raises(TypeError, match=r"colors: .*graphics card"):
        autosplats.render(points, there)
    for kind in (torch.rand(5, 3, device="meta"), torch.rand(5, 3).to_sparse()):
        with pytest.raises(TypeError, match="points: Tensor given, an array of numbers is wanted"):
            autosplats.estimate_normals(kind)


@pytest.mark.parametrize("method", ["fork", "spawn", "forkserver"])
def test_workers_of_a_loader(method, tmp_path):
    script = tmp_path / "loader.py"
    script.write_text(
        textwrap.dedent(
            f"""
            import autosplats, torch

            class Scans(torch.utils.data.Dataset):
                def __len__(self):
                    return 6

                def __getitem__(self, number):
                    random = torch.Generator().manual_seed(number)
                    points = torch.rand(5000, 3, generator=random, dtype=torch.float64)
                    picture = autosplats.render(points, size=(64, 48))
                    return torch.from_numpy(autosplats.estimate_normals(points).normals), torch.tensor(picture.array)

            if __name__ == "__main__":
                scans = Scans()
                # Threads of PyTorch and of the package run before there are workers.
                alone = [scans[number] for number in range(len(scans))]
                loader = torch.utils.data.DataLoader(
                    scans, num_workers=2, multiprocessing_context="{method}", persistent_workers=True, timeout=60
                )
                for epoch in range(2):
                    found = list(loader)
                    assert len(found) == len(alone)
                    for batch, wanted in zip(found, alone):
                        assert all(torch.equal(one[0], other) for one, other in zip(batch, wanted)), epoch
            """
        )
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
