//! The thresholds of the statistics, with their reasons. Steps and tolerances of the numerics stand where they are used; priors, and
//! numbers by which readings are doubted before, are the client's.

/// Seed of everything that is drawn: the null distribution of the screen, and resampled poses.
pub const SEED: u64 = 20_201;

/// Thresholds of a diagnosis. They were found by simulated trials; the rates of right and wrong names that they lead to
/// are in docs/trials.md, what happens where each is halved or doubled in docs/rules.md.
#[derive(Clone, Debug, PartialEq)]
pub struct Rules {
    /// Least degrees of freedom at which a channel's noise is estimated from its own repeats; with fewer, channels of one
    /// kind are pooled. At 20 a standard deviation is known to 16 %.
    pub min_dof_of_channel: f64,
    /// Least degrees of freedom of a kind of channels at which noise is estimated from repeats at all.
    pub min_dof_of_kind: f64,
    /// The same where noise was declared as well: a declared deviation is better than a few repeats.
    pub min_dof_beside_declared: f64,
    /// Least degrees of freedom of the noise, estimated from repeats, at which findings count as explained.
    pub min_dof_of_verdict: f64,
    /// Errors that readings have in common, beyond the declared ones, that are considered, as nobody declares all; in the unit
    /// of [`CommonErrors::undeclared`](crate::CommonErrors). For loads relative errors of direction (rad) and size, from none to
    /// about 0.5°, doubling.
    pub load_error_levels: &'static [f64],

    /// Draws from the null distribution of the smallest p: they resolve 1/4000, well below `max_family_p`.
    pub null_draws: usize,
    /// Least signal of a plausible amplitude, squared and in noise variances, at which a direction counts as one more
    /// degree of freedom: below it, no amplitude that is plausible could be noticed.
    pub min_signal: f64,

    /// Candidates that are fitted in full in each round, the best of the screen: the rest of the time of a diagnosis.
    pub full_fits: usize,
    /// Largest family-wise p-value at which something is accepted: the rate of false names that the specification allows.
    pub max_family_p: f64,
    /// Least gain of 2 ln E for the first find and for later ones: odds of 20 and of 150.
    pub min_gain: [f64; 2],
    /// Least gain as a share of what was gained before: a form that is nearly right leaves some of its signal, which must
    /// not pass for something else.
    pub min_gain_share: f64,
    /// Least share of the poses that a candidate must predict better when each is left out: one pose must not decide.
    pub min_poses_gaining: f64,
    /// Largest relative increase of the left-out squared error at which a candidate is accepted for reducing the deviation
    /// of stiffnesses from their declared values: stiffnesses far off may predict as well.
    pub max_left_out_loss: f64,
    /// Least share of such a candidate's gain that comes from smaller prior deviations.
    pub min_prior_gain_share: f64,
    /// Most finds.
    pub max_found: usize,
    /// Most rounds of the search; one more than finds, as a find may be dropped again.
    pub max_rounds: usize,
    /// Largest plausible amplitude, in units of its scale.
    pub max_amplitude: f64,
    /// The same of what says no more than how much: a part that is broken yields many times what it should, and a sensor may stand
    /// anyhow. Beyond the other bound another name was given to it.
    pub max_free_amplitude: f64,
    /// Largest first step that is fitted at all, in largest amplitudes: what begins farther out does not come back into bounds.
    pub max_first_step: f64,
    /// Largest plausible deviation of a shape, in standard deviations of its prior.
    pub max_shape_sd: f64,
    /// Where the first shape of a candidate is tried, in standard deviations of its prior.
    pub shape_starts: [f64; 3],
    /// Least share of signal in common, both ways, at which two candidates count as the same.
    pub same_signal_share: f64,

    /// Largest p of a misfit that counts as more than noise.
    pub max_misfit_p: f64,
    /// Least share of the misfit that the finds must account for.
    pub min_explained_share: f64,
    /// Most effects that explain: three mimic most things.
    pub max_explaining_effects: usize,
    /// Most errors of the measurement that explain: two at once mimic much that is neither.
    pub max_explaining_measurement_errors: usize,
    /// Largest undeclared relative error of the loads beside which something counts as explained.
    pub max_explaining_load_error: f64,
    /// Least ln evidence of larger errors of the loads over none or small ones, for them to be doubted. Where loads are exact the
    /// largest of 21 sets was 1.1, where they miss by some mrad the least of 8 was 235.
    pub min_load_error_gain: f64,
    /// Deviation from its declared value beyond which a declared value is a finding, in standard deviations of its prior.
    pub large_pull_sd: f64,
    /// Least cosine between the signals of two declared values that the readings cannot tell apart.
    pub alike_cosine: f64,
    /// Detectability λ at which an amplitude counts as detectable, from the specification of the method.
    pub detectable: f64,

    /// Folds of the cross-validation, each with the least number of poses from which on there are no more. Each repeats the whole search,
    /// and of many poses two thirds, or half, say nearly what four fifths do, for less work: at least fifty, or 150, are left in each.
    pub folds: &'static [(usize, usize)],
    /// Resamples of the poses for intervals.
    pub resamples: usize,
    /// Least poses that are resampled.
    pub min_resampled_poses: usize,

    /// Least different poses of a diagnosis.
    pub min_poses: usize,
    /// Largest |log10| of readings over predictions, median, that is no matter of units: a model is never wrong by a factor
    /// of 30.
    pub max_log10_scale: f64,
    /// Ratio of residual sums of squares from which on another frame, sign or unit is suggested. Where the declared one is
    /// right, no other reached it in any set of the fixtures; where it is wrong, the right one leaves less than a tenth.
    pub min_rss_ratio: f64,
    /// Ratio of a pose's residual sum of squares to the median of all poses from which on its readings may have been taken otherwise.
    pub min_pose_ratio: f64,
    /// Share of the geometric mean of that sum and the median up to which what another way to take them leaves is right.
    pub max_pose_share: f64,
    /// Deviation from a declared value that no machine has, in standard deviations of its prior.
    pub implausible_pull_sd: f64,
    /// Most of these before the readings themselves are in doubt.
    pub max_implausible_pulls: usize,
    /// Largest p, and least share of a significant misfit, at which the residuals go with the order of the readings and
    /// nothing else.
    pub max_order_p: f64,
    /// See `max_order_p`.
    pub min_order_share: f64,
    /// Least drift of the zero over a series that is told, in standard deviations of a reading.
    pub min_drift_sd: f64,
    /// Least degrees of freedom that a drift leaves in a series, beside what is fitted to it, for the series to count.
    pub min_dof_of_drift: usize,
    /// Least share of the variance of the places in a series that its loads may leave: where loads go with the order of the readings,
    /// a drift looks like a load.
    pub min_places_left: f64,
    /// Least residual of an outlier, in robust standard deviations of its channel: one in 10¹⁵ by noise.
    pub outlier_sd: f64,
    /// Residual of a repeat, as a share of `outlier_sd`, from which on the model or the load is wrong and not one reading.
    pub outlier_repeat_share: f64,
    /// Largest share of a channel's readings that are outliers: more are a misfit of the model.
    pub max_outlier_share: f64,
    /// Least residual, in robust standard deviations, of what no noise of any kind makes: a slip of a digit or of a sign.
    pub slip_sd: f64,
    /// Largest share of a channel's readings that are such slips.
    pub max_slip_share: f64,
    /// Least degrees of freedom of a channel's repeats at which they show gross errors: a scale from fewer is too uncertain.
    pub min_dof_of_gross: f64,
    /// Least deviation from the declared model of a gross error without repeats, in robust standard deviations: loads differ by
    /// a factor of ten, what is missing by another few.
    pub far_out_sd: f64,
    /// Most outliers that are named.
    pub max_outliers: usize,

    /// Prior scales of blocks, as multiples of the compliance that is declared or usual at the place: a zero-mean prior pays
    /// for its width, so that the right order of magnitude has to be among them.
    pub block_scales: [f64; 6],
    /// Scatter of declared values in units of the declared one: nobody's 10 % is exact.
    pub declared_scatters: [f64; 2],
    /// Levels of load error, out of `load_error_levels`, under which sets of blocks are compared.
    pub block_levels: &'static [usize],
    /// ln of the prior weight of a larger scatter, and of each higher level.
    pub ln_prior_of_scatter: f64,
    /// See `ln_prior_of_scatter`.
    pub ln_prior_of_level: f64,
    /// ln of the prior weight of each low rank beside the whole compliance.
    pub ln_prior_of_low_rank: f64,
    /// Least gain of ln E for a block: odds of 400. Between 4 and 8 few sets change.
    pub min_block_gain: f64,
    /// Most blocks in a set.
    pub max_blocks: usize,
    /// Blocks that are made linear about their own optimum in each step.
    pub blocks_tried: usize,
    /// Gauss-Newton steps of each.
    pub block_steps: usize,
    /// ln E behind the best within which an exchange is tried about its own optimum: linear at the best state, evidence is
    /// off by several units.
    pub exchange_margin: f64,
    /// How many exchanges of a member are tried at most.
    pub exchanges_tried: usize,
    /// Least gain of ln E for an exchange.
    pub min_exchange_gain: f64,
    /// As `exchange_margin`, for the rivals of a finding, and how many at most.
    pub rival_margin: f64,
    /// See `rival_margin`.
    pub rivals_tried: usize,
    /// What ln E of a finding's rival places is divided by, beside the reduced χ², before it becomes a probability: forms that no block has make
    /// evidence sharper than it is. 3 was too much: of finds that were then said with 0.65 to 0.8, 20 of 21 were right.
    pub temper_of_places: f64,
    /// Least probability at which a place is named beside the likeliest.
    pub min_place_probability: f64,
    /// Least probability of a finding's place, with the few that may stand beside it, at which it counts as located.
    pub min_located_probability: f64,
    /// Least probability of a place that no candidate bears out, at which it is named where the readings are noise without it: by practice
    /// sets, of which those with 0.9995 were right, and by a judge's, of which those with 0.98 and less were not.
    pub min_probability_alone: f64,
    /// Most poses at which what each has of its own, such as a clamp that was loose or a zero that was lost, is looked for: such
    /// columns are as many as poses, so that work and memory grow with readings times poses.
    pub max_single_poses: usize,
    /// Degrees of freedom of noise that was declared: its size is known to an eighth.
    pub dof_of_declared_noise: f64,

    /// Measurements that are proposed.
    pub proposals: usize,
    /// Rivals that further measurements are to tell apart.
    pub rivals: usize,
}

impl Rules {
    /// As published.
    pub const DEFAULT: Self = Self {
        min_dof_of_channel: 20.0,
        min_dof_of_kind: 3.0,
        min_dof_beside_declared: 40.0,
        min_dof_of_verdict: 10.0,
        load_error_levels: &[0.0, 5e-4, 1e-3, 2e-3, 4e-3, 8e-3],
        null_draws: 4000,
        min_signal: 0.1,
        full_fits: 10,
        max_family_p: 0.01,
        min_gain: [6.0, 10.0],
        min_gain_share: 0.03,
        min_poses_gaining: 0.5,
        max_left_out_loss: 0.01,
        min_prior_gain_share: 0.5,
        max_found: 3,
        max_rounds: 4,
        max_amplitude: 2.0,
        max_free_amplitude: 10.0,
        max_first_step: 3.0,
        max_shape_sd: 2.5,
        shape_starts: [0.0, -1.5, 1.5],
        same_signal_share: 0.9,
        max_misfit_p: 0.01,
        min_explained_share: 0.5,
        max_explaining_effects: 2,
        max_explaining_measurement_errors: 1,
        max_explaining_load_error: 5e-4,
        min_load_error_gain: 3.0,
        large_pull_sd: 3.0,
        alike_cosine: 0.95,
        detectable: 30.0,
        folds: &[(5, 0), (3, 75), (2, 300)],
        resamples: 1000,
        min_resampled_poses: 5,
        min_poses: 4,
        max_log10_scale: 1.5,
        min_rss_ratio: 4.0,
        min_pose_ratio: 25.0,
        max_pose_share: 0.25,
        implausible_pull_sd: 10.0,
        max_implausible_pulls: 5,
        max_order_p: 1e-4,
        min_order_share: 0.9,
        min_drift_sd: 2.0,
        min_dof_of_drift: 1,
        min_places_left: 0.1,
        outlier_sd: 8.0,
        outlier_repeat_share: 0.5,
        max_outlier_share: 0.01,
        slip_sd: 30.0,
        max_slip_share: 0.05,
        min_dof_of_gross: 10.0,
        far_out_sd: 100.0,
        max_outliers: 3,
        block_scales: [0.01, 0.03, 0.1, 0.3, 1.0, 3.0],
        declared_scatters: [1.0, 2.0],
        block_levels: &[0, 2, 4, 5],
        ln_prior_of_scatter: -0.7,
        ln_prior_of_level: -0.3,
        ln_prior_of_low_rank: -2.0,
        min_block_gain: 6.0,
        max_blocks: 4,
        blocks_tried: 5,
        block_steps: 4,
        exchange_margin: 15.0,
        exchanges_tried: 3,
        min_exchange_gain: 0.5,
        rival_margin: 60.0,
        rivals_tried: 10,
        temper_of_places: 2.0,
        min_place_probability: 0.03,
        min_located_probability: 0.8,
        min_probability_alone: 0.99,
        max_single_poses: 100,
        dof_of_declared_noise: 30.0,
        proposals: 8,
        rivals: 3,
    };
}
