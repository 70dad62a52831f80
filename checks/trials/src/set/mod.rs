//! One data set: a machine, what it was declared as, readings, held-out deflections, and what is in it.

mod measuring;
#[cfg(test)]
mod tests;
mod tuning;

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{DVector, Vector6};
use serde_json::{Value, json};

use self::measuring::{HeldOut, LAYOUTS, NOISE, held_out, layouts_for, misaim, noise, plan, pose_in, round};
use self::tuning::{Tuning, whitened};
use crate::Random;
use crate::effects::{self, Effect, LISTED, Needs, OUTSIDE, Spec};
use crate::forms::FORMS;
use crate::machine::{Machine, Part, Pose};
use crate::truth::{Row, World};

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
pub struct SetOptions {
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
    /// Read in steps of so many micrometres, and of five times as many microradians
    #[arg(long)]
    pub step_um: Option<f64>,
    /// Read each load once, and declare the noise so many times as great as it is
    #[arg(long)]
    pub declared: Option<f64>,
}

/// Relative scatter of declared stiffnesses.
const SCATTER: f64 = 0.05;
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
    /// Of one reading: µm and µrad.
    declared_noise: Option<[f64; 2]>,
    held: HeldOut,
    /// So many more that their error is that of all that could be held out.
    many_held: HeldOut,
    rotations: bool,
    temperature: bool,
    wrong: Vec<String>,
    factor: f64,
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
    /// Draws a set; all of it follows from the seed and the conditions.
    pub fn new(kind: Kind, seed: u64, conditions: &SetOptions) -> Result<Self, String> {
        let mut rng = Random::new(seed ^ ((kind as u64 + 1) << 48));
        for attempt in 0..200 {
            // declared values by turns: some parts hardly act and would be drawn away
            let part = &WRONG[(seed as usize / 2 + attempt / 12) % WRONG.len()];
            if let Some(set) = Self::draw(kind, seed, conditions, part, &mut rng)? {
                return Ok(set);
            }
        }
        Err(format!("seed {seed}: no set can show this"))
    }

    /// `None` when re-identification takes so much of the signal that the set shows nothing.
    fn draw(
        kind: Kind,
        seed: u64,
        conditions: &SetOptions,
        part: &Wrong,
        rng: &mut Random,
    ) -> Result<Option<Self>, String> {
        let specs = specs(kind, conditions, rng)?;
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
        let count = conditions.poses.unwrap_or(count);

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
            declared_noise: None,
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
            Kind::One | Kind::Two | Kind::Outside | Kind::Forms | Kind::FormPairs => {
                set.put_in(&specs, conditions, rng)
            }
        };
        if !shows {
            return Ok(None);
        }
        set.readings = set.world.deflections(&set.poses, &set.rows, true);
        noise(&set.rows, &mut set.readings, rng);
        if let Some(step_um) = conditions.step_um {
            round(&mut set.readings, step_um);
        }
        if let Some(factor) = conditions.declared {
            set.read_once(factor);
        }
        set.many_held = held_out(rng, &set.declared, angle, !levels.moment.is_empty(), temperature, 12);
        for held in [&mut set.held, &mut set.many_held] {
            held.values = set.world.deflections(&held.poses, &held.rows, conditions.sensed_heldout);
        }
        Ok(Some(set))
    }

    /// Leaves the first reading of each load, and declares its noise: so many times as great as it is.
    fn read_once(&mut self, factor: f64) {
        let both = std::mem::take(&mut self.rows).into_iter().zip(std::mem::take(&mut self.readings));
        (self.rows, self.readings) = both.filter(|(row, _)| row.repeat == 1).unzip();
        self.declared_noise = Some(NOISE.map(|[reading, zero]| factor * reading.hypot(zero)));
    }

    /// What changes in the readings from one machine to another, whitened.
    fn signal(&self, from: &World, to: &World) -> DVector<f64> {
        let (a, b) = (from.deflections(&self.poses, &self.rows, true), to.deflections(&self.poses, &self.rows, true));
        let change: Vec<_> = b.iter().zip(&a).map(|(b, a)| b - a).collect();
        whitened(&self.rows, &change, self.rotations)
    }

    /// Puts effects into the machine, as strong as wanted; false when they cannot be seen there.
    fn put_in(&mut self, specs: &[Spec], conditions: &SetOptions, rng: &mut Random) -> bool {
        let tuning = Tuning::new(&self.world, &self.poses, &self.rows, self.rotations);
        let mut signals = Vec::new();
        let mut chosen = Vec::new();
        let bare = self.world.clone();
        for spec in specs {
            let bins = [(35.0, 100.0), (100.0, 400.0), (400.0, 1000.0), (1000.0, 5000.0)];
            let (low, high) = bins[if specs.len() > 1 { 1 + rng.index(3) } else { rng.index(4) }];
            let target = conditions.lambda.unwrap_or_else(|| rng.log_between(low, high));
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
        conditions.effect.is_some() || conditions.lambda.is_some() || (seen && apart)
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
        let mut measured = self.csv(&self.poses, &self.rows, &self.readings, 1, 2);
        if let Some([linear, angular]) = self.declared_noise {
            let numbers = format!(",{linear:.3},{angular:.3}\n");
            measured = measured.replace('\n', &numbers).replacen(&numbers, ",sigma_linear_um,sigma_angular_urad\n", 1);
        }
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

    /// The held-out loads on A as readings of a point ahead of A by this much along w, without what is read; and of each its zone and
    /// how the point moves, m.
    pub fn asked(&self, ahead_m: f64) -> (String, Vec<(&'static str, [f64; 3])>) {
        let HeldOut { poses, rows, zones, values } = &self.held;
        let mut lines = self.csv(poses, rows, values, 101, 4).lines().map(str::to_owned).collect::<Vec<_>>();
        for (n, line) in lines.iter_mut().enumerate() {
            let point = format!("0,0,0,0,0,{}", ahead_m * 1e3);
            let columns = "load_u_mm,load_v_mm,load_w_mm,point_u_mm,point_v_mm,point_w_mm";
            *line += &format!(",{}", if n == 0 { columns } else { &point });
        }
        let moved = |d: &Vector6<f64>| [d[0] + ahead_m * d[4], d[1] - ahead_m * d[3], d[2]];
        (lines.join("\n") + "\n", zones.iter().copied().zip(values.iter().map(moved)).collect())
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
fn specs(kind: Kind, conditions: &SetOptions, rng: &mut Random) -> Result<Vec<Spec>, String> {
    let listed = |rng: &mut Random| if rng.chance(0.04) { effects::COUPLING } else { rng.pick(&LISTED) };
    let wished = match &conditions.effect {
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
