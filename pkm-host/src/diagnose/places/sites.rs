//! Findings of the inference as sites: what each may be called, and where it is.

use nalgebra::DMatrix;
use pkm_core::effects::Place;
use pkm_diagnosis::places::{Inferred, NOWHERE, Rival};
use pkm_diagnosis::{Kind, Rules, Search};

use super::ties::TIED;
use super::{World, named};
use crate::diagnose::model::Model;

/// A place where the readings ask for more than the declared model.
#[derive(Clone, Debug)]
pub struct Site {
    /// The likeliest place.
    pub place: String,
    /// Places that the readings cannot tell apart from it.
    pub place_class: Vec<String>,
    /// In which direction it gives.
    pub motion: &'static str,
    /// What it depends on.
    pub law: &'static str,
    /// Probability that it is at the place or one of its class, the other findings given.
    pub probability: f64,
    /// Candidates of the model that would explain it.
    pub candidates: Vec<usize>,
    /// What it may do to the readings: whitened columns of one prior standard deviation.
    pub columns: DMatrix<f64>,
}

impl Site {
    /// Whether it disturbs the readings and is no part of the machine: what comes and goes by pose may be the sensor, or is a part that yields
    /// at other poses as well.
    pub fn is_disturbance(&self) -> bool {
        let may_be_the_sensor = || self.place_class.iter().any(|place| place == "sensor");
        matches!(self.place.as_str(), "sensor" | "load" | "time" | NOWHERE)
            || self.law == "time"
            || self.law == "pose" && may_be_the_sensor()
    }

    /// The same, first of all where a candidate that explains it acts, and as it acts: the formula says more than the block that found it.
    pub fn named(&self, model: &Model, candidate: usize) -> Self {
        let formula = named::place_of(model, candidate);
        let mut all: Vec<String> = Vec::new();
        for place in formula.places.iter().chain([&self.place]).chain(&self.place_class) {
            if !all.contains(place) {
                all.push(place.clone());
            }
        }
        all.truncate(1 + self.place_class.len().max(MAX_CLASS));
        let place = all.remove(0);
        Self { place, place_class: all, motion: formula.motion, law: formula.law, ..self.clone() }
    }
}

/// Most places that a finding may name beside the likeliest: what has a longer list is not located.
pub const MAX_CLASS: usize = 3;

/// Whether a place is in one of the limbs, of which several may act alike.
fn is_of_limb(place: &str) -> bool {
    matches!(Place::from_name(place), Some(Place::BaseJoint { .. } | Place::Body { .. } | Place::PlatformJoint { .. }))
}

/// Laws that one and the same physics may be taken for.
pub fn family(law: &str) -> &str {
    match law {
        "constant" | "extension" | "periodic" => "compliance",
        "load" | "direction" => "load",
        other => other,
    }
}

/// Probability of what is at one of some places at least, and at none of others.
fn probability_of(rivals: &[Rival], some: &[String], others: &[String]) -> f64 {
    let is_there = |names: &[String], among: &[String]| names.iter().any(|place| among.contains(place));
    let is_one = |r: &&Rival| is_there(&r.places, some) && !is_there(&r.places, others);
    rivals.iter().filter(is_one).map(|r| r.probability).sum()
}

/// What holds a limb's joint, and where it does yields with it: no deflection at the tool tells a joint from its seat.
pub fn seat(place: &str) -> Option<String> {
    let seat = match Place::from_name(place)? {
        Place::BaseJoint { .. } => Place::Base,
        Place::PlatformJoint { .. } => Place::MovingPlatform,
        _ => return None,
    };
    seat.name().map(str::to_owned)
}

/// The places that a finding names.
struct Named<'a> {
    rivals: &'a [Rival],
    names: Vec<String>,
}

impl Named<'_> {
    /// Adds some that are not there yet, as long as there is room.
    fn add(&mut self, places: impl IntoIterator<Item = String>) {
        for place in places {
            if self.names.len() <= MAX_CLASS && !self.names.contains(&place) {
                self.names.push(place);
            }
        }
    }

    /// Of some places the one that holds most of what is at none of `named`, and how much; the first of several.
    fn likeliest(&self, places: &[String], named: &[String]) -> Option<(String, f64)> {
        let with = places.iter().map(|p| (p.clone(), probability_of(self.rivals, std::slice::from_ref(p), named)));
        with.reduce(|best, next| if next.1 > best.1 { next } else { best })
    }
}

/// The places that a finding names, `1 + MAX_CLASS` at the most: its block's own two, of several limbs the likeliest, and its seat; those that
/// hold most of what is at none of these; the seats of these; what else is likely. What so few do not hold is not located: then all are named
/// that it takes.
fn named_places(own: &[String], rivals: &[Rival], rules: &Rules) -> Vec<String> {
    let mut named = Named { rivals, names: Vec::new() };
    if own.first().is_some_and(|place| is_of_limb(place)) {
        named.add(named.likeliest(own, &[]).map(|l| l.0));
    } else {
        // the second of two, such as the joint whose axes are turned
        named.add(own.iter().take(2).cloned());
    }
    if let [only] = own {
        named.add(seat(only));
    }
    let mut places: Vec<String> = rivals.iter().flat_map(|r| r.places.clone()).collect();
    let share = |place: &String| probability_of(rivals, std::slice::from_ref(place), &[]);
    places.sort_by(|a, b| share(b).total_cmp(&share(a)));
    places.dedup();
    while let Some((place, p)) = named.likeliest(&places, &named.names)
        && p >= rules.min_place_probability
        && named.names.len() <= MAX_CLASS
    {
        named.add([place]);
    }
    named.add(named.names.clone().iter().filter_map(|place| seat(place)));
    named.add(places.iter().filter(|place| share(place) >= rules.min_place_probability).cloned());
    while probability_of(rivals, &named.names, &[]) < rules.min_located_probability
        && let Some((place, p)) = named.likeliest(&places, &named.names)
        && p > 0.0
    {
        named.names.push(place);
    }
    named.names
}

/// The sites of an inference. Where it found nothing a declared value may still be wrong: that is one site without a place.
pub fn sites(world: &World, inferred: &Inferred, model: &Model, rules: &Rules) -> Vec<Site> {
    let of = |f: &pkm_diagnosis::places::Finding| {
        let block = world.block(f.block);
        let all = named_places(&block.places, &f.rivals, rules);
        // formulas where evidence itself puts it: these become the model, and no place that is merely possible may
        let top = f.rivals.first().map_or(1.0, |r| r.probability);
        let is_near = |place: &String| {
            let share = |r: &Rival| (r.probability / top).powf(f.temper);
            let is_likely = |r: &Rival| r.places.first() == Some(place) && share(r) >= rules.min_place_probability;
            block.places.contains(place) || f.rivals.iter().any(is_likely)
        };
        let is_there = |c: &usize| {
            let w = named::place_of(model, *c);
            // what is beside the mechanism is no formula of something in it
            let is_alike = family(w.law) == family(block.law) && (w.motion == TIED) == (block.motion == TIED);
            is_alike && w.places.first().is_some_and(is_near)
        };
        let candidates = (0..model.candidates.len()).filter(is_there).collect();
        Site {
            place: all.first().cloned().unwrap_or_else(|| NOWHERE.into()),
            probability: probability_of(&f.rivals, &all, &[]),
            motion: block.motion,
            law: block.law,
            candidates,
            place_class: all.into_iter().skip(1).collect(),
            columns: f.columns.clone(),
        }
    };
    inferred.findings.iter().map(of).collect()
}

/// What disturbs the readings and has no formula, beside which the machine is identified: whitened columns of one standard
/// deviation.
pub fn disturbances(sites: &[Site], search: &Search) -> Option<DMatrix<f64>> {
    let named = named_at(sites, search);
    let without = sites.iter().zip(named).filter(|(site, named)| named.is_none() && site.is_disturbance());
    let columns: Vec<_> = without.flat_map(|(site, _)| site.columns.column_iter()).collect();
    (!columns.is_empty()).then(|| DMatrix::from_columns(&columns))
}

/// The finds of a search that no inference preceded, where their formulas have them.
pub fn of_search(model: &Model, search: &Search) -> Vec<Site> {
    let of = |found: &pkm_diagnosis::search::Found| {
        let w = named::place_of(model, found.candidate);
        Site {
            place: w.places.first().cloned().unwrap_or_else(|| NOWHERE.into()),
            place_class: w.places.into_iter().skip(1).collect(),
            motion: w.motion,
            law: w.law,
            probability: found.confidence,
            candidates: vec![found.candidate],
            columns: DMatrix::zeros(0, 0),
        }
    };
    search.found.iter().map(of).collect()
}

/// What the search by formulas may name: one candidate a site, and where there is no site at all a wrong declared value.
pub fn permitted(sites: &[Site], model: &Model) -> Vec<Vec<usize>> {
    if sites.is_empty() {
        let declared = |c: &usize| model.candidates[*c].kind == Kind::DeclaredValues;
        return vec![(0..model.candidates.len()).filter(declared).collect()];
    }
    sites.iter().map(|s| s.candidates.clone()).collect()
}

/// The find of the search at each site, by its place in the search; none where no formula explains what is there.
pub fn named_at(sites: &[Site], search: &Search) -> Vec<Option<usize>> {
    let mut at = vec![None; sites.len()];
    for (n, found) in search.found.iter().enumerate() {
        let free = (0..sites.len()).find(|s| at[*s].is_none() && sites[*s].candidates.contains(&found.candidate));
        if let Some(site) = free {
            at[site] = Some(n);
        }
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(own: &[&str], places: &[(&str, f64)]) -> Vec<String> {
        let list = |names: &str| names.split('+').map(str::to_owned).collect::<Vec<String>>();
        let own: Vec<String> = own.iter().map(|p| (*p).to_owned()).collect();
        let rival = |(names, share): &(&str, f64)| Rival { block: 0, places: list(names), probability: *share };
        let rivals: Vec<Rival> = places.iter().map(rival).collect();
        named_places(&own, &rivals, &Rules::DEFAULT)
    }

    #[test]
    fn a_finding_names_four_places_or_as_many_as_hold_it() {
        let sure = [("tool+moving_platform", 0.97), ("base", 0.02), ("sensor", 0.01)];
        assert_eq!(named(&["tool", "moving_platform"], &sure), ["tool", "moving_platform"]);
        let spread = [("base", 0.5), ("tool", 0.2), ("load", 0.11), ("sensor", 0.1), ("geometry", 0.09)];
        assert_eq!(named(&["base"], &spread), ["base", "tool", "load", "sensor"]);
        // a place of the block's own stands before a likelier rival
        let own = [("base+limb.1.body", 0.5), ("tool", 0.2), ("load", 0.11), ("sensor", 0.1), ("geometry", 0.09)];
        assert_eq!(named(&["base", "limb.1.body"], &own), ["base", "limb.1.body", "tool", "load"]);
        // a joint may be its seat
        let joint = [("limb.3.base_joint", 0.9), ("limb.3.body", 0.1)];
        assert_eq!(named(&["limb.3.base_joint"], &joint), ["limb.3.base_joint", "base", "limb.3.body"]);
        let joint = [("limb.1.platform_joint", 1.0)];
        assert_eq!(named(&["limb.1.platform_joint"], &joint), ["limb.1.platform_joint", "moving_platform"]);
        // all limbs alike are held by the one that may be alone
        let bodies = ["limb.1.body", "limb.2.body", "limb.3.body"];
        let limbs = [
            ("limb.1.body+limb.2.body+limb.3.body", 0.4),
            ("limb.3.platform_joint", 0.25),
            ("limb.3.body", 0.2),
            ("limb.3.base_joint", 0.15),
        ];
        let all = ["limb.3.body", "limb.3.platform_joint", "limb.3.base_joint", "moving_platform"];
        assert_eq!(named(&bodies, &limbs), all);
        // and the others are named where there is room
        let two = [("limb.1.body+limb.2.body", 0.6), ("limb.2.body", 0.4)];
        assert_eq!(named(&["limb.1.body", "limb.2.body"], &two), ["limb.2.body", "limb.1.body"]);
        let wide =
            [("base", 0.4), ("tool", 0.15), ("load", 0.12), ("sensor", 0.11), ("geometry", 0.11), ("time", 0.11)];
        assert_eq!(named(&["base"], &wide), ["base", "tool", "load", "sensor", "geometry"]);
    }
}
