"""Reads octrees by laspy and by copclib, and compares them with the files of which they were made.

Takes pairs of paths: a LAS or LAZ file, and the COPC file of its points. Prints a line for each pair.
"""

import sys

import copclib
import laspy
import numpy as np

FIELDS = ["x", "y", "z", "intensity", "classification", "return_number", "point_source_id"]


def rows(points):
    """Values of each point as a row, in an order that does not depend on that of the file."""
    columns = np.stack([np.asarray(points[name], dtype=np.float64) for name in FIELDS])
    return columns[:, np.lexsort(columns)]


def inside(points, low, high):
    """Number of points in a box, borders included."""
    axes = [np.asarray(points[axis]) for axis in "xyz"]
    return int(np.all([(a >= l) & (a <= h) for a, l, h in zip(axes, low, high)], axis=0).sum())


def check_laspy(source, path):
    with laspy.CopcReader.open(path) as reader:
        np.testing.assert_allclose(rows(reader.query()), rows(source), rtol=0, atol=1e-7)
        extent = reader.header.maxs - reader.header.mins
        # Beside the steps of the coordinates, so that no point lies on the border.
        beside = np.asarray(reader.header.scales) * 0.37
        for share in (0.1, 0.3, 0.45):
            low, high = (reader.header.mins + extent * part + beside for part in (share, 1 - share))
            found = reader.query(laspy.copc.Bounds(mins=low, maxs=high))
            assert inside(found, low, high) == inside(source, low, high), share


def check_copclib(source, path):
    reader = copclib.FileReader(path)
    nodes = [node for node in reader.GetAllNodes() if node.point_count]
    count = sum(len(reader.GetPoints(node)) for node in nodes)
    assert count == len(source), count


for source, path in zip(sys.argv[1::2], sys.argv[2::2]):
    points = laspy.read(source)
    check_laspy(points, path)
    check_copclib(points, path)
    print(f"{path}: {len(points)} points")
