//! Findings in a machinist's words: what to inspect, units that he thinks in, what the figures mean.

use pkm_core::Wrench;
use pkm_core::effects::EFFECTS;
use pkm_diagnosis::places::NOWHERE;

use super::declared::{Declared, Part};
use super::model::MEASUREMENT;

/// What the statistics of a report mean, a line each.
pub const LEGEND: [(&str, &str); 7] = [
    (
        "λ",
        "detectability, the squared signal-to-noise ratio of an effect after the stiffnesses are re-identified: found from about 30 on",
    ),
    ("lack of fit", "misfit over noise, near 1 for a good model; p below 0.01: more than noise"),
    ("Δχ²", "by how much a candidate would lower χ²"),
    ("degrees of freedom", "parameters of the candidate"),
    ("2 Δ ln E", "how much likelier it makes the readings: more than 6 counts, for a second find more than 10"),
    ("cross-validated gain", "how much better poses are predicted that its fit has not seen"),
    ("order", "of the readings in the file"),
];

/// A place as people say it.
pub fn place(place: &str) -> String {
    match place {
        NOWHERE => "no place of the machine".to_owned(),
        "time" => "the instrument and its zero, which drift".to_owned(),
        _ => place.replace("limb.", "limb ").replace('.', ", ").replace('_', " "),
    }
}

/// What an error of the measurement is that has no formula.
pub fn error_of(place: &str, law: &str) -> String {
    match law {
        _ if place == "time" => "readings as time goes (a drift)".to_owned(),
        "direction" => format!("{place}, by direction (it lags behind, as a gauge with friction in its stem does)"),
        "pose" => format!("{place}, anew at each pose (a zero that was lost, a clamp or reflector that moved)"),
        "time" => format!("{place}, with time (a drift, or a change at one of the poses)"),
        _ => format!("{place}, law: {law}"),
    }
}

/// Where to look on the machine when an effect is found; an effect without a formula has its place alone.
pub fn inspect_effect(id: &str, at: &str) -> String {
    if id == super::ELEMENT && at == "geometry" {
        return "sizes, joint axes, and the zeros of θ, σ and Z0 (the homing of the drives)".to_owned();
    }
    if id == super::ELEMENT {
        return place(at);
    }
    let known = EFFECTS.iter().chain(&MEASUREMENT).find(|info| info.id == id);
    known.map_or("", |info| info.expected.inspect).to_owned()
}

/// Where to look at a screw that is worn between two lengths of its limb.
pub fn stretch([from_m, to_m]: [f64; 2]) -> String {
    format!("screw and nut where the limb is {:.0} to {:.0} mm long", 1e3 * from_m, 1e3 * to_m)
}

/// What yields at the base, the platform or the tool otherwise than in proportion to the load.
pub const MOUNT: &str = "bolts, seats and clamping, which open or slip under load";

/// What yields at the tool or the platform at some poses and not at others.
pub const AT_SOME_POSES: &str =
    "its holder, brackets and clamping, which yield otherwise at some poses; the model does not have that";

/// What of a mount the model has, if there are elements of it.
pub const MODELLED: &str = "; the model has what they yield in proportion to it";

/// Factor by which no material of a kind differs from another: a body that comes out farther off has another section, length or form.
pub const MATERIAL_RATIO: f64 = 1.15;

/// Where to look on the machine when a declared value is wrong by a factor.
pub fn inspect_declared(declared: &Declared, ratio: f64) -> String {
    let limb = declared.limb + 1;
    if declared.is_of_body() && ratio.max(1.0 / ratio) > MATERIAL_RATIO {
        return format!(
            "limb {limb}: section, length and form of rod and screw, which no material makes {ratio:.2} times as stiff; the form of \
             the model is in doubt"
        );
    }
    let what = match declared.part {
        Part::BaseLinear(2) | Part::PlatformLinear(2) => "joint, bearing or drive along its axis",
        Part::BaseLinear(_) => "the joint at the base, across the limb",
        Part::BaseAngular(_) => "the joint at the base, against tilting",
        Part::PlatformLinear(_) => "the joint at the platform, across the limb",
        Part::PlatformAngular(_) => "the joint at the platform, against tilting",
        Part::Young | Part::Shear => "rod and screw, with what holds them",
    };
    format!("limb {limb}: {what}")
}

/// Of what the readings tell no more than a ratio: a common error of both is one of all stiffnesses.
pub fn ratio_alone(id: &str) -> Option<&'static str> {
    match id {
        "load-gain" => {
            Some("of the ratio of forces to moments: an error of both alike is not told from all stiffnesses")
        }
        "sensor-scale" => {
            Some("of the ratio of translations to rotations: an error of both alike is not told from all stiffnesses")
        }
        _ => None,
    }
}

/// What is not looked for among many poses.
pub const SINGLE_POSES: &str = "what one pose has of its own, such as a clamp that was loose there or a zero that was lost; there are too many poses";

/// What the axis of a joint's stiffness stands for.
pub fn axis(key: &str, axis: usize) -> String {
    let about = if key.contains("angular") { "about " } else { "along " };
    match axis {
        2 => format!("[2] ({about}the limb)"),
        _ => format!("[{axis}] ({about}the joint's {})", ["x", "y"][axis]),
    }
}

/// A parameter's name without its unit, the unit that people use, and how many of these are one in SI.
fn units(name: &str) -> (&str, &'static str, f64) {
    let known = [
        ("_rad_per_nm_per_k", "µrad/(N·m) per K", 1e6),
        ("_rad_per_nm3", "µrad/(N·m) per m²", 1e6),
        ("_rad_per_nm2", "µrad/(N·m) per m", 1e6),
        ("_rad_per_nm", "µrad/(N·m)", 1e6),
        ("_m_per_n_per_k", "nm/N per K", 1e9),
        ("_m_per_n3", "nm/N per kN²", 1e15),
        ("_m_per_n2", "nm/N per kN", 1e12),
        ("_m_per_n", "nm/N", 1e9),
        ("_per_nm2", "nm/N at 1 m", 1e9),
        ("_per_nm", "nm/N per m²", 1e9),
        ("_per_n", "nm/N per m", 1e9),
        ("_n_per_m", "N/µm", 1e-6),
        ("_per_k", "ppm/K", 1e6),
        ("_rad", "mrad", 1e3),
        ("_n", "N", 1.0),
    ];
    if let Some((bare, unit, factor)) = known.iter().find_map(|(end, u, f)| Some((name.strip_suffix(end)?, *u, *f))) {
        return (bare, unit, factor);
    }
    match name.strip_suffix("_m") {
        Some(bare) if bare.ends_with("play") || bare.ends_with("lag") => (bare, "µm", 1e6),
        Some(bare) => (bare, "mm", 1e3),
        None => (name, "%", 100.0),
    }
}

/// Four figures at most, without a power of ten where it can be helped.
fn figures(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        size if (1e-3..1e5).contains(&size) => format!("{value:.*}", (2 - size.log10().floor() as i32).max(0) as usize),
        _ => format!("{value:.1e}"),
    }
}

/// A probability with so many decimals: one that is not 1 does not read as 1.
pub(crate) fn probability(p: f64, decimals: usize) -> String {
    let least = 0.1_f64.powi(decimals as i32);
    match p {
        _ if p > 1.0 - least => format!("> {:.decimals$}", 1.0 - least),
        _ if p < least => format!("< {least:.decimals$}"),
        _ => format!("{p:.decimals$}"),
    }
}

/// An amplitude, as `play 6.8 ± 0.2 µm`: two figures of the error, and the value to the same place.
pub fn amplitude(name: &str, value: f64, error: Option<f64>) -> String {
    let (bare, unit, factor) = units(name);
    let (bare, value) = (bare.replace('_', " "), factor * value);
    let Some(error) = error.map(|e| factor * e) else { return format!("{bare} {} {unit}", figures(value)) };
    match 1.0 - error.log10().floor() {
        // without the sign of what rounds to 0
        places @ ..=6.0 if value.abs() < 1e5 => {
            let (places, tenth) = (places.max(0.0) as usize, 10_f64.powf(places.max(0.0)));
            format!("{bare} {:.places$} ± {error:.places$} {unit}", (value * tenth).round() / tenth + 0.0)
        }
        _ => format!("{bare} {} ± {} {unit}", figures(value), figures(error)),
    }
}

/// A load, as `Fx −400 N`.
pub fn load(w: &Wrench<f64>) -> String {
    let of = |names: [&str; 3], values: [f64; 3], unit: &str| {
        let parts = names.into_iter().zip(values).filter(|(_, v)| *v != 0.0);
        let size = |v: f64| if v.abs() < 1.0 { figures(v) } else { format!("{v:.0}") };
        parts.map(|(n, v)| format!("{n} {} {unit}", size(v)).replace('-', "−")).collect::<Vec<_>>()
    };
    let parts =
        [of(["Fx", "Fy", "Fz"], w.force_n.into(), "N"), of(["Mx", "My", "Mz"], w.moment_nm.into(), "N·m")].concat();
    if parts.is_empty() { "none".into() } else { parts.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_of_an_element_has_its_unit() {
        let places = ["limb.1.body", "tool", "moving_platform"];
        let motions = ["axial", "tilting", "tied_to_limb_2", "tied_to_base"];
        let laws = ["constant", "extension", "periodic", "load", "direction", "temperature"];
        let mut names: Vec<&str> = Vec::new();
        for (place, motion, law) in
            places.into_iter().flat_map(|p| motions.map(|m| (p, m))).flat_map(|(p, m)| laws.map(|l| (p, m, l)))
        {
            let element = pkm_core::effects::Element::from_names(place, motion, law, []);
            names.extend(element.iter().flat_map(|e| e.parameter_names()));
        }
        assert!(names.len() > 30);
        for name in names.iter().filter(|name| name.contains("_per_")) {
            let shown = amplitude(name, 1e-9, None);
            assert!(!shown.contains(" per n") && !shown.contains('%') && !shown.contains(" m per"), "{name}: {shown}");
        }
        assert_eq!(amplitude("lateral.curvature_per_nm", -1.88e-5, None), "lateral.curvature -18800 nm/N per m²");
        assert_eq!(amplitude("axial.lag_m", 8.75e-7, Some(6.1e-8)), "axial.lag 0.875 ± 0.061 µm");
        assert_eq!(amplitude("axial.even_m_per_n2", 2.5e-12, None), "axial.even 2.50 nm/N per kN");
        assert_eq!(amplitude("stiffness_n_per_m", 1.1e8, Some(6.9e6)), "stiffness 110.0 ± 6.9 N/µm");
    }

    #[test]
    fn amplitudes_and_loads_read_as_people_say_them() {
        assert_eq!(amplitude("play_m", 6.8e-6, Some(2e-7)), "play 6.80 ± 0.20 µm");
        assert_eq!(amplitude("axial_m_per_n", -9e-17, Some(1.2e-12)), "axial 0.0000 ± 0.0012 nm/N");
        assert_eq!(amplitude("tube_m", 0.356, Some(0.15)), "tube 356 ± 150 mm");
        assert_eq!(amplitude("axial_m_per_n", 5e-9, Some(0.0)), "axial 5.00 ± 0 nm/N");
        assert_eq!(amplitude("axial_m_per_n", 5.2e-9, None), "axial 5.20 nm/N");
        assert_eq!(amplitude("error_m", -4e-3, None), "error -4.00 mm");
        assert_eq!(amplitude("forces", 0.05, None), "forces 5.00 %");
        assert_eq!([0.9949, 0.996, 0.5, 0.004].map(|p| probability(p, 2)), ["> 0.99", "> 0.99", "0.50", "< 0.01"]);
        assert_eq!(probability(1.0, 4), "> 0.9999");
        let w = Wrench::from_vector([-400.0, 0.0, 0.0, 0.0, 0.0, 25.0].into());
        assert_eq!(load(&w), "Fx −400 N, Mz 25 N·m");
    }
}
