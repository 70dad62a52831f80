//! Where the load of a machine has turned: what the lag of its friction depends on.

use nalgebra::Vector3;

use crate::scalar::Scalar;

/// Most turns that are remembered of a limb. Smaller loops inside of the innermost leave no loss.
pub const MAX_TURNS: usize = 4;

/// What is remembered of the load on a machine, for its friction: the tensions of each limb at which the load turned and whose
/// loops have not closed (Masing's rule, `docs/theory.md`). The elongation that follows has no leap.
///
/// ```
/// use pkm_core::nalgebra::Vector3;
/// use pkm_core::stiffness::LoadHistory;
/// use pkm_core::tables::reference::PARAMETERS;
/// use pkm_core::{Machine, MachineParameters, Pose, StiffnessError, Wrench};
/// let effects = PARAMETERS.effects.with("friction-hysteresis", [2e-6, 0.0, 50.0]).unwrap();
/// let rubbing = Machine::<f64>::new(&MachineParameters { effects, ..PARAMETERS }).unwrap();
/// let mut history = LoadHistory::new();
/// let pose = Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.53 };
/// let mut loaded = |force_n: f64| {
///     let wrench = Wrench { force_n: Vector3::new(0.0, 0.0, force_n), ..Wrench::ZERO };
///     rubbing.load_response(&pose)?.deflection_after(&wrench, &mut history)
/// };
/// let up = loaded(200.0)?.translation_m.z;
/// loaded(800.0)?;
/// let down = loaded(200.0)?.translation_m.z;
/// assert!(down > up + 1e-6);
/// # Ok::<(), StiffnessError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoadHistory<T> {
    limbs: [Turns<T>; 3],
}

/// Of one limb.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Turns<T> {
    /// From the outermost loop to the innermost; the first `count` count.
    tensions: [T; MAX_TURNS],
    count: usize,
    last: T,
}

impl<T: Scalar> LoadHistory<T> {
    /// A load that has only grown.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes the next tensions.
    pub(super) fn go_on(&mut self, tensions: &Vector3<T>) {
        for (limb, tension) in self.limbs.iter_mut().zip(tensions.as_slice()) {
            limb.go_on(*tension);
        }
    }

    /// At which tensions a limb (0, 1, 2) turned.
    pub(super) fn turns(&self, limb: usize) -> &[T] {
        self.limbs.get(limb).map_or(&[], Turns::open)
    }
}

impl<T: Scalar> Turns<T> {
    fn open(&self) -> &[T] {
        self.tensions.get(..self.count).unwrap_or(&[])
    }

    fn go_on(&mut self, tension: T) {
        let step = tension - self.last;
        let so_far = self.last - self.open().last().copied().unwrap_or(T::ZERO);
        if step * so_far < T::ZERO
            && let Some(next) = self.tensions.get_mut(self.count)
        {
            *next = self.last;
            self.count += 1;
        }
        // a loop that closes is forgotten, with both its turns: the second is not there where there was no room for it
        if let [.., outer, inner] = self.open()
            && (tension - *inner) * (*inner - *outer) > T::ZERO
        {
            self.count -= 1;
        }
        // the outermost is forgotten where the load is greater than ever
        while let [.., outer, inner] = self.open() {
            if (tension - *outer) * (*outer - *inner) < T::ZERO {
                break;
            }
            self.count -= 2;
        }
        if let [first] = self.open()
            && tension.abs() >= first.abs()
        {
            self.count = 0;
        }
        self.last = tension;
    }
}
