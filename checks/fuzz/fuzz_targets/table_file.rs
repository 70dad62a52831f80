//! Tables of coefficients. One that is taken is positive where the core evaluates it, and reads back from what it writes.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64};
use pkm_core::{CorrectionError, Domain, Pose};
use pkm_files::table::TableFile;
use pkm_fuzz::{assert_finite, file, read};

fuzz_target!(|bytes: &[u8]| {
    let Some(table) = read(TableFile::parse(&file(bytes))) else { return };
    let written = table.to_json();
    let again = read(TableFile::parse(&file(written.as_bytes()))).expect("what was written");
    assert_eq!(again.to_json(), written);

    let numbers = table.numbers();
    let core = numbers.table().expect("the core has checked it");
    let [theta_rad, sigma_rad, z0_m] = numbers.centre;
    let middle = Pose { theta_rad, sigma_rad, z0_m };
    assert_eq!(core.domain(&middle), Domain::Inside);
    assert!(core.coefficients(&middle).iter().all(|c| *c > 0.0));
    for corrected in [core.factor_form(&MACHINE_F64, &middle), core.diagonal_form(&MACHINE_F64, &middle)] {
        match corrected {
            Ok(corrected) => assert_finite(corrected.factor.lower().iter().copied()),
            Err(e) => assert!(!matches!(e, CorrectionError::NotPositive { .. }), "{e}"),
        }
    }
    let narrow = numbers.narrowed();
    if let Ok(core) = narrow.table() {
        let [theta_rad, sigma_rad, z0_m] = narrow.centre;
        if let Ok(corrected) = core.factor_form(&MACHINE_F32, &Pose { theta_rad, sigma_rad, z0_m }) {
            assert_finite(corrected.factor.lower().iter().copied());
        }
    }
});
