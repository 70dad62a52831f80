//! What is known of an effect without readings: its names, and what a diagnosis expects of it. A controller uses the amplitudes
//! alone, so that no image holds what is here.

use super::MAX_PARAMETERS;

/// What is known of an effect without a machine.
#[derive(Clone, Copy, Debug)]
pub struct EffectInfo {
    /// As in files.
    pub id: &'static str,
    /// Amplitudes, and shapes of laws.
    pub parameters: &'static [ParameterInfo],
    /// Whether the parameters may be negative.
    pub signed: bool,
    /// Where and how it acts.
    pub expected: Expected,
}

impl EffectInfo {
    /// Names of the parameters with units, as in files.
    pub fn names(&self) -> impl ExactSizeIterator<Item = &'static str> + Clone {
        self.parameters.iter().map(|p| p.name)
    }

    /// Least sizes of parameters that are refused; infinite for what it does not have.
    pub(super) const fn limits(&self) -> [f64; MAX_PARAMETERS] {
        let mut limits = [f64::INFINITY; MAX_PARAMETERS];
        let mut i = 0;
        while i < self.parameters.len() {
            limits[i] = self.parameters[i].refused_from;
            i += 1;
        }
        limits
    }
}

/// A parameter of an effect.
#[derive(Clone, Copy, Debug)]
pub struct ParameterInfo {
    /// With its unit, as in files.
    pub name: &'static str,
    /// Least size that is refused: far beyond any machine, and near where `f32` fails.
    pub refused_from: f64,
    /// Size before any reading.
    pub plausible: Plausible,
    /// Whether it acts like another parameter unless readings were taken while the load went down.
    pub needs_unloading: bool,
    /// Whether much that is on no list has the same effect.
    pub ambiguous: bool,
}

impl ParameterInfo {
    /// A parameter that any readings tell.
    pub const fn new(name: &'static str, refused_from: f64, plausible: Plausible) -> Self {
        Self { name, refused_from, plausible, needs_unloading: false, ambiguous: false }
    }
}

/// Which sizes of a parameter are plausible before any reading, in SI, for a machine.
#[derive(Clone, Copy, Debug)]
pub enum Plausible {
    /// Normally distributed about 0 with this standard deviation.
    Within(fn(&MachineScales) -> f64),
    /// Between 0 and this.
    Below(fn(&MachineScales) -> f64),
    /// Log-normally distributed.
    Around {
        /// Median.
        median: fn(&MachineScales) -> f64,
        /// Standard deviation of its logarithm.
        ln_sd: f64,
    },
}

/// Sizes of a machine that those of effects go with.
#[derive(Clone, Copy, Debug)]
pub struct MachineScales {
    /// Compliance of a limb along its axis, m/N.
    pub axial_m_per_n: f64,
    /// Compliance of a limb across its axis, m/N.
    pub across_m_per_n: f64,
    /// Least compliance at A against a moment, rad/(N·m).
    pub turning_rad_per_nm: f64,
    /// Compliance of the softest joint against tilting, rad/(N·m).
    pub tilting_rad_per_nm: f64,
    /// Mean of a1 and a2, m.
    pub arm_m: f64,
    /// b1, m.
    pub b1_m: f64,
    /// Least length of screw 1, m.
    pub shortest_m: f64,
    /// Greatest length of any screw, m.
    pub longest_m: f64,
    /// Usual force on the machine while it is read, N.
    pub force_n: f64,
}

impl MachineScales {
    /// Play and friction of fits and bearings, of which a part of a hand's size has `of_fits_m` and a greater machine a multiple of what a limb
    /// yields under its usual force.
    pub fn gap_m(&self, of_fits_m: f64, limbs: f64) -> f64 {
        of_fits_m.max(limbs * self.axial_m_per_n * self.force_n)
    }
}

/// Where and how an effect acts, in the words of a diagnosis' findings (`docs/formats.md`).
#[derive(Clone, Copy, Debug)]
pub struct Expected {
    /// Places on the machine.
    pub places: &'static [&'static str],
    /// Motion there.
    pub motion: &'static str,
    /// What it depends on.
    pub law: &'static str,
    /// ln of its prior weight; 0 for what yields where parts are elastic.
    pub ln_prior: f64,
    /// Effects that deflections at the tool hardly tell apart have the same class; none where it is alone.
    pub class: Option<&'static str>,
    /// Which readings tell it.
    pub told_by: ToldBy,
    /// What to inspect on the machine.
    pub inspect: &'static str,
}

/// Which readings tell an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ToldBy {
    /// Any.
    Loading,
    /// Those while the load went down tell it from others of its class.
    Unloading,
    /// Those with temperatures; without them it is no candidate.
    Temperatures,
}
