"""The paper's model in NumPy alone, for all poses at once: a reference that shares no formula with the core.

K_p is Eq. 8's structural matrix of 24 rows, inverted whole, and Eq. 9; K_m is the factor form of a coefficients.json.
Machines with effects are beyond it.
"""

import json
import tomllib
from pathlib import Path

import numpy as np


def machine(path):
    """A machine file's limbs in SI, and where they are fixed to the platform and to the base."""
    raw = tomllib.loads(Path(path).read_text())
    size = {key: value / 1e3 for key, value in raw["geometry"].items()}
    triangle = lambda half, far: np.array([[0, -half, 0], [0, half, 0], [far, 0, 0]])
    limbs = []
    for limb in raw["limb"]:
        joints = [
            np.array(limb[joint]["linear_n_per_m"] + limb[joint]["angular_nm_per_rad"])
            for joint in ("base_joint", "platform_joint")
        ]
        ea = ei = gj = 0.0
        for tube in (limb["body"]["rod"], limb["body"]["screw"]):
            outer, inner = tube["outer_mm"] / 1e3, tube["inner_mm"] / 1e3
            ea += tube["young_gpa"] * 1e9 * np.pi * (outer**2 - inner**2) / 4
            ei += tube["young_gpa"] * 1e9 * np.pi * (outer**4 - inner**4) / 64
            gj += tube["shear_gpa"] * 1e9 * np.pi * (outer**4 - inner**4) / 32
        limbs.append((*joints, ea, ei, gj))
    return limbs, triangle(size["a1_mm"], size["a2_mm"]), triangle(size["b1_mm"], size["b2_mm"])


def space(machine, poses):
    """Rotations A to B, and from A the points A_i and B_i in B: (n, 3, 3), (n, 3, 3), (n, 3, 3)."""
    _, platform, base = machine
    theta, sigma, z0 = poses.T
    st, ct, ss, cs, zero = np.sin(theta), np.cos(theta), np.sin(sigma), np.cos(sigma), np.zeros_like(theta)
    rotation = np.stack([ct, st * ss, st * cs, zero, cs, -ss, -st, ct * ss, ct * cs], -1).reshape(-1, 3, 3)
    a = np.stack([z0 * np.tan(theta), zero, z0], -1)
    return rotation, platform @ rotation.swapaxes(1, 2), base - a[:, None]


def ik(machine, poses):
    """Screw lengths, (n, 3)."""
    _, platform, base = space(machine, poses)
    return np.linalg.norm(platform - base, axis=2)


def both(axes):
    """One rotation for translations and rotations, (n, 6, 6)."""
    turn = np.zeros((len(axes), 6, 6))
    turn[:, :3, :3] = turn[:, 3:, 3:] = axes
    return turn


def beam(ea, ei, gj, q):
    """Stiffness of beams of lengths q with z along them, base before tip, (n, 12, 12)."""
    k = np.zeros((len(q), 12, 12))

    def pair(i, j, value):
        k[:, i, j] = k[:, j, i] = value

    for axis, s in ((2, ea / q), (5, gj / q)):
        pair(axis, axis, s)
        pair(axis + 6, axis + 6, s)
        pair(axis, axis + 6, -s)
    for x, r, sign in ((0, 4, 1), (1, 3, -1)):
        pair(x, x, 12 * ei / q**3)
        pair(x + 6, x + 6, 12 * ei / q**3)
        pair(x, x + 6, -12 * ei / q**3)
        pair(r, r, 4 * ei / q)
        pair(r + 6, r + 6, 4 * ei / q)
        pair(r, r + 6, 2 * ei / q)
        pair(x, r, sign * 6 * ei / q**2)
        pair(x, r + 6, sign * 6 * ei / q**2)
        pair(x + 6, r, -sign * 6 * ei / q**2)
        pair(x + 6, r + 6, -sign * 6 * ei / q**2)
    return k


def rigid(r):
    """Displacement of a rigid body at r from that at its origin, (n, 6, 6)."""
    x, y, z = r.T
    m = np.tile(np.eye(6), (len(r), 1, 1))
    m[:, 0, 4], m[:, 0, 5], m[:, 1, 3], m[:, 1, 5], m[:, 2, 3], m[:, 2, 4] = z, -y, -z, x, y, -x
    return m


def basic_stiffness(machine, poses):
    """K_p at A in A-uvw, (n, 6, 6)."""
    rotation, platform, base = space(machine, poses)
    u, y = rotation[:, :, 0], np.broadcast_to([0.0, 1.0, 0.0], (len(poses), 3))
    k = np.zeros((len(poses), 24, 24))
    for i, (base_joint, platform_joint, ea, ei, gj) in enumerate(machine[0]):
        along = platform[:, i] - base[:, i]
        q = np.linalg.norm(along, axis=1)
        z, x = along / q[:, None], y if i == 2 else u
        axes = np.stack([x, np.cross(z, x), z], -1)
        turn, base_turn = both(axes), both(axes if i == 2 else np.stack([u, y, np.cross(u, y)], -1))
        parts = beam(ea, ei, gj, q)
        of = lambda m: turn @ m @ turn.swapaxes(1, 2)
        held = of(parts[:, :6, :6]) + base_turn * base_joint @ base_turn.swapaxes(1, 2)
        across = of(parts[:, :6, 6:])
        link = of(parts[:, 6:, 6:]) - across.swapaxes(1, 2) @ np.linalg.solve(held, across)
        joint = turn * platform_joint @ turn.swapaxes(1, 2)
        to_a = joint @ rigid(platform[:, i])
        own = slice(6 * i, 6 * i + 6)
        k[:, own, own] = link + joint
        k[:, own, 18:], k[:, 18:, own] = -to_a, -to_a.swapaxes(1, 2)
        k[:, 18:, 18:] += rigid(platform[:, i]).swapaxes(1, 2) @ to_a
    terminal = np.linalg.inv(np.linalg.inv(k)[:, 18:, 18:])
    return both(rotation).swapaxes(1, 2) @ terminal @ both(rotation)


def table(path):
    """A coefficients.json."""
    return json.loads(Path(path).read_text())


def corrected_stiffness(machine, table, poses):
    """K_m in the factor form, (L G)(L G)ᵀ with K_p = L Lᵀ."""
    of_file = poses * [180 / np.pi, 180 / np.pi, 1e3]
    scaled = (of_file - table["center"]) / table["scale"]
    monomials = np.prod(scaled[:, None] ** np.array(table["terms"]), axis=2)
    g = np.zeros((len(poses), 6, 6))
    rows, columns = np.tril_indices(6)
    g[:, rows, columns] = monomials @ np.array(table["factor"]["coefficients"]).T
    factor = np.linalg.cholesky(basic_stiffness(machine, poses)) @ g
    return factor @ factor.swapaxes(1, 2)
