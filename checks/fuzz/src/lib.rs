//! What the targets share: how bytes become numbers and machines, and what a refusal has to say.

use pkm_core::machine::BodyKind;
use pkm_core::tables::reference::{PARAMETERS, WRIST};
use pkm_core::{MachineParameters, Pose, Scalar, Wrench, WristParameters};
use pkm_files::error::Result;
use pkm_files::source::Source;

/// The file's name in every text target.
const FILE: &str = "input";

/// The bytes as a file, whatever they are.
pub fn file(bytes: &[u8]) -> Source {
    Source::from_text(FILE, String::from_utf8_lossy(bytes).into_owned())
}

/// What was read. A refusal must name the file, say something fit for a terminal, and lay the fault on the input.
pub fn read<T>(result: Result<T>) -> Option<T> {
    match result {
        Ok(value) => Some(value),
        Err(failure) => {
            assert_eq!(failure.file.as_deref(), Some(FILE), "{failure}");
            assert_eq!(failure.exit_code(), 2, "{failure}");
            assert!(!failure.message.trim().is_empty());
            assert!(!failure.to_string().contains(char::is_control), "{:?}", failure.to_string());
            None
        }
    }
}

/// Bytes as a supply of numbers. An empty one gives the usual number every time, so that few bytes change few numbers.
pub struct Numbers<'a>(pub &'a [u8]);

impl Numbers<'_> {
    /// The next byte, or 0.
    pub fn byte(&mut self) -> u8 {
        self.take::<1>()[0]
    }

    fn take<const N: usize>(&mut self) -> [u8; N] {
        let mut bytes = [0; N];
        for byte in &mut bytes {
            if let Some((first, rest)) = self.0.split_first() {
                (*byte, self.0) = (*first, rest);
            }
        }
        bytes
    }

    /// A number about the usual one, of any size, or of any bits.
    pub fn number(&mut self, usual: f64) -> f64 {
        match self.byte() {
            0..=31 => usual,
            32..=159 => usual * (1.0 + f64::from(i16::from_le_bytes(self.take())) / 8192.0),
            160..=223 => {
                let [mantissa, exponent] = self.take().map(|b: u8| b as i8);
                f64::from(mantissa) * 10f64.powi(i32::from(exponent) / 3)
            }
            _ => f64::from_bits(u64::from_le_bytes(self.take())),
        }
    }

    /// Numbers about the usual ones.
    pub fn numbers<const N: usize>(&mut self, usual: [f64; N]) -> [f64; N] {
        usual.map(|usual| self.number(usual))
    }

    fn change(&mut self, all: &mut [&mut f64], times: u8) {
        for _ in 0..times {
            let place = usize::from(self.byte()) % all.len();
            *all[place] = self.number(*all[place]);
        }
    }

    /// The reference machine with up to fifteen numbers changed, effects among them, and bodies of either kind.
    pub fn machine(&mut self) -> MachineParameters {
        let mut p = PARAMETERS;
        let first = self.byte();
        for (i, limb) in p.limbs.iter_mut().enumerate() {
            if first >> (4 + i) & 1 == 1 {
                limb.body.kind = BodyKind::Diagonal;
            }
        }
        let g = &mut p.geometry;
        let mut all: Vec<&mut f64> = Vec::with_capacity(256);
        all.extend([&mut g.a1_m, &mut g.a2_m, &mut g.b1_m, &mut g.b2_m]);
        all.extend(p.travel.min_m.iter_mut().chain(&mut p.travel.max_m));
        for limb in &mut p.limbs {
            for joint in [&mut limb.base_joint, &mut limb.platform_joint] {
                all.extend(joint.linear_n_per_m.iter_mut().chain(&mut joint.angular_nm_per_rad));
            }
            for tube in [&mut limb.body.rod, &mut limb.body.screw] {
                all.extend([&mut tube.young_pa, &mut tube.shear_pa, &mut tube.outer_m, &mut tube.inner_m]);
            }
        }
        all.extend(p.effects.parameters.as_flattened_mut());
        self.change(&mut all, first % 16);
        p
    }

    /// The reference wrist with up to seven numbers changed.
    pub fn wrist(&mut self) -> WristParameters {
        let mut w = WRIST;
        let mut all = vec![&mut w.offset_m, &mut w.first_d_m, &mut w.first_b_m, &mut w.second_b_m, &mut w.flange_m];
        all.extend([&mut w.home_z0_m, &mut w.singularity_margin]);
        all.extend(w.min_rad.iter_mut().chain(&mut w.max_rad));
        let count = self.byte() % 8;
        self.change(&mut all, count);
        w
    }

    /// A pose about one in the reference machine's box.
    pub fn pose(&mut self) -> Pose<f64> {
        let [theta_rad, sigma_rad, z0_m] = self.numbers([0.1, -0.05, 0.53]);
        Pose { theta_rad, sigma_rad, z0_m }
    }

    /// A load about one of cutting.
    pub fn wrench(&mut self) -> Wrench<f64> {
        Wrench::from_vector(self.numbers([120.0, 50.0, -400.0, 2.0, -1.0, 5.0]).into())
    }
}

/// Numbers rounded to the arithmetic that is tried.
pub trait Rounded<T> {
    /// The same with other numbers.
    type To;
    /// Rounds them.
    fn rounded(&self) -> Self::To;
}

impl<T: Scalar, const N: usize> Rounded<T> for [f64; N] {
    type To = [T; N];
    fn rounded(&self) -> [T; N] {
        self.map(T::from_f64)
    }
}

impl<T: Scalar> Rounded<T> for Pose<f64> {
    type To = Pose<T>;
    fn rounded(&self) -> Pose<T> {
        let [theta_rad, sigma_rad, z0_m] = [self.theta_rad, self.sigma_rad, self.z0_m].rounded();
        Pose { theta_rad, sigma_rad, z0_m }
    }
}

impl<T: Scalar> Rounded<T> for Wrench<f64> {
    type To = Wrench<T>;
    fn rounded(&self) -> Wrench<T> {
        let components: [f64; 6] = self.to_vector().into();
        Wrench::from_vector(components.rounded().into())
    }
}

/// Numbers that the core gave without an error.
#[track_caller]
pub fn assert_finite<T: Scalar>(numbers: impl IntoIterator<Item = T>) {
    for number in numbers {
        assert!(number.is_finite());
    }
}
