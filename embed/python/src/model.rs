//! A machine, with a table or without: kinematics and stiffness of arrays of poses.

use std::path::PathBuf;

use numpy::{PyArray1, PyArray2, PyArray3};
use pkm_core::{Configuration, Domain, JointValues, Pose, ScrewLengths, StiffnessError, Tool, ToolSolution, Wrench};
use pkm_host::files::machine::MachineFile;
use pkm_host::files::path::unit;
use pkm_host::files::readings::Condition;
use pkm_host::files::source::Source;
use pkm_host::plan::model::{self, Form, Solved, extrapolation_warning, no_factor_form, solve_at};
use pkm_host::plan::reach::Reach;
use pkm_host::pose::core_units;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::{self, Refusal, usage};
use crate::rows::{Given, array, each, each_of, matrices, rows, rows_for};

/// A machine, with a correction table or without.
///
/// Without `machine` it is the reference machine, without `table` the basic model K_p. `table` is the coefficients.json
/// of `fit`; `form` is how it is applied: "auto" is the factor form where the table has it. What is doubtful about the
/// files is a `pkm.Warning`.
///
/// Every array has a row for each pose. A method computes all rows on one core without the GIL, or raises the
/// `RefusedError` of the first row that is refused, with its number in `row`: no row of a result is ever NaN.
///
/// - poses (n, 3): theta_rad, sigma_rad, z0_m
/// - q_m (n, 3): screw lengths of limbs 1, 2, 3 in m
/// - joints (n, 5): the three screw lengths in m, then beta1_rad, beta2_rad
/// - wrenches (n, 6): fx_n, fy_n, fz_n, mx_nm, my_nm, mz_nm on the moving platform, in A-uvw
/// - stiffness (n, 6, 6): at A in A-uvw, N/m, N, N·m/rad
/// - deflections (n, 6): translation in m, rotation in rad, in A-uvw
///
/// "Or one row": an array of the shape of one row then stands for all.
#[pyclass(frozen, module = "pkm._core")]
pub struct Model {
    model: model::Model,
    /// What was asked for; the table's own form may differ.
    form: Form,
    /// Absolute paths of machine and table, and the form, to pickle.
    arguments: (Option<PathBuf>, Option<PathBuf>, String),
}

type Matrices<'py> = Bound<'py, PyArray3<f64>>;
type Rows<'py> = Bound<'py, PyArray2<f64>>;
type Pickled<'py> = ((Option<PathBuf>, Option<PathBuf>), Bound<'py, PyDict>);

fn pose([theta_rad, sigma_rad, z0_m]: [f64; 3]) -> Pose<f64> {
    Pose { theta_rad, sigma_rad, z0_m }
}

fn numbers(pose: &Pose<f64>) -> [f64; 3] {
    [pose.theta_rad, pose.sigma_rad, pose.z0_m]
}

fn joint_values([q1, q2, q3, beta1, beta2]: [f64; 5]) -> JointValues<f64> {
    JointValues { lengths: ScrewLengths { q_m: [q1, q2, q3].into() }, beta_rad: [beta1, beta2].into() }
}

#[pymethods]
impl Model {
    #[new]
    #[pyo3(signature = (machine=None, table=None, *, form="auto"))]
    fn new(py: Python<'_>, machine: Option<PathBuf>, table: Option<PathBuf>, form: &str) -> PyResult<Self> {
        let absolute = |path: &Option<PathBuf>| path.as_ref().map(std::path::absolute).transpose();
        let arguments = (absolute(&machine)?, absolute(&table)?, form.to_owned());
        let form = match form {
            "auto" => Form::Auto,
            "diagonal" => Form::Diagonal,
            "factor" => Form::Factor,
            other => return Err(usage(format!("form: expected auto, diagonal or factor, found {other}"))),
        };
        let read = || {
            let file = MachineFile::read(machine.as_deref())?;
            let mut warnings = file.warnings.clone();
            let table = table.as_deref().map(Source::read).transpose()?;
            let (model, warning) = model::Model::new(file, table, form)?;
            warnings.extend(warning);
            Ok((model, warnings))
        };
        let (model, warnings) = read().map_err(|failure| errors::of(&failure))?;
        warnings.iter().try_for_each(|warning| errors::warn(py, warning))?;
        Ok(Self { model, form, arguments })
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<Pickled<'py>> {
        let (machine, table, form) = self.arguments.clone();
        let named = PyDict::new(py);
        named.set_item("form", form)?;
        Ok(((machine, table), named))
    }

    /// Name of the machine.
    #[getter]
    fn name(&self) -> &str {
        &self.model.machine.name
    }

    /// The machine file's box, (3, 2): least and greatest theta_rad, sigma_rad, z0_m.
    #[getter]
    fn pose_box<'py>(&self, py: Python<'py>) -> PyResult<Rows<'py>> {
        let [theta, sigma, z0] = self.model.machine.pose_box.ranges();
        let [low, high] = [0, 1].map(|end| core_units([theta[end], sigma[end], z0[end]]));
        array(py, (0..3).map(|i| [low[i], high[i]]).collect())
    }

    /// Screw lengths of poses, within travel: (n, 3) to (n, 3).
    fn ik<'py>(&self, py: Python<'py>, poses: Given<'py>) -> PyResult<Rows<'py>> {
        let file = &self.model.machine;
        let lengths = each(py, &rows("poses", &poses)?, |row| {
            let pose = pose(*row);
            let refused = |error| Refusal::from(error).saying(file.refusal(error, &pose));
            Ok(file.machine.inverse(&pose).map_err(refused)?.q_m.into())
        })?;
        array(py, lengths)
    }

    /// Poses of screw lengths: (n, 3) to (n, 3).
    fn fk<'py>(&self, py: Python<'py>, q_m: Given<'py>) -> PyResult<Rows<'py>> {
        let machine = &self.model.machine.machine;
        let poses = each(py, &rows::<3>("q_m", &q_m)?, |row| {
            Ok(numbers(&machine.forward(&ScrewLengths { q_m: (*row).into() })?))
        })?;
        array(py, poses)
    }

    /// Whether `ik` takes each pose.
    fn reachable<'py>(&self, py: Python<'py>, poses: Given<'py>) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let machine = &self.model.machine.machine;
        let reachable = each(py, &rows("poses", &poses)?, |row| Ok(machine.inverse(&pose(*row)).is_ok()))?;
        Ok(PyArray1::from_vec(py, reachable))
    }

    /// Whether each pose is inside the box that the table was fitted on; outside it extrapolates.
    fn inside_box<'py>(&self, py: Python<'py>, poses: Given<'py>) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let Some((table, _)) = self.model.applied().map_err(|failure| errors::of(&failure))? else {
            return Err(usage("inside_box: the model has no table".to_owned()));
        };
        let inside = each(py, &rows("poses", &poses)?, |row| Ok(table.domain(&pose(*row)) == Domain::Inside))?;
        Ok(PyArray1::from_vec(py, inside))
    }

    /// K_m of the table, or without one K_p: (n, 3) to (n, 6, 6).
    #[pyo3(signature = (poses, *, temperature_c=20.0))]
    fn stiffness<'py>(&self, py: Python<'py>, poses: Given<'py>, temperature_c: f64) -> PyResult<Matrices<'py>> {
        let solved = self.solve(py, &rows("poses", &poses)?, temperature_c)?;
        let k = each(py, &solved, |solved| {
            let k = solved.factor.stiffness().matrix();
            if k.iter().all(|k| k.is_finite()) {
                // symmetric: its columns are its rows
                Ok(k.into())
            } else {
                Err(Refusal::no_stiffness("the table gives a stiffness that is not finite"))
            }
        })?;
        matrices(py, k)
    }

    /// Deflections (n, 6) under loads that have grown from zero, as `pkm-host predict` computes them.
    ///
    /// `wrenches` (n, 6) or one row act at the points `at_m`, (n, 3) or one row in A-uvw, default A; the deflections are
    /// those of these points. `rise_k` is how much warmer the machine is than when the deflections were zeroed.
    #[pyo3(signature = (poses, wrenches, *, at_m=None, temperature_c=20.0, rise_k=0.0))]
    fn deflection<'py>(
        &self,
        py: Python<'py>,
        poses: Given<'py>,
        wrenches: Given<'py>,
        at_m: Option<Given<'py>>,
        temperature_c: f64,
        rise_k: f64,
    ) -> PyResult<Rows<'py>> {
        if let Some(t) = self.model.table.as_ref().filter(|t| self.form == Form::Auto && t.form == Form::Diagonal) {
            return Err(errors::of(&no_factor_form(&t.source, "or give form=\"diagonal\" to have it all the same")));
        }
        let poses = rows("poses", &poses)?;
        let wrenches = rows_for::<6>("wrenches", &wrenches, poses.len())?;
        let points = at_m.map_or_else(|| Ok(vec![[0.0; 3]; poses.len()]), |at| rows_for("at_m", &at, poses.len()))?;
        let solved = self.solve(py, &poses, temperature_c)?;
        let loaded: Vec<_> = poses.iter().zip(&solved).zip(wrenches.iter().zip(&points)).collect();
        let deflections = each(py, &loaded, |((row, solved), (wrench, point_m))| {
            let condition = Condition {
                pose: 0,
                wrench: Wrench::from_vector((**wrench).into()),
                point_m: **point_m,
                turned_at: Wrench::ZERO,
                temperature_c,
                rise_k,
                gauge: None,
            };
            let deflection = self.model.deflection(solved, &pose(**row), &condition)?.to_vector();
            // under A's finite deflection a point far beyond any machine may have none
            if deflection.iter().all(|d| d.is_finite()) {
                Ok(deflection.into())
            } else {
                Err(StiffnessError::NotFinite.into())
            }
        })?;
        array(py, deflections)
    }

    /// Joints (n, 5) of tools with the tip at `tips_m` (n, 3) and the axis along `axes`, (n, 3) or one row, both in B.
    ///
    /// An axis points from the flange to the tip and may have any length. Of several solutions in home's working mode the
    /// nearest to the joints `near`, (n, 5) or one row, is taken; default: home.
    #[pyo3(signature = (tips_m, axes, *, near=None))]
    fn inverse_tool<'py>(
        &self,
        py: Python<'py>,
        tips_m: Given<'py>,
        axes: Given<'py>,
        near: Option<Given<'py>>,
    ) -> PyResult<Rows<'py>> {
        let reach = Reach::new(&self.model.machine).map_err(|failure| errors::of(&failure))?;
        let tips = rows::<3>("tips_m", &tips_m)?;
        let axes = rows_for::<3>("axes", &axes, tips.len())?;
        let near = match near {
            None => vec![reach.home(); tips.len()],
            Some(near) => {
                let joints = rows_for("near", &near, tips.len())?;
                each_of(py, "near: ", &joints, |row| Ok(reach.five.forward(&joint_values(*row))?.0))?
            }
        };
        let tools: Vec<_> = tips.into_iter().zip(axes).zip(near).collect();
        let joints = each(py, &tools, |((tip_m, axis), near)| solution(&reach, *tip_m, *axis, near))?;
        array(py, joints)
    }

    /// Tips in m and unit axes of tools, in B: (n, 5) to two of (n, 3).
    fn forward_tool<'py>(&self, py: Python<'py>, joints: Given<'py>) -> PyResult<(Rows<'py>, Rows<'py>)> {
        let five = self.model.machine.five_axis().map_err(|failure| errors::of(&failure))?;
        let tools: Vec<([f64; 3], [f64; 3])> = each(py, &rows("joints", &joints)?, |row| {
            let (_, Tool { tip_m, axis }) = five.forward(&joint_values(*row))?;
            Ok((tip_m.into(), axis.into()))
        })?;
        let (tips, axes) = tools.into_iter().unzip();
        Ok((array(py, tips)?, array(py, axes)?))
    }
}

impl Model {
    /// Stiffness at every pose, with a warning where the table extrapolates.
    fn solve(&self, py: Python<'_>, poses: &[[f64; 3]], temperature_c: f64) -> PyResult<Vec<Solved>> {
        let table = self.model.applied().map_err(|failure| errors::of(&failure))?;
        let machine = self.model.machine.machine.at_temperature(temperature_c);
        let machine = machine.map_err(|error| usage(format!("temperature_c: {error}")))?;
        let solved = each(py, poses, |row| Ok(solve_at(&table, &machine, &pose(*row))?))?;
        if let Some(warning) = extrapolation_warning(&solved) {
            errors::warn_of_extrapolation(py, &warning)?;
        }
        Ok(solved)
    }
}

/// Joint values of the inverse-kinematics solution nearest to a configuration, as `pkm-host ik` chooses it.
fn solution(
    reach: &Reach<'_>,
    tip_m: [f64; 3],
    axis: [f64; 3],
    near: &Configuration<f64>,
) -> Result<[f64; 5], Refusal> {
    if !tip_m.iter().chain(&axis).all(|v| v.is_finite()) || axis == [0.0; 3] {
        return Err(pkm_core::ToolError::NotFinite.into());
    }
    let ToolSolution { joints, .. } = reach.nearest(&Tool { tip_m: tip_m.into(), axis: unit(axis).into() }, near)?;
    let ([q1, q2, q3], [beta1, beta2]) = (joints.lengths.q_m.into(), joints.beta_rad.into());
    Ok([q1, q2, q3, beta1, beta2])
}
