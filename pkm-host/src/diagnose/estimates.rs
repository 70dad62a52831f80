//! How sure a diagnosis is: standard and expanded uncertainties of what it estimates, with their covariance, and the condition of
//! the machine that follows: the stiffness of each limb along its axis, and of the platform in the middle of the box.

use nalgebra::{DMatrix, DVector};
use pkm_core::effects::{EFFECTS, Place};
use pkm_core::{Machine, MachineParameters, Pose};
use pkm_diagnosis::{Fit, Noise, NoiseSource, Role, student};
use serde::Serialize;

use super::model::{Meaning, Model, info};
use crate::files::verified::Quantity;
use crate::pose::written_units;

/// Probability that a value lies within its expanded uncertainty.
pub const COVERAGE: f64 = 0.95;

/// Step of the derivatives, in standard deviations of the priors.
const STEP: f64 = 1e-3;

/// Standard deviations of its declared uncertainty by which a limb must differ from its declared value to be worth an inspection.
const NOTABLE_SD: f64 = 2.0;

/// Greatest standard uncertainty, in those that were declared, of a stiffness that counts as determined by the readings.
const MAX_UNDETERMINED: f64 = 0.8;

/// By what standard uncertainties are multiplied to be expanded ones.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Coverage {
    /// Probability of lying within.
    pub coverage: f64,
    /// The factor.
    pub k: f64,
    /// Of the noise, which the uncertainties are multiples of; none where it was declared, and counts as known.
    pub degrees_of_freedom: Option<f64>,
}

impl Coverage {
    /// For some noise: Student where it was estimated from repeats.
    pub fn of(noise: &Noise) -> Self {
        let degrees_of_freedom = (noise.source == NoiseSource::Repeats).then_some(noise.dof);
        Self { coverage: COVERAGE, k: student::coverage_factor(COVERAGE, degrees_of_freedom), degrees_of_freedom }
    }
}

/// One estimate, in the units of the machine file.
#[derive(Clone, Debug, Serialize)]
pub struct Estimate {
    /// Key of the machine file or `effect.parameter`; with several of a name, each once.
    pub name: String,
    /// Most likely value.
    pub value: f64,
    /// One standard deviation.
    pub standard_uncertainty: f64,
    /// The same times the coverage factor.
    pub expanded_uncertainty: f64,
}

/// All estimates with their covariance, and the condition.
pub struct Estimates {
    /// By what standard uncertainties are multiplied.
    pub coverage: Coverage,
    /// In the order of the fit.
    pub all: Vec<Estimate>,
    /// Of their values.
    pub covariance: DMatrix<f64>,
    /// Where the platform's stiffness is given.
    pub pose: Pose<f64>,
    /// Names of the declared values, in the order of [`Quantity::shared`].
    pub declared: Vec<String>,
    /// How far each is from what was declared, in units of its prior, and the covariance of that.
    pub deviations: Vec<f64>,
    /// See `deviations`.
    pub deviation_covariance: Vec<Vec<f64>>,
    /// Limbs first.
    pub condition: Vec<Quantity>,
}

/// Axial compliance of each limb, by its place among the transmitted wrenches.
const AXIAL: [usize; 3] = [0, 3, 6];

/// Limbs without what holds them: base and platform yield for all three, and sound nuts and screws would pass for worn.
fn limbs_alone(parameters: &MachineParameters) -> MachineParameters {
    let mut effects = parameters.effects;
    for (info, values) in EFFECTS.iter().zip(&mut effects.parameters) {
        // sizes are at no place that yields
        let first = info.expected.places.first().and_then(|place| Place::from_name(place));
        if first.is_some_and(|place| place.limb().is_none()) {
            values.fill(0.0);
        }
    }
    for slot in &mut effects.elements {
        *slot = slot.filter(|element| element.place.limb().is_some());
    }
    MachineParameters { effects, ..*parameters }
}

/// ln of each quantity, in the order of [`quantity_names`]; none of what has no stiffness there.
fn quantities(parameters: &MachineParameters, pose: &Pose<f64>) -> Vec<Option<f64>> {
    let alone = Machine::<f64>::new(&limbs_alone(parameters)).ok().and_then(|machine| machine.transmission(pose).ok());
    let stiffness = Machine::<f64>::new(parameters).ok().and_then(|machine| machine.stiffness(pose).ok());
    let limbs = AXIAL.map(|i| Some(1.0 / alone.as_ref()?.compliance[(i, i)]));
    let principal: [Option<f64>; 6] = std::array::from_fn(|i| Some(stiffness.as_ref()?.principal()[i]));
    let ln = |value: Option<f64>| value.map(f64::ln).filter(|ln| ln.is_finite());
    limbs.into_iter().chain(principal).map(ln).collect()
}

/// Name of a limb's own stiffness along its axis; limbs count from 1.
fn axial(limb: usize) -> String {
    format!("limb.{limb}.axial")
}

/// Name, words and unit of each quantity.
fn quantity_names() -> Vec<(String, String, &'static str)> {
    let limb = |n: usize| (axial(n), format!("limb {n} along its axis, drive, joints and body"), "N/m");
    let principal = |(i, axis): (usize, &str)| {
        let what = format!("platform at the middle of the box, {axis}");
        (format!("k{0}{0}", i + 1), what, if i < 3 { "N/m" } else { "N·m/rad" })
    };
    let axes = ["along u", "along v", "along w", "about u", "about v", "about w"];
    (1..=3).map(limb).chain(axes.into_iter().enumerate().map(principal)).collect()
}

/// Names of what was fitted, each once.
fn names(model: &Model, fit: &Fit) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for unknown in &fit.unknowns {
        let plain = match model.meaning(*unknown) {
            Meaning::Stiffness(d) => d.axis().map_or(d.key(), |axis| format!("{}[{axis}]", d.key())),
            Meaning::Class(class) => format!("factor of {}", model.classes[class].keys().join(" + ")),
            Meaning::Element(element) => format!("element.{}", model.elements[element].name()),
            Meaning::Effect { effect, parameter } => {
                let info = info(effect);
                format!("{}.{}", info.id, info.parameters[parameter].name)
            }
        };
        let number = |n: usize| if n == 1 { plain.clone() } else { format!("{plain} ({n})") };
        let free = (1..).map(number).find(|name| !names.contains(name));
        names.push(free.unwrap_or(plain));
    }
    names
}

/// Value of each unknown, and how it grows with the unknown.
fn values(model: &Model, fit: &Fit) -> Vec<(f64, f64)> {
    let value = |(u, x): (&pkm_diagnosis::Unknown, &f64)| {
        let prior = model.parameters[u.0].prior;
        let declared = match model.meaning(*u) {
            Meaning::Stiffness(d) => d.value(&model.declared),
            _ => 1.0,
        };
        (declared * prior.value(*x), declared * prior.error(*x, 1.0))
    };
    fit.unknowns.iter().zip(fit.x.iter()).map(value).collect()
}

/// State of a stiffness by ln of its change, the standard and expanded uncertainty of that, and the declared uncertainty.
fn state(change: f64, [standard, expanded]: [f64; 2], declared: f64) -> &'static str {
    match change {
        _ if standard > MAX_UNDETERMINED * declared && change.abs() <= expanded.max(NOTABLE_SD * declared) => {
            "not_determined"
        }
        _ if change.abs() <= expanded => "as_declared",
        _ if change.abs() <= NOTABLE_SD * declared => "within_declared_uncertainty",
        _ if change < 0.0 => "softer",
        _ => "stiffer",
    }
}

impl Estimates {
    /// Of a fit, about which the readings scatter as [`Fit::covariance`] says.
    pub fn new(model: &Model, (fit, scatter): (&Fit, f64), noise: &Noise, pose: Pose<f64>) -> Self {
        let coverage = Coverage::of(noise);
        let (names, values) = (names(model, fit), values(model, fit));
        let covariance = fit.covariance(scatter);
        let scaled = |i: usize, j: usize| covariance[(i, j)] * values[i].1 * values[j].1;
        let of = |(n, name): (usize, &String)| {
            let standard_uncertainty = scaled(n, n).sqrt();
            let expanded_uncertainty = coverage.k * standard_uncertainty;
            Estimate { name: name.clone(), value: values[n].0, standard_uncertainty, expanded_uncertainty }
        };
        let at = |x: &DVector<f64>| quantities(&model.state(&fit.unknowns, x.as_slice(), false).machine, &pose);
        let (declared, identified) = (quantities(&model.declared, &pose), at(&fit.x));
        // on both sides of each unknown
        let beside = |n: usize| {
            [STEP, -STEP].map(|step| {
                let mut x = fit.x.clone();
                x[n] += step;
                at(&x)
            })
        };
        let beside: Vec<[Vec<Option<f64>>; 2]> = (0..fit.x.len()).map(beside).collect();
        let is_declared: Vec<usize> =
            (0..names.len()).filter(|n| model.parameters[fit.unknowns[*n].0].role == Role::Declared).collect();
        let condition = |(q, (quantity, what, unit)): (usize, (String, String, &str))| {
            let slopes = beside.iter().map(|[above, below]| Some((above[q]? - below[q]?) / (2.0 * STEP)));
            let gradient: DVector<f64> = slopes.collect::<Option<Vec<f64>>>()?.into();
            let (declared, identified) = (declared[q]?, identified[q]?);
            let shared = &covariance * &gradient;
            // loads that are all too large by a share make every stiffness too large by as much
            let standard_uncertainty = gradient.dot(&shared).sqrt().hypot(model.uncertainty.load_calibration);
            let expanded_uncertainty = coverage.k * standard_uncertainty;
            let declared_uncertainty = is_declared.iter().map(|n| gradient[*n].powi(2)).sum::<f64>().sqrt();
            let change: f64 = identified - declared;
            Some(Quantity {
                quantity,
                what,
                unit: unit.to_owned(),
                declared: declared.exp(),
                identified: identified.exp(),
                standard_uncertainty,
                expanded_uncertainty,
                declared_uncertainty,
                state: state(change, [standard_uncertainty, expanded_uncertainty], declared_uncertainty).to_owned(),
                shared: is_declared.iter().map(|n| shared[*n]).collect(),
            })
        };
        Self {
            coverage,
            all: names.iter().enumerate().map(of).collect(),
            covariance: DMatrix::from_fn(names.len(), names.len(), scaled),
            pose,
            condition: quantity_names().into_iter().enumerate().filter_map(condition).collect(),
            declared: is_declared.iter().map(|n| names[*n].clone()).collect(),
            deviations: is_declared.iter().map(|n| fit.x[*n]).collect(),
            deviation_covariance: is_declared
                .iter()
                .map(|n| is_declared.iter().map(|m| covariance[(*n, *m)]).collect())
                .collect(),
        }
    }

    /// `covariance.csv`: the covariance of the estimates, a row and a column for each.
    pub fn covariance_csv(&self) -> String {
        let header = ["estimate".to_owned()].into_iter().chain(self.all.iter().map(|e| e.name.clone()));
        let row = |(n, e): (usize, &Estimate)| {
            let numbers = self.covariance.row(n).iter().map(|v| format!("{v:.9e}")).collect::<Vec<_>>();
            [vec![e.name.clone()], numbers].concat()
        };
        let rows = self.all.iter().enumerate().map(row);
        crate::files::dataset::to_csv(b',', &header.collect::<Vec<_>>(), rows)
    }

    /// Stiffness of a limb along its axis; none where it has none.
    fn of_limb(&self, limb: usize) -> Option<&Quantity> {
        self.condition.iter().find(|q| q.quantity == axial(limb))
    }

    /// What to do about the limbs that differ, in a sentence each: softness is wear, and nothing gets stiffer by itself.
    pub fn notable(&self) -> Vec<String> {
        let of = |limb: usize| match self.of_limb(limb) {
            Some(q) if q.state == "softer" => {
                Some(format!("{}: inspect nut, bearings, screw and joints of limb {limb}", q.text()))
            }
            Some(q) if q.state == "stiffer" => Some(format!(
                "{}, which no wear does: check the scale of the loads and of the sensor, and where these are right correct the \
                 declared stiffness of limb {limb}",
                q.text()
            )),
            Some(_) => None,
            None => Some(format!(
                "limb {limb} has no stiffness of its own along its axis in what was identified: the form of the model is in doubt"
            )),
        };
        (1..=AXIAL.len()).filter_map(of).collect()
    }

    /// Limbs that are as soft or stiff beyond what was declared as this state says.
    pub fn limbs_that_are(&self, state: &str) -> Vec<usize> {
        (1..=AXIAL.len()).filter(|limb| self.of_limb(*limb).is_some_and(|q| q.state == state)).collect()
    }

    /// Limbs of which the readings hardly tell more than what is declared, in a sentence.
    pub fn not_determined(&self) -> Option<String> {
        let of = |limb: usize| self.of_limb(limb).filter(|q| !q.is_determined());
        let shown = |limb: usize| {
            let q = of(limb)?;
            let alone = 100.0 * q.declared_uncertainty * self.coverage.k;
            let [change, uncertainty] = [q.change().exp_m1(), q.expanded_uncertainty].map(|v| 100.0 * v);
            Some(format!("limb {limb} ({change:+.1} ± {uncertainty:.1} %; as declared ± {alone:.1} %)"))
        };
        let all: Vec<String> = (1..=AXIAL.len()).filter_map(shown).collect();
        (!all.is_empty()).then(|| {
            format!("Not determined by these readings, stiffness along the axis of {}; ± covers 95 %.", all.join(", "))
        })
    }

    /// That no limb differs, of those that the readings tell; none where they tell of none.
    pub fn none_differs(&self) -> Option<String> {
        let told = |limb: &usize| self.of_limb(*limb).is_some_and(Quantity::is_determined);
        let limbs: Vec<String> = (1..=AXIAL.len()).filter(told).map(|limb| limb.to_string()).collect();
        let who = match limbs.as_slice() {
            [] => return None,
            all if all.len() == AXIAL.len() => "No limb differs along its axis".to_owned(),
            [one] => format!("Limb {one}, of which alone the readings tell, does not differ along its axis"),
            some => format!(
                "Limbs {}, of which alone the readings tell, do not differ along their axes",
                some.join(" and ")
            ),
        };
        Some(format!("{who} from what is declared by more than the declared uncertainty allows."))
    }

    /// The condition as JSON.
    pub fn condition_json(&self) -> serde_json::Value {
        let [theta_deg, sigma_deg, z0_mm] = written_units(&self.pose);
        serde_json::json!({
            "pose": { "theta_deg": theta_deg, "sigma_deg": sigma_deg, "z0_mm": z0_mm },
            "inspect": self.notable(),
            "quantities": self.condition,
            "shared_with": self.declared,
            "deviations": self.deviations,
            "deviation_covariance": self.deviation_covariance,
        })
    }
}

#[cfg(test)]
mod tests {
    use pkm_core::effects::Effects;
    use pkm_core::tables::reference::PARAMETERS;

    use super::*;

    /// Estimates of three limbs: ln of their changes, and their standard uncertainties. Each is declared to 0.06.
    fn limbs(of: [[f64; 2]; 3]) -> Estimates {
        let limb = |(n, [change, standard]): (usize, [f64; 2])| Quantity {
            quantity: axial(n + 1),
            what: quantity_names()[n].1.clone(),
            unit: "N/m".into(),
            declared: 1e8,
            identified: 1e8 * change.exp(),
            standard_uncertainty: standard,
            expanded_uncertainty: 2.0 * standard,
            declared_uncertainty: 0.06,
            state: state(change, [standard, 2.0 * standard], 0.06).into(),
            shared: Vec::new(),
        };
        Estimates {
            coverage: Coverage { coverage: COVERAGE, k: 2.0, degrees_of_freedom: None },
            all: Vec::new(),
            covariance: DMatrix::zeros(0, 0),
            pose: Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.53 },
            declared: Vec::new(),
            deviations: Vec::new(),
            deviation_covariance: Vec::new(),
            condition: of.into_iter().enumerate().map(limb).collect(),
        }
    }

    /// A limb of which the readings say next to nothing is not "as declared": they do not tell.
    #[test]
    fn what_the_readings_do_not_tell_is_not_determined() {
        let some = limbs([[0.0, 0.02], [-0.03, 0.057], [0.05, 0.03]]);
        let states: Vec<&str> = some.condition.iter().map(|q| q.state.as_str()).collect();
        assert_eq!(states, ["as_declared", "not_determined", "as_declared"]);
        let said = some.not_determined().unwrap();
        assert!(said.ends_with("axis of limb 2 (-3.0 ± 11.4 %; as declared ± 12.0 %); ± covers 95 %."), "{said}");
        assert!(some.none_differs().unwrap().starts_with("Limbs 1 and 3, of which alone the readings tell, do not"));
        let none = limbs([[0.0, 0.05]; 3]);
        assert_eq!(none.none_differs(), None);
        let all = limbs([[0.0, 0.02], [0.1, 0.02], [0.0, 0.02]]);
        assert_eq!((all.not_determined(), all.condition[1].state.as_str()), (None, "within_declared_uncertainty"));
        assert!(all.none_differs().unwrap().starts_with("No limb differs along its axis from"));
        // far off in spite of what is declared: the readings do tell
        assert_eq!(limbs([[-0.3, 0.05]; 3]).limbs_that_are("softer"), [1, 2, 3]);
    }

    /// Wear makes nothing stiffer.
    #[test]
    fn a_limb_that_is_stiffer_is_not_inspected_for_wear() {
        let [worn, stiff] =
            <[String; 2]>::try_from(limbs([[-0.3, 0.02], [0.16, 0.02], [0.0, 0.02]]).notable()).unwrap();
        assert!(worn.ends_with("inspect nut, bearings, screw and joints of limb 1"), "{worn}");
        assert!(stiff.contains("17.4 % stiffer") && !stiff.contains("inspect"), "{stiff}");
        assert!(stiff.contains("scale of the loads") && stiff.ends_with("declared stiffness of limb 2"), "{stiff}");
    }

    /// What holds a limb is no softness of its own: base and platform may yield as they like, and a joint of the limb may not.
    #[test]
    fn a_limb_is_as_stiff_whatever_holds_it() {
        let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
        let of = |effects: Option<Effects>| {
            let effects = effects.unwrap();
            let all = quantities(&MachineParameters { effects, ..PARAMETERS }, &pose);
            DVector::from_vec(all.into_iter().collect::<Option<Vec<f64>>>().unwrap())
        };
        let declared = of(Some(Effects::NONE));
        let (limbs, platform) = (0..AXIAL.len(), AXIAL.len() + 2);
        let none = Effects::NONE;
        for held in [
            none.with("base-compliance", [2e-9, 1e-8]),
            none.with("moving-platform-compliance", [1e-7, 1e-7, 1e-7, 1e-8, 1e-9]),
            none.with_element("base", "z", "constant", [5e-9]),
            none.with_element("moving_platform", "w", "constant", [5e-9]),
        ] {
            let found = of(held);
            assert!(limbs.clone().all(|n| found[n] == declared[n]), "{found} {declared}");
            assert!(found[platform] < declared[platform] - 1e-3);
        }
        for own in
            [none.with("limb-2-axial", [5e-9]), none.with_element("limb.2.platform_joint", "axial", "constant", [5e-9])]
        {
            let found = of(own);
            let softer = limbs.clone().map(|n| found[n] < declared[n] - 1e-2).collect::<Vec<_>>();
            assert_eq!(softer, [false, true, false]);
        }
    }

    /// Where a limb yields less than nothing and its foot makes up for that, the machine has a stiffness and the limb has none: the rest is said.
    #[test]
    fn what_has_no_stiffness_is_none_and_the_rest_is_there() {
        let pose = Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.53 };
        let of = |effects| quantities(&MachineParameters { effects, ..PARAMETERS }, &pose);
        let own = (-of(Effects::NONE)[1].unwrap()).exp();
        let mut foot = [0.0; 7];
        (foot[0], foot[6]) = (own, 1.0);
        let standing = Effects::NONE.with_element("base", "coupled", "constant", foot).unwrap();
        let all = of(standing.with_element("limb.2.body", "axial", "constant", [-1.2 * own]).unwrap());
        assert!(all[1].is_none() && all[AXIAL.len()..].iter().all(Option::is_some), "{all:?}");
        let far_less = Effects::NONE.with_element("limb.2.body", "axial", "constant", [-1.2 * own]).unwrap();
        assert!(of(far_less)[AXIAL.len()..].iter().all(Option::is_none));
    }
}
