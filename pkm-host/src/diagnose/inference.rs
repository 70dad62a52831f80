//! The search for what the model lacks, in all readings or in those that a fold of a cross-validation keeps.

use pkm_diagnosis::places::{Inferred, NOWHERE};
use pkm_diagnosis::{
    Fit, ForwardModel, Levels, Noise, Observations, Problem, Rules, Search, Whitener, levels, rounding, search, verdict,
};

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

/// Fits of stiffnesses to what readings in coarse steps say near the last ones.
const REFITS: usize = 10;

/// Where a search ended.
pub struct Found<'a> {
    /// With what blocks found among the candidates of its model.
    pub experiment: &'a Experiment<'a>,
    /// Beside disturbances of the readings, if any were found.
    pub levels: &'a Levels<'a>,
    /// Of what was searched.
    pub noise: &'a Noise,
    /// What was tried and found.
    pub search: Search,
    /// Re-identified stiffnesses and nothing else, from readings as they are, where those of `search` are beside disturbances.
    pub reidentified: Option<Fit>,
    /// Places of what was found.
    pub sites: &'a [Site],
    /// What was inferred of places, if that is the method.
    pub inferred: Option<&'a (World, Inferred)>,
}

/// What is done with the end of a search.
type Then<'a> = dyn FnMut(Found<'_>) + 'a;

impl Start<'_> {
    /// Searches some readings; `then` makes of it what outlives the search. `None` where a fit does not converge.
    pub fn search<R>(&self, readings: &Readings, read: &Observations, then: impl FnOnce(Found<'_>) -> R) -> Option<R> {
        let (mut then, mut made) = (Some(then), None);
        self.search_into(readings, read, &mut |found| made = then.take().map(|then| then(found)))?;
        made
    }

    /// Searches readings. For those in coarse steps pseudo-observations stand in: first those near re-identified stiffnesses, then those near
    /// what was found in these.
    fn search_into(&self, readings: &Readings, read: &Observations, then: &mut Then<'_>) -> Option<()> {
        if rounding::coarse(read, self.noise).is_empty() {
            return self.once(readings, read, self.noise, then);
        }
        let (first, noise) = self.near_stiffnesses(readings, read)?;
        let mut said = None;
        self.once(readings, &first, &noise, &mut |found| {
            said = found.levels.expected(&found.search.fit, found.search.levels[1]);
        })?;
        let (second, noise) = rounding::unrounded(read, self.noise, &said?)?;
        self.once(readings, &second, &noise, then)
    }

    /// Pseudo-observations of readings in coarse steps near the stiffnesses that are re-identified by them.
    fn near_stiffnesses(&self, readings: &Readings, read: &Observations) -> Option<(Observations, Noise)> {
        let experiment = Experiment::new(self.model, readings);
        let declared = experiment.declared();
        let (mut x, mut level) = (vec![0.0; declared.len()], 0);
        let mut near = rounding::unrounded(read, self.noise, &experiment.predict(&declared, &x)?)?;
        for _ in 0..REFITS {
            let whitener = Whitener::new(&near.0, &near.1);
            let plain = Problem::new(&near.0, &whitener, &experiment, self.rules);
            let whiteners = levels::whiteners(&plain);
            let levels = Levels::new(&plain, &whiteners);
            let (at, fit) = levels.fit(&declared, &x, level)?;
            near = rounding::unrounded(read, self.noise, &levels.expected(&fit, at)?)?;
            (x, level) = (fit.x.as_slice().to_vec(), at);
        }
        Some(near)
    }

    /// Searches observations as they are.
    fn once(&self, readings: &Readings, read: &Observations, noise: &Noise, then: &mut Then<'_>) -> Option<()> {
        let whitener = Whitener::new(read, noise);
        let experiment = Experiment::new(self.model, readings);
        let plain = Problem::new(read, &whitener, &experiment, self.rules);
        let whiteners = levels::whiteners(&plain);
        let levels = Levels::new(&plain, &whiteners);
        let inferred = match self.method {
            Method::Formulas => None,
            Method::Places => Some(places::infer(&levels, noise, self.model, readings)?),
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
        let (levels, search, reidentified) = match beside {
            Some((beside, found)) => {
                let reidentified = verdict::settled_fit(&levels, noise, search.base, search.levels[0], false)?;
                (beside, found, Some(reidentified))
            }
            None => (levels, search, None),
        };
        let inferred = inferred.as_ref();
        then(Found { experiment: &experiment, levels: &levels, noise, search, reidentified, sites: &sites, inferred });
        Some(())
    }
}

/// Which sites are findings: all but those in the machine for which no formula and no element was found, where what is left of the readings
/// is noise. Then nothing but their own blocks asks for them, which must be surer than elsewhere.
pub fn borne_out(sites: &[Site], search: &Search, is_noise: bool, rules: &Rules) -> Vec<bool> {
    let named = sites::named_at(sites, search);
    let is_sure = |site: &Site| site.is_disturbance() || site.probability >= rules.min_probability_alone;
    sites.iter().zip(named).map(|(site, named)| !is_noise || named.is_some() || is_sure(site)).collect()
}

/// Where something was found, by a formula or as a place alone, the end with the values that predict best ([`verdict::settled`]).
/// Where nothing was, what is left of the readings may well be errors of the loads.
pub fn settled(levels: &Levels<'_>, noise: &Noise, sites: &[Site], search: Search) -> Option<Search> {
    let is_found = !search.found.is_empty() || sites.iter().any(|site| site.place != NOWHERE);
    if is_found { verdict::settled(levels, noise, search) } else { Some(search) }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use pkm_diagnosis::search::Found;

    use super::*;

    #[test]
    fn a_place_in_the_machine_needs_a_formula_a_misfit_or_to_be_sure() {
        let site = |place: &str, candidate: usize, probability: f64| Site {
            place: place.into(),
            place_class: Vec::new(),
            motion: "general",
            law: "constant",
            probability,
            candidates: vec![candidate],
            columns: DMatrix::zeros(0, 0),
        };
        let sites =
            [site("base", 3, 0.95), site("tool", 4, 0.9), site("sensor", 5, 0.9), site("moving_platform", 6, 0.995)];
        let fit = || Fit::new(Vec::new(), DVector::zeros(0), DVector::zeros(1), DMatrix::zeros(1, 0), 0.0).unwrap();
        let found = vec![Found { candidate: 4, class: Vec::new(), confidence: 1.0 }];
        let search = Search { base: fit(), fit: fit(), levels: [0; 2], found, steps: Vec::new(), rounds: Vec::new() };
        let places = |is_noise| {
            let is_found = borne_out(&sites, &search, is_noise, &Rules::DEFAULT);
            sites.iter().zip(is_found).filter(|s| s.1).map(|s| s.0.place.as_str()).collect::<Vec<_>>()
        };
        assert_eq!(places(true), ["tool", "sensor", "moving_platform"]);
        assert_eq!(places(false), ["base", "tool", "sensor", "moving_platform"]);
    }
}
