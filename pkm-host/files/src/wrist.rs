//! The section `[wrist]` of a machine file.

use pkm_core::WristParameters;
use serde::Deserialize;

use super::machine_raw::{Misplaced, Number, metres};
use crate::pose::PoseBox;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawWrist {
    pub(super) offset_mm: Option<Number>,
    pub(super) first: Option<RawFirstJoint>,
    pub(super) second: Option<RawSecondJoint>,
    pub(super) flange_mm: Option<Number>,
    pub(super) singularity_margin: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawFirstJoint {
    pub(super) d_mm: Option<Number>,
    pub(super) b_mm: Option<Number>,
    pub(super) min_deg: Option<Number>,
    pub(super) max_deg: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSecondJoint {
    pub(super) b_mm: Option<Number>,
    pub(super) min_deg: Option<Number>,
    pub(super) max_deg: Option<Number>,
}

/// Numbers with their keys, and whether they must be at least 0. Limits are compared.
pub(super) fn wrist_numbers(w: &RawWrist) -> std::result::Result<Vec<(&'static str, &Number, bool)>, Misplaced> {
    let mut numbers = Vec::new();
    numbers.extend(w.offset_mm.iter().map(|n| ("wrist.offset_mm", n, false)));
    numbers.extend(w.flange_mm.iter().map(|n| ("wrist.flange_mm", n, true)));
    numbers.extend(w.singularity_margin.iter().map(|n| ("wrist.singularity_margin", n, true)));
    let mut limits = Vec::new();
    if let Some(j) = &w.first {
        numbers.extend(j.d_mm.iter().map(|n| ("wrist.first.d_mm", n, false)));
        numbers.extend(j.b_mm.iter().map(|n| ("wrist.first.b_mm", n, false)));
        limits.push((0, ("wrist.first.min_deg", &j.min_deg), ("wrist.first.max_deg", &j.max_deg)));
    }
    if let Some(j) = &w.second {
        numbers.extend(j.b_mm.iter().map(|n| ("wrist.second.b_mm", n, false)));
        limits.push((1, ("wrist.second.min_deg", &j.min_deg), ("wrist.second.max_deg", &j.max_deg)));
    }
    for (joint, (min_key, min), (max_key, max)) in limits {
        numbers.extend(min.iter().map(|n| (min_key, n, false)));
        numbers.extend(max.iter().map(|n| (max_key, n, false)));
        let or = |n: &Option<Number>, paper_rad: f64| n.as_ref().map_or(paper_rad.to_degrees(), |n| *n.get_ref());
        let low = or(min, WristParameters::PAPER.min_rad[joint]);
        let high = or(max, WristParameters::PAPER.max_rad[joint]);
        let (key, n, message) = match (max, min) {
            (Some(max), _) => (max_key, max, format!("expected a limit above {low}, found {high}")),
            (None, Some(min)) => (min_key, min, format!("expected a limit below {high}, found {low}")),
            (None, None) => continue,
        };
        if low >= high {
            return Err((key, n.span(), message));
        }
    }
    Ok(numbers)
}

/// What the paper's values stand in for. The margin has one of its own, the paper none.
pub(super) fn wrist_left_out(wrist: Option<&RawWrist>) -> Vec<&'static str> {
    let (first, second) = (wrist.and_then(|w| w.first.as_ref()), wrist.and_then(|w| w.second.as_ref()));
    let mut keys = vec![("wrist.offset_mm", wrist.and_then(|w| w.offset_mm.as_ref()))];
    match first {
        Some(j) => keys.extend([
            ("wrist.first.d_mm", j.d_mm.as_ref()),
            ("wrist.first.b_mm", j.b_mm.as_ref()),
            ("wrist.first.min_deg", j.min_deg.as_ref()),
            ("wrist.first.max_deg", j.max_deg.as_ref()),
        ]),
        None => keys.push(("wrist.first", None)),
    }
    match second {
        Some(j) => keys.extend([
            ("wrist.second.b_mm", j.b_mm.as_ref()),
            ("wrist.second.min_deg", j.min_deg.as_ref()),
            ("wrist.second.max_deg", j.max_deg.as_ref()),
        ]),
        None => keys.push(("wrist.second", None)),
    }
    keys.push(("wrist.flange_mm", wrist.and_then(|w| w.flange_mm.as_ref())));
    keys.into_iter().filter_map(|(key, value)| value.is_none().then_some(key)).collect()
}

/// Table 1; what the file leaves out has the paper's values.
pub(super) fn wrist_parameters(wrist: Option<&RawWrist>, pose_box: &PoseBox) -> WristParameters {
    let [_, _, z0_mm] = pose_box.middle();
    let mut p = WristParameters { home_z0_m: metres(z0_mm), ..WristParameters::PAPER };
    let Some(wrist) = wrist else { return p };
    let put = |to: &mut f64, n: &Option<Number>, turned: fn(f64) -> f64| {
        if let Some(n) = n {
            *to = turned(*n.get_ref());
        }
    };
    put(&mut p.offset_m, &wrist.offset_mm, metres);
    put(&mut p.flange_m, &wrist.flange_mm, metres);
    put(&mut p.singularity_margin, &wrist.singularity_margin, |margin| margin);
    if let Some(j) = &wrist.first {
        put(&mut p.first_d_m, &j.d_mm, metres);
        put(&mut p.first_b_m, &j.b_mm, metres);
        put(&mut p.min_rad[0], &j.min_deg, f64::to_radians);
        put(&mut p.max_rad[0], &j.max_deg, f64::to_radians);
    }
    if let Some(j) = &wrist.second {
        put(&mut p.second_b_m, &j.b_mm, metres);
        put(&mut p.min_rad[1], &j.min_deg, f64::to_radians);
        put(&mut p.max_rad[1], &j.max_deg, f64::to_radians);
    }
    p
}
