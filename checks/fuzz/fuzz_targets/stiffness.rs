//! Stiffness, deflection and compensation of any machine with any effects and any table, in both arithmetics.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pkm_core::correction::FACTOR_ENTRIES;
use pkm_core::nalgebra::Vector3;
use pkm_core::{Basis, CorrectionTable, Deflection, Machine, Pose, Scalar, StiffnessFactor, Wrench};
use pkm_fuzz::{Numbers, Rounded, assert_finite};

const TERMS: usize = 2;

fn assert_deflection<T: Scalar>(d: &Deflection<T>) {
    assert_finite(d.to_vector().iter().copied());
}

/// K = F Fᵀ is symmetric and positive definite by its making if every number is finite and the diagonal above 0.
fn assert_factor<T: Scalar>(factor: &StiffnessFactor<T>) {
    assert_finite(factor.lower().iter().copied());
    assert!(factor.lower().diagonal().iter().all(|pivot| *pivot > T::ZERO));
}

struct Load<T> {
    wrench: Wrench<T>,
    turned_at: Wrench<T>,
    tip_m: Vector3<T>,
    temperature_c: T,
}

fn walk<T: Scalar>(machine: &Machine<T>, table: Option<&CorrectionTable<'_, T>>, pose: &Pose<T>, load: &Load<T>) {
    if let Ok(stiffness) = machine.stiffness(pose) {
        let k = stiffness.matrix();
        assert_finite(k.iter().copied());
        assert!(stiffness.principal().iter().all(|k| *k > T::ZERO));
        assert_eq!(k, k.transpose());
        if let Ok(factor) = stiffness.factor() {
            assert_factor(&factor);
            if let Ok(deflection) = factor.deflection(&load.wrench) {
                assert_deflection(&deflection);
                if let Ok(compensated) = machine.compensated(pose, &deflection, load.tip_m) {
                    assert_eq!(machine.inverse(&compensated.pose), Ok(compensated.lengths));
                }
            }
        }
    }
    if let Ok(deflection) = machine.load_dependent_deflection(pose, &load.wrench, &load.turned_at) {
        assert_deflection(&deflection);
    }
    if let Ok(deflection) = machine.thermal_deflection(pose, load.temperature_c) {
        assert_deflection(&deflection);
    }
    if let Some(table) = table {
        for corrected in [table.factor_form(machine, pose), table.diagonal_form(machine, pose)] {
            if let Ok(corrected) = corrected {
                assert_factor(&corrected.factor);
            }
        }
        if let Ok(cycle) = table.cycle(machine, pose, &load.wrench, load.tip_m) {
            assert_factor(&cycle.corrected.factor);
            assert_deflection(&cycle.deflection);
            assert_finite(cycle.lengths.q_m.iter().chain(&cycle.compensated.lengths.q_m).copied());
        }
    }
}

macro_rules! walk {
    ($t:ty, $parameters:expr, $centre:expr, $half_width:expr, $terms:expr, $diagonal:expr, $factor:expr, $pose:expr,
     $load:expr) => {
        let (diagonal, factor): ([$t; 6 * TERMS], [$t; FACTOR_ENTRIES * TERMS]) =
            ($diagonal.rounded(), $factor.rounded());
        let table = Basis::<$t>::new($centre.rounded(), $half_width.rounded(), $terms)
            .and_then(|basis| CorrectionTable::<$t>::new(basis, &diagonal, Some(&factor)));
        if let Ok(machine) = Machine::<$t>::new($parameters) {
            let (wrench, turned_at, tip_m, temperature_c) = $load;
            let load = Load::<$t> {
                wrench: wrench.rounded(),
                turned_at: turned_at.rounded(),
                tip_m: tip_m.rounded().into(),
                temperature_c: temperature_c as $t,
            };
            walk(&machine, table.as_ref().ok(), &$pose.rounded(), &load);
            if let Ok(warm) = machine.at_temperature(load.temperature_c) {
                walk(&warm, None, &$pose.rounded(), &load);
            }
        }
    };
}

fuzz_target!(|bytes: &[u8]| {
    let mut n = Numbers(bytes);
    let (parameters, pose) = (n.machine(), n.pose());
    let load = (n.wrench(), n.wrench(), n.numbers([0.0, 0.0, 0.3]), n.number(30.0));
    let (centre, half_width) = (n.numbers([0.0, 0.0, 0.53]), n.numbers([0.26, 0.26, 0.03]));
    let terms = [[0, 0, 0], [n.byte() % 8, n.byte() % 8, n.byte() % 8]];
    // the table that changes nothing, and then some
    let mut diagonal = [0.0; 6 * TERMS];
    let mut factor = [0.0; FACTOR_ENTRIES * TERMS];
    for i in 0..6 {
        diagonal[i * TERMS] = 1.0;
        factor[i * (i + 3) / 2 * TERMS] = 1.0;
    }
    for _ in 0..n.byte() % 16 {
        let place = usize::from(n.byte());
        let all = diagonal.len() + factor.len();
        let number = diagonal.iter_mut().chain(&mut factor).nth(place % all).expect("one of all");
        *number = n.number(1.0);
    }
    walk!(f64, &parameters, centre, half_width, &terms, diagonal, factor, pose, load);
    walk!(f32, &parameters, centre, half_width, &terms, diagonal, factor, pose, load);
});
