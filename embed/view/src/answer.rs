//! Everything about one configuration.

use pkm_core::kinematics::platform_axes;
use pkm_core::nalgebra::{Matrix3, Vector3};
use pkm_core::{
    CorrectionError, CorrectionTable, Deflection, Domain, FiveAxis, Machine, StiffnessFactor, ToolDeflectionError,
    ToolFrame, Transmission, Wrench,
};

use crate::machine::Row;
use crate::text::Text;
use crate::{Form, Request, View};

/// The forms in the order of their numbers.
pub const FORMS: [Form; 3] = [Form::Basic, Form::Diagonal, Form::Factor];

/// Names and lengths of the parts of an answer, one after another; matrices by column.
pub const ANSWER: [(&str, usize); 22] = [
    // screw lengths; distance from the nearest end of travel, and the limb, from 1; see `SingularityDistance`
    ("lengths", 3),
    ("margin", 2),
    ("singularity", 2),
    // normalised determinant of the five axes; 1 inside the table's box
    ("share", 1),
    ("inside", 1),
    // the platform: A, and u, v, w; the tool: its tip, and x, y, z of T_h
    ("a", 3),
    ("platform", 9),
    ("tip", 3),
    ("tool", 9),
    // from A to the tip: first axis, second axis (along it and away from it), spindle
    ("wrist", 12),
    // B_i, A_i; axes of the base joints and of the bodies; lengths as they stand there
    ("base", 9),
    ("joints", 9),
    ("base_axes", 27),
    ("body_axes", 27),
    // by form: see FORM
    ("basic", FORM_NUMBERS),
    ("diagonal", FORM_NUMBERS),
    ("factor", FORM_NUMBERS),
    // of the form that was asked for: columns are the displacements under unit forces along x, y, z, at A and at the tip, m/N
    ("ellipsoid_a", 9),
    ("ellipsoid_tip", 9),
    // 1 if there is a command that makes up for the load: its configuration, its screw lengths
    ("compensated", 1),
    ("command", 5),
    ("command_lengths", 3),
];

/// Names and lengths of the parts of a form's answer: 1 if there is one; K at A in A-uvw; displacement and turn of the tip, and of
/// A, by the load and the temperature.
pub const FORM: [(&str, usize); 6] = [("ok", 1), ("k", 36), ("tip", 3), ("turn", 3), ("a", 3), ("a_turn", 3)];

const fn sum(parts: &[(&str, usize)]) -> usize {
    let (mut i, mut sum) = (0, 0);
    while i < parts.len() {
        sum += parts[i].1;
        i += 1;
    }
    sum
}

/// Numbers of a form's answer.
pub const FORM_NUMBERS: usize = sum(&FORM);
/// Numbers of an answer.
pub const ANSWER_NUMBERS: usize = sum(&ANSWER);

/// The tool as the platform sees it.
struct Placed {
    /// u, v, w in B as columns.
    platform: Matrix3<f64>,
    tool: ToolFrame<f64>,
    /// The tip in A-uvw.
    tip_m: Vector3<f64>,
}

/// The mechanism's answer to a load under a form.
struct Loaded {
    factor: StiffnessFactor<f64>,
    /// Of A, in A-uvw.
    deflection: Deflection<f64>,
}

fn loaded(
    machine: &Machine<f64>,
    table: Option<&CorrectionTable<'_, f64>>,
    form: Form,
    request: &Request,
    wrench: &Wrench<f64>,
) -> Result<Loaded, CorrectionError> {
    let pose = &request.configuration.pose;
    let factor = match (form, table) {
        (Form::Basic, _) => machine.stiffness(pose)?.factor()?,
        (_, None) => return Err(CorrectionError::NoFactorForm),
        (Form::Diagonal, Some(table)) => table.diagonal_form(machine, pose)?.factor,
        (Form::Factor, Some(table)) => table.factor_form(machine, pose)?.factor,
    };
    let beyond = machine.load_dependent_deflection(pose, wrench, &Wrench::ZERO)?;
    let grown = machine.thermal_deflection(pose, request.temperature_c - pkm_core::thermal::DECLARED_TEMPERATURE_C)?;
    let deflection = factor.deflection(wrench)?.plus(&beyond).plus(&grown);
    Ok(Loaded { factor, deflection })
}

impl Placed {
    fn new(request: &Request, tool: ToolFrame<f64>, a_m: Vector3<f64>) -> Self {
        let pose = &request.configuration.pose;
        let sin_cos = |angle: f64| pkm_core::Scalar::sin_cos(angle);
        let platform = platform_axes(sin_cos(pose.theta_rad), sin_cos(pose.sigma_rad));
        let tip_m = platform.tr_mul(&(tool.tip_m - a_m));
        Self { platform, tool, tip_m }
    }

    /// A load on the tool in its own axes, as one at A in A-uvw.
    fn at_a(&self, wrench: &Wrench<f64>) -> Wrench<f64> {
        let turned = |v: &Vector3<f64>| self.platform.tr_mul(&(self.tool.axes * v));
        Wrench { force_n: turned(&wrench.force_n), moment_nm: turned(&wrench.moment_nm) }.moved_to_a(self.tip_m)
    }

    fn write_form(&self, row: &mut Row<'_>, loaded: &Result<Loaded, CorrectionError>) {
        let Ok(Loaded { factor, deflection }) = loaded else { return row.zeros(FORM_NUMBERS) };
        let tip = deflection.seen_at(self.tip_m);
        row.put(&[1.0]);
        row.put(factor.stiffness().matrix().as_slice());
        for moved in [&tip.translation_m, &tip.rotation_rad, &deflection.translation_m, &deflection.rotation_rad] {
            row.put((self.platform * moved).as_slice());
        }
    }

    /// Displacements of a point of the platform (A-uvw) under unit forces there along x, y, z of B.
    fn write_ellipsoid(&self, row: &mut Row<'_>, factor: &StiffnessFactor<f64>, at_m: Vector3<f64>) {
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let force = Wrench { force_n: self.platform.tr_mul(&axis), ..Wrench::ZERO }.moved_to_a(at_m);
            let moved = factor.deflection(&force).unwrap_or(Deflection::ZERO);
            row.put((self.platform * moved.seen_at(at_m).translation_m).as_slice());
        }
    }
}

/// Joints and axes of the limbs, from A-uvw of the actual platform into B.
fn write_limbs(row: &mut Row<'_>, t: &Transmission<f64>) {
    let seen = |at: &Vector3<f64>| t.base_axes.tr_mul(&(at - t.base_m));
    for end in [0, 1] {
        for limb in &t.limbs {
            row.put(seen(&limb.joints_m[end]).as_slice());
        }
    }
    for end in [0, 1] {
        for limb in &t.limbs {
            row.put(t.base_axes.tr_mul(&limb.axes[end]).as_slice());
        }
    }
}

impl View {
    /// Works out everything about a configuration under a load; false, with a [text](Self::texts), where the machine cannot
    /// stand there. A form that has no answer has its own text.
    pub fn solve(&mut self, request: &Request) -> bool {
        self.texts = [Text::EMPTY; crate::TEXTS];
        let warm = self.machine.at_temperature(request.temperature_c);
        let said = match &warm {
            Ok(machine) => self.solve_warm(machine, request),
            Err(e) => Err(Text::of(e)),
        };
        if let Err(text) = said {
            self.texts[0] = text;
        }
        said.is_ok()
    }

    fn solve_warm(&mut self, machine: &Machine<f64>, request: &Request) -> Result<(), Text> {
        let five = FiveAxis { machine, wrist: &self.wrist };
        let (c, pose) = (&request.configuration, &request.configuration.pose);
        let tool = five.frame(c).map_err(|e| Text::of(&e))?;
        let joints = five.joints(c).map_err(|e| Text::of(&e))?;
        let distance = machine.singularity_distance(pose).map_err(|e| Text::of(&e))?;
        let transmission = machine.transmission(pose).map_err(|e| Text::of(&e))?;
        let share = five.normalised_determinant(c).map_err(|e| Text::of(&e))?;
        let table = self.table.as_ref().and_then(|table| table.core().ok());
        let (margin_m, limb) = machine.travel_margin_m(&joints.lengths).map_err(|e| Text::of(&e))?;
        let a_m = pose.a_in_b_m();
        let placed = Placed::new(request, tool, a_m);
        let wrench = placed.at_a(&request.wrench);

        let mut row = Row(self.answer.iter_mut());
        row.put(joints.lengths.q_m.as_slice());
        row.put(&[margin_m, limb as f64, distance.limbs_1_2, distance.limb_3, share]);
        row.put(&[if table.as_ref().is_some_and(|t| t.domain(pose) == Domain::Inside) { 1.0 } else { 0.0 }]);
        row.put(a_m.as_slice());
        row.put(placed.platform.as_slice());
        row.put(placed.tool.tip_m.as_slice());
        row.put(placed.tool.axes.as_slice());
        write_wrist(&mut row, &placed, a_m, &self.links);
        write_limbs(&mut row, &transmission);
        let mut shown = None;
        for (n, form) in FORMS.into_iter().enumerate() {
            let answer = loaded(machine, table.as_ref(), form, request, &wrench);
            placed.write_form(&mut row, &answer);
            match answer {
                Ok(answer) if form == request.form => shown = Some(answer.factor),
                Ok(_) => {}
                Err(e) => self.texts[1 + n] = Text::of(&e),
            }
        }
        match &shown {
            Some(factor) => {
                placed.write_ellipsoid(&mut row, factor, Vector3::zeros());
                placed.write_ellipsoid(&mut row, factor, placed.tip_m);
            }
            None => row.zeros(18),
        }
        // with the diagonal form no load is to be compensated
        let table = table.as_ref().filter(|t| t.has_factor_form() && request.form == Form::Factor);
        self.texts[4] = write_command(&mut row, &five, table, request).map_or_else(|e| Text::of(&e), |()| Text::EMPTY);
        Ok(())
    }
}

/// The wrist's links, m: offset along u, along the first axis, away from it, along the second link.
pub(crate) type Links = [f64; 4];

fn write_wrist(row: &mut Row<'_>, placed: &Placed, a_m: Vector3<f64>, links: &Links) {
    let [offset, first_d, first_b, second_b] = *links;
    let (u, w) = (placed.platform.column(0), placed.platform.column(2));
    let (x_h, y_h) = (placed.tool.axes.column(0), placed.tool.axes.column(1));
    let first = a_m + u * offset;
    let along = first + w * first_d;
    let second = along + y_h.cross(&w) * first_b;
    for point in [first, along, second, second + x_h * second_b] {
        row.put(point.as_slice());
    }
}

fn write_command(
    row: &mut Row<'_>,
    five: &FiveAxis<'_, f64>,
    table: Option<&CorrectionTable<'_, f64>>,
    request: &Request,
) -> Result<(), ToolDeflectionError> {
    let found = five.tool(&request.configuration).map_err(ToolDeflectionError::from);
    match found.and_then(|tool| five.compensated(table, &tool, &request.wrench, &request.configuration)) {
        Ok(command) => {
            row.put(&[1.0]);
            row.put(&crate::numbers_of(&command.solution.configuration));
            row.put(command.solution.joints.lengths.q_m.as_slice());
            Ok(())
        }
        Err(e) => {
            row.zeros(9);
            Err(e)
        }
    }
}
