//! What a diagnosis needs to know of a model: its unknowns, what it may lack, its predictions.

/// An unknown, by its place in [`ForwardModel::parameters`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Unknown(pub usize);

/// Prior of a parameter. Every unknown is a number x with a standard normal prior, so that all of them weigh alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Prior {
    /// Normal around 0.
    Normal {
        /// Standard deviation.
        scale: f64,
    },
    /// Logarithm normal around that of a middle.
    LogNormal {
        /// Median.
        middle: f64,
        /// Standard deviation of the logarithm.
        sd: f64,
    },
    /// Between 0 and a greatest value, with three quarters of it as the median: logistic in x.
    Below {
        /// Greatest value.
        greatest: f64,
    },
}

impl Prior {
    /// The parameter from its unknown.
    pub fn value(&self, x: f64) -> f64 {
        match *self {
            Self::Normal { scale } => scale * x,
            Self::LogNormal { middle, sd } => middle * (sd * x).exp(),
            Self::Below { greatest } => greatest / (1.0 + (-x).exp() / 3.0),
        }
    }

    /// Standard error of the parameter from that of its unknown.
    pub fn error(&self, x: f64, error: f64) -> f64 {
        match *self {
            Self::Normal { scale } => scale * error,
            Self::LogNormal { sd, .. } => self.value(x) * sd * error,
            Self::Below { greatest } => {
                let value = self.value(x);
                value * (1.0 - value / greatest) * error
            }
        }
    }
}

/// What a parameter is to a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Declared with an uncertainty, and always fitted.
    Declared,
    /// How much of a candidate there is: 0 for none.
    Amplitude {
        /// Negative values have no physical meaning.
        one_sided: bool,
    },
    /// Of a candidate; it changes nothing where the amplitudes are 0.
    Shape,
}

/// What is known of an unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// What x stands for.
    pub prior: Prior,
    /// What it is to the model.
    pub role: Role,
    /// It follows so many forms of residual that a finding that needs it is never called explained.
    pub ambiguous: bool,
}

impl Parameter {
    /// Whether it says how much of a candidate there is.
    pub fn is_amplitude(&self) -> bool {
        matches!(self.role, Role::Amplitude { .. })
    }

    /// Whether it must not be negative.
    pub fn is_one_sided(&self) -> bool {
        self.role == Role::Amplitude { one_sided: true }
    }
}

/// What a candidate belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Physics that the model lacks, by a formula.
    Effect,
    /// Physics that the model lacks and that has no formula of its own, at a place: named where no formula does as well.
    Element,
    /// An error of the measurement.
    Measurement,
    /// Declared values that are wrong.
    DeclaredValues,
}

/// Something that the model may lack.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Its id, or the keys of the declared values.
    pub names: Vec<String>,
    /// What it belongs to.
    pub kind: Kind,
    /// Where it is: candidates of one place are put right by one repair.
    pub place: String,
    /// What is unknown of it: amplitudes, then or between them shapes.
    pub unknowns: Vec<Unknown>,
    /// Where a fit of them begins, if something else has said how large they are; else empty.
    pub start: Vec<f64>,
    /// Its amplitudes say no more than how much, and may be as great as [`Rules::max_free_amplitude`](crate::Rules::max_free_amplitude).
    pub is_free: bool,
}

impl Candidate {
    /// As one name.
    pub fn name(&self) -> String {
        self.names.join(" + ")
    }
}

/// Errors that groups of readings have in common and that are no unknowns of the model, such as those of a load: columns of
/// predictions, each with its declared standard deviation. A column acts in every group on its own.
#[derive(Clone, Debug, Default)]
pub struct CommonErrors {
    /// Predicted effect of one unit, by column; each as [`ForwardModel::predict`] gives it.
    pub columns: Vec<Vec<f64>>,
    /// Declared standard deviation of each column.
    pub sd: Vec<f64>,
    /// What an undeclared error of 1 adds to it: see [`Rules::load_error_levels`](crate::Rules).
    pub undeclared: Vec<f64>,
    /// Group of each condition, counted from 0.
    pub group_of: Vec<usize>,
}

/// A model with unknowns under the conditions of some measurement.
pub trait ForwardModel: Sync {
    /// Everything that may be unknown.
    fn parameters(&self) -> &[Parameter];

    /// What the model may lack, in the order of reports.
    fn candidates(&self) -> &[Candidate];

    /// What the sensors read at `x`, in SI units: channel by channel in each condition. Unknowns that are not given are 0.
    /// A negative x of a one-sided amplitude acts like its positive self with the opposite sign, so that a fit sees no edge
    /// at 0. `None` where the model has no prediction.
    fn predict(&self, unknowns: &[Unknown], x: &[f64]) -> Option<Vec<f64>>;

    /// Whether the model at `x` is possible wherever it will be used, not under the conditions of the readings alone.
    fn is_possible(&self, _unknowns: &[Unknown], _x: &[f64]) -> bool {
        true
    }

    /// Errors that readings have in common besides the zero of their series.
    fn common_errors(&self) -> Option<CommonErrors>;

    /// Parameters that are always fitted.
    fn declared(&self) -> Vec<Unknown> {
        let all = self.parameters().iter().enumerate();
        all.filter(|(_, p)| p.role == Role::Declared).map(|(n, _)| Unknown(n)).collect()
    }
}
