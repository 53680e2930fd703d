"""Time BVH parsing, forward kinematics and writing, beside upc-pymotion where it is installed.

    python benchmarks/bvh.py --frames 10000 --joints 20

Prints a table and one JSON line. Times are the best of several runs in one process.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from cospeech.motion.bvh import read_bvh, write_bvh
from cospeech.motion.kinematics import euler_to_quaternion, skeleton_positions
from cospeech.motion.motion import Motion
from cospeech.motion.skeleton import Skeleton


def make_motion(frames: int, joints: int) -> Motion:
    """A random walk of joint angles on a chain-and-branches skeleton."""
    generator = np.random.default_rng(0)
    parents = (-1, *(max(0, joint - 1 - joint % 3) for joint in range(1, joints)))
    skeleton = Skeleton(
        "benchmark",
        tuple(f"joint{i}" for i in range(joints)),
        parents,
        generator.uniform(-0.3, 0.3, (joints, 3)).round(4),
    )
    angles = 0.02 * generator.normal(size=(frames, joints, 3)).cumsum(axis=0)
    rotations = euler_to_quaternion(angles, "ZXY")
    root = 0.01 * generator.normal(size=(frames, 3)).cumsum(axis=0)
    positions = skeleton_positions(skeleton, rotations, root)
    return Motion(skeleton, 60.0, positions, rotations.astype(np.float32))


def best_of(repeats: int, function: Callable[[], object]) -> float:
    """Seconds of the fastest of several calls."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def ours(path: Path, motion: Motion, repeats: int) -> dict[str, float]:
    """Seconds per task; reading includes the conversion to quaternions and world positions."""
    rotations, root = motion.rotations_local, motion.positions[:, 0]
    assert rotations is not None
    return {
        "read to positions": best_of(repeats, lambda: read_bvh(path)),
        "forward kinematics": best_of(
            repeats, lambda: skeleton_positions(motion.skeleton, rotations, root)
        ),
        "write": best_of(repeats, lambda: write_bvh(path.with_name("ours.bvh"), motion)),
    }


def pymotion(path: Path, repeats: int) -> dict[str, float]:
    """The same tasks in upc-pymotion (NumPy)."""
    import pymotion.rotations.quat_np as quat
    from pymotion.io.bvh import BVH
    from pymotion.ops.skeleton_np import fk

    def load() -> BVH:
        file = BVH()
        file.load(str(path))
        return file

    file = load()
    data = file.data
    order = np.broadcast_to(data["rot_order"], data["rotations"].shape)

    def pose() -> tuple:
        rotations = quat.from_euler(np.radians(data["rotations"]), order=order)
        return rotations, data["positions"][:, 0], data["offsets"].astype(float), data["parents"]

    posed = pose()
    return {
        "read to positions": best_of(repeats, lambda: (load(), fk(*pose()))),
        "forward kinematics": best_of(repeats, lambda: fk(*posed)),
        "write": best_of(repeats, lambda: file.save(str(path.with_name("theirs.bvh")))),
    }


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=10_000)
    parser.add_argument("--joints", type=int, default=20)
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    motion = make_motion(arguments.frames, arguments.joints)
    with tempfile.TemporaryDirectory() as folder:
        path = write_bvh(Path(folder, "motion.bvh"), motion)
        megabytes = path.stat().st_size / 1e6
        times = {"cospeech": ours(path, motion, arguments.repeats)}
        if importlib.util.find_spec("pymotion"):
            times["upc-pymotion"] = pymotion(path, arguments.repeats)
    table = Table(title=f"{arguments.frames} frames, {arguments.joints} joints, {megabytes:.1f} MB")
    for column in ("task", *(f"{library} [s]" for library in times), "ratio"):
        table.add_column(column)
    for task, seconds in times["cospeech"].items():
        theirs = [times[library][task] for library in times if library != "cospeech"]
        ratio = f"{theirs[0] / seconds:.1f} x" if theirs else "-"
        table.add_row(task, f"{seconds:.3f}", *(f"{value:.3f}" for value in theirs), ratio)
    Console().print(table)
    print(json.dumps({"benchmark": "bvh", **vars(arguments), "seconds": times}))


if __name__ == "__main__":
    main()
