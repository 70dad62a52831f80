//! One data set: a machine, what it was declared as, readings, held-out deflections, and what is in it.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{DMatrix, DVector, Vector3, Vector6};
use serde_json::{Value, json};

use crate::Random;
use crate::effects::{self, Effect, LISTED, Needs, OUTSIDE, Spec};
use crate::forms::FORMS;
use crate::machine::{Machine, Part, Pose};
use crate::truth::{Row, World, Wrench};

/// What a set is meant to show.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// Only scatter of the declared stiffnesses.
    None,
    /// One effect.
    One,
    /// Two at once.
    Two,
    /// A declared value that is wrong.
    Declared,
    /// Physics that is not in the contract.
    Outside,
    /// As `none`, under loads that miss their mark.
    LoadErrors,
    /// One thing, in a form that is nobody's.
    Forms,
    /// Two of these.
    FormPairs,
    /// As `none`, but three times the scatter.
    Scatter,
}

impl Kind {
    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::One => "one",
            Self::Two => "two",
            Self::Declared => "declared",
            Self::Outside => "outside",
            Self::LoadErrors => "load-errors",
            Self::Forms => "forms",
            Self::FormPairs => "form-pairs",
            Self::Scatter => "scatter",
        }
    }
}

/// What may be asked of a set beyond its kind.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Wish {
    /// Only this effect (of the contract, or one outside it), instead of a random one
    #[arg(long)]
    pub effect: Option<String>,
    /// Aim at this λ instead of a random one
    #[arg(long)]
    pub lambda: Option<f64>,
    /// Let held-out deflections hold what the sensor makes of them; else they are the machine's own
    #[arg(long)]
    pub sensed_heldout: bool,
    /// Measure at this many poses, instead of a random number
    #[arg(long)]
    pub poses: Option<usize>,
}

/// Standard deviations of a reading (µm, µrad) and of a series' zero.
const NOISE: [[f64; 2]; 2] = [[1.5, 0.7], [5.0, 2.5]];
/// Relative scatter of declared stiffnesses.
const SCATTER: f64 = 0.05;
/// What a user believes of it.
const PRIOR: f64 = 0.10;

/// A generated set.
#[derive(Clone, Debug)]
pub struct Set {
    /// Kind.
    pub kind: Kind,
    /// All follows from it.
    pub seed: u64,
    /// Signal of the effect that re-identification of the stiffnesses cannot take.
    pub lambda: f64,
    declared: Machine,
    world: World,
    poses: Vec<Pose>,
    rows: Vec<Row>,
    readings: Vec<Vector6<f64>>,
    held: HeldOut,
    /// So many more that their error is that of all that could be held out.
    many_held: HeldOut,
    rotations: bool,
    temperature: bool,
    wrong: Vec<String>,
    factor: f64,
}

/// Loads of a series, in order.
struct Levels {
    force: &'static [f64],
    moment: &'static [f64],
    unload: bool,
}

const LAYOUTS: [Levels; 6] = [
    Levels { force: &[200.0, 500.0, 1000.0], moment: &[30.0, 100.0], unload: true },
    Levels { force: &[500.0, 1000.0], moment: &[20.0, 50.0, 100.0], unload: false },
    Levels { force: &[200.0, 500.0, 1000.0], moment: &[], unload: true },
    Levels { force: &[100.0, 200.0, 400.0, 700.0, 1000.0], moment: &[50.0, 100.0], unload: false },
    Levels { force: &[100.0, 250.0, 500.0, 1000.0], moment: &[30.0, 100.0], unload: true },
    Levels { force: &[500.0, 1000.0], moment: &[], unload: false },
];

fn layouts_for(needs: &[Needs]) -> Vec<usize> {
    let fits = |levels: &Levels| {
        needs.iter().all(|n| match n {
            Needs::Nothing | Needs::Temperature => true,
            Needs::Moments => !levels.moment.is_empty(),
            Needs::Levels => levels.force.len() >= 4,
            Needs::Unloading => levels.unload,
        })
    };
    (0..LAYOUTS.len()).filter(|i| fits(&LAYOUTS[*i])).collect()
}

/// A pose of the box, `wide` times as large.
fn pose_in(rng: &mut Random, machine: &Machine, angle: f64, wide: f64) -> Pose {
    loop {
        let mut part = |limit: f64| rng.between(-limit, limit);
        let (theta, sigma, z) = (part(angle * wide), part(angle * wide), part(0.030 * wide));
        let round = |v: f64, digits: f64| (v * digits).round() / digits;
        let pose = Pose([
            round(theta.to_degrees(), 1e4).to_radians(),
            round(sigma.to_degrees(), 1e4).to_radians(),
            round(0.530 + z, 1e6),
        ]);
        let beyond = theta.abs() > angle || sigma.abs() > angle || z.abs() > 0.030;
        if machine.reaches(&pose) && (wide <= 1.0 || beyond) {
            return pose;
        }
    }
}

fn plan(rng: &mut Random, poses: usize, levels: &Levels, soft_y: bool, temperature: bool) -> Vec<Row> {
    let mut rows = Vec::new();
    let (mut series, mut t) = (0, rng.between(19.0, 23.0));
    for pose in 0..poses {
        if temperature {
            // between poses time goes by
            t = (t + 2.0 * rng.normal()).clamp(17.0, 27.0);
        }
        for axis in 0..6 {
            let list = if axis < 3 { levels.force } else { levels.moment };
            if list.is_empty() {
                continue;
            }
            let share = if soft_y && axis == 1 { 0.5 } else { 1.0 };
            for sign in [1.0, -1.0] {
                for repeat in 1..=2 {
                    series += 1;
                    let up = list.iter().map(|l| (*l, false));
                    let falls = if levels.unload && axis < 3 { list.len() - 1 } else { 0 };
                    let down = list[..falls].iter().rev().map(|l| (*l, true));
                    for (level, unload) in up.chain(down) {
                        if temperature {
                            t = (t + 0.1 * rng.normal()).clamp(16.0, 28.0);
                        }
                        let wrench = Wrench::ith(axis, sign * level * share);
                        let temperature = if temperature { (t * 100.0).round() / 100.0 } else { 20.0 };
                        rows.push(Row { pose, wrench, applied: wrench, series, repeat, unload, temperature });
                    }
                }
            }
        }
    }
    rows
}

/// Poses and loads that were not measured.
#[derive(Clone, Debug)]
struct HeldOut {
    poses: Vec<Pose>,
    rows: Vec<Row>,
    zones: Vec<&'static str>,
    values: Vec<Vector6<f64>>,
}

/// Draws `count` times 22 poses that were not measured.
fn held_out(
    rng: &mut Random,
    machine: &Machine,
    angle: f64,
    moments: bool,
    temperature: bool,
    count: usize,
) -> HeldOut {
    let (mut poses, mut rows, mut zones) = (Vec::new(), Vec::new(), Vec::new());
    for n in 0..22 * count {
        let zone = ["inside", "beyond", "loads"][usize::from(n % 22 >= 8) + usize::from(n % 22 >= 16)];
        poses.push(pose_in(rng, machine, angle, if zone == "beyond" { 1.4 } else { 1.0 }));
        let t = if temperature { (rng.between(17.0, 26.0) * 100.0).round() / 100.0 } else { 20.0 };
        for k in 0..if zone == "loads" { 4 } else { 5 } {
            let mut wrench = Wrench::zeros();
            if zone == "loads" {
                let part = |v: Vector3<f64>, size: f64| v.map(|x| (x * size * 10.0).round() / 10.0);
                wrench.fixed_rows_mut::<3>(0).copy_from(&part(rng.direction(), 1500.0));
                let moment = part(rng.direction(), rng.between(20.0, 120.0));
                wrench.fixed_rows_mut::<3>(3).copy_from(&moment);
            } else {
                let sign = rng.pick(&[1.0, -1.0]);
                match k {
                    4 if moments => wrench[3 + rng.index(3)] = sign * 100.0,
                    3 | 4 => wrench[rng.index(3)] = sign * rng.pick(&[300.0, 700.0, 1000.0]),
                    axis => wrench[axis] = sign * rng.pick(&[300.0, 700.0, 1000.0]),
                }
            }
            let series = rows.len() + 1;
            rows.push(Row { pose: n, wrench, applied: wrench, series, repeat: 1, unload: false, temperature: t });
            zones.push(zone);
        }
    }
    HeldOut { poses, rows, zones, values: Vec::new() }
}

/// Readings in µm and µrad as one vector, whitened with the noise of a reading and of a series' zero.
fn whitened(rows: &[Row], readings: &[Vector6<f64>], rotations: bool) -> DVector<f64> {
    let channels = if rotations { 6 } else { 3 };
    let mut all = DVector::zeros(rows.len() * channels);
    for same in rows.chunk_by(|a, b| a.series == b.series).scan(0, |from, chunk| {
        let range = *from..*from + chunk.len();
        *from = range.end;
        Some(range)
    }) {
        let n = same.len() as f64;
        for channel in 0..channels {
            let [s, t] = NOISE[channel / 3];
            let mean = same.clone().map(|i| readings[i][channel] * 1e6).sum::<f64>() / n;
            let share = 1.0 - s / (s * s + n * t * t).sqrt();
            for i in same.clone() {
                all[i * channels + channel] = (readings[i][channel] * 1e6 - share * mean) / s;
            }
        }
    }
    all
}

/// Derivatives of the whitened readings by every declared stiffness, times its prior.
struct Tuning {
    jacobian: DMatrix<f64>,
    /// (AᵀA + 1)⁻¹
    inner: DMatrix<f64>,
}

impl Tuning {
    fn new(world: &World, poses: &[Pose], rows: &[Row], rotations: bool) -> Self {
        let bare = world.with(Vec::new());
        let base = bare.deflections(poses, rows, false);
        let h = 1e-3;
        let columns: Vec<DVector<f64>> = bare
            .machine
            .stiffnesses()
            .into_iter()
            .map(|which| {
                let mut moved = bare.clone();
                moved.machine.scale(which, 1.0 + h);
                let there = moved.deflections(poses, rows, false);
                let change: Vec<_> = there.iter().zip(&base).map(|(a, b)| (a - b) * (PRIOR / h)).collect();
                whitened(rows, &change, rotations)
            })
            .collect();
        let jacobian = DMatrix::from_columns(&columns);
        let inner = jacobian.tr_mul(&jacobian) + DMatrix::identity(columns.len(), columns.len());
        let inner = inner.cholesky().expect("identity plus a square").inverse();
        Self { jacobian, inner }
    }

    /// aᵀ(1 + AAᵀ)⁻¹b in its small form.
    fn product(&self, a: &DVector<f64>, b: &DVector<f64>) -> f64 {
        a.dot(b) - (self.jacobian.tr_mul(a).transpose() * &self.inner * self.jacobian.tr_mul(b))[0]
    }

    /// λ = ηᵀ(1 + AAᵀ)⁻¹η.
    fn lambda(&self, signal: &DVector<f64>) -> f64 {
        self.product(signal, signal)
    }
}

/// Parts of a machine that may be declared wrong together: limbs, which entries, and their names in files.
type Wrong = (&'static [usize], &'static str, &'static str);
const WRONG: [Wrong; 6] = [
    (&[0, 1], "platform_joint", "linear_n_per_m"),
    (&[0, 1], "base_joint", "linear_n_per_m"),
    (&[2], "platform_joint", "linear_n_per_m"),
    (&[2], "base_joint", "linear_n_per_m"),
    (&[0, 1], "base_joint", "angular_nm_per_rad"),
    (&[0, 1, 2], "body", "young_gpa"),
];

fn is_part(part: Part, joint: &str, entries: &str) -> bool {
    let range = if entries.starts_with("linear") { 0..3 } else { 3..6 };
    match part {
        Part::Base(j) => joint == "base_joint" && range.contains(&j),
        Part::Platform(j) => joint == "platform_joint" && range.contains(&j),
        Part::Young => joint == "body",
        Part::Shear => false,
    }
}

impl Set {
    /// Draws a set; all of it follows from the seed and the wish.
    pub fn new(kind: Kind, seed: u64, wish: &Wish) -> Result<Self, String> {
        let mut rng = Random::new(seed ^ ((kind as u64 + 1) << 48));
        for attempt in 0..200 {
            // declared values by turns: some parts hardly act and would be drawn away
            let part = &WRONG[(seed as usize / 2 + attempt / 12) % WRONG.len()];
            if let Some(set) = Self::draw(kind, seed, wish, part, &mut rng)? {
                return Ok(set);
            }
        }
        Err(format!("seed {seed}: no set can show this"))
    }

    /// `None` when re-identification takes so much of the signal that the set shows nothing.
    fn draw(kind: Kind, seed: u64, wish: &Wish, part: &Wrong, rng: &mut Random) -> Result<Option<Self>, String> {
        let specs = specs(kind, wish, rng)?;
        let needs: Vec<Needs> = specs.iter().map(|s| s.needs).collect();
        let temperature = needs.contains(&Needs::Temperature) || rng.chance(0.1);
        let rotations = needs.contains(&Needs::Moments) || !rng.chance(0.12);
        let levels = &LAYOUTS[rng.pick(&layouts_for(&needs))];
        let angle = rng.pick(&[12.0_f64, 12.0, 15.0]).to_radians();
        let count = match rng.index(10) {
            0 => 12 + rng.index(29),
            1..5 => 10,
            _ => 12 + rng.index(9),
        };
        let count = wish.poses.unwrap_or(count);

        let declared = if rng.chance(0.4) { Machine::reference() } else { Machine::random(rng) };
        let mut machine = declared.clone();
        for which in declared.stiffnesses() {
            let scatter = if kind == Kind::Scatter { 3.0 * SCATTER } else { SCATTER };
            machine.scale(which, (scatter * rng.normal()).exp());
        }
        let poses: Vec<Pose> = (0..count).map(|_| pose_in(rng, &declared, angle, 1.0)).collect();
        let soft_y = rng.chance(0.3);
        let rows = plan(rng, count, levels, soft_y, temperature);
        let held = held_out(rng, &declared, angle, !levels.moment.is_empty(), temperature, 1);
        let mut set = Self {
            kind,
            seed,
            lambda: 0.0,
            world: World::new(declared.clone(), machine, Vec::new()),
            declared,
            poses,
            rows,
            readings: Vec::new(),
            held,
            many_held: HeldOut { poses: Vec::new(), rows: Vec::new(), zones: Vec::new(), values: Vec::new() },
            rotations,
            temperature,
            wrong: Vec::new(),
            factor: 1.0,
        };
        let shows = match kind {
            Kind::None | Kind::Scatter => true,
            Kind::LoadErrors => {
                misaim(&mut set.rows, rng);
                true
            }
            Kind::Declared => set.declare_wrong(part, rng),
            Kind::One | Kind::Two | Kind::Outside | Kind::Forms | Kind::FormPairs => set.put_in(&specs, wish, rng),
        };
        if !shows {
            return Ok(None);
        }
        set.readings = set.world.deflections(&set.poses, &set.rows, true);
        noise(&set.rows, &mut set.readings, rng);
        set.many_held = held_out(rng, &set.declared, angle, !levels.moment.is_empty(), temperature, 12);
        for held in [&mut set.held, &mut set.many_held] {
            held.values = set.world.deflections(&held.poses, &held.rows, wish.sensed_heldout);
        }
        Ok(Some(set))
    }

    /// What changes in the readings from one machine to another, whitened.
    fn signal(&self, from: &World, to: &World) -> DVector<f64> {
        let (a, b) = (from.deflections(&self.poses, &self.rows, true), to.deflections(&self.poses, &self.rows, true));
        let change: Vec<_> = b.iter().zip(&a).map(|(b, a)| b - a).collect();
        whitened(&self.rows, &change, self.rotations)
    }

    /// Puts effects into the machine, as strong as wanted; false when they cannot be seen there.
    fn put_in(&mut self, specs: &[Spec], wish: &Wish, rng: &mut Random) -> bool {
        let tuning = Tuning::new(&self.world, &self.poses, &self.rows, self.rotations);
        let mut signals = Vec::new();
        let mut chosen = Vec::new();
        let bare = self.world.clone();
        for spec in specs {
            let bins = [(35.0, 100.0), (100.0, 400.0), (400.0, 1000.0), (1000.0, 5000.0)];
            let (low, high) = bins[if specs.len() > 1 { 1 + rng.index(3) } else { rng.index(4) }];
            let target = wish.lambda.unwrap_or_else(|| rng.log_between(low, high));
            let signal = |effect: &Effect| self.signal(&bare, &bare.with(vec![effect.clone()]));
            let lambda = |effect: &Effect| tuning.lambda(&signal(effect));
            let effect = scaled_to(Effect::random(spec, rng), spec, target, lambda);
            signals.push(signal(&effect));
            chosen.push(effect);
        }
        let least = if specs.len() > 1 { 80.0 } else { 30.0 };
        let seen = signals.iter().all(|s| tuning.lambda(s) >= least);
        // two that move the readings alike are one to whoever reads them
        let apart = signals.iter().enumerate().all(|(i, a)| {
            let product = |b: &DVector<f64>| tuning.product(a, b).powi(2) / (tuning.lambda(a) * tuning.lambda(b));
            signals[..i].iter().all(|b| product(b) < 0.8)
        });
        self.world = bare.with(chosen);
        self.lambda = tuning.lambda(&self.signal(&bare, &self.world));
        wish.effect.is_some() || wish.lambda.is_some() || (seen && apart)
    }

    /// Makes a part of the machine other than declared; false when no fit would find that.
    fn declare_wrong(&mut self, (limbs, joint, entries): &Wrong, rng: &mut Random) -> bool {
        // declared 30-50 % too stiff or too soft, by turns
        let off = rng.between(0.30, 0.50);
        let factor = 1.0 / if self.seed.is_multiple_of(2) { 1.0 + off } else { 1.0 - off };
        let mut other = self.world.clone();
        for (limb, part) in self.declared.stiffnesses() {
            if limbs.contains(&limb) && is_part(part, joint, entries) {
                other.machine.scale((limb, part), factor);
            }
        }
        let tuning = Tuning::new(&self.world, &self.poses, &self.rows, self.rotations);
        // here it is what re-identification takes beyond its prior
        let signal = self.signal(&self.world, &other);
        self.lambda = tuning.lambda(&signal);
        self.wrong = limbs.iter().map(|l| format!("limb.{}.{joint}.{entries}", l + 1)).collect();
        self.factor = factor;
        self.world = other;
        // what a fit is expected to move it by, in sd of the prior: 3 is the limit of a finding
        (&tuning.inner * tuning.jacobian.tr_mul(&signal)).amax() >= 3.3
    }

    /// `truth.json`.
    pub fn truth(&self) -> Value {
        let outside = |id: &str| OUTSIDE.iter().any(|s| s.id == id);
        let mut contains: Vec<&str> = self.world.effects.iter().map(|e| e.id).collect();
        let about: Vec<String> = (self.world.effects.iter())
            .map(|e| format!("{} form {}, amplitude {:.4}", e.id, e.variant, e.amplitude))
            .collect();
        let mut truth = json!({"kind": self.kind.name(), "seed": self.seed, "about": about.join("; ")});
        match self.kind {
            Kind::None | Kind::Scatter | Kind::LoadErrors => truth["expected_verdict"] = json!(["adequate"]),
            Kind::Declared => {
                truth["expected_verdict"] = json!(["adequate"]);
                truth["declared_value_finding"] =
                    json!(format!("{} are {:.2} of what was declared", self.wrong.join(", "), self.factor));
                truth["declared_parameters"] = json!(self.wrong);
            }
            Kind::Outside => {
                truth["expected_verdict"] = json!(["unexplained", "partly_explained", "ambiguous"]);
                contains.iter_mut().filter(|id| outside(id)).for_each(|id| *id = "(outside the list)");
            }
            Kind::One | Kind::Two => {}
            Kind::Forms | Kind::FormPairs => contains.clear(),
        }
        let accept: Vec<&str> = self.world.effects.iter().flat_map(Effect::accepted).collect();
        truth["accept"] = json!(accept);
        let where_ok: Vec<_> = self.world.effects.iter().map(effects::places_of).collect();
        truth["where_ok"] = json!(where_ok);
        truth["contains"] = json!(contains);
        truth["lambda"] = json!(self.lambda.round());
        truth
    }

    /// Writes the folder; with very many held-out poses too, if asked.
    pub fn write(&self, folder: &Path, many: bool) -> Result<(), String> {
        let put = |name: &str, text: String| {
            std::fs::create_dir_all(folder)
                .and_then(|()| std::fs::write(folder.join(name), text))
                .map_err(|e| format!("{}: {e}", folder.join(name).display()))
        };
        put("machine.toml", self.declared.toml("trial"))?;
        let measured = self.csv(&self.poses, &self.rows, &self.readings, 1, 2);
        put("measured.csv", measured)?;
        let csv = |held: &HeldOut| self.csv(&held.poses, &held.rows, &held.values, 101, 4);
        put("heldout.csv", csv(&self.held))?;
        if many {
            put("heldout_many.csv", csv(&self.many_held))?;
        }
        let mut zones = "row,pose,zone\n".to_owned();
        for (i, (row, zone)) in self.held.rows.iter().zip(&self.held.zones).enumerate() {
            _ = writeln!(zones, "{i},p{},{zone}", row.pose + 101);
        }
        put("heldout_zones.csv", zones)?;
        put("truth.json", format!("{:#}\n", self.truth()))
    }

    fn csv(&self, poses: &[Pose], rows: &[Row], values: &[Vector6<f64>], first: usize, digits: usize) -> String {
        let mut s =
            "pose,theta_deg,sigma_deg,z0_mm,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,dx_um,dy_um,dz_um,rx_urad,ry_urad,\
                     rz_urad,series,repeat,direction"
                .to_owned();
        s += if self.temperature { ",temperature_c\n" } else { "\n" };
        for (row, value) in rows.iter().zip(values) {
            let [theta, sigma, z0] = poses[row.pose].0;
            let (theta, sigma, z0) = (theta.to_degrees(), sigma.to_degrees(), z0 * 1e3);
            _ = write!(s, "p{:02},{theta:.4},{sigma:.4},{z0:.3}", row.pose + first);
            row.wrench.iter().for_each(|w| _ = write!(s, ",{}", w + 0.0));
            for (i, v) in value.iter().enumerate() {
                _ = if i < 3 || self.rotations { write!(s, ",{:.digits$}", v * 1e6) } else { write!(s, ",") };
            }
            let direction = if row.unload { "unload" } else { "load" };
            _ = write!(s, ",{},{},{direction}", row.series, row.repeat);
            if self.temperature {
                _ = write!(s, ",{:.2}", row.temperature);
            }
            s.push('\n');
        }
        s
    }
}

/// Which effects a set of this kind gets.
fn specs(kind: Kind, wish: &Wish, rng: &mut Random) -> Result<Vec<Spec>, String> {
    let listed = |rng: &mut Random| if rng.chance(0.04) { effects::COUPLING } else { rng.pick(&LISTED) };
    let wished = match &wish.effect {
        Some(id) => Some(effects::find(id).ok_or_else(|| format!("no effect {id}"))?),
        None => None,
    };
    let first = match (kind, wished) {
        (Kind::None | Kind::Scatter | Kind::LoadErrors | Kind::Declared, _) => return Ok(Vec::new()),
        (_, Some(spec)) => spec,
        (Kind::Outside, None) => rng.pick(&OUTSIDE),
        (Kind::One | Kind::Two, None) => listed(rng),
        (Kind::Forms | Kind::FormPairs, None) => rng.pick(&FORMS),
    };
    let mut all = vec![first];
    while kind == Kind::FormPairs && all.len() < 2 {
        let second = rng.pick(&FORMS);
        let alike = first.id.split('-').nth(1) == second.id.split('-').nth(1);
        if !alike && !layouts_for(&[first.needs, second.needs]).is_empty() {
            all.push(second);
        }
    }
    while kind == Kind::Two && all.len() < 2 {
        let second = listed(rng);
        let axial = |s: &Spec| effects::declared_of(s.id).first().copied();
        let same_class = effects::class_of(first.id, false, false).contains(&second.id);
        let same_limb = axial(&first).is_some() && axial(&first) == axial(&second);
        if !same_class && !same_limb && !layouts_for(&[first.needs, second.needs]).is_empty() {
            all.push(second);
        }
    }
    Ok(all)
}

/// Changes the amplitude until the signal is as wanted, or the plausible range ends.
fn scaled_to(mut effect: Effect, spec: &Spec, target: f64, lambda: impl Fn(&Effect) -> f64) -> Effect {
    let (mut low, mut high) = (spec.range.0.ln(), spec.range.1.ln());
    for _ in 0..8 {
        let now = lambda(&effect);
        if (now / target).ln().abs() < 0.15 {
            break;
        }
        let at = effect.amplitude.ln();
        if now < target {
            low = at;
        } else {
            high = at;
        }
        // λ goes with the square of a small amplitude; where it doesn't, halving the residual does
        let guess = at + 0.5 * (target / now.max(1e-9)).ln();
        effect.amplitude = if guess > low && guess < high { guess } else { 0.5 * (low + high) }.exp();
    }
    effect
}

/// Per pose and direction of load: a small turn of the force and an error of its size.
fn misaim(rows: &mut [Row], rng: &mut Random) {
    let (angle, gain) = (rng.between(2e-3, 5e-3), rng.between(5e-3, 1e-2));
    let mut found = BTreeMap::new();
    for row in rows {
        let sign: [i8; 6] =
            std::array::from_fn(|i| if row.wrench[i] == 0.0 { 0 } else { row.wrench[i].signum() as i8 });
        let (turn, size) = *found
            .entry((row.pose, sign))
            .or_insert_with(|| (rng.direction() * (angle * rng.normal().abs()), 1.0 + gain * rng.normal()));
        let rotation = nalgebra::Rotation3::new(turn);
        for part in [0, 3] {
            let v: Vector3<f64> = row.wrench.fixed_rows::<3>(part).into();
            row.applied.fixed_rows_mut::<3>(part).copy_from(&(rotation * v * size));
        }
    }
}

fn noise(rows: &[Row], readings: &mut [Vector6<f64>], rng: &mut Random) {
    let mut zero = [0.0; 6];
    let mut series = usize::MAX;
    for (row, reading) in rows.iter().zip(readings) {
        if row.series != series {
            series = row.series;
            zero = std::array::from_fn(|i| NOISE[i / 3][1] * rng.normal());
        }
        for (i, v) in reading.iter_mut().enumerate() {
            *v += 1e-6 * (zero[i] + NOISE[i / 3][0] * rng.normal());
        }
    }
}

/// A machine whose stiffness [`stiffness`] writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Stiff {
    /// That of `fixtures/machines/reference.toml`.
    Reference,
    /// That of `fixtures/machines/x150.toml`.
    X150,
}

/// Stiffness at A in A-uvw of a machine with an elastic moving platform and an elastic base, by dense frames, over a box
/// that is as wide as travel lets it be: where nothing but the machine's own physics is wrong with the model.
///
/// # Errors
/// A machine that does not stand.
pub fn stiffness(of: Stiff) -> Result<String, String> {
    // θ and σ in degrees, Z0 in mm: least, greatest, step
    let (name, machine, grid): (_, _, [[i32; 3]; 3]) = match of {
        Stiff::Reference => ("reference", Machine::reference(), [[-36, 36, 9], [-24, 24, 8], [440, 620, 36]]),
        Stiff::X150 => ("X150", Machine::x150(), [[-6, 18, 3], [-8, 8, 4], [244, 272, 4]]),
    };
    let elastic = |id, amplitude| Effect { id, variant: 0, amplitude, shape: [0.0; 8] };
    let effects = vec![elastic("moving-platform-compliance", 3.0), elastic("base-compliance", 2.0)];
    let world = World::new(machine.clone(), machine, effects);
    let names: Vec<String> = (1..=6).flat_map(|i| (i..=6).map(move |j| format!("k{i}{j}"))).collect();
    let mut csv = format!(
        "# terminal stiffness of the {name} machine with an elastic moving platform and base, by dense frames; simulated\n\
         # K at A in A-uvw, SI\npose,theta_deg,sigma_deg,z0_mm,{}\n",
        names.join(",")
    );
    let mut count = 0;
    let [thetas, sigmas, heights] = grid.map(|[least, most, step]| (least..=most).step_by(step as usize));
    for theta in thetas {
        for sigma in sigmas.clone() {
            for z0 in heights.clone() {
                let pose = Pose([f64::from(theta).to_radians(), f64::from(sigma).to_radians(), f64::from(z0) / 1e3]);
                if !world.nominal.reaches(&pose) {
                    continue;
                }
                count += 1;
                let k = world.reduced(&pose, 20.0).c.try_inverse().ok_or("a compliance that has no inverse")?;
                let upper = (0..6).flat_map(|i| (i..6).map(move |j| (i, j)));
                let cells: Vec<String> = upper.map(|(i, j)| format!("{:.9e}", 0.5 * (k[(i, j)] + k[(j, i)]))).collect();
                csv.push_str(&format!("W{count:03},{theta},{sigma},{z0},{}\n", cells.join(",")));
            }
        }
    }
    Ok(csv)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_follows_from_the_seed() {
        for kind in [Kind::None, Kind::Two, Kind::Declared, Kind::Outside, Kind::LoadErrors] {
            let [a, b] = [0, 1].map(|_| Set::new(kind, 7, &Wish::default()).unwrap());
            assert_eq!((a.truth(), a.readings), (b.truth(), b.readings));
        }
        let [a, b] = [7, 8].map(|seed| Set::new(Kind::None, seed, &Wish::default()).unwrap());
        assert_ne!(a.readings[0], b.readings[0]);
    }

    #[test]
    fn every_effect_can_be_made_and_reaches_lambda() {
        for spec in LISTED.iter().chain([&effects::COUPLING]).chain(&OUTSIDE).chain(&FORMS) {
            let wish = Wish { effect: Some(spec.id.to_owned()), lambda: Some(60.0), ..Wish::default() };
            let is_among = |list: &[Spec]| list.iter().any(|s| s.id == spec.id);
            let kind = match spec {
                _ if is_among(&OUTSIDE) => Kind::Outside,
                _ if is_among(&FORMS) => Kind::Forms,
                _ => Kind::One,
            };
            let set = Set::new(kind, 3, &wish).unwrap();
            assert!(set.readings.iter().chain(&set.held.values).all(|d| d.norm() < 0.02), "{}", spec.id);
            // all stiffnesses together take a gain of the load; a telescope is never a plain rod
            let range = match spec.id {
                "load-gain" => 1.0..60.0,
                "telescopic-limb" => 20.0..1000.0,
                _ => 25.0..150.0,
            };
            assert!(range.contains(&set.lambda), "{}: {}", spec.id, set.lambda);
        }
    }

    #[test]
    fn noise_is_white_with_unit_variance_once_whitened() {
        let mut rng = Random::new(5);
        let rows = plan(&mut rng, 12, &LAYOUTS[0], false, false);
        let mut readings = vec![Vector6::zeros(); rows.len()];
        noise(&rows, &mut readings, &mut rng);
        let z = whitened(&rows, &readings, true);
        let n = z.len() as f64;
        assert!((z.norm_squared() / n - 1.0).abs() < 4.0 * (2.0 / n).sqrt());
        // the zero of a series is no longer in it: neighbours are independent
        let product: f64 = (0..z.len() - 6).map(|i| z[i] * z[i + 6]).sum::<f64>() / n;
        assert!(product.abs() < 4.0 / n.sqrt(), "{product}");
    }

    #[test]
    fn lambda_of_a_change_of_stiffness_is_what_the_prior_leaves() {
        let m = Machine::reference();
        let world = World::new(m.clone(), m.clone(), Vec::new());
        let mut rng = Random::new(1);
        let poses = [Pose([0.1, 0.05, 0.52]), Pose([-0.1, 0.1, 0.55])];
        let rows = plan(&mut rng, 2, &LAYOUTS[0], false, false);
        let tuning = Tuning::new(&world, &poses, &rows, true);
        let by_one_sd = tuning.jacobian.column(2).into_owned();
        // AᵀA (AᵀA + 1)⁻¹, below 1: re-identification by one sd costs 1 at most
        let expected = (tuning.jacobian.tr_mul(&tuning.jacobian) * &tuning.inner)[(2, 2)];
        assert!((tuning.lambda(&by_one_sd) / expected - 1.0).abs() < 1e-6 && expected < 1.0);
    }

    #[test]
    fn held_out_poses_beyond_the_box_are_within_travel() {
        let mut rng = Random::new(2);
        let machine = Machine::random(&mut rng);
        let HeldOut { poses, rows, zones, .. } = held_out(&mut rng, &machine, 0.2, true, false, 1);
        assert_eq!((rows.len(), zones.iter().filter(|z| **z == "beyond").count()), (104, 40));
        assert!(poses.iter().all(|p| machine.reaches(p)));
        let beyond = |p: &Pose| p.0[0].abs() > 0.2 || p.0[1].abs() > 0.2 || (p.0[2] - 0.53).abs() > 0.03;
        assert!(poses[8..16].iter().all(beyond) && !poses[..8].iter().any(beyond));
    }
}
