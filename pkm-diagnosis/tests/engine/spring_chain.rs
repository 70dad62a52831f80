//! Another machine: a telescoping chain of three springs under one force, read by one gauge.

use pkm_diagnosis::verdict::{self, Verdict};
use pkm_diagnosis::{
    Candidate, Channel, CommonErrors, ForwardModel, Kind, Levels, Noise, Observations, Parameter, Prior, Problem,
    Reading, Role, Rules, Search, Unknown, Whitener, design, levels, residuals::Residuals, search,
};

use crate::support::normal;

/// Declared compliance of a spring at its full length, m/N.
pub const COMPLIANCE: f64 = 1e-7;
/// Of the gauge, m.
const NOISE: f64 = 0.1e-6;

/// Unknown number of what is not a spring.
const FOUNDATION: usize = 3;
const PLAY: usize = 4;
const PLAY_FORCE: usize = 5;
const GAUGE: usize = 6;
const ALL_SPRINGS: usize = 7;

/// The chain under conditions: the share of each spring's length that is out, and a force in N.
pub struct Chain {
    pub conditions: Vec<([f64; 3], f64)>,
    parameters: Vec<Parameter>,
    candidates: Vec<Candidate>,
}

impl Chain {
    fn new(conditions: Vec<([f64; 3], f64)>) -> Self {
        let stiffness = |sd| Prior::LogNormal { middle: 1.0, sd };
        let of = |prior, role| Parameter { prior, role, ambiguous: false };
        let one_sided = Role::Amplitude { one_sided: true };
        let signed = Role::Amplitude { one_sided: false };
        let mut parameters = vec![of(stiffness(0.1), Role::Declared); 3];
        parameters.push(of(Prior::Normal { scale: COMPLIANCE }, one_sided));
        parameters.push(of(Prior::Normal { scale: 20e-6 }, one_sided));
        parameters.push(of(Prior::LogNormal { middle: 30.0, sd: 1.0 }, Role::Shape));
        parameters.push(of(Prior::Normal { scale: 0.05 }, signed));
        parameters.push(of(stiffness(0.5), signed));
        let candidate = |name: &str, kind, unknowns: &[usize]| Candidate {
            names: vec![name.into()],
            kind,
            place: name.into(),
            unknowns: unknowns.iter().copied().map(Unknown).collect(),
            start: Vec::new(),
            is_free: false,
        };
        let candidates = vec![
            candidate("foundation", Kind::Effect, &[FOUNDATION]),
            candidate("play", Kind::Effect, &[PLAY, PLAY_FORCE]),
            candidate("gauge", Kind::Measurement, &[GAUGE]),
            candidate("springs", Kind::DeclaredValues, &[ALL_SPRINGS]),
        ];
        Self { conditions, parameters, candidates }
    }
}

impl ForwardModel for Chain {
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    fn predict(&self, unknowns: &[Unknown], x: &[f64]) -> Option<Vec<f64>> {
        let of = |n: usize| {
            let x = unknowns.iter().position(|u| u.0 == n).map_or(0.0, |k| x[k]);
            self.parameters[n].prior.value(x)
        };
        let deflection = |(out, force): &([f64; 3], f64)| {
            let springs: f64 = (0..3).map(|i| COMPLIANCE * out[i] / (of(i) * of(ALL_SPRINGS))).sum();
            let elastic = force * (springs + of(FOUNDATION));
            (elastic + of(PLAY) * (force / of(PLAY_FORCE)).tanh()) * (1.0 + of(GAUGE))
        };
        Some(self.conditions.iter().map(deflection).collect())
    }

    fn common_errors(&self) -> Option<CommonErrors> {
        // the force, common to all that was read in one pose
        let column = self.predict(&[], &[])?;
        let group_of = (0..self.conditions.len()).map(|n| n / 6).collect();
        Some(CommonErrors { columns: vec![column], sd: vec![1e-4], undeclared: vec![1.0], group_of })
    }
}

/// Fourteen poses under six forces.
pub fn chain() -> Chain {
    let mut rng = fastrand::Rng::with_seed(51);
    let poses: Vec<[f64; 3]> = (0..14).map(|_| std::array::from_fn(|_| 0.3 + 1.4 * rng.f64())).collect();
    let forces = [-200.0, -60.0, -15.0, 15.0, 60.0, 200.0];
    Chain::new(poses.into_iter().flat_map(|pose| forces.map(|force| (pose, force))).collect())
}

/// Readings in three series of a chain with springs that differ from the declared ones, and some more unknowns.
pub fn read(chain: &Chain, truth: &[(usize, f64)], seed: u64) -> Observations {
    let mut rng = fastrand::Rng::with_seed(seed);
    let springs = [0, 1, 2].map(|n| (n, normal(&mut rng)));
    let (unknowns, x): (Vec<Unknown>, Vec<f64>) = springs.iter().chain(truth).map(|(n, x)| (Unknown(*n), *x)).unzip();
    let said = chain.predict(&unknowns, &x).unwrap();
    let mut readings = Vec::new();
    for series in 0..3 {
        let zero = 0.06e-6 * normal(&mut rng);
        for (condition, d) in said.iter().enumerate() {
            let observed = vec![Some(d + zero + NOISE * normal(&mut rng))];
            readings.push(Reading {
                condition,
                repeat_of: condition,
                series,
                observed,
                sigma: vec![None],
                covariance: None,
                drawn: Vec::new(),
            });
        }
    }
    let channels = vec![Channel { kind: 0, resolution: 1e-9 }];
    Observations { channels, pose_of: (0..said.len()).map(|n| n / 6).collect(), readings }
}

/// Names of what is found, with the verdict, and what else a test looks at.
fn diagnosed<T>(
    chain: &Chain,
    read: &Observations,
    more: impl Fn(&Levels<'_>, &Noise, &Search) -> T,
) -> (Vec<String>, Verdict, T) {
    let rules = Rules::DEFAULT;
    let noise = Noise::estimate(read, &rules).unwrap();
    let whitener = Whitener::new(read, &noise);
    let plain = Problem::new(read, &whitener, chain, &rules);
    let whiteners = levels::whiteners(&plain);
    let levels = Levels::new(&plain, &whiteners);
    let search = search::search(&levels, None).unwrap();
    let judgement = verdict::judge(&levels, &noise, &search).unwrap();
    let names = search.found.iter().map(|f| chain.candidates[f.candidate].name()).collect();
    let more = more(&levels, &noise, &search);
    (names, judgement.verdict, more)
}

#[test]
fn nothing_is_named_where_nothing_is_missing() {
    let chain = chain();
    for seed in 0..20 {
        let (names, verdict, ()) = diagnosed(&chain, &read(&chain, &[], 60 + seed), |_, _, _| ());
        assert_eq!((names, verdict), (vec![], Verdict::Adequate), "seed {seed}");
    }
}

/// Forces that are off by more than anybody declared, each pose's by its own: that is an error of the measurement, which is said
/// beside, and no lack of fit of the model.
#[test]
fn errors_of_the_load_are_no_lack_of_fit() {
    let chain = chain();
    let mut rng = fastrand::Rng::with_seed(70);
    let mut readings = read(&chain, &[], 70);
    let gains: Vec<f64> = (0..14).map(|_| 3e-3 * normal(&mut rng)).collect();
    for r in &mut readings.readings {
        let pose = r.condition / 6;
        r.observed[0] = r.observed[0].map(|d| d * (1.0 + gains[pose]));
    }
    let (names, verdict, (level, doubted)) = diagnosed(&chain, &readings, |levels, noise, search| {
        (search.levels[1], verdict::judge(levels, noise, search).unwrap().doubts_loads)
    });
    assert_eq!((names, verdict, doubted), (vec![], Verdict::Adequate, true));
    assert!(Rules::DEFAULT.load_error_levels[level] >= 2e-3);
}

/// Exact forces are not doubted, nor does a find count as less than explained for them, though noise makes small errors of the
/// forces the likeliest in some sets.
#[test]
fn exact_loads_are_not_doubted() {
    let chain = chain();
    let mut levels_taken = Vec::new();
    for seed in 0..60 {
        let read = read(&chain, &[(FOUNDATION, 0.5)], 300 + seed);
        let (names, verdict, (level, doubted)) = diagnosed(&chain, &read, |levels, noise, search| {
            (search.levels[1], verdict::judge(levels, noise, search).unwrap().doubts_loads)
        });
        assert_eq!((names, doubted), (vec!["foundation".into()], false), "seed {seed}");
        assert_ne!(verdict, Verdict::PartlyExplained, "seed {seed}");
        levels_taken.push(level);
    }
    assert!(levels_taken.iter().any(|level| Rules::DEFAULT.load_error_levels[*level] > 5e-4), "{levels_taken:?}");
}

/// Beside a find values go by the declared errors, whatever the readings make of their loads; the uncertainty stays theirs.
/// Where nothing is missing values go by the errors that the readings suggest.
#[test]
fn values_beside_a_find_go_by_the_declared_errors() {
    let chain = chain();
    let mut rng = fastrand::Rng::with_seed(71);
    let gains: Vec<f64> = (0..14).map(|_| 8e-3 * normal(&mut rng)).collect();
    for foundation in [0.0, 0.5] {
        let mut readings = read(&chain, &[(FOUNDATION, foundation)], 71);
        for r in &mut readings.readings {
            let pose = r.condition / 6;
            r.observed[0] = r.observed[0].map(|d| d * (1.0 + gains[pose]));
        }
        diagnosed(&chain, &readings, |levels, noise, search| {
            let again = search::search(levels, None).unwrap();
            let settled = verdict::settled(levels, noise, again).unwrap();
            let start = vec![0.0; search.fit.x.len()];
            let declared = levels.problems[0].fit(&search.fit.unknowns, &start).unwrap();
            let moved = (&search.fit.x - &declared.x).amax();
            assert!(search.levels[1] > 0 && moved > 0.03, "{moved}");
            let (x, expected) = (&settled.fit.x, if search.found.is_empty() { &search.fit.x } else { &declared.x });
            assert!((x - expected).amax() < 0.01 * moved, "{x} {expected}");
            assert_eq!(search.found.is_empty(), foundation == 0.0);
            for (own, before) in settled.fit.standard_errors(1.0).iter().zip(search.fit.standard_errors(1.0).iter()) {
                assert!((own / before - 1.0).abs() < 0.1, "{own} {before}");
            }
        });
    }
}

#[test]
fn what_is_missing_is_named_and_measured() {
    let chain = chain();
    for (seed, name, truth) in [
        (80, "foundation", vec![(FOUNDATION, 0.5)]),
        (81, "play", vec![(PLAY, 0.6), (PLAY_FORCE, -0.5)]),
        (82, "springs", vec![(ALL_SPRINGS, -1.2)]),
    ] {
        let (names, verdict, found) = diagnosed(&chain, &read(&chain, &truth, seed), |_, _, search| {
            let fit = &search.fit;
            let errors = fit.standard_errors(1.0);
            let at = |n: usize| fit.unknowns.iter().position(|u| u.0 == n);
            truth.iter().filter_map(|(n, x)| at(*n).map(|k| (fit.x[k] - x) / errors[k])).collect::<Vec<f64>>()
        });
        assert_eq!(names, [name]);
        assert_eq!(verdict, if name == "springs" { Verdict::Adequate } else { Verdict::Explained });
        assert_eq!(found.len(), truth.len());
        assert!(found.iter().all(|off| off.abs() < 4.0), "{name}: {found:?}");
    }
}

#[test]
fn what_the_readings_can_show_is_said_and_what_to_read_next() {
    let chain = chain();
    let readings = read(&chain, &[(FOUNDATION, 0.5)], 83);
    let (_, _, (hidden, proposals)) = diagnosed(&chain, &readings, |levels, noise, search| {
        let hidden: Vec<bool> = (0..chain.candidates.len())
            .map(|c| verdict::smallest_detectable(levels, search, c).iter().all(|(_, size)| size.is_none()))
            .collect();
        let rivals = design::rivals(levels, search);
        let proposals = design::propose(&chain, &[1.0 / noise.variance(0).sqrt()], &rivals, 3);
        (hidden, proposals)
    });
    assert!(!hidden[0] && !hidden[1]);
    assert_eq!(proposals.len(), 3);
    // none is proposed twice
    let mut conditions: Vec<usize> = proposals.iter().map(|p| p.condition).collect();
    conditions.sort_unstable();
    conditions.dedup();
    assert_eq!(conditions.len(), 3);
    assert!(proposals.iter().all(|p| p.separates[0] < p.separates[1]));
}

#[test]
fn a_gross_error_stands_out() {
    let chain = chain();
    let mut readings = read(&chain, &[], 84);
    *readings.readings[100].observed[0].as_mut().unwrap() += 40.0 * NOISE;
    let (_, _, outliers) = diagnosed(&chain, &readings, |levels, noise, search| {
        let residuals = Residuals::new(&levels.problems[search.levels[1]], noise, search).unwrap();
        residuals.outliers(&readings, &Rules::DEFAULT)
    });
    assert_eq!(outliers.iter().map(|o| (o.reading, o.channel)).collect::<Vec<_>>(), [(100, 0)]);
}
