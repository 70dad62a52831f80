"""Rows a second on one core, and how many times that is what NumPy makes of the same model in the same run.

Once with a call of NumPy for each pose, as a control cycle or an optimiser asks, and once with all poses in one array.
"""

import os
import time

# before NumPy reads it: its linear algebra on one core too
os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")

import numpy as np

import numpy_model
import pkm
from conftest import FIXTURES, WIDE_TABLE


def rate(compute, poses):
    """Rows a second, the best of three."""
    times = []
    for _ in range(3):
        begun = time.perf_counter()
        compute(poses)
        times.append(time.perf_counter() - begun)
    return len(poses) / min(times)


def main():
    basic, corrected = pkm.Model(), pkm.Model(table=WIDE_TABLE)
    machine = numpy_model.machine(FIXTURES / "machines/reference.toml")
    table = numpy_model.table(WIDE_TABLE)
    low, high = basic.pose_box.T
    poses = np.random.default_rng(0).uniform(low, high, (100_000, 3))
    cases = [
        ("inverse kinematics", basic.ik, lambda p: numpy_model.ik(machine, p), 100_000),
        ("K_m", corrected.stiffness, lambda p: numpy_model.corrected_stiffness(machine, table, p), 2_000),
    ]
    for name, ours, numpys, count in cases:
        ours, together = rate(ours, poses), rate(numpys, poses[:count])
        one_by_one = rate(lambda p: [numpys(row[None]) for row in p], poses[:300])
        print(
            f"{name}: {ours:.2g} a second; NumPy a pose at a time {one_by_one:.2g} (ratio {ours / one_by_one:.0f}), "
            f"all poses in one array {together:.2g} (ratio {ours / together:.0f})"
        )


main()
