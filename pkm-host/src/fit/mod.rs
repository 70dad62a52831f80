//! Fitting correction tables to stiffness data (paper, Eqs. 10-14; `docs/theory.md`).

mod checks;
mod evaluate;
pub mod export;
mod regression;
pub(crate) mod uncertainty;
mod verification;

use std::collections::BTreeSet;

use nalgebra::{DMatrix, DVector, Vector3};
use pkm_core::correction::{EQ_11, FACTOR_ENTRIES};
use pkm_core::{Basis, Machine, Stiffness};

use crate::error::{Failure, Result, printable};
use crate::files::dataset::{StiffnessData, Target};
use crate::files::machine::MachineFile;
use crate::files::source::Source;
use crate::files::table::{DiagonalForm, FactorForm, TableFile};
use crate::files::table_numbers::{TableNumbers, UncertaintyNumbers, refuse_not_positive};
use crate::pose::{MAX_RADIANS, NamedPose, PoseBox, core_units, file_units};

use self::checks::suspicious_ratios;
pub use self::checks::{read_otherwise, stray_poses, too_sure};
pub use self::evaluate::{DeflectionError, DeflectionErrors, Evaluation, evaluate};
use self::regression::{Regression, columns, condition, levels, refuse_rank_deficiency, select, spread};
use self::uncertainty::Training;
pub use self::verification::Verification;

/// Which of the nine terms Eq. 12 gives to c11…c66.
const EQ_12: [[bool; 9]; 6] = {
    const fn with(cross: Option<usize>) -> [bool; 9] {
        let mut used = [true, true, true, true, true, false, false, false, true];
        if let Some(i) = cross {
            used[i] = true;
        }
        used
    }
    const THETA_Z0: usize = 6;
    const SIGMA_Z0: usize = 7;
    [
        with(Some(THETA_Z0)),
        with(Some(SIGMA_Z0)),
        with(Some(SIGMA_Z0)),
        with(Some(THETA_Z0)),
        with(None),
        with(Some(SIGMA_Z0)),
    ]
};

/// Which terms the polynomials get.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum TermChoice {
    /// Eq. 12 for the diagonal form, Eq. 11's nine for the factor form.
    Paper,
    /// Eq. 11's nine for both.
    Full,
    /// Picked for each coefficient by leave-one-out prediction of the training poses.
    Select,
}

impl TermChoice {
    /// As `--terms` has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Full => "full",
            Self::Select => "select",
        }
    }
}

/// A fitted table with all that is reported about it.
pub struct Fit {
    /// Which terms it got.
    pub choice: TermChoice,
    /// What was fitted on, with K_p beside it.
    pub training: Vec<Sample>,
    /// What the fit is judged by.
    pub verification: Option<Verification>,
    /// Middle and half widths of the box in ° and mm.
    pub center: [f64; 3],
    /// See `center`.
    pub scale: [f64; 3],
    /// Extent of the training poses.
    pub extent: PoseBox,
    /// The table.
    pub numbers: TableNumbers,
    /// Of the factor form, at poses that it was not fitted on; see [`Fit::estimate_uncertainty`].
    pub uncertainty: Option<UncertaintyNumbers>,
    /// Of the diagonal form, then of the factor form.
    pub polynomials: Vec<Polynomial>,
    /// The paper's e_ij in ° and mm.
    pub paper_e: [[f64; 9]; 6],
    /// Worst condition number of the polynomials' design matrices, scaled variables.
    pub condition: f64,
}

impl Fit {
    /// Finds out how far the table may be off at the tool's tip, here in A-uvw, from poses that are left out of the fit. It stays unknown
    /// where the poses are too few for this.
    pub fn estimate_uncertainty(&mut self, tip_m: Vector3<f64>) {
        let TableNumbers { centre, half_width, terms, .. } = &self.numbers;
        let some = some_of(&self.training, MAX_LEFT_OUT);
        let entries: Option<Vec<_>> = some.iter().map(|s| s.factor_entries()).collect();
        let basic: Option<Vec<_>> = some.iter().map(|s| s.basic.factor().ok()).collect();
        let basis = Basis::<f64>::new(*centre, *half_width, terms).ok();
        let (Some(entries), Some(basic), Some(basis)) = (entries, basic, basis) else { return };
        let design = design(&basis, terms.len(), some.iter().copied());
        let variables: Vec<[f64; 3]> = some.iter().map(|s| file_units(&s.pose.pose)).collect();
        let used: Vec<Vec<bool>> = self.polynomials.iter().skip(6).map(|p| p.used.clone()).collect();
        let training = Training {
            variables: &variables,
            terms,
            design: &design,
            used: &used,
            entries: &entries,
            basic: &basic,
            tip_m,
        };
        self.uncertainty = training.uncertainty();
    }

    /// What is doubtful about the data or the figures.
    pub fn warnings(&self, data: &Source, verification: Option<&Source>, verified: Option<&Evaluation>) -> Vec<String> {
        let mut warnings = Vec::new();
        if let Some(v) = verified.filter(|v| v.outside_box > 0) {
            warnings.push(format!(
                "{} of {} verification poses lie outside the table's box: extrapolated",
                v.outside_box, v.poses
            ));
        }
        warnings.extend(self.verification.as_ref().and_then(Verification::warning));
        let judged_by = self.verification.as_ref().map(|v| &v.samples);
        for (source, samples) in [(data, &self.training)].into_iter().chain(verification.zip(judged_by)) {
            let columns = suspicious_ratios(samples);
            if !columns.is_empty() {
                let shown: Vec<String> = columns.iter().map(|(name, ratio)| format!("{name} {ratio:.1e}")).collect();
                warnings.push(format!(
                    "{}: stiffnesses far from the declared machine's, in the mean over the poses {} times: are they in N/m \
                     (1 N/mm = 1000 N/m) and N·m/rad?",
                    printable(&source.name),
                    shown.join(", ")
                ));
            }
        }
        if self.extent.may_be_in_radians() {
            warnings.push(format!(
                "{}: no angle is above {MAX_RADIANS}°: are theta_deg and sigma_deg in degrees?",
                data.name
            ));
        }
        warnings
    }

    /// The table with where it comes from.
    pub fn table_file(&self, machine: &MachineFile, data: &Source) -> TableFile {
        let rows = |n: &[f64]| n.chunks(self.numbers.terms.len()).map(<[f64]>::to_vec).collect::<Vec<_>>();
        TableFile {
            format: 1,
            machine: machine.name.clone(),
            machine_sha256: machine.source.sha256(),
            data: data.file_name(),
            data_sha256: data.sha256(),
            extent: self.extent,
            center: self.center,
            scale: self.scale,
            terms: self.numbers.terms.clone(),
            diagonal: DiagonalForm { coefficients: rows(&self.numbers.diagonal), paper_e: self.paper_e },
            factor: self.numbers.factor.as_deref().map(|f| FactorForm { coefficients: rows(f) }),
            uncertainty: self.uncertainty.clone(),
        }
    }
}

/// Most poses that are left out one by one: more say no more of a table's lack of fit, and the time goes with the square.
const MAX_LEFT_OUT: usize = 200;

/// So many of the poses at most, drawn from a fixed seed: a stride would meet the steps of a grid.
fn some_of(training: &[Sample], most: usize) -> Vec<&Sample> {
    let mut chosen = fastrand::Rng::with_seed(1).choose_multiple(0..training.len(), most);
    chosen.sort_unstable();
    chosen.into_iter().map(|i| &training[i]).collect()
}

/// One fitted polynomial over all terms of the table; 0 where it does not use one.
pub struct Polynomial {
    /// `c11`, or `g21`.
    pub name: String,
    /// By term.
    pub coefficients: Vec<f64>,
    /// Standard errors, by term: square roots of the diagonal of s²(XᵀX)⁻¹.
    pub standard_errors: Vec<f64>,
    /// Terms it uses.
    pub used: Vec<bool>,
    /// Root mean square of leave-one-out prediction errors.
    pub loo_rms: f64,
    /// The same with the terms that `paper` would give it.
    pub paper_loo_rms: f64,
}

/// A pose with its basic and its target stiffness.
#[derive(Clone)]
pub struct Sample {
    /// The pose.
    pub pose: NamedPose,
    /// K_p of the machine.
    pub basic: Stiffness<f64>,
    /// K_a of the data.
    pub target: Target,
}

impl Sample {
    /// c_ii = k_a / k_p.
    pub fn ratios(&self) -> [f64; 6] {
        let (a, p) = (self.target.principal, self.basic.principal());
        std::array::from_fn(|i| a[i] / p[i])
    }

    /// Lower triangle, row by row, of G = chol(L⁻¹ K_a L⁻ᵀ), K_p = L Lᵀ.
    fn factor_entries(&self) -> Option<[f64; FACTOR_ENTRIES]> {
        let (l, target) = (self.basic.factor().ok()?.lower(), self.target.full?.matrix());
        let half = l.solve_lower_triangular(&target)?;
        let inner = l.solve_lower_triangular(&half.transpose())?;
        let g = ((inner + inner.transpose()) * 0.5).cholesky()?.l();
        let mut entries = (0..6).flat_map(|i| (0..=i).map(move |j| g[(i, j)]));
        Some(std::array::from_fn(|_| entries.next().unwrap_or(f64::NAN)))
    }
}

/// Computes K_p beside every target.
///
/// # Errors
/// A pose at which the core gives none.
pub fn samples(machine: &Machine<f64>, data: StiffnessData) -> Result<Vec<Sample>> {
    let file = data.source.name;
    data.poses
        .into_iter()
        .zip(data.targets)
        .map(|(pose, target)| match machine.stiffness(&pose.pose) {
            Ok(basic) => Ok(Sample { pose, basic, target }),
            Err(e) => Err(Failure::input(e.to_string()).in_file(&file).at_line(pose.line)),
        })
        .collect()
}

/// Design matrix: the terms of a basis at each sample's pose.
fn design<'a>(basis: &Basis<'_, f64>, terms: usize, samples: impl IntoIterator<Item = &'a Sample>) -> DMatrix<f64> {
    let monomials: Vec<_> = samples.into_iter().map(|s| basis.monomials(&s.pose.pose)).collect();
    DMatrix::from_fn(monomials.len(), terms, |i, j| monomials[i][j])
}

/// Fits both forms (the factor form when the data are whole matrices).
///
/// # Errors
/// Poses that cannot determine the terms; a correction that is not positive somewhere in its box.
pub fn fit(training: Vec<Sample>, verification: Option<Vec<Sample>>, choice: TermChoice) -> Result<Fit> {
    let extent = PoseBox::of(training.iter().map(|s| &s.pose.pose));
    // the terms of a variable that does not vary are 0, and the rank check names them
    let (center, scale) = (extent.middle(), extent.half_widths());
    let (centre, half_width) = (core_units(center), core_units(scale));

    let (responses, has_factor) = responses(&training);
    let design_of = |terms: &[[u8; 3]]| -> Result<DMatrix<f64>> {
        let basis = Basis::<f64>::new(centre, half_width, terms).map_err(|e| Failure::other(e.to_string()))?;
        Ok(design(&basis, terms.len(), &training))
    };
    let paper_design = design_of(&EQ_11)?;
    // Eq. 12 is fitted for every choice, and Eq. 11's θσ where nine terms are asked for.
    let all_nine = choice == TermChoice::Full || has_factor;
    let needed: Vec<bool> = EQ_11.iter().map(|t| all_nine || *t != [1, 1, 0]).collect();
    refuse_rank_deficiency(&paper_design, &needed)?;

    let steps: [usize; 3] =
        std::array::from_fn(|axis| levels(training.iter().map(|s| file_units(&s.pose.pose)[axis])).len());
    let (terms, masks) = terms_of(choice, &responses, steps, design_of)?;
    let design = design_of(&terms)?;

    let mut polynomials = Vec::new();
    let mut paper_e = [[0.0; 9]; 6];
    for (row, ((name, y), used)) in responses.into_iter().zip(masks).enumerate() {
        let y = DVector::from_vec(y);
        let own = Regression::new(&design, &used, &y)?;
        let paper = Regression::new(&paper_design, &paper_mask(row), &y)?;
        if let Some(e) = paper_e.get_mut(row) {
            // the nine terms whichever were asked for, else Eq. 12's
            let nine = if choice == TermChoice::Full { &own } else { &paper };
            let mask = if choice == TermChoice::Full { [true; 9] } else { paper_mask(row) };
            *e = paper_coefficients(&spread(&nine.coefficients, &mask), center, scale);
        }
        polynomials.push(Polynomial {
            coefficients: spread(&own.coefficients, &used),
            standard_errors: spread(&own.standard_errors, &used),
            loo_rms: own.loo_rms,
            paper_loo_rms: paper.loo_rms,
            used,
            name,
        });
    }
    let (diagonal, factor) = polynomials.split_at(6);
    let flat = |rows: &[Polynomial]| rows.iter().flat_map(|p| p.coefficients.iter().copied()).collect::<Vec<_>>();
    let numbers = TableNumbers {
        centre,
        half_width,
        terms: terms.clone(),
        diagonal: flat(diagonal),
        factor: has_factor.then(|| flat(factor)),
    };

    for (name, row) in numbers.positive_rows() {
        refuse_not_positive(&name, row, &terms, (center, scale))?;
    }
    let condition = polynomials.iter().map(|p| condition(&columns(&design, &p.used))).fold(1.0, f64::max);
    Ok(Fit {
        choice,
        verification: verification.map(|given| Verification::new(given, &training)),
        training,
        center,
        scale,
        extent,
        numbers,
        uncertainty: None,
        polynomials,
        paper_e,
        condition,
    })
}

/// What a polynomial is fitted to: its name, and a value at each pose.
type Response = (String, Vec<f64>);

/// c11…c66, and the factor form's g11…g66 where the data are whole matrices, which the flag says.
fn responses(training: &[Sample]) -> (Vec<Response>, bool) {
    let mut responses: Vec<Response> =
        (0..6).map(|i| (format!("c{0}{0}", i + 1), training.iter().map(|s| s.ratios()[i]).collect())).collect();
    let entries: Option<Vec<_>> = training.iter().map(Sample::factor_entries).collect();
    if let Some(entries) = &entries {
        let names = (1..=6).flat_map(|i| (1..=i).map(move |j| format!("g{i}{j}")));
        responses.extend(names.enumerate().map(|(n, name)| (name, entries.iter().map(|e| e[n]).collect())));
    }
    (responses, entries.is_some())
}

/// Which of Eq. 11's terms the paper gives to a response.
fn paper_mask(row: usize) -> [bool; 9] {
    EQ_12.get(row).map_or([true; 9], |mask| *mask)
}

/// A table's terms, and which of them each response uses.
type Terms = (Vec<[u8; 3]>, Vec<Vec<bool>>);

fn terms_of(
    choice: TermChoice,
    responses: &[Response],
    steps: [usize; 3],
    design_of: impl Fn(&[[u8; 3]]) -> Result<DMatrix<f64>>,
) -> Result<Terms> {
    Ok(match choice {
        TermChoice::Paper => (EQ_11.to_vec(), (0..responses.len()).map(|r| paper_mask(r).to_vec()).collect()),
        TermChoice::Full => (EQ_11.to_vec(), vec![vec![true; 9]; responses.len()]),
        TermChoice::Select => {
            let candidates = candidate_terms(steps);
            let design = design_of(&candidates)?;
            let chosen: Vec<BTreeSet<usize>> = responses.iter().map(|(_, y)| select(&design, y)).collect();
            let union: Vec<usize> = chosen.iter().flatten().copied().collect::<BTreeSet<_>>().into_iter().collect();
            let masks = chosen.iter().map(|set| union.iter().map(|t| set.contains(t)).collect()).collect();
            (union.iter().map(|t| candidates[*t]).collect(), masks)
        }
    })
}

/// What `select` may pick, the constant first: products up to the fourth order (second in Z0), and single
/// powers of θ and σ to the sixth, since c66 bends faster with σ than four orders follow. Over so many steps of a variable as the poses
/// have, no higher power than passes through them: it would swing between them, where nothing tells.
fn candidate_terms(steps: [usize; 3]) -> Vec<[u8; 3]> {
    let mut terms: Vec<[u8; 3]> = (0..=2)
        .flat_map(|s| (0..=4).flat_map(move |p| (0..=4).map(move |r| [p, r, s])))
        .filter(|t| t.iter().sum::<u8>() <= 4)
        .collect();
    terms.extend([[5, 0, 0], [6, 0, 0], [0, 5, 0], [0, 6, 0]]);
    terms.retain(|t| t.iter().zip(steps).all(|(power, steps)| usize::from(*power) < steps));
    terms.sort_by_key(|t| (t.iter().sum::<u8>(), std::cmp::Reverse(*t)));
    terms
}

/// e_i1…e_i9 of Eq. 11 in ° and mm, from coefficients of its scaled terms.
fn paper_coefficients(c: &[f64], center: [f64; 3], scale: [f64; 3]) -> [f64; 9] {
    let mut e = [0.0; 9];
    for (c, term) in c.iter().zip(EQ_11) {
        // each factor ((x − centre)/scale)^n as coefficients of x⁰…xⁿ
        let powers: [Vec<f64>; 3] = std::array::from_fn(|i| {
            (0..term[i]).fold(vec![1.0], |p, _| {
                let mut next = vec![0.0; p.len() + 1];
                for (k, a) in p.iter().enumerate() {
                    next[k] -= a * center[i] / scale[i];
                    next[k + 1] += a / scale[i];
                }
                next
            })
        });
        for (j, [p, r, s]) in EQ_11.iter().enumerate() {
            let factor = |i: usize, n: &u8| powers[i].get(usize::from(*n)).copied().unwrap_or(0.0);
            e[j] += c * factor(0, p) * factor(1, r) * factor(2, s);
        }
    }
    e
}
