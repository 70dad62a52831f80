//! One bit that is not as it was built: found when the controller starts, and before it takes another table.

use pkm_core::checksum::{Damaged, MemoryChecksums};
use pkm_core::correction::{EQ_11, FACTOR_ENTRIES};
use pkm_core::effects::EFFECTS;
use pkm_core::tables::reference::{
    MACHINE_F32, MACHINE_F64, PARAMETERS, TABLE_F32, TABLE_F64, WRIST, WRIST_F32, WRIST_F64,
};
use pkm_core::{Basis, CorrectionTable, FiveAxis, Machine, MachineParameters, Wrist, WristParameters};
use pkm_tests::{between, cases, seeded};

static DOUBLE: FiveAxis<'static, f64> = FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 };
static SINGLE: FiveAxis<'static, f32> = FiveAxis { machine: &MACHINE_F32, wrist: &WRIST_F32 };
const BUILT_F64: MemoryChecksums = DOUBLE.checksums(&TABLE_F64);
const BUILT_F32: MemoryChecksums = SINGLE.checksums(&TABLE_F32);

macro_rules! every_bit {
    ($test:ident, $t:ty, $five:ident) => {
        #[test]
        fn $test() {
            let mut rng = seeded();
            let (mut refused, mut found) = (0, 0);
            let numbers: Vec<$t> = (0..6 + 27 * EQ_11.len()).map(|_| between(&mut rng, 0.1, 2.0) as $t).collect();
            let made = |numbers: &[$t], terms: &[[u8; 3]]| {
                let (extent, coefficients) = numbers.split_at(6);
                let (diagonal, factor) = coefficients.split_at(6 * EQ_11.len());
                assert_eq!(factor.len(), FACTOR_ENTRIES * EQ_11.len());
                let [a, b, c, d, e, f] = *extent else { unreachable!() };
                let basis = Basis::<$t>::new([a, b, c], [d, e, f], terms)?;
                let table = CorrectionTable::<$t>::new(basis, diagonal, Some(factor))?;
                Ok::<_, pkm_core::TableError>(($five.checksums(&table), $five.verify(&table, &$five.checksums(&table))))
            };
            let (built, intact) = made(&numbers, &EQ_11).unwrap();
            assert_eq!(intact, Ok(()));
            for _ in 0..cases(10_000) {
                let (mut numbers, mut terms) = (numbers.clone(), EQ_11);
                let bits = 8 * size_of::<$t>();
                let bit = rng.usize(0..bits * numbers.len() + 8 * 27);
                match numbers.get_mut(bit / bits) {
                    Some(number) => *number = <$t>::from_bits(number.to_bits() ^ (1 << (bit % bits))),
                    None => {
                        let bit = bit - bits * numbers.len();
                        terms[bit / 24][bit / 8 % 3] ^= 1 << (bit % 8);
                    }
                }
                match made(&numbers, &terms) {
                    Err(_) => refused += 1,
                    Ok((checksums, _)) => found += usize::from(checksums.table != built.table),
                }
            }
            println!("{refused} refused by the constructors, {found} found by the checksum");
            assert_eq!(refused + found, cases(10_000));
            assert!(refused > 0 && found > refused);
        }
    };
}

every_bit!(one_bit_of_a_table_is_found_f64, f64, DOUBLE);
every_bit!(one_bit_of_a_table_is_found_f32, f32, SINGLE);

#[test]
fn what_was_built_is_intact_and_another_machine_is_refused() {
    assert_eq!(DOUBLE.verify(&TABLE_F64, &BUILT_F64), Ok(()));
    assert_eq!(SINGLE.verify(&TABLE_F32, &BUILT_F32), Ok(()));
    assert_eq!(BUILT_F64.table, TABLE_F64.checksum());
    assert_ne!(BUILT_F64, BUILT_F32);

    let longer = WristParameters { flange_m: WRIST.flange_m + 1e-6, ..WRIST };
    let wrist = Wrist::<f64>::new(&longer).unwrap();
    let five = FiveAxis { wrist: &wrist, ..DOUBLE };
    assert_eq!(five.verify(&TABLE_F64, &BUILT_F64), Err(Damaged::Wrist));
    let other =
        CorrectionTable::<f64>::new(Basis::<f64>::new([0.0; 3], [1.0; 3], &[[0, 0, 0]]).unwrap(), &[1.0; 6], None);
    assert_eq!(DOUBLE.verify(&other.unwrap(), &BUILT_F64), Err(Damaged::Table));

    let mut machines = vec![];
    let mut parameters = PARAMETERS;
    parameters.geometry.b2_m *= 1.0 + 1e-6;
    machines.push(parameters);
    for limb in 0..3 {
        let mut parameters = PARAMETERS;
        parameters.limbs[limb].body.rod.young_pa *= 1.001;
        machines.push(parameters);
        parameters = PARAMETERS;
        parameters.limbs[limb].platform_joint.linear_n_per_m[1] *= 1.001;
        machines.push(parameters);
        parameters = PARAMETERS;
        parameters.travel.max_m[limb] += 1e-6;
        machines.push(parameters);
    }
    for effect in &EFFECTS {
        let effects = PARAMETERS.effects.with(effect.id, [1e-9]).unwrap();
        machines.push(MachineParameters { effects, ..PARAMETERS });
    }
    for (motion, law) in [("axial", "constant"), ("axial", "temperature"), ("lateral", "constant")] {
        let effects = PARAMETERS.effects.with_element("limb.1.body", motion, law, [1e-9]).unwrap();
        machines.push(MachineParameters { effects, ..PARAMETERS });
    }
    let mut seen = std::collections::HashSet::new();
    for parameters in &machines {
        let machine = Machine::<f64>::new(parameters).unwrap();
        let five = FiveAxis { machine: &machine, ..DOUBLE };
        assert_eq!(five.verify(&TABLE_F64, &BUILT_F64), Err(Damaged::Machine));
        let single = Machine::<f32>::new(parameters).unwrap();
        let five = FiveAxis { machine: &single, ..SINGLE };
        assert_eq!(five.verify(&TABLE_F32, &BUILT_F32), Err(Damaged::Machine));
        assert!(seen.insert(machine.checksum()) && seen.insert(single.checksum()));
    }
}
