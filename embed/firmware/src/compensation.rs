//! What the cyclic task compensates with: in either arithmetic, with what was learned, and with what the machine carries. Knows no hardware.

use pkm_core::compensator::{CarriedWeight, Compensator, CompensatorSettings, Fault, Reading, WeightError};
use pkm_core::estimation::{Estimator, EstimatorSettings, state_bytes};
use pkm_core::{Model, Scalar};
use pkm_protocol::{Arithmetic, Carried, Demand};

pub const AMPLITUDES: usize = 6;

pub type Learner = Estimator<f64, AMPLITUDES>;

/// Machine and table in service, in either arithmetic.
pub struct Models<'a> {
    pub single: Model<'a, f32>,
    pub double: Model<'a, f64>,
}

/// What the machine carries, with its reference in either arithmetic.
#[derive(Clone, Copy)]
pub struct Weighed {
    single: CarriedWeight<f32, 3>,
    double: CarriedWeight<f64, 3>,
}

impl Weighed {
    /// Takes about as long as a period of both arithmetics.
    ///
    /// # Errors
    /// Those of either.
    pub fn new(models: &Models<'_>, carried: &Carried) -> Result<Self, WeightError> {
        let Models { single, double } = models;
        let double = carried.carried(double.machine, double.table)?;
        Ok(Self { single: carried.carried(single.machine, single.table)?, double })
    }
}

/// From period to period.
#[derive(Clone, Copy)]
pub struct Compensation {
    pub learner: Learner,
    /// What it knows, narrowed.
    single: Estimator<f32, AMPLITUDES>,
    of_double: Compensator<f64, 3>,
    of_single: Compensator<f32, 3>,
    period_s: f64,
    /// The latest demand, at whose place the offset goes back when there is none any more.
    latest: Option<Demand>,
    pub offset_m: [f64; 3],
    pub fault: Option<Fault>,
    /// Periods in which it has compensated a demand.
    pub compensated: u32,
}

impl Compensation {
    /// Without an offset. `None` when a setting is out of its range.
    pub fn new(learned: &EstimatorSettings<AMPLITUDES>, period_s: f64) -> Option<Self> {
        // for a load that is computed, not measured
        let settings = CompensatorSettings { period_s, gain: 1.0, stuck_s: 0.0, ..CompensatorSettings::DEFAULT };
        Some(Self {
            learner: Estimator::new(learned).ok()?,
            single: Estimator::new(learned).ok()?,
            of_double: Compensator::new(&settings).ok()?,
            of_single: Compensator::new(&settings).ok()?,
            period_s,
            latest: None,
            offset_m: [0.0; 3],
            fault: None,
            compensated: 0,
        })
    }

    /// Begins to learn anew: what was learned beyond one table another may have already. The offset follows at its rate limit.
    pub fn forget(&mut self, learned: &EstimatorSettings<AMPLITUDES>) {
        if let Ok(fresh) = Estimator::new(learned) {
            self.learner = fresh;
        }
        self.narrow();
    }

    /// Has `f32` know what the learner knows.
    pub fn narrow(&mut self) {
        let mut state = [0; state_bytes(AMPLITUDES)];
        // both are of the same settings, and of any machine
        let _ = self.learner.save(0, 0, &mut state).and_then(|()| self.single.restore(0, &state));
    }

    /// Compensates this, too, from the next period on. The offset goes there at its rate limit.
    pub fn carry(&mut self, weighed: &Weighed) {
        self.of_single.set_weight(Some(weighed.single));
        self.of_double.set_weight(Some(weighed.double));
    }

    /// A period. Without a demand the offset goes back to none. Each arithmetic has a compensator of its own: the offset of one is gone
    /// before that of the other comes, or it would leap.
    pub fn period(&mut self, models: &Models<'_>, demand: Option<Demand>) {
        let (at, enabled) = match (demand, self.latest) {
            (Some(next), Some(last)) if next.arithmetic != last.arithmetic && self.offset_m != [0.0; 3] => {
                (last, false)
            }
            (Some(next), _) => (next, true),
            (None, Some(last)) => (last, false),
            (None, None) => return,
        };
        self.latest = Some(at);
        if enabled {
            self.compensated = self.compensated.wrapping_add(1);
            self.learner.follow(self.period_s);
            self.single.follow(self.period_s as f32);
        }
        (self.offset_m, self.fault) = match at.arithmetic {
            Arithmetic::F32 => update(&mut self.of_single, models.single.with_learned(&self.single), &at, enabled),
            Arithmetic::F64 => update(&mut self.of_double, models.double.with_learned(&self.learner), &at, enabled),
        };
    }
}

/// A period of the compensation, in the arithmetic of the demand.
fn update<T: Scalar>(
    compensator: &mut Compensator<T, 3>,
    model: Model<'_, T, AMPLITUDES>,
    demand: &Demand,
    enabled: bool,
) -> ([f64; 3], Option<Fault>) {
    let (pose, wrench, tip_m) = demand.inputs();
    let reading = Reading { enabled, wrench, rise: demand.rise() };
    let offset = compensator.update(&model, &pose, tip_m, &reading);
    (offset.joints.map(T::to_f64).into(), offset.fault)
}
