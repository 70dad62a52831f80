//! The document `geometry.json`.

use pkm_diagnosis::validation::Errors;
use serde_json::{Value, json};

use super::model::Meaning;
use super::outcome::{Estimate, Identification, Rival, RivalErrors};
use crate::pose::tidy;

/// mm or mrad.
fn shown(value: f64) -> f64 {
    tidy(1e3 * value)
}

fn estimate(e: &Estimate) -> Value {
    json!({
        "key": e.meaning.key(),
        "unit": e.unit(),
        "declared": shown(e.declared),
        "value": shown(e.value),
        "change": shown(e.value - e.declared),
        "sd": shown(e.sd),
        "declared_sd": shown(e.prior_sd),
        "pull_sd": tidy(e.pull_sd()),
        "identifiable": e.identifiable,
        "held": shown(e.held),
    })
}

fn errors(e: &Errors) -> Value {
    let all = &e.kinds[0];
    json!({
        "readings": e.readings,
        "rms_um": tidy(all.rms * 1e6),
        "rms_interval_um": all.rms_interval.map(|i| i.map(|v| tidy(v * 1e6))),
        "max_um": tidy(all.max * 1e6),
        "ratio_to_noise": tidy(e.chi2_per_dof.sqrt()),
    })
}

fn by_rival(all: &RivalErrors) -> Value {
    let of = |rival: Rival| all.iter().find(|(r, _)| *r == rival).map(|(_, e)| errors(e));
    json!({
        "declared": of(Rival::Declared),
        "identified": of(Rival::Identified),
        "with_found": of(Rival::WithFound),
    })
}

impl Identification {
    /// What to add to where the controller takes each drive to be: true position less commanded one, with deviation.
    pub fn zeros(&self) -> Vec<(String, &Estimate)> {
        let name = |m: Meaning| match m {
            Meaning::ScrewZero(i) => Some(format!("screw {}", i + 1)),
            Meaning::Beta(i) => Some(format!("wrist joint {}", i + 1)),
            _ => None,
        };
        self.estimates.iter().filter_map(|e| Some((name(e.meaning)?, e))).collect()
    }

    /// `geometry.json`.
    pub fn to_json(&self) -> Value {
        let located = |name: &str, at: &[f64; 3], sd: &[f64; 3]| json!({ "name": name, "at_mm": at.map(shown), "sd_mm": sd.map(shown) });
        let frame = self.frame.as_ref().map(|(motion, [origin, rotation])| {
            let rows: [[f64; 3]; 3] = motion.rotation.matrix().transpose().into();
            let at: [f64; 3] = motion.translation_m.into();
            json!({
                "origin_mm": at.map(shown), "rotation": rows.map(|r| r.map(tidy)),
                "sd_mm": origin.map(shown), "sd_mrad": rotation.map(shown),
            })
        });
        let direction = |d: &super::Direction| {
            let parts: serde_json::Map<String, Value> =
                d.parts.iter().map(|(m, v)| (m.key(), json!(tidy(*v)))).collect();
            json!({ "value": tidy(d.singular_value), "identified": d.is_identified(), "direction": parts })
        };
        let zero = |(name, e): &(String, &Estimate)| json!({ "drive": name, "add": shown(e.held), "sd": shown(e.sd), "unit": e.unit(), "identifiable": e.identifiable });
        let tried = |t: &super::Tried| json!({ "id": t.id, "gain": tidy(t.gain), "left_out_gain": tidy(t.left_out_gain), "state": t.state });
        let [before, after, with_found] = &self.lack_of_fit;
        let (given, poses, held_out) = &self.held_out;
        json!({
            "verdict": self.verdict,
            "poses": self.size.1,
            "numbers": self.size.0,
            "parameters": self.estimates.iter().map(estimate).collect::<Vec<_>>(),
            "covariance": {
                "keys": self.estimates.iter().map(|e| e.meaning.key()).collect::<Vec<_>>(),
                "matrix": self.covariance.iter().map(|r| r.iter().map(|v| v * 1e6).collect::<Vec<_>>()).collect::<Vec<_>>(),
            },
            "zeros": self.zeros().iter().map(zero).collect::<Vec<_>>(),
            "singular_values": self.directions.iter().map(direction).collect::<Vec<_>>(),
            "measuring_frame": frame,
            "targets": self.targets.iter().map(|(t, at, sd)| located(&t.name, at, sd)).collect::<Vec<_>>(),
            "balls": self.balls.iter().map(|(b, at, sd)| located(b, at, sd)).collect::<Vec<_>>(),
            "lack_of_fit": { "declared": before, "identified": after, "with_found": with_found },
            "found": self.found().map(|t| &t.id).collect::<Vec<_>>(),
            "tried": self.tried.iter().map(tried).collect::<Vec<_>>(),
            "errors": by_rival(&self.errors),
            "holdout": {
                "chosen": if *given { "given" } else { "by cross-validation" }, "poses": poses, "errors": by_rival(held_out),
            },
            "suspect_readings": self.suspects.iter()
                .map(|s| json!({ "line": s.line, "residual_sd": tidy(s.residual_sd), "excluded": s.is_excluded }))
                .collect::<Vec<_>>(),
        })
    }
}
