//! The `[solid]` part of a machine file: what the limbs and platforms are made of, enough to build them as solids.
//! Everything in it has a default that follows from the rest of the file.

mod telescope;

use std::fmt::Write as _;
use std::ops::Range;

use pkm_core::MachineParameters;
use pkm_core::machine::{LimbParameters, Tube};
use serde::Deserialize;
use toml::Spanned;

use crate::toml_error::Numbers;

/// A machine in solids, SI.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    /// In order.
    pub limbs: [LimbSolid; 3],
    /// How far A_1, A_2 and A_3 lie out of the platform's plane, along w, while the pose stays; m.
    pub offset_m: [f64; 3],
    /// `None`: rigid.
    pub platform: Option<Plate>,
    /// `None`: rigid.
    pub base: Option<Plate>,
}

/// What is between the two joints of a limb.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LimbSolid {
    /// The paper's link: rod and screw side by side on one axis, over the whole length, joined at both ends.
    Uniform {
        /// Of `[limb.body]`.
        rod: Bar,
        /// See `rod`.
        screw: Bar,
    },
    /// A ram that slides in a tube, moved by a screw.
    Telescopic(Telescope),
}

/// A round bar of one material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bar {
    /// Diameter.
    pub outer_m: f64,
    /// Diameter of the bore, 0 without one.
    pub inner_m: f64,
    /// Young's modulus.
    pub young_pa: f64,
    /// Poisson's ratio.
    pub poisson: f64,
}

/// Lengths are along the limb, from the centre of the base joint or of the platform joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Telescope {
    /// Held by the base joint.
    pub tube: Bar,
    /// From the base joint to the tube's mouth.
    pub tube_m: f64,
    /// How far the tube reaches behind the base joint.
    pub behind_m: f64,
    /// Held by the platform joint.
    pub ram: Bar,
    /// From the platform joint to the ram's inner end.
    pub ram_m: f64,
    /// From the tube's rear end to the nut at the ram's inner end.
    pub screw: Bar,
    /// Between tube and screw.
    pub bearing: Seat,
    /// Between screw and ram.
    pub nut: Seat,
    /// Of each of the two guides, at the tube's mouth and at the ram's inner end, across the limb.
    pub guide_n_per_m: f64,
    /// Of the key that keeps the ram from turning, at the tube's mouth.
    pub key_nm_per_rad: f64,
}

/// A bearing of the screw, or its nut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seat {
    /// Along the limb.
    pub axial_n_per_m: f64,
    /// Across it.
    pub radial_n_per_m: f64,
}

/// A plate: the hull of a rim about each of its bores.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plate {
    /// Thickness; the joints are at half of it.
    pub thickness_m: f64,
    /// Diameter of the bores that hold the joints.
    pub bore_m: f64,
    /// Diameter of the bore at A that holds the wrist; 0 for the base, which has none.
    pub hub_m: f64,
    /// Width of material about a bore.
    pub rim_m: f64,
    /// Young's modulus.
    pub young_pa: f64,
    /// Poisson's ratio.
    pub poisson: f64,
}

type Triple = Option<Spanned<Numbers<3>>>;
type Single = Option<Spanned<f64>>;

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct RawSolid {
    limb: RawLimb,
    offset_mm: Triple,
    tube: RawTube,
    ram: RawRam,
    screw: RawScrew,
    bearing: RawSeat,
    nut: RawSeat,
    guide: RawGuide,
    platform: RawPlatform,
    base: RawBase,
}

#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum RawLimb {
    #[default]
    Telescopic,
    Uniform,
}

#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum RawKind {
    #[default]
    Elastic,
    Rigid,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawTube {
    outer_mm: Triple,
    inner_mm: Triple,
    length_mm: Triple,
    behind_mm: Triple,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawRam {
    outer_mm: Triple,
    inner_mm: Triple,
    length_mm: Triple,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawScrew {
    outer_mm: Triple,
    inner_mm: Triple,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawSeat {
    axial_n_per_m: Triple,
    radial_n_per_m: Triple,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawGuide {
    radial_n_per_m: Triple,
    key_nm_per_rad: Triple,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawPlatform {
    kind: RawKind,
    thickness_mm: Single,
    bore_mm: Single,
    hub_mm: Single,
    rim_mm: Single,
    young_gpa: Single,
    poisson: Single,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawBase {
    kind: RawKind,
    thickness_mm: Single,
    bore_mm: Single,
    rim_mm: Single,
    young_gpa: Single,
    poisson: Single,
}

/// What is wrong with the section.
pub(crate) struct Flaw {
    pub key: String,
    /// In the file, if it is there.
    pub place: Option<Range<usize>>,
    pub message: String,
    /// Wrong by itself, not only beside other dimensions: a flaw of the file whatever it is read for.
    pub of_value: bool,
}

type Checked<T> = Result<T, Flaw>;

fn misfit<T>(key: String, place: Option<Range<usize>>, message: String) -> Checked<T> {
    Err(Flaw { key, place, message, of_value: false })
}

const POSITIVE: f64 = f64::MIN_POSITIVE;

fn checked(key: &str, place: Option<Range<usize>>, value: f64, least: f64, below: f64) -> Checked<f64> {
    if value >= least && value < below {
        return Ok(value);
    }
    let message = match (least, below) {
        (POSITIVE, f64::MAX) => format!("expected a number above 0, found {value}"),
        (_, f64::MAX) => format!("expected a number of at least {least}, found {value}"),
        _ => format!("expected a number from {least} to below {below}, found {value}"),
    };
    Err(Flaw { key: key.to_owned(), place, message, of_value: true })
}

/// Values of the three limbs, times the unit; the default where the file has none.
fn three(key: &str, raw: &Triple, unit: f64, least: f64, default: [f64; 3]) -> Checked<[f64; 3]> {
    let Some(raw) = raw else { return Ok(default) };
    let mut values = [0.0; 3];
    for (i, (to, value)) in values.iter_mut().zip(raw.get_ref().0).enumerate() {
        *to = unit * checked(&format!("{key}[{i}]"), Some(raw.span()), value, least, f64::MAX)?;
    }
    Ok(values)
}

fn one(key: &str, raw: &Single, unit: f64, least: f64, below: f64, default: f64) -> Checked<f64> {
    let Some(raw) = raw else { return Ok(default) };
    Ok(unit * checked(key, Some(raw.span()), *raw.get_ref(), least, below)?)
}

const MM: f64 = 1e-3;

impl Bar {
    /// Of a tube as `[limb.body]` has it.
    fn declared(key: &str, tube: &Tube) -> Checked<Self> {
        let poisson = tube.young_pa / (2.0 * tube.shear_pa) - 1.0;
        if !(poisson > -1.0 && poisson < 0.5) {
            let message = format!(
                "expected moduli of an isotropic solid, young_gpa/3 < shear_gpa: Poisson's ratio would be {poisson:.3}"
            );
            return misfit(key.to_owned(), None, message);
        }
        Ok(Self { outer_m: tube.outer_m, inner_m: tube.inner_m, young_pa: tube.young_pa, poisson })
    }

    /// EI over E.
    fn inertia_m4(&self) -> f64 {
        std::f64::consts::PI / 64.0 * (self.outer_m.powi(4) - self.inner_m.powi(4))
    }
}

impl Solid {
    /// From the file's section, or from nothing.
    pub(crate) fn new(raw: &RawSolid, machine: &MachineParameters) -> Checked<Self> {
        let mut bodies = Vec::new();
        for (i, LimbParameters { body, .. }) in (1..).zip(&machine.limbs) {
            bodies.push([
                Bar::declared(&format!("limb.{i}.body.rod"), &body.rod)?,
                Bar::declared(&format!("limb.{i}.body.screw"), &body.screw)?,
            ]);
        }
        let limbs = match raw.limb {
            RawLimb::Uniform => std::array::from_fn(|i| LimbSolid::Uniform { rod: bodies[i][0], screw: bodies[i][1] }),
            RawLimb::Telescopic => raw.telescopes(machine, &bodies)?.map(LimbSolid::Telescopic),
        };
        let offset_m = three("solid.offset_mm", &raw.offset_mm, MM, -1e4, [0.0; 3])?;
        let g = &machine.geometry;
        let (a, b) = (g.a1_m.min(g.a2_m), g.b1_m.min(g.b2_m));
        let wide = |platform_end: bool| {
            let outer = limbs.iter().map(|limb| match limb {
                LimbSolid::Uniform { rod, .. } => rod.outer_m,
                LimbSolid::Telescopic(t) => {
                    if platform_end {
                        t.ram.outer_m
                    } else {
                        t.tube.outer_m
                    }
                }
            });
            outer.fold(0.0, f64::max)
        };
        let plate = |name: &str, keys: [&Single; 5], hub_m: f64, default: [f64; 3]| -> Checked<Plate> {
            let size = |key: &str, raw: &Single, default| {
                one(&format!("solid.{name}.{key}"), raw, MM, POSITIVE, f64::MAX, default)
            };
            let [thickness, bore, rim, young, poisson] = keys;
            let young_key = format!("solid.{name}.young_gpa");
            Ok(Plate {
                thickness_m: size("thickness_mm", thickness, default[0])?,
                bore_m: size("bore_mm", bore, default[1])?,
                hub_m,
                rim_m: size("rim_mm", rim, default[2])?,
                young_pa: one(&young_key, young, 1e9, POSITIVE, f64::MAX, bodies[0][0].young_pa)?,
                poisson: one(&format!("solid.{name}.poisson"), poisson, 1.0, -0.99, 0.5, bodies[0][0].poisson)?,
            })
        };
        // bores let the limbs through
        let p = &raw.platform;
        let hub_m = one("solid.platform.hub_mm", &p.hub_mm, MM, POSITIVE, f64::MAX, 0.67 * a)?;
        let keys = [&p.thickness_mm, &p.bore_mm, &p.rim_mm, &p.young_gpa, &p.poisson];
        let thickness = 0.25 * (g.a1_m * g.a2_m).sqrt();
        let platform = plate("platform", keys, hub_m, [thickness, (0.42 * a).max(1.1 * wide(true)), 0.14 * a])?;
        let keys =
            [&raw.base.thickness_mm, &raw.base.bore_mm, &raw.base.rim_mm, &raw.base.young_gpa, &raw.base.poisson];
        let thickness = 0.22 * (g.b1_m * g.b2_m).sqrt();
        let base = plate("base", keys, 0.0, [thickness, (0.25 * b).max(1.1 * wide(false)), 0.2 * b])?;
        let elastic = |kind, plate| match kind {
            RawKind::Elastic => Some(plate),
            RawKind::Rigid => None,
        };
        let solid = Self { limbs, offset_m, platform: elastic(p.kind, platform), base: elastic(raw.base.kind, base) };
        solid.check_bores(machine)?;
        Ok(solid)
    }

    /// Bores with their diameters, in the plate's own axes: A_i and A of the platform, B_i of the base.
    pub fn platform_bores(plate: &Plate, machine: &MachineParameters) -> Vec<([f64; 2], f64)> {
        let g = &machine.geometry;
        let joints = [[0.0, -g.a1_m], [0.0, g.a1_m], [g.a2_m, 0.0]].map(|at| (at, plate.bore_m));
        joints.into_iter().chain([([0.0, 0.0], plate.hub_m)]).collect()
    }

    /// See [`platform_bores`](Self::platform_bores).
    pub fn base_bores(plate: &Plate, machine: &MachineParameters) -> Vec<([f64; 2], f64)> {
        let g = &machine.geometry;
        [[0.0, -g.b1_m], [0.0, g.b1_m], [g.b2_m, 0.0]].map(|at| (at, plate.bore_m)).into()
    }

    /// The section of the machine file that says all of it.
    pub fn toml(&self) -> String {
        let tidy = |v: f64| format!("{}", (v * 1e6).round() / 1e6);
        let mm = |v: [f64; 3]| format!("[{}]", v.map(|m| tidy(m / MM)).join(", "));
        let whole = |v: [f64; 3]| {
            let digits =
                |k: f64| format!("{k:.6e}").parse::<f64>().map_or_else(|e| e.to_string(), |k| format!("{k:e}"));
            format!("[{}]", v.map(digits).join(", "))
        };
        let telescopes: Vec<&Telescope> = self
            .limbs
            .iter()
            .filter_map(|l| match l {
                LimbSolid::Telescopic(t) => Some(t),
                LimbSolid::Uniform { .. } => None,
            })
            .collect();
        let kind = if telescopes.is_empty() { "uniform" } else { "telescopic" };
        let mut s = format!("[solid]\nlimb = \"{kind}\"\noffset_mm = {}\n", mm(self.offset_m));
        if let [a, b, c] = telescopes[..] {
            let of = |pick: fn(&Telescope) -> f64| [pick(a), pick(b), pick(c)];
            let mut part = |name: &str, keys: &[(&str, String)]| {
                _ = writeln!(s, "[solid.{name}]");
                keys.iter().for_each(|(key, value)| _ = writeln!(s, "{key} = {value}"));
            };
            part(
                "tube",
                &[
                    ("outer_mm", mm(of(|t| t.tube.outer_m))),
                    ("inner_mm", mm(of(|t| t.tube.inner_m))),
                    ("length_mm", mm(of(|t| t.tube_m))),
                    ("behind_mm", mm(of(|t| t.behind_m))),
                ],
            );
            part(
                "ram",
                &[
                    ("outer_mm", mm(of(|t| t.ram.outer_m))),
                    ("inner_mm", mm(of(|t| t.ram.inner_m))),
                    ("length_mm", mm(of(|t| t.ram_m))),
                ],
            );
            part("screw", &[("outer_mm", mm(of(|t| t.screw.outer_m))), ("inner_mm", mm(of(|t| t.screw.inner_m)))]);
            for (name, seats) in [("bearing", [a, b, c].map(|t| t.bearing)), ("nut", [a, b, c].map(|t| t.nut))] {
                part(
                    name,
                    &[
                        ("axial_n_per_m", whole(seats.map(|s| s.axial_n_per_m))),
                        ("radial_n_per_m", whole(seats.map(|s| s.radial_n_per_m))),
                    ],
                );
            }
            part(
                "guide",
                &[
                    ("radial_n_per_m", whole(of(|t| t.guide_n_per_m))),
                    ("key_nm_per_rad", whole(of(|t| t.key_nm_per_rad))),
                ],
            );
        }
        for (name, plate) in [("platform", &self.platform), ("base", &self.base)] {
            _ = writeln!(s, "[solid.{name}]");
            let Some(p) = plate else {
                s.push_str("kind = \"rigid\"\n");
                continue;
            };
            let hub = (name == "platform").then_some(("hub_mm", p.hub_m / MM));
            let sizes = [("thickness_mm", p.thickness_m / MM), ("bore_mm", p.bore_m / MM)];
            let rest = [("rim_mm", p.rim_m / MM), ("young_gpa", p.young_pa / 1e9), ("poisson", p.poisson)];
            for (key, value) in sizes.into_iter().chain(hub).chain(rest) {
                _ = writeln!(s, "{key} = {}", tidy(value));
            }
        }
        s
    }

    fn check_bores(&self, machine: &MachineParameters) -> Checked<()> {
        let plates = [
            ("platform", self.platform.as_ref().map(|p| (Self::platform_bores(p, machine), p.rim_m))),
            ("base", self.base.as_ref().map(|p| (Self::base_bores(p, machine), p.rim_m))),
        ];
        for (name, plate) in plates {
            let Some((bores, rim)) = plate else { continue };
            let widest = bores.iter().map(|(_, size)| *size).fold(0.0, f64::max);
            if rim < 0.05 * widest {
                let message = format!(
                    "expected a rim of at least a twentieth of the widest bore, {:.1} mm, found {:.1} mm",
                    0.05 * widest / MM,
                    rim / MM
                );
                return misfit(format!("solid.{name}.rim_mm"), None, message);
            }
            for (i, (at, size)) in bores.iter().enumerate() {
                for (other, other_size) in &bores[..i] {
                    let wall = (at[0] - other[0]).hypot(at[1] - other[1]) - 0.5 * (size + other_size);
                    if wall < 0.1 * rim {
                        let message = format!(
                            "bores too near: {:.1} mm of material between two of them, expected a tenth of the rim, {:.1} mm",
                            wall / MM,
                            0.1 * rim / MM
                        );
                        return misfit(format!("solid.{name}.bore_mm"), None, message);
                    }
                }
            }
        }
        Ok(())
    }
}
