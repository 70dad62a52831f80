"""Commands: that their documents arrive as data classes and tables, with the numbers of the files that they write."""

import ast
import copy
import inspect
import json
import pickle
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pkm
from conftest import FIXTURES, WIDE_TABLE
from pkm import errors

MEASURED = FIXTURES / "measured/own-none-1"


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    return pkm.fit(tmp_path_factory.mktemp("fit"))


def test_fit_gives_the_papers_tables(fitted):
    assert (fitted.poses, len(fitted.terms), fitted.warnings) == (49, 9, [])
    table = fitted.to_pandas()
    document = json.loads((fitted.folder / "fit.json").read_text())
    assert table.loc[("verify", "improved", "re_percent", "mean")].tolist() == document["verify"]["improved"]["re_percent"]["mean"]
    # the README's claims: the factor form is right for loads, Eq. 10 as published is not
    deflections = fitted.deflections_to_pandas().xs(("verify", "mean"), level=("poses", "statistic"))
    assert (deflections.loc["factor"] < 1.1).all() and (deflections.loc["diagonal_literal"] > 40).all()


def test_the_fitted_table_gives_the_stiffness_that_it_was_fitted_to(fitted):
    import pandas

    data = pandas.read_csv(FIXTURES / "stiffness/fe-l49.csv", comment="#")
    poses = np.column_stack([np.radians(data.theta_deg), np.radians(data.sigma_deg), data.z0_mm / 1e3])
    k = pkm.Model(table=fitted.table).stiffness(poses)
    found = np.einsum("nii->ni", k)
    expected = data[[f"k{i}{i}" for i in range(1, 7)]].to_numpy()
    worst = fitted.to_pandas().loc[("train", "factor", "re_percent", "max")].to_numpy()
    np.testing.assert_allclose(100 * np.abs(found / expected - 1).max(axis=0), worst, rtol=1e-9)


def test_stiffness_is_that_of_the_command(tmp_path):
    """Bit for bit: a CSV of poses through the command, and the same numbers as an array."""
    poses = tmp_path / "poses.csv"
    poses.write_text("pose,theta_deg,sigma_deg,z0_mm\na,5,-3,530\nb,-12.5,7,512.25\n")
    written = pkm.run("stiffness", poses=poses, table=WIDE_TABLE)["poses"]
    in_si = np.array([[np.radians(5), np.radians(-3), 530 / 1e3], [np.radians(-12.5), np.radians(7), 512.25 / 1e3]])
    assert np.array([p["k"] for p in written]).tobytes() == pkm.Model(table=WIDE_TABLE).stiffness(in_si).tobytes()


def test_five_axes_are_those_of_the_command():
    tip_mm, axis = [-150, 20, 1120], [0.05, 0, 1]
    written = pkm.run("ik", tip_mm=tip_mm, axis=axis)
    joints = pkm.Model().inverse_tool([[tip / 1e3 for tip in tip_mm]], axis)[0]
    assert (joints[:3] * 1e3).tolist() == written["q_mm"]
    assert np.degrees(joints[3:]).tolist() == [written["beta1_deg"], written["beta2_deg"]]


def test_deflection_is_that_of_predict(tmp_path):
    data = tmp_path / "loads.csv"
    data.write_text(
        "pose,theta_deg,sigma_deg,z0_mm,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,point_u_mm,point_v_mm,point_w_mm\n"
        "a,5,-3,530,120,-80,-400,5,10,-2,50,-150,600\n"
    )
    prediction = pkm.predict(tmp_path / "predicted.csv", data=data, table=WIDE_TABLE)
    row = prediction.to_pandas().iloc[0]
    model = pkm.Model(table=WIDE_TABLE)
    pose = [[np.radians(5), np.radians(-3), 530 / 1e3]]
    seen = model.deflection(pose, [120, -80, -400, 5, 10, -2], at_m=[0.05, -0.15, 0.6])[0]
    written = row[["dx_um", "dy_um", "dz_um", "rx_urad", "ry_urad", "rz_urad"]].to_numpy(float)
    np.testing.assert_allclose(written, seen * 1e6, rtol=1e-12)
    assert (prediction.rows, prediction.outside_box) == (1, 0)


def test_diagnosis(tmp_path):
    with pytest.warns(pkm.Warning, match="wrist"):
        diagnosis = pkm.diagnose(
            tmp_path, machine=MEASURED / "machine.toml", data=MEASURED / "measured.csv", holdout=MEASURED / "heldout.csv"
        )
    document = json.loads((tmp_path / "diagnosis.json").read_text())
    # nothing is wrong with this machine
    assert diagnosis.verdict == document["verdict"] == "adequate" and diagnosis.effects == []
    assert diagnosis.holdout_after.linear_um_rms == document["holdout"]["after"]["linear_um_rms"]
    readings = diagnosis.to_pandas()
    assert len(readings) == len(document["readings"])
    first = document["readings"][0]
    assert readings.loc[first["line"], "dx_um_read"] == first["read"][0]
    assert diagnosis.errors_to_pandas().loc["after", "linear_um_rms"] == diagnosis.holdout_after.linear_um_rms
    pkm.Model(diagnosis.machine, diagnosis.table)


def test_placement(tmp_path):
    placement = pkm.place(tmp_path, table=WIDE_TABLE, objectives=["tip-worst"], step_mm=200)
    assert [place.series for place in placement.places] == ["A", "B"]
    holes = placement.to_pandas()
    first = placement.places[0]
    worst = holes.loc[("A", "tip-worst"), "deflection_um"].max()
    assert (first.unit, first.value) == ("µm", pytest.approx(worst, rel=1e-9))


def test_compensation(tmp_path):
    path = pkm.compensate(tmp_path / "path.csv", FIXTURES / "jobs/path.csv", table=WIDE_TABLE)
    # the README's figure
    assert path.before_um_rms > 30 and path.after_um_rms < 0.004
    assert path.path.exists() and path.report.exists() and path.points == 34
    # the same path without the loads that its comments set
    program = tmp_path / "program.ngc"
    program.write_text(re.sub(r"\(wrench [^)]*\)", "", (FIXTURES / "jobs/path.ngc").read_text()))
    light, heavy = (
        pkm.compensate(tmp_path / "path.ngc", program, table=WIDE_TABLE, wrench=[0, 0, -force, 0, 0, 0])
        for force in (100, 200)
    )
    assert heavy.before_um_max == pytest.approx(2 * light.before_um_max, rel=1e-3)


def test_options_are_what_a_notebook_has(tmp_path):
    expected = pkm.run("ik", theta_deg=5, sigma_deg=-3, z0_mm=530)
    assert pkm.run("ik", theta_deg=np.int64(5), sigma_deg=np.float32(-3), z0_mm=np.array(530.0)) == expected
    measured = FIXTURES / "measured/p05/measured.csv"
    assert pkm.run("check", measured)["readings"] == 840
    renamed = tmp_path / "renamed.csv"
    renamed.write_text(measured.read_text().replace(",dx_um,", ",X,"))
    columns = {"dx_um": "X"}
    assert pkm.run("check", renamed, columns=columns)["readings"] == 840
    predicted = pkm.predict(tmp_path / "predicted.csv", data=renamed, columns=columns)
    assert len(predicted.to_pandas()) == predicted.rows
    with pytest.raises(pkm.UsageError, match="data: expected the path of a file, found a DataFrame"):
        pkm.diagnose(tmp_path / "d", data=predicted.to_pandas())


def test_predicted_rows_are_read_as_they_were_written(tmp_path):
    names = "pose,theta_deg,sigma_deg,z0_mm,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm"
    rows = [["P#1", 5.5, -3, 530, 120, -80, -400, 5, 10, -2], ["00", 1.5, 2.5, 520, 0, 0, -400, 0, 0, 0]]
    (tmp_path / "a.csv").write_text("\n".join([names, *(",".join(map(str, row)) for row in rows)]) + "\n")
    comma = [";".join(str(cell).replace(".", ",") for cell in row) for row in rows]
    (tmp_path / "b.csv").write_text("\n".join([names.replace(",", ";"), *comma]) + "\n")
    a, b = (pkm.predict(tmp_path / f"{name}-out.csv", data=tmp_path / f"{name}.csv").to_pandas() for name in "ab")
    assert list(a["pose"]) == list(b["pose"]) == ["P#1", "00"]
    assert a["theta_deg"].tolist() == [5.5, 1.5]
    numbers = [name for name in a.columns if name.endswith(("_um", "_n", "_deg", "_urad"))]
    np.testing.assert_array_equal(a[numbers].to_numpy(float), b[numbers].to_numpy(float))


def test_a_model_is_pickled_as_its_files(tmp_path, monkeypatch):
    monkeypatch.chdir(WIDE_TABLE.parent)
    model = pkm.Model(table=WIDE_TABLE.name, form="factor")
    monkeypatch.chdir(tmp_path)
    poses = [[0.1, -0.05, 0.53]]
    for other in (pickle.loads(pickle.dumps(model)), copy.deepcopy(model)):
        np.testing.assert_array_equal(other.stiffness(poses), model.stiffness(poses))


def test_no_result_is_infinite():
    with pytest.raises(pkm.NotFiniteError):
        pkm.Model().deflection([[0.1, 0, 0.53]], [1, 2, 3, 0, 0, 0], at_m=[1e300, 0, 0])


def test_failures_have_types(tmp_path):
    with pytest.raises(errors.UsageError, match="invalid value 'best'"):
        pkm.fit(tmp_path, terms="best")
    with pytest.raises(errors.InputError, match="No such file") as caught:
        pkm.fit(tmp_path, data=tmp_path / "none.csv")
    assert caught.value.file.endswith("none.csv")
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    (tmp_path / "poses.csv").write_text("pose,theta_deg,sigma_deg,z0_mm\na,x,0,530\n")
    with pytest.raises(errors.InputError) as caught:
        pkm.run("stiffness", poses=tmp_path / "poses.csv")
    assert (caught.value.line, caught.value.column) == (2, "theta_deg")
    with pytest.raises(errors.OutOfTravelError, match="travel 420 to 770 mm"):
        pkm.run("ik", theta_deg=0, sigma_deg=0, z0_mm=300)
    with pytest.raises(errors.OtherError):
        pkm.fit("/proc/none")
    assert list(tmp_path.iterdir()) == [tmp_path / "poses.csv"]


def test_the_documents_first_block_runs(tmp_path, monkeypatch):
    blocks = (FIXTURES.parent / "docs/python.md").read_text().split("```python\n")
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(blocks[1].split("```")[0], names)
    np.testing.assert_allclose(names["model"].fk(names["q_m"]), names["poses"], atol=1e-12)
    assert names["k_m"].shape == names["k_p"].shape == (2, 6, 6)


def test_pandas_is_optional():
    code = "import sys; sys.modules['pandas'] = None; import pkm; print(pkm.Model().ik([[0, 0, 0.53]]).shape)"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "(1, 3)\n"


def test_stubs_are_the_module():
    """Every name of the stubs is in the compiled module, the other way round, and both are documented alike."""
    stubs = ast.parse(Path(pkm.__file__).with_name("_core.pyi").read_text()).body
    (model,) = [node for node in stubs if isinstance(node, ast.ClassDef)]
    methods = {node.name: node for node in model.body if isinstance(node, ast.FunctionDef)}
    del methods["__new__"]
    assert set(methods) == {name for name in vars(pkm.Model) if not name.startswith("_")}
    assert ast.get_docstring(model) == inspect.getdoc(pkm.Model)
    for name, node in methods.items():
        compiled = getattr(pkm.Model, name)
        assert ast.get_docstring(node) == inspect.getdoc(compiled)
        if not node.decorator_list:
            arguments = [argument.arg for argument in [*node.args.args, *node.args.kwonlyargs]]
            assert list(inspect.signature(compiled).parameters) == arguments
