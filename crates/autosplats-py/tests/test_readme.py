"""What newcomers type: the Python of both READMEs, word by word."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import autosplats

PACKAGE = Path(__file__).parents[1]


def blocks(readme: Path) -> list[str]:
    return re.findall(r"```python\n(.*?)```", readme.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize("readme", [PACKAGE / "README.md", PACKAGE.parents[1] / "README.md"], ids=["package", "root"])
def test_what_newcomers_type(readme, points, colors, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fields = {"Classification": np.full(len(points), 2, np.uint8), "Intensity": np.arange(len(points), dtype=np.uint16)}
    cloud = autosplats.Cloud(points, colors, fields=fields)
    for name in ("scan.laz", "tile.laz", "tile.copc.laz"):
        autosplats.write(cloud, name)
    (tmp_path / "tiles").mkdir()
    autosplats.write(cloud, "tiles/one.laz")
    typed: dict[str, object] = {}
    for block in blocks(readme):
        # Recordings of ROS and machines of Ray are tested elsewhere.
        block = block.replace('"drive.mcap", topics=["/lidar/points"]', '"scene:figure:1K"')
        exec(block.partition("from autosplats import ray")[0], typed)
    assert "normals" in typed
    assert (tmp_path / "scan.png").stat().st_size > 10_000
