//! Findings as effects with their places, and the sets that they were compared with.

use pkm_diagnosis::places::{Inferred, NOWHERE};
use pkm_diagnosis::{Kind, Rules, Search, Unknown, search};

use super::model::{Meaning, Model, info};
use super::places::World;
use super::places::sites::{self, Site};
use super::text;

/// A finding.
pub struct Effect {
    /// Its id.
    pub id: &'static str,
    /// Place of `[[element]]`, or `geometry`, `sensor`, `load`, `time`.
    pub place: String,
    /// Places that the readings cannot tell apart from it.
    pub place_class: Vec<String>,
    /// In which direction it gives.
    pub motion: &'static str,
    /// What it depends on.
    pub law: &'static str,
    /// Probability of the place and its class.
    pub probability: f64,
    /// Name, value, standard error.
    pub parameters: Vec<(String, f64, f64)>,
    /// Probability against what is not in its class.
    pub confidence: f64,
    /// What the data cannot tell from it.
    pub class: Vec<String>,
}

impl Effect {
    /// Whether another is the same physics: a form may take two blocks.
    fn is_alike(&self, other: &Self) -> bool {
        (self.id, &self.place, self.motion, self.law) == (other.id, &other.place, other.motion, other.law)
    }

    /// Merges another finding of the same effect.
    fn absorb(&mut self, other: Self) {
        let new = other.place_class.into_iter().filter(|p| !self.place_class.contains(p));
        let room = sites::MAX_CLASS.saturating_sub(self.place_class.len());
        self.place_class.extend(new.take(room).collect::<Vec<_>>());
        self.parameters.extend(other.parameters);
        self.probability = self.probability.max(other.probability);
    }

    /// Numbers parameters of one name, as coupled elements have in several directions.
    fn number_parameters(&mut self) {
        let names: Vec<String> = self.parameters.iter().map(|p| p.0.clone()).collect();
        for (n, (name, ..)) in self.parameters.iter_mut().enumerate() {
            if names.iter().filter(|other| *other == name).count() > 1 {
                let number = names[..=n].iter().filter(|other| *other == name).count();
                *name = name.replacen('.', &format!("_{number}."), 1);
            }
        }
    }

    /// Whether the readings say where it is.
    pub fn is_located(&self) -> bool {
        self.place_class.len() <= sites::MAX_CLASS
    }

    /// Whether the model has it in proportion to the load alone, where it is not: elements outside the limbs have no law of the load.
    pub fn is_in_proportion_alone(&self) -> bool {
        self.id == ELEMENT && self.law == "load" && matches!(self.place.as_str(), "base" | "tool" | "moving_platform")
    }

    /// Where to look on the machine.
    pub fn inspect(&self) -> String {
        if self.is_located() {
            let own = text::inspect_effect(self.id, &self.place);
            if self.id == ELEMENT && self.law == "pose" && !self.is_measurement() {
                return format!("{own}, {}", text::AT_SOME_POSES);
            }
            if self.is_in_proportion_alone() {
                let modelled = if self.parameters.is_empty() { "" } else { text::MODELLED };
                return format!("{own}, {}{modelled}", text::MOUNT);
            }
            if let Some(stretch) = self.stretch_m() {
                return format!("{own}, {}", text::stretch(stretch));
            }
            let seat = sites::seat(&self.place).filter(|seat| self.id == ELEMENT && self.place_class.contains(seat));
            return match seat {
                Some(seat) => format!("{own}, and its seat in the {}", text::place(&seat)),
                None => own,
            };
        }
        let places = [&self.place].into_iter().chain(&self.place_class).map(|place| text::place(place));
        format!("{} (the readings do not say which)", places.collect::<Vec<_>>().join("; "))
    }

    /// Lengths of the limb between which its screw is worn, if that is what it is: between which it yields more, not less.
    fn stretch_m(&self) -> Option<[f64; 2]> {
        let of = |name: &str| self.parameters.iter().find(|p| p.0.ends_with(name)).map(|p| p.1);
        of(".local_m_per_n").or_else(|| of(".local_rad_per_nm")).filter(|local| *local > 0.0)?;
        let (at, half) = (of(".local_at_m")?, of(".local_half_m")?);
        Some([at - half, at + half])
    }

    /// What else it may be at its place: laws of another kind in sets of findings that are nearly as likely.
    pub fn rivals_of_law(&self, world: &World, inferred: &Inferred, rules: &Rules) -> Vec<String> {
        let (mut own, mut others) = (0.0, Vec::new());
        for (blocks, probability) in &inferred.alternatives {
            let is_here = |place: &String| *place == self.place || self.place_class.contains(place);
            let here = blocks.iter().map(|b| world.block(*b)).filter(|b| b.places.first().is_some_and(is_here));
            let laws: Vec<&str> = here.map(|b| b.law).collect();
            if laws.iter().any(|law| sites::family(law) == sites::family(self.law)) {
                own += probability;
            } else {
                others.extend(laws.first().map(|law| (*law, *probability)));
            }
        }
        let mut likely: Vec<&str> = Vec::new();
        for (law, _) in &others {
            let all: f64 = others.iter().filter(|o| o.0 == *law).map(|o| o.1).sum();
            if all > rules.min_place_probability * own && !likely.contains(law) {
                likely.push(law);
            }
        }
        likely.into_iter().map(|law| format!("{ELEMENT} at {}, {law}", self.place)).collect()
    }

    /// Whether it is an error of the measurement and no part of the machine.
    pub fn is_measurement(&self) -> bool {
        matches!(self.place.as_str(), "sensor" | "load" | "time")
    }
}

/// What an effect is called that has no formula.
pub const ELEMENT: &str = "element";

/// What stands at the sites: effects by their formula, and what yields without one. Declared values have a list of their own.
/// `scatter` is as for [`Fit::covariance`](pkm_diagnosis::Fit::covariance).
pub fn effects(model: &Model, search: &Search, sites: &[Site], scatter: f64) -> Vec<Effect> {
    let end = &search.fit;
    let standard_errors = end.standard_errors(scatter);
    let at = |site: &Site| Effect {
        id: ELEMENT,
        place: site.place.clone(),
        place_class: site.place_class.clone(),
        motion: site.motion,
        law: site.law,
        probability: site.probability,
        parameters: Vec::new(),
        confidence: site.probability,
        class: Vec::new(),
    };
    let of = |found: &search::Found, site: &Site| {
        // wrong declared values have a list of their own
        if model.class_of(found.candidate).is_some() {
            return None;
        }
        let effect = model.effect_of(found.candidate);
        let name = |u: Unknown| match model.meaning(u) {
            Meaning::Effect { effect: own, parameter } if effect == Some(own) => {
                Some(info(own).parameters[parameter].name.to_owned())
            }
            Meaning::Element(element) if effect.is_none() => Some(model.elements[element].name()),
            _ => None,
        };
        let own = &model.candidates[found.candidate].unknowns;
        let parameters = (end.unknowns.iter().enumerate())
            .filter(|(_, u)| own.contains(u))
            .filter_map(|(n, u)| {
                let prior = model.parameters[u.0].prior;
                let origin = match model.meaning(*u) {
                    Meaning::Element(element) => model.elements[element].origin(),
                    _ => 0.0,
                };
                Some((name(*u)?, origin + prior.value(end.x[n]), prior.error(end.x[n], standard_errors[n])))
            })
            .collect();
        let mut class: Vec<String> = Vec::new();
        // an element can always do what a formula does
        let rivals = found.class.iter().filter(|c| effect.is_none() || model.candidates[**c].kind != Kind::Element);
        let own_name = model.candidates[found.candidate].name();
        for name in rivals.flat_map(|c| &model.candidates[*c].names) {
            // another form of the same
            if !class.contains(name) && *name != own_name {
                class.push(name.clone());
            }
        }
        let id = effect.map_or(ELEMENT, |effect| info(effect).id);
        Some(Effect { id, parameters, confidence: found.confidence, class, ..at(&site.named(model, found.candidate)) })
    };
    let named = sites::named_at(sites, search);
    let all = sites.iter().zip(named).filter(|(site, _)| site.place != NOWHERE);
    let found = all.filter_map(|(site, found)| found.map_or_else(|| Some(at(site)), |n| of(&search.found[n], site)));
    let mut effects: Vec<Effect> = Vec::new();
    for effect in found {
        match effects.iter_mut().find(|e| e.is_alike(&effect)) {
            Some(there) => there.absorb(effect),
            None => effects.push(effect),
        }
    }
    effects.iter_mut().for_each(Effect::number_parameters);
    effects
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_worn_stretch_yields_more_than_the_rest() {
        let inspect = |local: f64| {
            let of = |name: &str, value| (format!("axial.{name}"), value, 0.0);
            let effect = Effect {
                id: ELEMENT,
                place: "limb.3.body".into(),
                place_class: Vec::new(),
                motion: "axial",
                law: "extension",
                probability: 1.0,
                parameters: vec![of("local_m_per_n", local), of("local_at_m", 0.5), of("local_half_m", 0.06)],
                confidence: 1.0,
                class: Vec::new(),
            };
            effect.inspect()
        };
        assert_eq!(inspect(3e-9), "limb 3, body, screw and nut where the limb is 440 to 560 mm long");
        assert_eq!(inspect(-3e-9), "limb 3, body");
    }
}
