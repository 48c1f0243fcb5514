"""Reads one file with every capable peer, and prints a JSON line for each: name, points, best wall and CPU seconds.

Called by the benchmark `peers`. A peer that is not installed is reported as missing.
"""

import json
import os
import shutil
import subprocess
import sys
import time


def open3d(path):
    import open3d

    return len(open3d.io.read_point_cloud(path).points)


def laspy(path):
    import laspy

    las = laspy.read(path)
    return len(las.xyz)


def pye57(path):
    import pye57

    file = pye57.E57(path)
    scans = [file.read_scan(i, ignore_missing_fields=True, intensity=True, colors=True) for i in range(file.scan_count)]
    return sum(len(scan["cartesianX"]) for scan in scans)


def plyfile(path):
    import plyfile

    return len(plyfile.PlyData.read(path)["vertex"].data.copy())


def numpy(path):
    import numpy

    return len(numpy.loadtxt(path, skiprows=1))


def pdal(path):
    if shutil.which("pdal") is None:
        raise ImportError("no command pdal")
    pipeline = json.dumps([path, {"type": "writers.null"}])
    subprocess.run(["pdal", "pipeline", "--stdin"], input=pipeline, text=True, check=True, capture_output=True)
    return 0


PEERS = {
    "ply": [open3d, plyfile, pdal],
    "pcd": [open3d, pdal],
    "xyz": [open3d, numpy, pdal],
    "las": [laspy, pdal],
    "laz": [laspy, pdal],
    "e57": [pye57, pdal],
}


def main():
    path, repeats = sys.argv[1], int(sys.argv[2])
    for peer in PEERS[path.rsplit(".", 1)[1]]:
        best = None
        try:
            for _ in range(repeats):
                before, wall = os.times(), time.perf_counter()
                points = peer(path)
                wall, after = time.perf_counter() - wall, os.times()
                cpu = sum(after[:4]) - sum(before[:4])
                best = min(best or (wall, cpu), (wall, cpu))
        except ImportError as error:
            print(json.dumps({"name": peer.__name__, "missing": str(error)}))
            continue
        except Exception as error:  # A failing peer is a result too.
            print(json.dumps({"name": peer.__name__, "missing": f"fails: {str(error)[:80]}"}))
            continue
        print(json.dumps({"name": peer.__name__, "points": points, "wall": best[0], "cpu": best[1]}))


main()
