"""Arrays against NumPy's own model, against the program's bits, and what is refused."""

import json
import os
import threading
from pathlib import Path

import numpy as np
import pytest

import numpy_model
import pkm
from conftest import FIXTURES, WIDE_TABLE
from pkm import errors

MACHINE = FIXTURES / "machines/reference.toml"


def test_inverse_kinematics_are_distances(basic, poses):
    np.testing.assert_allclose(basic.ik(poses), numpy_model.ik(numpy_model.machine(MACHINE), poses), rtol=1e-14)


def test_forward_kinematics_undo_them(basic, poses):
    np.testing.assert_allclose(basic.fk(basic.ik(poses)), poses, rtol=0, atol=1e-12)


def scaled_difference(k, reference):
    root = np.sqrt(np.einsum("nii->ni", reference))
    return np.abs((k - reference) / (root[:, :, None] * root[:, None])).max()


def test_basic_stiffness_is_that_of_the_structural_matrix(basic, poses):
    reference = numpy_model.basic_stiffness(numpy_model.machine(MACHINE), poses)
    # NumPy inverts 24 rows in double precision: it is the less exact of the two
    assert scaled_difference(basic.stiffness(poses), reference) < 1e-9


def test_corrected_stiffness_is_the_factor_form(corrected, poses):
    machine, table = numpy_model.machine(MACHINE), numpy_model.table(WIDE_TABLE)
    reference = numpy_model.corrected_stiffness(machine, table, poses)
    assert scaled_difference(corrected.stiffness(poses), reference) < 1e-9


def test_deflections_solve_for_the_wrench(corrected, poses):
    wrenches = np.random.default_rng(1).uniform(-500, 500, (len(poses), 6))
    solved = np.linalg.solve(corrected.stiffness(poses), wrenches[:, :, None])[:, :, 0]
    np.testing.assert_allclose(corrected.deflection(poses, wrenches), solved, rtol=1e-9, atol=1e-15)


def test_a_load_may_act_beside_a(corrected, poses):
    force, at = np.array([100.0, -200.0, -400.0]), np.array([0.05, -0.15, 0.6])
    at_a = corrected.deflection(poses, np.concatenate([force, np.cross(at, force)]))
    seen = corrected.deflection(poses, np.concatenate([force, np.zeros(3)]), at_m=at)
    np.testing.assert_allclose(seen[:, :3], at_a[:, :3] + np.cross(at_a[:, 3:], at), rtol=1e-12, atol=1e-18)
    np.testing.assert_array_equal(seen[:, 3:], at_a[:, 3:])


def test_five_axes_there_and_back(basic):
    rng = np.random.default_rng(2)
    tips = rng.uniform([-0.25, -0.05, 1.1], [-0.1, 0.05, 1.14], (50, 3))
    axes = np.column_stack([rng.uniform(-0.1, 0.1, (50, 2)), np.ones(50)])
    joints = basic.inverse_tool(tips, axes)
    there_tips, there_axes = basic.forward_tool(joints)
    np.testing.assert_allclose(there_tips, tips, rtol=0, atol=1e-12)
    np.testing.assert_allclose(there_axes, axes / np.linalg.norm(axes, axis=1)[:, None], rtol=0, atol=1e-12)
    # the nearest solution to itself
    np.testing.assert_allclose(basic.inverse_tool(tips, axes, near=joints), joints, rtol=0, atol=1e-12)


@pytest.mark.skipif("PKM_BITS" not in os.environ, reason="cargo xtask python writes them")
def test_every_bit_is_the_cores():
    """What another build of the core, called from Rust, has written down."""
    bits = {key: np.array(rows) for key, rows in json.loads(Path(os.environ["PKM_BITS"]).read_text()).items()}
    basic, corrected = pkm.Model(), pkm.Model(table=WIDE_TABLE)
    assert len(bits["poses"]) >= 1000
    found = {
        "q_m": basic.ik(bits["poses"]),
        "fk": basic.fk(bits["q_m"]),
        "k_p": basic.stiffness(bits["poses"]),
        "k_m": corrected.stiffness(bits["poses"]),
        "deflection": corrected.deflection(bits["poses"], bits["wrenches"]),
        "tools": np.hstack(basic.forward_tool(bits["joints"])),
    }
    for name, values in found.items():
        expected = bits[name].reshape(values.shape)
        assert values.tobytes() == expected.tobytes(), name


def test_rows_may_be_of_any_type_and_layout(basic):
    rows = [[0, 0, 1], [0, 0, 1]]
    assert basic.reachable(rows).tolist() == [False, False]
    poses = np.asfortranarray([[0.1, -0.05, 0.53], [0.0, 0.0, 0.5]])
    np.testing.assert_array_equal(basic.ik(poses), basic.ik(poses.tolist()))
    np.testing.assert_array_equal(basic.ik(poses[::-1]), basic.ik(poses)[::-1])
    assert basic.ik(np.empty((0, 3))).shape == (0, 3)
    assert basic.stiffness(np.empty((0, 3))).shape == (0, 6, 6)


@pytest.mark.parametrize(
    "bad, error, status",
    [
        ([0, 0, 0.3], errors.OutOfTravelError, "out_of_travel"),
        ([2, 0, 0.53], errors.UnreachableError, "unreachable"),
        ([0, np.nan, 0.53], errors.NotFiniteError, "not_finite"),
        ([0, 0, np.inf], errors.NotFiniteError, "not_finite"),
    ],
)
def test_the_first_refused_row_is_named(basic, bad, error, status):
    poses = np.array([[0, 0, 0.53], bad, bad])
    for compute in (basic.ik, basic.stiffness, lambda poses: basic.deflection(poses, [0, 0, 1, 0, 0, 0])):
        with pytest.raises(error, match="row 1: ") as caught:
            compute(poses)
        assert (caught.value.row, caught.value.status) == (1, status)
        assert isinstance(caught.value, pkm.RefusedError)
    assert basic.reachable(poses).tolist() == [True, False, False]


def test_a_refusal_says_by_how_much(basic):
    with pytest.raises(errors.OutOfTravelError, match="limb 3 would leave its travel: 340 mm long, travel 420 to 770 mm"):
        basic.ik([[0, 0, 0.3]])


def test_other_refusals(basic, corrected):
    for wrench in ([np.nan] * 6, [0, 0, np.inf, 0, 0, 0]):
        with pytest.raises(errors.NotFiniteError, match="row 0"):
            basic.deflection([[0, 0, 0.53]], wrench)
    for axis in ([0, 0, 0], [0, 0, np.nan]):
        with pytest.raises(errors.NotFiniteError, match="row 0"):
            basic.inverse_tool([[-0.2, 0, 1.1]], axis)
    with pytest.raises(pkm.RefusedError, match="row 1: .*limb"):
        basic.inverse_tool([[-0.2, 0, 1.1], [-0.2, 0, 2]], [0, 0, 1])
    with pytest.raises(errors.OutOfTravelError, match="row 0"):
        basic.forward_tool([[0.56, 0.56, 0.55, 3, 0]])
    with pytest.raises(errors.UsageError, match="temperature_c"):
        basic.stiffness([[0, 0, 0.53]], temperature_c=np.nan)


@pytest.mark.parametrize("shape", [(), (3,), (2, 2), (3, 2), (1, 3, 1)])
def test_shapes(basic, shape):
    with pytest.raises(errors.UsageError, match=r"poses: expected an array of shape \(n, 3\), found"):
        basic.ik(np.zeros(shape))


def test_shapes_of_what_goes_with_them(basic):
    with pytest.raises(errors.UsageError, match=r"wrenches: expected an array of shape \(2, 6\) or \(6,\), found \[3, 6\]"):
        basic.deflection(np.zeros((2, 3)), np.zeros((3, 6)))


def test_masked_elements_are_refused(basic, corrected):
    poses = np.ma.masked_invalid([[0.1, -0.05, 0.53], [np.nan, 0, 0.5]])
    poses.data[1, 0] = 0  # as a mask of readings that are finite and wrong
    with pytest.raises(errors.UsageError, match="^poses: .*masked"):
        basic.reachable(poses)
    load = np.ma.array([0, 0, -400.0, 0, 0, 0], mask=[0, 0, 1, 0, 0, 0])
    with pytest.raises(errors.UsageError, match="^wrenches: .*masked"):
        corrected.deflection([[0, 0, 0.53]], load)
    whole = np.ma.array([[0.1, -0.05, 0.53]])
    np.testing.assert_array_equal(basic.ik(whole), basic.ik(whole.data))
    assert basic.ik(poses[:1]).shape == (1, 3)


@pytest.mark.parametrize("bad", ["abc", [["a", 0, 0]], [[0, 0, 0.53], [0, 0]], object(), None, [[0, 0, 1j]]])
def test_what_is_no_array_of_numbers(basic, bad):
    with pytest.raises(errors.UsageError, match="^poses: "):
        basic.ik(bad)
    with pytest.raises(errors.UsageError, match="^axes: "):
        basic.inverse_tool([[-0.2, 0, 1.1]], bad)


def test_an_error_about_near_says_so(basic):
    tool = ([[-0.2, 0, 1.1], [-0.2, 0, 1.1]], [0, 0, 1])
    home = basic.inverse_tool(*tool)
    for bad, error in ((np.nan, errors.NotFiniteError), (0.3, errors.OutOfTravelError)):
        near = home.copy()
        near[1, 0] = bad
        with pytest.raises(error, match="^near: row 1: ") as caught:
            basic.inverse_tool(*tool, near=near)
        assert caught.value.row == 1
    with pytest.raises(errors.UsageError, match="^near: "):
        basic.inverse_tool(*tool, near=[[0, 0]])


def test_extrapolation_is_warned_of(corrected):
    pose = [[0, 0, 0.64]]
    assert corrected.inside_box([[0, 0, 0.53], *pose]).tolist() == [True, False]
    with pytest.warns(pkm.ExtrapolationWarning, match="1 of 1 poses lie outside the table's box"):
        corrected.stiffness(pose)


def test_files(basic, tmp_path):
    assert basic.name == "reference"
    with pytest.warns(pkm.Warning, match="was fitted for machine `reference` from another machine file"):
        pkm.Model(FIXTURES / "machines/x150.toml", WIDE_TABLE)
    broken = tmp_path / "broken.toml"
    broken.write_text(MACHINE.read_text().replace("a1_mm = 180.0", "a1_mm = -180.0"))
    with pytest.raises(errors.InputError, match="broken.toml:6: .*a1_mm") as caught:
        pkm.Model(broken)
    assert (Path(caught.value.file).name, caught.value.line, caught.value.column) == ("broken.toml", 6, "geometry.a1_mm")
    with pytest.raises(errors.UsageError, match="form"):
        pkm.Model(form="best")
    with pytest.raises(errors.UsageError, match="no table"):
        basic.inside_box([[0, 0, 0.53]])


def test_a_table_without_factor_form_is_not_for_loads(tmp_path):
    table = numpy_model.table(WIDE_TABLE)
    table["factor"] = None
    path = tmp_path / "diagonal.json"
    path.write_text(json.dumps(table))
    pose, load = [[0, 0, 0.53]], [0, 0, -400, 0, 0, 0]
    with pytest.raises(errors.InputError, match="diagonal form is wrong for loads"):
        pkm.Model(table=path).deflection(pose, load)
    insisted = pkm.Model(table=WIDE_TABLE, form="diagonal")
    np.testing.assert_array_equal(insisted.stiffness(pose), pkm.Model(table=path).stiffness(pose))
    assert insisted.deflection(pose, load).shape == (1, 6)


def test_the_gil_is_released(corrected, poses):
    """A thread that only counts gets on while a batch is computed."""
    many = np.tile(poses, (200, 1))
    during, done = [0], threading.Event()

    def count():
        while not done.is_set():
            during[0] += 1

    counter = threading.Thread(target=count)
    counter.start()
    before = during[0]
    try:
        corrected.stiffness(many)
        after = during[0]
    finally:
        done.set()
        counter.join()
    # with the GIL held it could not count once in between
    assert after - before > 1000
