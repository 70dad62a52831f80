//! What `pkm-host view` shows of a machine, as flat numbers: the machine in, everything about one configuration out.
//!
//! The page has this crate as WebAssembly (`embed/wasm`), the host links it, so that both compute the same and can compare a
//! [checksum](View::sweep) over many poses. Nothing is modelled here: stiffness, kinematics and compensation are the core's, and what
//! is added turns vectors from one frame into another. All numbers are SI, vectors in B-xyz unless a name says otherwise.

#![no_std]
#![forbid(unsafe_code)]

mod answer;
mod machine;
mod sweep;
mod table;
mod text;

pub use answer::{ANSWER, ANSWER_NUMBERS, FORM, FORM_NUMBERS, FORMS};
pub use machine::{EFFECTS_AT, ELEMENT_NUMBERS, ELEMENTS_AT, MACHINE_NUMBERS, write_machine};
pub use sweep::START;
pub use table::TABLE_NUMBERS;
pub use text::Text;

use pkm_core::nalgebra::{Vector2, Vector3};
use pkm_core::{Configuration, FiveAxis, JointValues, Machine, Pose, Scalar, ScrewLengths, Tool, Wrench, Wrist};

use answer::Links;
use machine::Ranges;
use table::Table;

/// How K is corrected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// K_p.
    Basic,
    /// The paper's form.
    Diagonal,
    /// The factor form.
    Factor,
}

/// What is asked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// Where the five axes stand.
    pub configuration: Configuration<f64>,
    /// On the tool at its tip, in the tool's axes.
    pub wrench: Wrench<f64>,
    /// Of the machine, °C; at the zero reading it had 20.
    pub temperature_c: f64,
    /// Whose compliance ellipsoids are wanted.
    pub form: Form,
}

/// Numbers of a configuration: θ, σ in rad, Z0 in m, β1, β2 in rad.
pub const CONFIGURATION_NUMBERS: usize = 5;
/// Numbers of a [`Request`]: the configuration, force and moment, temperature, form.
pub const REQUEST_NUMBERS: usize = CONFIGURATION_NUMBERS + 6 + 1 + 1;

/// A configuration of its numbers.
pub fn configuration_of(
    [theta_rad, sigma_rad, z0_m, beta1, beta2]: [f64; CONFIGURATION_NUMBERS],
) -> Configuration<f64> {
    Configuration { pose: Pose { theta_rad, sigma_rad, z0_m }, beta_rad: Vector2::new(beta1, beta2) }
}

/// Numbers of a configuration.
pub fn numbers_of(c: &Configuration<f64>) -> [f64; CONFIGURATION_NUMBERS] {
    [c.pose.theta_rad, c.pose.sigma_rad, c.pose.z0_m, c.beta_rad.x, c.beta_rad.y]
}

impl Request {
    /// A request of its numbers.
    pub fn of(n: &[f64; REQUEST_NUMBERS]) -> Self {
        Self {
            configuration: configuration_of([n[0], n[1], n[2], n[3], n[4]]),
            wrench: Wrench { force_n: Vector3::new(n[5], n[6], n[7]), moment_nm: Vector3::new(n[8], n[9], n[10]) },
            temperature_c: n[11],
            form: match n[12] {
                1.0 => Form::Diagonal,
                2.0 => Form::Factor,
                _ => Form::Basic,
            },
        }
    }
}

/// A machine with its wrist and, if there is one, a table.
#[derive(Debug)]
pub struct View {
    machine: Machine<f64>,
    wrist: Wrist<f64>,
    ranges: Ranges,
    links: Links,
    table: Option<Table>,
    answer: [f64; ANSWER_NUMBERS],
    texts: [Text; TEXTS],
}

/// Why there is no answer; why there is none in each of the three forms; why the deflection is not compensated.
pub const TEXTS: usize = 5;

impl View {
    /// Takes a machine in.
    ///
    /// # Errors
    /// What the core says of it.
    pub fn new(numbers: &[f64; MACHINE_NUMBERS]) -> Result<Self, Text> {
        let (machine, wrist, ranges, links) = machine::read_machine(numbers)?;
        let (answer, texts) = ([0.0; ANSWER_NUMBERS], [Text::EMPTY; TEXTS]);
        Ok(Self { machine, wrist, ranges, links, table: None, answer, texts })
    }

    /// Takes other values of the same machine in: its table stays.
    ///
    /// # Errors
    /// What the core says of them; the machine is the former one then.
    pub fn set_machine(&mut self, numbers: &[f64; MACHINE_NUMBERS]) -> Result<(), Text> {
        (self.machine, self.wrist, self.ranges, self.links) = machine::read_machine(numbers)?;
        Ok(())
    }

    /// Takes a table in.
    ///
    /// # Errors
    /// What the core says of it.
    pub fn set_table(&mut self, numbers: &[f64; TABLE_NUMBERS]) -> Result<(), Text> {
        self.table = Some(Table::read(numbers)?);
        Ok(())
    }

    /// The last answer.
    pub fn answer(&self) -> &[f64; ANSWER_NUMBERS] {
        &self.answer
    }

    /// What is said of the last answer.
    pub fn texts(&self) -> &[Text; TEXTS] {
        &self.texts
    }

    fn five(&self) -> FiveAxis<'_, f64> {
        FiveAxis { machine: &self.machine, wrist: &self.wrist }
    }

    /// The configuration of screw lengths and wrist angles.
    ///
    /// # Errors
    /// What the core says.
    pub fn forward(&self, q_m: [f64; 3], beta_rad: [f64; 2]) -> Result<[f64; CONFIGURATION_NUMBERS], Text> {
        let joints = JointValues { lengths: ScrewLengths { q_m: q_m.into() }, beta_rad: beta_rad.into() };
        self.five().forward(&joints).map(|(configuration, _)| numbers_of(&configuration)).map_err(|e| Text::of(&e))
    }

    /// The configuration that holds the tip with the wrist's joints at given angles.
    ///
    /// # Errors
    /// What the core says.
    pub fn tip(&self, tip_m: [f64; 3], beta_rad: [f64; 2]) -> Result<[f64; CONFIGURATION_NUMBERS], Text> {
        let hold = self.five().inverse_at(tip_m.into(), beta_rad.into());
        hold.map(|hold| numbers_of(&hold.configuration)).map_err(|e| Text::of(&e))
    }

    /// The configuration with A in a place, all else as in another: A stays in the plane y = 0 of B.
    ///
    /// # Errors
    /// What the core says.
    pub fn platform(
        &self,
        a_m: [f64; 3],
        near: [f64; CONFIGURATION_NUMBERS],
    ) -> Result<[f64; CONFIGURATION_NUMBERS], Text> {
        let [_, sigma, _, beta1, beta2] = near;
        let configuration = configuration_of([Scalar::atan2(a_m[0], a_m[2]), sigma, a_m[2], beta1, beta2]);
        self.five().joints(&configuration).map_err(|e| Text::of(&e))?;
        Ok(numbers_of(&configuration))
    }

    /// The configuration that holds a tool, tip and axis, near another.
    ///
    /// # Errors
    /// What the core says.
    pub fn tool(
        &self,
        tip_m: [f64; 3],
        axis: [f64; 3],
        near: [f64; CONFIGURATION_NUMBERS],
    ) -> Result<[f64; CONFIGURATION_NUMBERS], Text> {
        let tool = Tool { tip_m: tip_m.into(), axis: axis.into() };
        let hold = self.five().search(&tool, &configuration_of(near));
        hold.map(|hold| numbers_of(&hold.configuration)).map_err(|e| Text::of(&e))
    }
}
