//! One bit that is not as it was built: found when the controller starts, and before it takes another table.
//! Tables that come while it runs are the ones that were sent, or none.

use pkm_core::checksum::{Damaged, MemoryChecksums};
use pkm_core::compensator::{Compensator, CompensatorSettings, Reading};
use pkm_core::correction::{
    EQ_11, FACTOR_ENTRIES, TableBuffer, TableHeader, TableWatch, TransferError, UNCERTAINTY_COLUMNS,
    UNCERTAINTY_ENTRIES, UNCERTAINTY_SPREAD, WATCHED_NUMBERS,
};
use pkm_core::effects::EFFECTS;
use pkm_core::tables::reference::{
    MACHINE_F32, MACHINE_F64, PARAMETERS, TABLE_F32, TABLE_F64, WRIST, WRIST_F32, WRIST_F64,
};
use pkm_core::{
    Basis, CorrectionTable, FiveAxis, Machine, MachineParameters, Model, Pose, Scalar, TableError, TableUncertainty,
    Wrench, Wrist, WristParameters,
};
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

/// Every bit of every number: refused when it is made, or found.
#[test]
fn one_bit_of_a_tables_uncertainty_is_found() {
    const NUMBERS: usize = UNCERTAINTY_SPREAD + 1 + UNCERTAINTY_COLUMNS * UNCERTAINTY_ENTRIES;
    let made = |numbers: &[f64; NUMBERS]| {
        let (spread, others) = numbers.split_first_chunk().unwrap();
        let [rest, entries @ ..] = others else { unreachable!() };
        let columns = std::array::from_fn(|c| std::array::from_fn(|e| entries[UNCERTAINTY_ENTRIES * c + e]));
        TableUncertainty::<f64>::new(*spread, *rest, columns)
    };
    let mut rng = seeded();
    let numbers = std::array::from_fn(|_| between(&mut rng, 0.1, 2.0));
    let built = made(&numbers).unwrap();
    assert_eq!(built.verify(built.checksum()), Ok(()));
    let (mut refused, mut found) = (0, 0);
    for bit in 0..64 * NUMBERS {
        let mut other = numbers;
        other[bit / 64] = f64::from_bits(numbers[bit / 64].to_bits() ^ (1 << (bit % 64)));
        match made(&other).map(|other| other.verify(built.checksum())) {
            Err(_) => refused += 1,
            Ok(verified) => found += usize::from(verified == Err(Damaged::Uncertainty)),
        }
    }
    assert_eq!(refused + found, 64 * NUMBERS);
    assert!(found > refused, "{refused} refused, {found} found");
}

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

/// Sends a table, with what happens to its numbers on the way.
fn send<T: Scalar, const TERMS: usize>(
    buffer: &mut TableBuffer<T, TERMS>,
    header: &TableHeader,
    numbers: &[f64],
) -> Result<(), TransferError> {
    buffer.begin(header, PARAMETERS.checksum())?;
    numbers.iter().try_for_each(|number| buffer.push(*number))?;
    buffer.finish()
}

const ROWS_OF_ONES: [f64; 27 * 4] = [1.0; 27 * 4];
/// Smaller than the reference table, without couplings.
fn small() -> CorrectionTable<'static, f64> {
    let basis = Basis::<f64>::new([0.0, 0.0, 0.5], [0.2, 0.3, 0.1], &[[0, 0, 0], [1, 0, 2], [0, 1, 0], [6, 0, 0]]);
    CorrectionTable::<f64>::new(basis.unwrap(), &ROWS_OF_ONES[..24], None).unwrap()
}

#[test]
fn a_table_that_comes_is_the_one_that_was_sent() {
    let (mut double, mut single) = (TableBuffer::<f64, 20>::new(), TableBuffer::<f32, 20>::new());
    assert!(double.table().is_none() && !double.is_intact());
    for sent in [TABLE_F64, small(), TABLE_F64] {
        let (header, numbers) = (sent.header(PARAMETERS.checksum()), sent.numbers().collect::<Vec<_>>());
        assert_eq!((header.table, header.numbers()), (sent.checksum(), numbers.len()));
        assert_eq!(send(&mut double, &header, &numbers), Ok(()));
        assert_eq!(send(&mut single, &header, &numbers), Ok(()));
        assert_eq!((double.received(), double.header()), (numbers.len(), &header));
        assert!(double.is_intact() && single.is_intact());
        let (double, single) = (double.table().unwrap(), single.table().unwrap());
        assert_eq!(double.checksum(), sent.checksum());
        assert_eq!(double.has_factor_form(), sent.has_factor_form());
        let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
        assert_eq!(double.coefficients(&pose), sent.coefficients(&pose));
        if sent.has_factor_form() {
            assert_eq!(single.checksum(), TABLE_F32.checksum());
            let k = |table: &CorrectionTable<'_, f64>| table.factor_form(&MACHINE_F64, &pose).unwrap();
            assert_eq!(k(&double), k(&sent));
        }
    }
}

#[test]
fn a_flipped_bit_on_the_way_is_found() {
    let (header, sent) = (TABLE_F64.header(PARAMETERS.checksum()), TABLE_F64.numbers().collect::<Vec<_>>());
    let (mut double, mut single) = (TableBuffer::<f64, 9>::new(), TableBuffer::<f32, 9>::new());
    let mut rng = seeded();
    for _ in 0..cases(10_000) {
        let mut numbers = sent.clone();
        let number = &mut numbers[rng.usize(..sent.len())];
        *number = f64::from_bits(number.to_bits() ^ 1 << rng.u32(..64));
        assert!(send(&mut double, &header, &numbers).is_err() && double.table().is_none());
        // what a rounding hides was found before it
        assert!(send(&mut single, &header, &numbers).is_err() && single.table().is_none());
    }
    let flipped = [
        TableHeader { table: header.table ^ 1, ..header },
        TableHeader { machine: header.machine ^ 1, ..header },
        TableHeader { terms: 8, ..header },
        TableHeader { terms: 0, ..header },
        TableHeader { terms: 10, ..header },
        TableHeader { factor_form: false, ..header },
    ];
    use TransferError::{Checksum, NumberCount, OtherMachine, TermCount};
    let expected = [Checksum, OtherMachine, NumberCount, TermCount, TermCount, NumberCount];
    for (header, expected) in flipped.iter().zip(expected) {
        assert_eq!(send(&mut double, header, &sent), Err(expected));
        assert!(double.table().is_none());
    }
}

#[test]
fn a_bit_that_flips_in_service_is_found_within_two_rounds() {
    let degrees = || (0..5_u8).flat_map(|p| (0..5).flat_map(move |r| (0..5).map(move |s| [p, r, s])));
    let fourth: Vec<[u8; 3]> = degrees().filter(|term| term.iter().sum::<u8>() <= 4).collect();
    assert_eq!(fourth.len(), 35);
    let of_terms = |terms: &[[u8; 3]]| -> Vec<f64> {
        let exponents = terms.iter().flatten().map(|exponent| f64::from(*exponent));
        let coefficients = std::iter::repeat_n(1.0, (6 + FACTOR_ENTRIES) * terms.len());
        [0.1, 0.2, 0.5, 0.3, 0.3, 0.1].into_iter().chain(exponents).chain(coefficients).collect()
    };
    let reference: Vec<f64> = TABLE_F64.numbers().collect();
    // the numbers of 3 and of 35 terms are multiples of those that a look takes in, where a round takes a look more
    for sent in [reference, of_terms(&fourth[..3]), of_terms(&fourth)] {
        every_flip_is_found(&sent);
    }
}

fn every_flip_is_found(sent: &[f64]) {
    let count = (sent.len() - 6) / (3 + 6 + FACTOR_ENTRIES);
    let exponents = 6..6 + 3 * count;
    let terms_of = |numbers: &[f64]| -> Vec<[u8; 3]> {
        numbers[exponents.clone()].chunks(3).map(|t| [t[0], t[1], t[2]].map(|e| e as u8)).collect()
    };
    let mut rng = seeded();
    let periods = 2 * (sent.len() / WATCHED_NUMBERS + 1);
    let terms = terms_of(sent);
    let whole = laid_out(sent, &terms);
    for place in (0..cases(4)).flat_map(|_| 0..sent.len()) {
        let mut watch = TableWatch::new(whole.checksum());
        for _ in 0..rng.usize(..periods) {
            assert_eq!(watch.look(&whole), Ok(()));
        }
        let mut numbers = sent.to_vec();
        numbers[place] = match exponents.contains(&place) {
            true => f64::from(numbers[place] as u8 ^ 1 << rng.u32(..2)),
            false => f64::from_bits(numbers[place].to_bits() ^ 1 << rng.u32(..52)),
        };
        let terms = terms_of(&numbers);
        let flipped = laid_out(&numbers, &terms);
        let found = (1..=periods).find(|_| watch.look(&flipped) == Err(Damaged::Table));
        assert!(found.is_some(), "number {place} of {}", sent.len());
        // for good, also where the bit comes back
        assert!((0..periods).all(|_| watch.look(&whole) == Err(Damaged::Table)));
    }
}

fn laid_out<'a>(numbers: &'a [f64], terms: &'a [[u8; 3]]) -> CorrectionTable<'a, f64> {
    let (centre, half_width) = (std::array::from_fn(|n| numbers[n]), std::array::from_fn(|n| numbers[3 + n]));
    let (diagonal, factor) = numbers[6 + 3 * terms.len()..].split_at(6 * terms.len());
    let basis = Basis::<f64>::new(centre, half_width, terms).expect("a box and terms");
    CorrectionTable::<f64>::new(basis, diagonal, Some(factor)).expect("a table")
}

#[test]
fn a_table_that_stays_as_it_came_is_never_damaged() {
    let (mut double, mut single) = (TableBuffer::<f64, 9>::new(), TableBuffer::<f32, 9>::new());
    assert!(double.watch().is_none());
    for sent in [TABLE_F64, small()] {
        let (header, numbers) = (sent.header(PARAMETERS.checksum()), sent.numbers().collect::<Vec<_>>());
        send(&mut double, &header, &numbers).unwrap();
        send(&mut single, &header, &numbers).unwrap();
        let (mut of_double, mut of_single) = (double.watch().unwrap(), single.watch().unwrap());
        for _ in 0..1000 {
            assert_eq!(of_double.look(&double.table().unwrap()), Ok(()));
            assert_eq!(of_single.look(&single.table().unwrap()), Ok(()));
        }
        // and it is this one that is watched
        let other = if sent.has_factor_form() { small() } else { TABLE_F64 };
        assert!((0..1000).any(|_| of_double.look(&other).is_err()));
    }
    let mut built_in = TableWatch::new(TABLE_F32.checksum());
    assert!((0..1000).all(|_| built_in.look(&TABLE_F32).is_ok()));
}

#[test]
fn numbers_that_are_no_table_are_refused() {
    let (header, sent) = (TABLE_F64.header(PARAMETERS.checksum()), TABLE_F64.numbers().collect::<Vec<_>>());
    let mut buffer = TableBuffer::<f32, 9>::new();
    assert_eq!(buffer.push(1.0), Err(TransferError::NumberCount));
    assert_eq!(buffer.finish(), Err(TransferError::NumberCount));
    assert_eq!(send(&mut buffer, &header, &sent[1..]), Err(TransferError::Table(TableError::Exponent)));
    assert_eq!(send(&mut buffer, &header, &sent[..sent.len() - 1]), Err(TransferError::NumberCount));
    // nothing of it is taken later
    assert_eq!(buffer.push(sent[sent.len() - 1]), Err(TransferError::NumberCount));
    let changes = [(7, 2.5, TableError::Exponent), (7, 7.0, TableError::Exponent), (7, -1.0, TableError::Exponent)];
    let not_finite = [f64::NAN, f64::INFINITY].map(|bad| (100, bad, TableError::NotFinite));
    for (at, bad, expected) in changes.into_iter().chain(not_finite) {
        let mut numbers = sent.clone();
        numbers[at] = bad;
        assert_eq!(send(&mut buffer, &header, &numbers), Err(TransferError::Table(expected)));
    }
    // the right numbers, and no table in f32
    for (half_width, expected) in [(1e-60, TableError::EmptyBox), (1e60, TableError::NotFinite)] {
        let basis = Basis::<f64>::new([0.0; 3], [half_width; 3], &EQ_11).unwrap();
        let table = CorrectionTable::<f64>::new(basis, &ROWS_OF_ONES[..54], None).unwrap();
        let numbers: Vec<f64> = table.numbers().collect();
        let header = table.header(PARAMETERS.checksum());
        assert_eq!(send(&mut buffer, &header, &numbers), Err(TransferError::Table(expected)));
        assert_eq!(send(&mut TableBuffer::<f64, 9>::new(), &header, &numbers), Ok(()));
    }
    assert_eq!(send(&mut buffer, &header, &sent), Ok(()));
}

/// References change hands between two periods, and the offset goes to the new table at its rate limit.
#[test]
fn a_change_of_table_makes_no_step() {
    let settings = CompensatorSettings::DEFAULT;
    let mut compensator = Compensator::<f64, 3>::new(&settings).unwrap();
    let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
    let wrench = Wrench::from_vector([100.0, -50.0, -900.0, 2.0, -8.0, 5.0].into());
    let reading = Reading { enabled: true, wrench, rise: 0.0.into() };
    let softer: Vec<f64> =
        TABLE_F64.numbers().enumerate().map(|(i, n)| if i < 33 + 54 { n } else { 0.5 * n }).collect();
    let numbers = |all: &[f64]| {
        let (diagonal, factor) = all[33..].split_at(54);
        let basis = Basis::<f64>::new([all[0], all[1], all[2]], [all[3], all[4], all[5]], &EQ_11).unwrap();
        CorrectionTable::<f64>::new(basis, diagonal, Some(factor)).unwrap().header(PARAMETERS.checksum())
    };
    let (mut a, mut b) = (TableBuffer::<f64, 9>::new(), TableBuffer::<f64, 9>::new());
    let (mut in_service, mut spare) = (&mut a, &mut b);
    let settle = |compensator: &mut Compensator<f64, 3>, table: &CorrectionTable<'_, f64>| {
        let mut before = compensator.joints();
        let mut longest = 0.0_f64;
        for _ in 0..500 {
            let now =
                compensator.update(&Model::new(&MACHINE_F64, table), &pose, [0.01, -0.02, 0.3].into(), &reading).joints;
            longest = longest.max((now - before).amax());
            before = now;
        }
        longest
    };
    assert!(settle(&mut compensator, &in_service.table().unwrap_or(TABLE_F64)) > 0.0);
    let first = compensator.joints();
    let header = numbers(&softer);
    assert_eq!(send(spare, &header, &softer), Ok(()));
    core::mem::swap(&mut in_service, &mut spare);
    let longest = settle(&mut compensator, &in_service.table().unwrap());
    let moved = (compensator.joints() - first).amax();
    assert!(longest <= settings.screw_rate_m_per_s * settings.period_s * (1.0 + 1e-12), "{longest}");
    assert!(moved > 2.0 * longest, "{moved} {longest}");
}
