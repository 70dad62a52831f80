//! The document of `formats.md`.

use pkm_diagnosis::search::{Ranked, Round};
use serde_json::{Map, Value, json};

use super::badges::Badge;
use super::compare::{Errors, RIVALS, Rival};
use super::{Diagnosis, Effect, HeldOut, SEED, text};
use crate::files::readings::GAUGE;
use crate::pose::written_units;

fn effect(e: &Effect) -> Value {
    let parameters: Map<String, Value> =
        e.parameters.iter().map(|(n, v, s)| (n.to_string(), json!({ "value": v, "stderr": s }))).collect();
    json!({ "id": e.id, "where": e.place, "where_class": e.place_class, "motion": e.motion, "law": e.law,
        "probability": e.probability, "parameters": parameters, "confidence": e.confidence, "class": e.class,
        "of": if e.is_measurement() { "measurement" } else { "machine" },
        "inspect": e.inspect() })
}

/// Errors of one rival; null for one that was not judged.
fn of(errors: &[(Rival, Errors)], rival: Rival) -> Value {
    errors.iter().find(|e| e.0 == rival).map_or(Value::Null, |e| json!(e.1))
}

fn rivals(errors: &[(Rival, Errors)]) -> Map<String, Value> {
    RIVALS.iter().map(|(rival, key, _)| (key.to_string(), of(errors, *rival))).collect()
}

impl Diagnosis {
    /// The document of `formats.md`.
    pub fn to_json(&self) -> Value {
        let mut document = self.findings_json();
        document["measurement"] = json!(Badge::measurement(self));
        document["model"] = json!(Badge::model(self));
        document["uncertainty"] = json!(self.estimates.coverage);
        document["estimates"] = json!(self.estimates.all);
        document["condition"] = self.estimates.condition_json();
        document["holdout"] = self.held_out_json();
        document["ranking"] = self.ranking_json();
        document
    }

    /// Candidates round by round, the best first.
    fn ranking_json(&self) -> Value {
        let row = |(r, name): (&Ranked, &String)| {
            json!({ "candidate": name, "statistic": r.score.statistic, "dof": r.score.dof,
                "p": r.score.p, "gain_2_ln_evidence": r.gain, "left_out_gain": r.left_out_gain,
                "poses_that_gain": r.poses_that_gain, "gain_from_pulls": r.from_pulls,
                "rejected": r.rejected })
        };
        let round = |(round, names): (&Round, &Vec<String>)| {
            let rows: Vec<Value> = round.ranking.iter().zip(names).take(12).map(row).collect();
            json!({ "p_family": round.p_family, "candidates": rows })
        };
        self.search.rounds.iter().zip(&self.names).map(round).collect()
    }

    fn held_out_json(&self) -> Value {
        let HeldOut { given, poses, all, as_measured, zones, folds, said: _ } = &self.held_out;
        let mut held_out = rivals(all);
        held_out.insert("poses".into(), json!(poses));
        held_out.insert("chosen".into(), json!(if *given { "given" } else { "by cross-validation" }));
        if !given {
            held_out.insert("found_in_folds".into(), json!(folds));
        }
        held_out.insert("as_measured".into(), as_measured.as_ref().map_or(Value::Null, |errors| rivals(errors).into()));
        let zones: Map<String, Value> =
            zones.iter().map(|(zone, errors)| (zone.name().to_owned(), rivals(errors).into())).collect();
        held_out.insert("zones".into(), zones.into());
        held_out.into()
    }

    fn findings_json(&self) -> Value {
        let effects: Vec<Value> = self.effects.iter().map(effect).collect();
        let hidden = self.detectable.iter().filter(|d| d.is_hidden());
        let micro = |v: &[f64]| v.iter().map(|v| v * 1e6).collect::<Vec<f64>>();
        json!({
            "verdict": self.judgement.verdict,
            "data_warnings": self.warnings,
            "suspect_readings": self.suspects,
            "effects": effects,
            "declared_value_findings": self.declared,
            "not_detectable": hidden.map(|d| json!({ "id": d.id, "smallest_detectable": d.text() })).collect::<Vec<_>>(),
            "detectable": self.detectable.iter().filter(|d| !d.is_hidden())
                .map(|d| json!({ "id": d.id, "smallest_detectable": d.text() })).collect::<Vec<_>>(),
            "not_looked_for": if self.single_poses { vec![] } else { vec![text::SINGLE_POSES] },
            "lack_of_fit": self.judgement.before,
            "lack_of_fit_after": self.judgement.after,
            "load_error": { "direction_mrad": 1e3 * self.load_error,
                "gain": self.load_error,
                "about": "beyond the declared one, as the readings suggest" },
            "misfit_explained": self.judgement.gone,
            "noise": { "source": self.noise.source, "reading_um_urad": micro(&self.noise.within[..GAUGE]),
                "series_um_urad": micro(&self.noise.between[..GAUGE]),
                "gauge_reading_um": self.noise.within[GAUGE] * 1e6, "gauge_series_um": self.noise.between[GAUGE] * 1e6,
                "coarse": self.coarse.iter()
                    .map(|c| json!({ "column": c.column, "step": c.step, "noise": c.noise })).collect::<Vec<_>>() },
            "error_before": of(&self.errors, Rival::Declared),
            "error_after": of(&self.errors, Rival::After),
            "error_after_and_table": of(&self.errors, Rival::AfterAndTable),
            "error_retuned_only": of(&self.errors, Rival::Reidentified),
            "error_table_only": of(&self.errors, Rival::Table),
            "steps": self.steps.iter()
                .map(|s| json!({ "found": s.found, "error": s.errors, "holdout": s.held_out })).collect::<Vec<_>>(),
            "next_measurements": self.proposals.iter().map(|p| {
                let [theta_deg, sigma_deg, z0_mm] = written_units(&p.pose);
                json!({ "theta_deg": theta_deg, "sigma_deg": sigma_deg, "z0_mm": z0_mm,
                    "wrench": <[f64; 6]>::from(p.wrench.to_vector()), "separates": p.separates })
            }).collect::<Vec<_>>(),
            "alternatives": self.alternatives.iter()
                .map(|(effects, probability)| json!({ "effects": effects, "probability": probability })).collect::<Vec<_>>(),
            "none_of_these": self.none_of_these,
            "residual_structure": self.structure,
            "seed": SEED,
        })
    }
}
