//! What `embed/c/tests/compensator.c` prints, by the Rust compensator: the same readings, and every bit of the offsets.

use pkm_core::compensator::{
    CarriedWeight, Compensator, CompensatorSettings, Fault, Limit, Offset, Reading, Weight, WeightError,
};
use pkm_core::{Configuration, CorrectionTable, Domain, FiveAxis, Model, Pose, Scalar, TemperatureRise, Wrench};

use crate::qemu::Host;

const PERIODS: i32 = 4000;

/// As in the program.
const SETTINGS: CompensatorSettings = CompensatorSettings {
    stuck_s: 0.1,
    max_screw_m: 4e-6,
    max_wrist_rad: 1e-5,
    screw_rate_m_per_s: 1e-3,
    ..CompensatorSettings::DEFAULT
};

/// The program's random numbers.
pub struct Random(pub u32);

impl Random {
    /// From `from` to below `below`.
    pub fn next(&mut self, from: i32, below: i32) -> i32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        from + ((self.0 >> 8) % (below - from).unsigned_abs()) as i32
    }
}

/// What happens in a period.
#[derive(Default)]
struct Period {
    pose: [f64; 3],
    beta: [f64; 2],
    wrench: [f64; 6],
    rise: [f64; 4],
    enabled: bool,
}

impl Period {
    fn happen(&mut self, random: &mut Random, k: i32) {
        if k % 64 == 0 {
            let mut scaled = |from, below, by| f64::from(random.next(from, below)) / by;
            self.pose = [scaled(-60, 61, 200.0), scaled(-60, 61, 200.0), scaled(500, 561, 1000.0)];
            self.beta = [scaled(-100, 101, 500.0), scaled(-100, 101, 500.0)];
        }
        self.enabled = (k / 256) % 5 != 4 && random.next(0, 200) != 0;
        if (k / 512) % 3 != 2 {
            for (i, component) in self.wrench.iter_mut().enumerate() {
                *component = f64::from(random.next(-1000, 1001)) / if i < 3 { 2.0 } else { 100.0 };
            }
            match random.next(0, 40) {
                0 => self.wrench[1] = f64::NAN,
                1 => self.wrench[2] = 1e6,
                _ => {}
            }
        }
        for (i, rise) in (0..).zip(&mut self.rise) {
            *rise = f64::from(i) + f64::from(random.next(-4, 5)) / 10.0;
        }
        match random.next(0, 200) {
            lost @ 0..4 => self.rise[lost as usize] = f64::NAN,
            4 => self.rise[2] = 60.0,
            _ => {}
        }
    }
}

/// The number of a fault in `pkm.h`.
pub fn number(fault: Option<Fault>) -> Result<u8, String> {
    Ok(match fault {
        None => 0,
        Some(Fault::WrenchNotFinite) => 80,
        Some(Fault::WrenchTooLarge) => 81,
        Some(Fault::WrenchStuck) => 82,
        Some(Fault::TemperatureLost) => 83,
        Some(Fault::OutsideBox) => 84,
        Some(other) => return Err(format!("a fault that the program should not meet: {other}")),
    })
}

/// The lines of one compensator, and which faults and limits it met.
fn lines<T: Scalar, const JOINTS: usize>(
    name: &str,
    carried: Result<CarriedWeight<T, JOINTS>, WeightError>,
    mut update: impl FnMut(&mut Compensator<T, JOINTS>, &Configuration<T>, &Reading<T>) -> Offset<T, JOINTS>,
) -> Result<Vec<String>, String> {
    let mut compensator = Compensator::<T, JOINTS>::new(&SETTINGS).map_err(|e| e.to_string())?;
    let (mut random, mut period) = (Random(JOINTS as u32), Period::default());
    let (mut sum, mut lines) = (0_u64, Vec::new());
    let (mut faults, mut limits) = (Vec::new(), Vec::new());
    for k in 0..PERIODS {
        period.happen(&mut random, k);
        if k == PERIODS / 2 {
            compensator.reset();
        }
        if k == 3 * PERIODS / 4 {
            compensator.set_weight(Some(carried.map_err(|e| e.to_string())?));
        }
        let [theta_rad, sigma_rad, z0_m] = period.pose.map(T::from_f64);
        let at =
            Configuration { pose: Pose { theta_rad, sigma_rad, z0_m }, beta_rad: period.beta.map(T::from_f64).into() };
        let wrench = Wrench::from_vector(period.wrench.map(T::from_f64).into());
        let [first, second, third, platforms_k] = period.rise.map(T::from_f64);
        let rise = TemperatureRise { limbs_k: [first, second, third], platforms_k };
        let reading = Reading { enabled: period.enabled, wrench, rise };
        let Offset { joints, limit, domain, fault, .. } = update(&mut compensator, &at, &reading);
        let bits = joints.map(|joint| joint.to_f64().to_bits());
        sum = bits.iter().fold(sum, |sum, bits| (sum ^ bits).wrapping_mul(0x100_0000_01b3));
        let (fault, limit) = (number(fault)?, [Limit::None, Limit::Size, Limit::Rate].iter().position(|l| *l == limit));
        let limit = limit.ok_or("a limit that is not known here")?;
        faults.push(fault);
        limits.push(limit);
        if k % 50 == 49 {
            let domain = i32::from(domain == Domain::Outside);
            let bits: String = bits.iter().chain([&sum]).map(|bits| format!(" {bits:016x}")).collect();
            lines.push(format!("{name} {k} {limit} {domain} {fault}{bits}"));
        }
    }
    let met = [0, 80, 81, 82, 83, 84].iter().all(|n| faults.contains(n)) && (0..3).all(|n| limits.contains(&n));
    if met { Ok(lines) } else { Err(format!("{name}: not every fault and limit occurred")) }
}

fn both_kinds<T: Scalar>(
    width: &str,
    five: &FiveAxis<'_, T>,
    table: &CorrectionTable<'_, T>,
) -> Result<Vec<String>, String> {
    let tip = [0.01, -0.02, 0.3].map(T::from_f64).into();
    let number = T::from_f64;
    let home = Configuration {
        pose: Pose { theta_rad: T::ZERO, sigma_rad: T::ZERO, z0_m: number(0.53) },
        beta_rad: [T::ZERO; 2].into(),
    };
    let weight = |force_n: [f64; 3], centre_m: [f64; 3]| Weight {
        force_n: force_n.map(number).into(),
        centre_m: centre_m.map(number).into(),
    };
    let platform = weight([600.0, -150.0, -480.0], [0.02, -0.01, 0.1]);
    let tool = weight([150.0, -37.5, -120.0], [0.12, 0.01, -0.2]);
    let model = &Model::new(five.machine, table);
    let carried = CarriedWeight::<T, 3>::new(model, &platform, &home.pose, tip);
    let screws = lines::<T, 3>(&format!("compensator_{width}"), carried, |compensator, at, reading| {
        compensator.update(model, &at.pose, tip, reading)
    })?;
    let carried = CarriedWeight::<T, 5>::new(model, five.wrist, &platform, &tool, &home);
    let tool = lines::<T, 5>(&format!("tool_compensator_{width}"), carried, |compensator, at, reading| {
        compensator.update(model, five.wrist, at, reading)
    })?;
    Ok([screws, tool].concat())
}

/// Holds what the program printed against the host; returns the number of periods that are the same bits.
pub fn compare(text: &str, host: &Host) -> Result<usize, String> {
    let (double, single) = host.both(|m, t| both_kinds("f64", m, t), |m, t| both_kinds("f32", m, t))?;
    super::same_lines(text, &[double?, single?].concat())?;
    Ok(4 * PERIODS as usize)
}
