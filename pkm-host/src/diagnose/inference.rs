//! The search for what the model lacks, in all readings or in those that a fold of a cross-validation keeps.

use pkm_diagnosis::places::{Inferred, NOWHERE};
use pkm_diagnosis::{Levels, Noise, Observations, Problem, Rules, Search, Whitener, levels, search, verdict};

use super::Method;
use super::experiment::Experiment;
use super::model::Model;
use super::places::sites::{self, Site};
use super::places::{self, World};
use crate::files::readings::Readings;

/// What every search of one diagnosis begins with.
pub struct Start<'a> {
    /// With its formulas as candidates.
    pub model: &'a Model,
    /// Of the readings.
    pub noise: &'a Noise,
    /// How to search.
    pub method: Method,
    /// Whether the readings are in the units and the frame that they are said to be in.
    pub taken_as_said: bool,
    /// What decides.
    pub rules: &'a Rules,
}

/// Where a search ended.
pub struct Found<'a> {
    /// With what blocks found among the candidates of its model.
    pub experiment: &'a Experiment<'a>,
    /// Beside disturbances of the readings, if any were found.
    pub levels: &'a Levels<'a>,
    /// What was tried and found.
    pub search: Search,
    /// Places of what was found.
    pub sites: &'a [Site],
    /// What was inferred of places, if that is the method.
    pub inferred: Option<&'a (World, Inferred)>,
}

impl Start<'_> {
    /// Searches some readings; `then` makes of it what outlives the search. `None` where a fit does not converge.
    pub fn search<R>(&self, readings: &Readings, read: &Observations, then: impl FnOnce(Found<'_>) -> R) -> Option<R> {
        let whitener = Whitener::new(read, self.noise);
        let experiment = Experiment::new(self.model, readings);
        let plain = Problem::new(read, &whitener, &experiment, self.rules);
        let whiteners = levels::whiteners(&plain);
        let levels = Levels::new(&plain, &whiteners);
        let inferred = match self.method {
            Method::Formulas => None,
            Method::Places => Some(places::infer(&levels, self.noise, self.model, readings)?),
        };
        // what a block found is a candidate with the block's own directions
        let mut model = self.model.clone();
        let found = inferred.iter().flat_map(|(world, i)| i.findings.iter().flat_map(|f| world.elements(f)));
        found.for_each(|family| model.add_family(family));
        let experiment = Experiment::new(&model, readings);
        let plain = Problem::new(read, &whitener, &experiment, self.rules);
        let levels = Levels::new(&plain, &whiteners);
        let sites = inferred.as_ref().map(|(world, inferred)| sites::sites(world, inferred, &model, self.rules));
        let permitted = sites.as_ref().map(|sites| sites::permitted(sites, &model));
        let search = search::search(&levels, permitted.as_deref())?;
        let sites = sites.unwrap_or_else(|| sites::of_search(&model, &search));
        // readings in another unit or frame are no readings that something disturbs
        let disturbances = self.taken_as_said.then(|| sites::disturbances(&sites, &search)).flatten();
        let disturbed = disturbances.as_ref().map(|columns| levels::disturbed(&whiteners, columns));
        let beside = disturbed.as_ref().and_then(|whiteners| {
            let levels = Levels::new(&plain, whiteners);
            let search = search::search(&levels, permitted.as_deref())?;
            Some((levels, search))
        });
        // a fit that fails beside disturbances stays what it is without them
        let (levels, search) = beside.unwrap_or((levels, search));
        let inferred = inferred.as_ref();
        Some(then(Found { experiment: &experiment, levels: &levels, search, sites: &sites, inferred }))
    }
}

/// Where something was found, by a formula or as a place alone, the end with the values that predict best ([`verdict::settled`]).
/// Where nothing was, what is left of the readings may well be errors of the loads.
pub fn settled(levels: &Levels<'_>, noise: &Noise, sites: &[Site], search: Search) -> Option<Search> {
    let is_found = !search.found.is_empty() || sites.iter().any(|site| site.place != NOWHERE);
    if is_found { verdict::settled(levels, noise, search) } else { Some(search) }
}
