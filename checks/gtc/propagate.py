"""Expanded uncertainties of the tip by GTC, as a judge of those of `pkm-host predict`.

    pip install GTC
    python3 checks/gtc/propagate.py PROGRAM

Fits the example data, has the program say stiffness and prediction at four poses, and propagates the table's uncertainty through
the inverse of the stiffness with GTC's uncertain numbers (GUM, linear). Prints both in um, and fails where they differ by more
than 1e-6. `tests/tests/core/uncertainty.rs` holds the core against the figures that it prints.
"""

import csv
import json
import pathlib
import subprocess
import sys
import tempfile

from GTC import uncertainty, ureal

POSES = [(0, 0, 530), (11, -9, 550), (-14, 14, 505), (17, -17, 570)]
TIP = (0.03, -0.02, 0.3)
WRENCH = (120, -50, -400, 2, -8, 5)


def rows(path):
    with open(path, encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def said(program):
    """Stiffnesses, uncertainty of the table, predictions."""
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        head = "pose,theta_deg,sigma_deg,z0_mm"
        poses = [f"p{n},{t},{s},{z}" for n, (t, s, z) in enumerate(POSES)]
        (folder / "poses.csv").write_text("\n".join([head, *poses]) + "\n")
        tip = ",".join(str(c * 1e3) for c in TIP)
        load = ",".join(map(str, WRENCH))
        head += ",fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,load_u_mm,load_v_mm,load_w_mm,point_u_mm,point_v_mm,point_w_mm,dx_um,dy_um,dz_um"
        (folder / "data.csv").write_text("\n".join([head] + [f"{p},{load},{tip},{tip},0,0,0" for p in poses]) + "\n")
        run = lambda *words: subprocess.run([program, *map(str, words)], check=True, capture_output=True)
        run("fit", "--out", folder / "fit")
        table = ["--table", folder / "fit" / "coefficients.json"]
        run("stiffness", "--poses", folder / "poses.csv", *table, "--out", folder / "k.csv")
        run("predict", "--data", folder / "data.csv", *table, "--out", folder / "said.csv")
        numbers = json.loads((folder / "fit" / "coefficients.json").read_text())
        return rows(folder / "k.csv"), numbers, rows(folder / "said.csv")


def cholesky(k):
    f = [[0.0] * 6 for _ in range(6)]
    for i in range(6):
        for j in range(i + 1):
            rest = k[i][j] - sum(f[i][m] * f[j][m] for m in range(j))
            f[i][j] = rest**0.5 if i == j else rest / f[j][j]
    return f


def solve(a, b):
    """Gaussian elimination, also of uncertain numbers."""
    a, n = [list(row) + [right] for row, right in zip(a, b)], len(b)
    for i in range(n):
        for j in range(i + 1, n):
            share = a[j][i] / a[i][i]
            a[j] = [x - share * y for x, y in zip(a[j], a[i])]
    x = [0.0] * n
    for i in reversed(range(n)):
        x[i] = (a[i][n] - sum(a[i][m] * x[m] for m in range(i + 1, n))) / a[i][i]
    return x



def u95_um(row, numbers, pose):
    names = [[f"k{min(i, j) + 1}{max(i, j) + 1}" for j in range(6)] for i in range(6)]
    f = cholesky([[float(row[name]) for name in names[i]] for i in range(6)])
    known = numbers["uncertainty"]
    scaled = [(x - c) / h for x, c, h in zip(pose, numbers["center"], numbers["scale"])]
    root = sum(s * t for s, t in zip(known["spread"], [1.0] + [t**8 for t in scaled])) ** 0.5
    z = [ureal(0, 1) for _ in known["columns"]]
    s = [[0.0] * 6 for _ in range(6)]
    for i in range(6):
        for j in range(i + 1):
            n = i * (i + 1) // 2 + j
            rest = ureal(0, known["rest"] * (1 if i == j else 0.5**0.5))
            s[i][j] = root * (sum(column[n] * zr for column, zr in zip(known["columns"], z)) + rest)
            s[j][i] = s[i][j]
    # K = F (I + S)^-1 F^T: deflections by F^-T (I + S) F^-1
    (u, v, w), (fx, fy, fz, mx, my, mz) = TIP, WRENCH
    load = [fx, fy, fz, mx + v * fz - w * fy, my + w * fx - u * fz, mz + u * fy - v * fx]
    x = solve(f, load)
    y = [x[i] + sum(s[i][j] * x[j] for j in range(6)) for i in range(6)]
    d = solve([list(column) for column in zip(*f)], y)
    moved = [d[0] + d[4] * w - d[5] * v, d[1] + d[5] * u - d[3] * w, d[2] + d[3] * v - d[4] * u]
    return [1.96e6 * uncertainty(component) for component in moved]


def main():
    stiffnesses, numbers, predictions = said(sys.argv[1])
    worst = 0.0
    for pose, row, prediction in zip(POSES, stiffnesses, predictions):
        judged = u95_um(row, numbers, pose)
        found = [float(prediction[f"u95_d{axis}_um"]) for axis in "xyz"]
        print(f"{pose}: GTC {judged}, pkm-host {found}")
        worst = max([worst] + [abs(a / b - 1) for a, b in zip(found, judged)])
    print(f"greatest relative difference {worst:.1e}")
    return worst > 1e-6


if __name__ == "__main__":
    sys.exit(main())
