//! All amplitudes from many readings at once, by least squares with the settings as prior.

use nalgebra::{DMatrix, DVector};
use pkm_core::estimation::EstimatorSettings;
use pkm_core::{CorrectionTable, Machine};

use super::{Value, loaded};
use crate::files::log::Entry;

/// Values with their deviations; `None` without readings.
pub(super) fn fit<const N: usize>(
    machine: &Machine<f64>,
    table: Option<&CorrectionTable<'_, f64>>,
    settings: &EstimatorSettings<N>,
    entries: &[&Entry],
) -> Option<Vec<Value>> {
    entries.first()?;
    // in deviations of the settings, from what was accepted
    let (mut information, mut right) = (DMatrix::<f64>::identity(N, N), DVector::<f64>::zeros(N));
    for Entry { touch, temperature_c, readings, .. } in entries {
        let machine = &machine.at_temperature(*temperature_c).ok()?;
        let wrench = touch.wrench.moved_to_a(touch.tip_m);
        let grown = machine.thermal_deflection(&touch.pose, touch.rise_k).ok()?;
        let predicted = loaded(machine, table, touch)?.plus(&grown);
        let seen = predicted.seen_at(touch.tip_m).to_vector();
        let amplitudes = settings.amplitudes.map(|own| own.amplitude);
        let moved = machine.sensitivities(&touch.pose, &wrench, &amplitudes).ok()?;
        let shown = |n: usize| amplitudes[n].shown(moved[n], predicted).seen_at(touch.tip_m).to_vector();
        let shown: [_; N] = std::array::from_fn(shown);
        for reading in readings {
            let expected = reading.direction.dot(&seen);
            let noise = reading.deviation.hypot(settings.model_share * expected);
            let whole = shown.map(|shown| reading.direction.dot(&shown) / noise);
            let row =
                DVector::from_iterator(N, whole.iter().zip(&settings.amplitudes).map(|(w, own)| w * own.deviation));
            let accepted: f64 = whole.iter().zip(&settings.amplitudes).map(|(w, own)| w * own.accepted).sum();
            right += &row * ((reading.read - expected) / noise - accepted);
            information += &row * row.transpose();
        }
    }
    let factor = information.cholesky()?;
    let (best, covariance) = (factor.solve(&right), factor.inverse());
    let value = |(n, own): (usize, &pkm_core::estimation::AmplitudeSettings)| {
        (own.accepted + own.deviation * best[n], own.deviation * covariance[(n, n)].sqrt())
    };
    Some(settings.amplitudes.iter().enumerate().map(value).collect())
}
