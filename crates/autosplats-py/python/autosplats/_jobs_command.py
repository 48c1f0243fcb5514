"""The commands `python -m autosplats.jobs` and `python -m autosplats.ray`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, Literal

from . import jobs
from ._camera import Camera
from ._errors import Error
from ._job import Job, Report
from ._task import told

#: Exit codes: as those of the command `autosplats`, and one for tasks that failed while others are done.
_DONE, _SOME_FAILED, _BAD_USAGE, _INTERRUPTED = 0, 1, 2, 130

_CODES = """\
exit codes:
  0    done
  1    some tasks failed; the report names them, and the others are done
  2    bad usage, or outputs of other settings
  130  interrupted (Ctrl-C); what is done is kept, and the same command goes on"""


def main(engine: Literal["here", "ray"], arguments: list[str] | None = None) -> int:
    """Runs the command, and returns its exit code."""
    options = vars(_parser(engine).parse_args(arguments))
    make, is_quiet = options.pop("make"), options.pop("quiet")
    names = ("address", "num_cpus", "num_gpus", "memory", "retries", "speculate")
    running = {name: options.pop(name) for name in names if name in options}
    try:
        report = _run(engine, make(**options), {**running, "progress": not is_quiet})
    except KeyboardInterrupt:
        print("\nerror: interrupted", file=sys.stderr)
        return _INTERRUPTED
    except (Error, OSError, ImportError) as error:
        print(f"error: {told(error)}", file=sys.stderr)
        return _BAD_USAGE
    print(report)
    return _SOME_FAILED if report.failed else _DONE


def _run(engine: Literal["here", "ray"], job: Job, running: dict[str, Any]) -> Report:
    if engine == "here":
        return job.run(**running)
    from .ray import run

    return run(job, **running)


def _parser(engine: Literal["here", "ray"]) -> argparse.ArgumentParser:
    formatter = argparse.RawDescriptionHelpFormatter
    module, where = {"here": ("jobs", "in this process"), "ray": ("ray", "on a cluster of Ray")}[engine]
    about = f"Works on many tiles or frames {where}. The same command again does what is missing."
    parser = argparse.ArgumentParser(
        prog=f"python -m autosplats.{module}", description=about, epilog=_CODES, formatter_class=formatter
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    normals = _tiles(commands, "normals", "Estimate normals, curvature and density, exact up to the borders of tiles")
    normals.add_argument("-k", type=int, default=10, help="number of neighbours, 3 to 1024 [default: 10]")
    normals.add_argument("--orient", choices=["up", "sensor"], default="up", help="side of normals [default: up]")
    normals.add_argument("--sensor", type=_numbers, metavar="X,Y,Z", help="where all points were seen from")
    values = "of normals, curvature, density [default: all]"
    normals.add_argument("--values", type=_words, metavar="NAME,...", help=values)
    normals.set_defaults(make=_normals)

    thin = _tiles(commands, "thin", "Keep one point per cube, exact up to the borders of tiles")
    thin.add_argument("--voxel", type=float, required=True, metavar="SIZE", help="edge of the cubes in world units")
    thin.set_defaults(make=lambda tiles, **options: _of_tiles(jobs.thin_tiles, tiles, options))

    copc = _tiles(commands, "copc", "Convert tiles to octrees (COPC)", has_format=False)
    copc.add_argument("--side", type=float, metavar="SIZE", help="side of a grid whose cells become files")
    copc.set_defaults(make=lambda tiles, **options: _of_tiles(jobs.copc_tiles, tiles, options))

    frames = _pictures(commands, "frames", "Render the frames of a recording, a sequence or an animation")
    frames.add_argument("source", metavar="SOURCE", help="recording, folder, pattern of files, or animated scene")
    frames.add_argument("--frames", type=_range, metavar="A..B", help="the first and the last [default: all]")
    frames.add_argument("--view", default="auto", help="side to look from [default: auto]")
    frames.add_argument("--camera", metavar="FILE", help="camera that 'autosplats render --save-camera' wrote")
    frames.add_argument("--fps", type=float, help="frames per second of files and animations")
    frames.add_argument("--topics", type=_words, metavar="NAME,...", help="topics of a recording")
    frames.add_argument("--decay", type=float, metavar="SECONDS", help="time for which older points stay visible")
    frames.set_defaults(make=_frames)

    turntable = _pictures(commands, "turntable", "Render points from all around")
    turntable.add_argument("points", metavar="POINTS", help="file, address or scene")
    turntable.add_argument("--count", type=int, required=True, help="number of pictures")
    turntable.add_argument("--view", default="auto", help="side of the first picture [default: auto]")
    turntable.set_defaults(make=jobs.turntable)

    fly = _pictures(commands, "fly", "Render points along cameras")
    fly.add_argument("points", metavar="POINTS", help="file, address or scene")
    fly.add_argument("--cameras", required=True, metavar="FILE", help="cameras as JSON, a line for each picture")
    fly.set_defaults(make=_fly)

    for command in (normals, thin, copc, frames, turntable, fly):
        command.add_argument("--quiet", action="store_true", help="no progress")
        running = command.add_argument_group("running")
        running.add_argument("--retries", type=int, default=3, help="tries again of a task [default: 3]")
        if engine == "ray":
            running.add_argument("--address", help="of the cluster: auto, or HOST:PORT [default: this machine alone]")
            running.add_argument("--num-cpus", type=float, default=2, help="cores and threads per task [default: 2]")
            running.add_argument("--num-gpus", type=float, default=0, help="graphics cards per task [default: 0]")
            running.add_argument("--memory", type=int, metavar="BYTES", help="per task [default: by its points]")
            once = "do not start slow tasks a second time"
            running.add_argument("--no-speculate", dest="speculate", action="store_false", help=once)
    return parser


def _tiles(commands: Any, name: str, about: str, *, has_format: bool = True) -> argparse.ArgumentParser:
    command: argparse.ArgumentParser = commands.add_parser(name, help=about, description=about)
    tiles = "folder or files of tiles, or one octree (COPC, EPT)"
    command.add_argument("tiles", nargs="+", metavar="TILES", help=tiles)
    command.add_argument("-o", "--out", dest="output", required=True, metavar="FOLDER", help="folder for the outputs")
    command.add_argument("--keep", help="which points to keep: usual, ground ...")
    command.add_argument("--box-points", type=int, metavar="COUNT", help="most points of a box of an octree")
    if has_format:
        command.add_argument("--format", default="laz", help="ending of the outputs [default: laz]")
    return command


def _pictures(commands: Any, name: str, about: str) -> argparse.ArgumentParser:
    command: argparse.ArgumentParser = commands.add_parser(name, help=about, description=about)
    out = "name of the pictures, with a number: f_%%05d.png"
    command.add_argument("-o", "--out", dest="output", required=True, metavar="NAME", help=out)
    command.add_argument("--size", type=_size, default=(1280, 800), metavar="WxH", help="[default: 1280x800]")
    command.add_argument("--axes", help="which axis points up, such as z-up")
    command.add_argument("--backend", choices=["auto", "cpu", "gpu"], default="auto", help="[default: auto]")
    command.add_argument("--chunk", type=int, metavar="COUNT", help="pictures of a task [default: up to 16]")
    command.add_argument("--color", default="auto", help="height, intensity, the name of a field ... [default: auto]")
    command.add_argument("--range", dest="value_range", type=_ends, metavar="A..B", help="ends of the colour map")
    command.add_argument("--legend", action="store_true", help="draw the colour map")
    command.add_argument("--background", metavar="COLOR", help="a CSS colour, two for a gradient, or transparent")
    factor = "render so many times as wide and high, and average [default: 1]"
    command.add_argument("--supersample", type=int, default=1, metavar="FACTOR", help=factor)
    return command


def _normals(tiles: list[str], values: list[str] | None, **options: Any) -> Job:
    if values is not None:
        options["values"] = values
    return _of_tiles(jobs.tile_normals, tiles, options)


def _of_tiles(make: Any, tiles: list[str], options: dict[str, Any]) -> Job:
    if options["box_points"] is None:
        del options["box_points"]
    # A single name may be a folder, a pattern or an octree.
    job: Job = make(tiles[0] if len(tiles) == 1 else tiles, **options)
    return job


def _frames(source: str, camera: str | None, **options: Any) -> Job:
    playing = {name: options.pop(name) for name in ("fps", "topics", "decay")}
    given = {name: value for name, value in playing.items() if value is not None}
    return jobs.frames(source, camera=None if camera is None else _camera(camera), playing=given, **options)


def _fly(points: str, cameras: str, **options: Any) -> Job:
    lines = Path(cameras).read_text(encoding="utf-8").splitlines()
    return jobs.fly(points, cameras=[Camera.from_json(line) for line in lines if line.strip()], **options)


def _camera(path: str) -> Camera:
    return Camera.from_json(Path(path).read_text(encoding="utf-8"))


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(map(float, text.split(",")))


def _words(text: str) -> list[str]:
    return [word.strip() for word in text.split(",")]


def _size(text: str) -> tuple[int, int]:
    width, height = map(int, text.lower().split("x"))
    return width, height


def _range(text: str) -> tuple[int, int]:
    first, last = map(int, text.split(".."))
    return first, last


def _ends(text: str) -> tuple[float, float]:
    low, high = map(float, text.split(".."))
    return low, high
