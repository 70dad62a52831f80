"""The compiled module."""

import os
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Path = str | os.PathLike[str]

class Model:
    """A machine, with a correction table or without.

    Without `machine` it is the reference machine, without `table` the basic model K_p. `table` is the coefficients.json
    of `fit`; `form` is how it is applied: "auto" is the factor form where the table has it. What is doubtful about the
    files is a `pkm.Warning`.

    Every array has a row for each pose. A method computes all rows on one core without the GIL, or raises the
    `RefusedError` of the first row that is refused, with its number in `row`: no row of a result is ever NaN.

    - poses (n, 3): theta_rad, sigma_rad, z0_m
    - q_m (n, 3): screw lengths of limbs 1, 2, 3 in m
    - joints (n, 5): the three screw lengths in m, then beta1_rad, beta2_rad
    - wrenches (n, 6): fx_n, fy_n, fz_n, mx_nm, my_nm, mz_nm on the moving platform, in A-uvw
    - stiffness (n, 6, 6): at A in A-uvw, N/m, N, N·m/rad
    - deflections (n, 6): translation in m, rotation in rad, in A-uvw

    "Or one row": an array of the shape of one row then stands for all.
    """

    def __new__(
        cls,
        machine: _Path | None = None,
        table: _Path | None = None,
        *,
        form: Literal["auto", "diagonal", "factor"] = "auto",
    ) -> Model: ...
    @property
    def name(self) -> str:
        """Name of the machine."""
    @property
    def pose_box(self) -> NDArray[np.float64]:
        """The machine file's box, (3, 2): least and greatest theta_rad, sigma_rad, z0_m."""
    def ik(self, poses: ArrayLike) -> NDArray[np.float64]:
        """Screw lengths of poses, within travel: (n, 3) to (n, 3)."""
    def fk(self, q_m: ArrayLike) -> NDArray[np.float64]:
        """Poses of screw lengths: (n, 3) to (n, 3)."""
    def reachable(self, poses: ArrayLike) -> NDArray[np.bool_]:
        """Whether `ik` takes each pose."""
    def inside_box(self, poses: ArrayLike) -> NDArray[np.bool_]:
        """Whether each pose is inside the box that the table was fitted on; outside it extrapolates."""
    def stiffness(self, poses: ArrayLike, *, temperature_c: float = 20.0) -> NDArray[np.float64]:
        """K_m of the table, or without one K_p: (n, 3) to (n, 6, 6)."""
    def deflection(
        self,
        poses: ArrayLike,
        wrenches: ArrayLike,
        *,
        at_m: ArrayLike | None = None,
        temperature_c: float = 20.0,
        rise_k: float = 0.0,
    ) -> NDArray[np.float64]:
        """Deflections (n, 6) under loads that have grown from zero, as `pkm-host predict` computes them.

        `wrenches` (n, 6) or one row act at the points `at_m`, (n, 3) or one row in A-uvw, default A; the deflections are
        those of these points. `rise_k` is how much warmer the machine is than when the deflections were zeroed.
        """
    def inverse_tool(
        self, tips_m: ArrayLike, axes: ArrayLike, *, near: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Joints (n, 5) of tools with the tip at `tips_m` (n, 3) and the axis along `axes`, (n, 3) or one row, both in B.

        An axis points from the flange to the tip and may have any length. Of several solutions in home's working mode the
        nearest to the joints `near`, (n, 5) or one row, is taken; default: home.
        """
    def forward_tool(self, joints: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Tips in m and unit axes of tools, in B: (n, 5) to two of (n, 3)."""

def run(arguments: Sequence[str]) -> str:
    """Runs a command of pkm-host, such as ["fit", "--out", "out/fit"], and returns its JSON document."""
