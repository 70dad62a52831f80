//! A machine with or without a correction table: stiffness and deflection at poses.

use nalgebra::Vector3;
use pkm_core::{
    CorrectionError, CorrectionTable, Deflection, Domain, Machine, Pose, StiffnessError, StiffnessFactor,
    TableUncertainty, TipUncertainty, Wrench,
};

use crate::error::{Failure, Result};
use crate::files::machine::MachineFile;
use crate::files::readings::Condition;
use crate::files::source::Source;
use crate::files::table::TableFile;
use crate::files::table_numbers::TableNumbers;
use crate::pose::{NamedPose, PoseBox};

/// Which form of a table corrects the stiffness.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Form {
    /// Factor if the table has it, else diagonal.
    Auto,
    /// The paper's.
    Diagonal,
    /// Ours.
    Factor,
}

/// A machine, with a table or without.
pub struct Model {
    /// The machine.
    pub machine: MachineFile,
    /// The table.
    pub table: Option<Table>,
}

/// A table and how it is applied.
pub struct Table {
    /// Its file.
    pub source: Source,
    /// Its numbers.
    pub numbers: TableNumbers,
    /// Diagonal or factor.
    pub form: Form,
    /// Where it was fitted.
    pub pose_box: PoseBox,
    /// How far its factor form may be off, where that is applied and known.
    pub uncertainty: Option<TableUncertainty<f64>>,
}

/// A stiffness ready for loads, and whether its pose is inside the table's box (`None` without a table).
pub struct Solved {
    /// Of K at A in A-uvw.
    pub factor: StiffnessFactor<f64>,
    /// Inside the table's box or outside.
    pub domain: Option<Domain>,
    /// Expanded uncertainties of k11…k66, N/m and N·m/rad, where a table says them.
    pub u95_principal: Option<[f64; 6]>,
}

/// The core's view of a table, and the form that applies.
pub type Applied<'a> = Option<(CorrectionTable<'a, f64>, Form)>;

impl Model {
    /// Puts a machine and a table together; with a warning where the table was fitted from another machine file.
    ///
    /// # Errors
    /// A bad table, or one that lacks the form.
    pub fn new(machine: MachineFile, table: Option<Source>, form: Form) -> Result<(Self, Option<String>)> {
        let Some(source) = table else { return Ok((Self { machine, table: None }, None)) };
        let file = TableFile::parse(&source)?;
        let warning = (file.machine_sha256 != machine.source.sha256()).then(|| {
            let (fitted, own) = (&file.machine, &machine.source.name);
            format!("{} was fitted for machine `{fitted}` from another machine file than {own}, if only by a comment: give the \
                 file that it was fitted with, or fit it anew", source.name)
        });
        let form = match (form, &file.factor) {
            (Form::Factor, None) => {
                let message = "has no factor form (its data had no couplings): fit it on all 21 columns, or give --form diagonal, which is \
                               wrong for loads";
                return Err(Failure::input(message).in_file(source.name).at_column("factor"));
            }
            (Form::Auto, None) => Form::Diagonal,
            (Form::Auto, Some(_)) => Form::Factor,
            (form, _) => form,
        };
        let uncertainty = file.uncertainty.as_ref().filter(|_| form == Form::Factor).map(|u| u.core()).transpose()?;
        let table = Table { source, numbers: file.numbers(), form, pose_box: file.extent, uncertainty };
        Ok((Self { machine, table: Some(table) }, warning))
    }

    /// The core's view of the table.
    ///
    /// # Errors
    /// What the core refuses.
    pub fn applied(&self) -> Result<Applied<'_>> {
        self.table.as_ref().map(|t| Ok((t.numbers.table()?, t.form))).transpose()
    }

    /// Stiffness at every pose and temperature in °C.
    ///
    /// # Errors
    /// The pose at which there is none.
    pub fn solve<'a>(&self, poses: impl IntoIterator<Item = (&'a NamedPose, f64)>) -> Result<Vec<Solved>> {
        let table = self.applied()?;
        poses
            .into_iter()
            .map(|(p, temperature_c)| {
                let failed = |e: String| Failure::input(format!("pose `{}`: {e}", p.id)).at_line(p.line);
                let machine = self.machine.machine.at_temperature(temperature_c);
                let machine = machine.map_err(|e| failed(format!("{temperature_c} °C: {e}")))?;
                let mut solved = solve_at(&table, &machine, &p.pose).map_err(|e| failed(e.to_string()))?;
                let uncertainty = self.table.as_ref().and_then(|t| t.uncertainty.as_ref());
                if let (Some((table, _)), Some(uncertainty)) = (&table, uncertainty) {
                    let u95 = table.stiffness_u95(uncertainty, &solved.factor, &p.pose);
                    solved.u95_principal = Some(u95.into());
                }
                if solved.factor.stiffness().matrix().iter().all(|k| k.is_finite()) {
                    Ok(solved)
                } else {
                    Err(failed("the table gives a stiffness that is not finite".into()))
                }
            })
            .collect()
    }

    /// Deflection of a measured file's condition, seen at its point, m and rad.
    ///
    /// # Errors
    /// What the core refuses.
    pub fn deflection(
        &self,
        solved: &Solved,
        pose: &Pose<f64>,
        c: &Condition,
    ) -> std::result::Result<Deflection<f64>, StiffnessError> {
        let machine = &self.machine.machine;
        let at_a: Wrench<f64> = c.wrench.moved_to_a(c.point_m.into());
        let linear = solved.factor.deflection(&at_a)?;
        let extra = machine.load_dependent_deflection(pose, &at_a, &c.turned_at.moved_to_a(c.point_m.into()))?;
        Ok(linear.plus(&extra).plus(&machine.thermal_deflection(pose, c.rise_k)?).seen_at(c.point_m.into()))
    }

    /// How well the table's part of the deflection of a condition's point is known; none without a table that says so.
    ///
    /// # Errors
    /// What the core refuses.
    pub fn uncertainty(
        &self,
        solved: &Solved,
        pose: &Pose<f64>,
        wrench: &Wrench<f64>,
        point_m: Vector3<f64>,
    ) -> Result<Option<TipUncertainty<f64>>> {
        let Some((table, uncertainty)) = self.table.as_ref().and_then(|t| Some((t, t.uncertainty.as_ref()?))) else {
            return Ok(None);
        };
        let found = table.numbers.table()?.tip_uncertainty(uncertainty, &solved.factor, pose, wrench, point_m);
        found.map(Some).map_err(|e| Failure::input(format!("no uncertainty: {e}")))
    }
}

/// Stiffness of a machine at a pose.
///
/// # Errors
/// What the core refuses.
pub fn solve_at(
    table: &Applied<'_>,
    machine: &Machine<f64>,
    pose: &Pose<f64>,
) -> std::result::Result<Solved, CorrectionError> {
    let corrected = match table {
        None => return Ok(Solved { factor: machine.stiffness(pose)?.factor()?, domain: None, u95_principal: None }),
        Some((table, Form::Diagonal)) => table.diagonal_form(machine, pose),
        Some((table, _)) => table.factor_form(machine, pose),
    };
    corrected.map(|c| Solved { factor: c.factor, domain: Some(c.domain), u95_principal: None })
}

/// How far a table may be off at the tip: the greatest length of the expanded uncertainty (along u, v, w, coverage 95 %) of the
/// tip's deflection under a force of 1 N on it along u, v or w, m.
///
/// # Errors
/// What the core refuses.
pub fn u95_m_per_n(
    table: &CorrectionTable<'_, f64>,
    uncertainty: &TableUncertainty<f64>,
    factor: &StiffnessFactor<f64>,
    pose: &Pose<f64>,
    tip_m: Vector3<f64>,
) -> std::result::Result<f64, StiffnessError> {
    let mut greatest = 0.0_f64;
    for axis in 0..3 {
        let force = Wrench { force_n: Vector3::ith(axis, 1.0), ..Wrench::ZERO };
        greatest = greatest.max(table.tip_uncertainty(uncertainty, factor, pose, &force, tip_m)?.u95_m().norm());
    }
    Ok(greatest)
}

/// How many of some poses are outside the table's box.
pub fn outside_box(solved: &[Solved]) -> usize {
    solved.iter().filter(|s| s.domain == Some(Domain::Outside)).count()
}

/// A warning where poses are extrapolated.
pub fn extrapolation_warning(solved: &[Solved]) -> Option<String> {
    let outside = outside_box(solved);
    (outside > 0).then(|| format!("{outside} of {} poses lie outside the table's box: extrapolated", solved.len()))
}

/// Deflections were asked of a table for principal stiffnesses alone.
pub fn no_factor_form(table: &Source, or: &str) -> Failure {
    let message = "has no factor form, and the diagonal form is wrong for loads: fit it on data with all 21 columns";
    Failure::input(format!("{message}; {or}")).at_column("factor").in_file(&table.name)
}
