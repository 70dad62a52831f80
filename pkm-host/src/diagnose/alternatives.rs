//! Sets of findings that the readings leave possible.

use pkm_diagnosis::Search;
use pkm_diagnosis::places::{Inferred, NOWHERE, Rival};

use super::model::Model;
use super::places::World;
use super::places::sites::{self, Site};

/// Most sets that are told.
const MAX_TOLD: usize = 10;

/// Sets that are carried from one finding to the next.
const MAX_KEPT: usize = 1000;

/// What a finding that is not borne out, and what gains too little to be one, is worth of what the readings say.
const SHARE_IF_NOT_FOUND: f64 = 0.5;

/// What may be true of a finding: what it is called, none if nothing is there, and the probability.
type Outcome = (Option<String>, f64);

/// Sets of findings as `place: law`, the likeliest first, each finding at one of its places or not there, whatever the others are. A finding
/// that is named holds all places of its class. Sets with what goes with no place are none of these.
pub fn alternatives(
    (world, inferred): &(World, Inferred),
    model: &Model,
    search: &Search,
    sites: &[Site],
    is_found: &[bool],
) -> Vec<(Vec<String>, f64)> {
    let text = |place: &str, law: &str| format!("{place}: {law}");
    let called = |rival: &Rival| {
        let place = rival.places.first().map_or(NOWHERE, String::as_str);
        if place == NOWHERE { place.to_owned() } else { text(place, world.block(rival.block).law) }
    };
    let named = sites::named_at(sites, search);
    let of_finding = |at: usize| {
        let (site, share) = (&sites[at], if is_found[at] { 1.0 } else { SHARE_IF_NOT_FOUND });
        let is_elsewhere = |r: &&Rival| !r.places.iter().any(|p| *p == site.place || site.place_class.contains(p));
        let rivals = inferred.findings[at].rivals.iter().filter(is_elsewhere);
        let all = rivals.map(|r| (called(r), r.probability));
        let own = named[at].map_or_else(|| site.clone(), |n| site.named(model, search.found[n].candidate));
        let own = if own.place == NOWHERE { own.place } else { text(&own.place, own.law) };
        outcomes(all.chain([(own, site.probability)]), share)
    };
    let refused = inferred.refused.iter().map(|r| (called(r), r.probability));
    let findings = (0..sites.len()).map(of_finding).chain([outcomes(refused, SHARE_IF_NOT_FOUND)]);
    let mut sets = vec![(Vec::new(), 1.0)];
    for finding in findings {
        sets = with(&sets, &finding);
    }
    sets.retain(|(names, _)| names.iter().all(|name| name != NOWHERE));
    sets.truncate(MAX_TOLD);
    sets
}

/// All that may be true of a finding, of whose own a share counts; the rest is that nothing is there.
fn outcomes(own: impl Iterator<Item = (String, f64)>, share: f64) -> Vec<Outcome> {
    let mut all: Vec<Outcome> = own.map(|(name, p)| (Some(name), share * p)).collect();
    let there: f64 = all.iter().map(|o| o.1).sum();
    all.push((None, (1.0 - there).max(0.0)));
    all
}

/// Sets with one more finding, each once, the likeliest first.
fn with(sets: &[(Vec<String>, f64)], finding: &[Outcome]) -> Vec<(Vec<String>, f64)> {
    let mut all: Vec<(Vec<String>, f64)> = Vec::new();
    for (names, p) in sets {
        for (name, q) in finding.iter().filter(|o| o.1 > 0.0) {
            let mut names = names.clone();
            names.extend(name.clone());
            names.sort();
            names.dedup();
            match all.iter_mut().find(|a| a.0 == names) {
                Some(there) => there.1 += p * q,
                None => all.push((names, p * q)),
            }
        }
    }
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    all.truncate(MAX_KEPT);
    all
}
