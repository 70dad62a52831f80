//! What to think of a replayed log, the verdict first.

use pkm_core::K95;
use pkm_core::estimation::{Alarm, AmplitudeSettings, Refusal};

use super::{DAY_S, at_end, fitted, outside_box, refusals, taken_in, variance_left};
use crate::diagnose::text::probability;
use crate::files::learn::{named, units};
use crate::page::Finding;
use crate::replay::{BATCH, Replay, Step};

/// An amplitude with more than this of its variance left is not known.
const UNKNOWN: f64 = 0.5;
/// A change by more of its deviations from before anything was read than this was not to be expected.
const UNEXPECTED_SD: f64 = 3.0;
/// A value nearer to a limit than so many of its deviations is held there.
const AT_LIMIT_SD: f64 = 0.1;
/// So many readings refused in a row are no spikes.
const BROKEN: usize = 20;

/// Of the change of a limb's compliance along its axis the share of what the limb yields, in percent.
fn share_of_limb(replay: &Replay, n: usize, change: f64) -> Option<f64> {
    let own = &replay.learn.amplitudes[n];
    // of a limb nothing but its axis is learned
    let limb = own.amplitude.place()?.0.limb()?;
    let compliances = replay.limbs_m_per_n?;
    let declared = compliances.get(usize::from(limb).checked_sub(1)?)?;
    Some(100.0 * change / (declared + own.accepted))
}

/// An alarm in words.
pub(super) fn said(replay: &Replay, (n, alarm): &(usize, Alarm)) -> String {
    let amplitude = replay.learn.amplitudes[*n].amplitude;
    let (name, (_, unit, scale)) = (named(amplitude), units(amplitude));
    let direction = if alarm.change > 0.0 { "more" } else { "less" };
    let (plural, say) = if alarm.readings == 1 { ("", "says") } else { ("s", "say") };
    let share = share_of_limb(replay, *n, alarm.change).map_or(String::new(), |percent| {
        format!(": the limb yields {:.0} % {direction} along its axis", percent.abs())
    });
    format!(
        "{name}: {:.2} ± {:.2} {unit} {direction} than at acceptance (95 %){share}, as the last {} reading{plural} {say} (probability that it is \
         worth an alarm: {}).",
        scale * alarm.change.abs(),
        scale * K95 * alarm.deviation,
        alarm.readings,
        probability(alarm.probability, 3)
    )
}

/// Alarms at the end of amplitudes that the readings tell from one another, the greatest change first, and those of others.
fn standing(replay: &Replay) -> [Vec<(usize, Alarm)>; 2] {
    let values = replay.steps.last().map_or(&[][..], |step| &step.values);
    let own = |n: usize| &replay.learn.amplitudes[n];
    let is_told = |(n, _): &(usize, Alarm)| variance_left(own(*n), &values[*n]) <= UNKNOWN;
    let (mut told, blurred): (Vec<_>, Vec<_>) = replay.standing().iter().copied().partition(is_told);
    let size = |(n, alarm): &(usize, Alarm)| (alarm.change / own(*n).alarm).abs();
    told.sort_by(|a, b| size(b).total_cmp(&size(a)));
    [told, blurred]
}

/// Alarms of amplitudes that the readings tell from one another, the greatest change first; then of those together that they do
/// not.
fn alarms_said(replay: &Replay) -> Vec<Finding> {
    let own = |n: usize| &replay.learn.amplitudes[n];
    let [told, blurred] = standing(replay);
    let mut found: Vec<Finding> =
        told.iter().map(|alarm| Finding::warning(said(replay, alarm) + " Inspect it.")).collect();
    if !blurred.is_empty() {
        let each = blurred.iter().map(|(n, alarm)| {
            let (_, unit, scale) = units(own(*n).amplitude);
            format!("{} {:+.2} {unit}", named(own(*n).amplitude), scale * alarm.change)
        });
        let each: Vec<String> = each.collect();
        found.push(Finding::warning(format!(
            "Something has changed since acceptance, and what was touched does not tell where: any of {} may have all of it.",
            unknown(replay).join(", ")
        )));
        found.push(Finding::warning(format!("Shared by what each is taken to vary, it is {}.", each.join(", "))));
    }
    let far = |(n, alarm): &&(usize, Alarm)| alarm.change.abs() > UNEXPECTED_SD * own(*n).deviation;
    let far: Vec<String> = replay.standing().iter().filter(far).map(|(n, _)| named(own(*n).amplitude)).collect();
    if !far.is_empty() {
        found.push(Finding::warning(format!(
            "{}: more than {UNEXPECTED_SD} times the deviation that it is taken to have before anything is read, so that its interval is too \
             narrow: give a greater `deviation` (--learn).",
            far.join(", ")
        )));
    }
    found
}

/// How old what is known is, and what drift may have come of that.
fn aged(replay: &Replay) -> String {
    let [first, last] = [replay.age.since_first_s, replay.age.since_last_s].map(|s| f64::from(s) / DAY_S);
    let known = replay.steps.iter().rev().find(|step| step.outcome.is_ok()).map_or(&[][..], |step| &step.values);
    let grown = known.iter().zip(&replay.age.deviations).map(|((_, before), now)| now / before).fold(1.0, f64::max);
    let wider = format!("makes the intervals up to {:.0} % wider than readings left them", 100.0 * (grown - 1.0));
    let wider = if grown < 1.005 { "hardly widens the intervals" } else { &wider };
    format!(
        "At the log's end the first reading that was taken in is {first:.1} days old, the last one {last:.1} days; the drift that is \
         allowed until then {wider}."
    )
}

/// The last readings that were refused one after another, where they are too many for spikes and most before them were taken in.
fn refused_at_end(replay: &Replay) -> Option<&[Step]> {
    let count = replay.steps.iter().rev().take_while(|step| step.outcome.is_err()).count();
    let (before, last) = replay.steps.split_at(replay.steps.len() - count);
    (count >= BROKEN && 2 * taken_in(replay) > before.len()).then_some(last)
}

/// Then it is the log that is in doubt, and not the machine.
fn were_mostly_refused(replay: &Replay) -> bool {
    refused_at_end(replay).is_none() && 2 * taken_in(replay) < replay.steps.len()
}

/// How many were refused for which reason.
fn reasons(steps: &[Step]) -> String {
    let each = refusals(steps).into_iter().map(|(code, count)| format!("{count} as {}", code.replace('_', " ")));
    each.collect::<Vec<_>>().join(", ")
}

/// What is wrong with the log itself, if it is much.
fn of_refused(replay: &Replay) -> Option<Finding> {
    let (all, taken) = (replay.steps.len(), taken_in(replay));
    if were_mostly_refused(replay) {
        return Some(Finding::bad(format!(
            "Only {taken} of {all} readings were taken in; refused were {}. Find out why before you act on anything below.",
            reasons(&replay.steps)
        )));
    }
    let last = refused_at_end(replay)?;
    Some(Finding::bad(if last.iter().all(|step| step.outcome == Err(Refusal::Unexpected)) {
        format!(
            "The last {} readings are too far from what is expected: the sensor is broken, or the machine has changed by more than it \
             may learn.",
            last.len()
        )
    } else {
        format!(
            "The last {} readings were refused, {}: from line {} on nothing was learned. Find out why before you act on anything below.",
            last.len(),
            reasons(last),
            last[0].line
        )
    }))
}

/// Changes since acceptance that are none by chance, and have no alarm.
fn small_changes(replay: &Replay) -> Vec<Finding> {
    let values = at_end(replay).unwrap_or_default();
    let mut found = Vec::new();
    for (n, (own, (best, deviation))) in replay.learn.amplitudes.iter().zip(values).enumerate() {
        let (change, (_, unit, scale)) = (best - own.accepted, units(own.amplitude));
        if change.abs() <= UNEXPECTED_SD * deviation || replay.standing().iter().any(|(other, _)| *other == n) {
            continue;
        }
        found.push(Finding::good(format!(
            "{}: {:+.2} ± {:.2} {unit} since acceptance (95 %), which is not proven to be worth an alarm ({:.2} {unit}).",
            named(own.amplitude),
            scale * change,
            scale * K95 * deviation,
            scale * own.alarm
        )));
    }
    found
}

/// The limit that a value is held at, if it is: what may not change that way at all stands there where nothing is wrong.
fn limit(own: &AmplitudeSettings, (best, deviation): (f64, f64)) -> Option<&'static str> {
    let is_held = |limit: f64| (best - limit).abs() < (AT_LIMIT_SD * deviation).min((best - own.accepted).abs());
    [("least", own.least), ("most", own.most)].into_iter().find_map(|(name, at)| is_held(at).then_some(name))
}

/// Settings that this log speaks against.
fn of_settings(replay: &Replay) -> Vec<Finding> {
    let values = replay.steps.last().map_or(&[][..], |step| &step.values);
    let mut found = Vec::new();
    for (n, (own, value)) in replay.learn.amplitudes.iter().zip(values).enumerate() {
        let (name, (in_file, unit, scale)) = (named(own.amplitude), units(own.amplitude));
        let ratio = replay.alarm_ratios[n];
        if ratio > 1.0 {
            found.push(Finding::warning(format!(
                "{name}: what is worth an alarm would move the tip by {ratio:.1e} times what the machine yields to the loads of this log. \
                 Is `alarm` in {in_file} (--learn)?"
            )));
        }
        if let Some(limit) = limit(own, *value) {
            found.push(Finding::warning(format!(
                "{name} stands at the `{limit}` that it may be: the change may be greater. Where that is possible give another limit (--learn)."
            )));
        } else if let Some(fit) =
            replay.batch.as_ref().map(|batch| batch[n]).filter(|fit| differ(replay, own, *value, *fit))
        {
            found.push(Finding::warning(format!(
                "{name}: the estimator says {:.2} {unit}, a fit of the last {} readings {:.2}, which is no chance. It may change faster than \
                 `drift_per_day` (--learn) allows, so that the estimator follows too slowly and its interval is too narrow.",
                scale * value.0,
                fitted(replay),
                scale * fit.0
            )));
        }
    }
    found
}

/// Whether the estimator and the fit of some of its readings say two things of an amplitude, though none was found to have changed
/// meanwhile. Of two that are right the difference has the difference of their variances, that of the fit with what drifts while its
/// readings are taken.
fn differ(
    replay: &Replay,
    own: &AmplitudeSettings,
    (best, deviation): (f64, f64),
    (fitted, of_fit): (f64, f64),
) -> bool {
    let mut last = replay.steps.iter().rev().filter(|step| step.outcome.is_ok()).take(BATCH).peekable();
    let until_s = last.peek().map_or(0, |step| step.time_s);
    let (mut from_s, mut is_steady) = (until_s, true);
    for step in last {
        (from_s, is_steady) = (step.time_s, is_steady && !step.changed);
    }
    let drifted = own.drift_per_day.powi(2) * f64::from(until_s - from_s) / DAY_S / 3.0;
    let variance = of_fit.powi(2) + drifted - deviation.powi(2);
    let off = (best - fitted).abs();
    is_steady && off > UNEXPECTED_SD * variance.max(0.0).sqrt() && off > K95 * deviation
}

/// What to think of it, the verdict first.
pub(super) fn findings(replay: &Replay) -> Vec<Finding> {
    let (all, taken) = (replay.steps.len(), taken_in(replay));
    let mut found: Vec<Finding> = of_refused(replay).into_iter().collect();
    found.extend(alarms_said(replay));
    if taken > 0 {
        found.extend(of_settings(replay));
        if replay.standing().is_empty() {
            found.push(Finding::good("No change that is worth an alarm is proven."));
        }
        found.extend(small_changes(replay));
        found.push(Finding::good(aged(replay)));
    }
    let text = format!("{taken} of {all} readings were taken in.");
    found.push(if taken == all { Finding::good(text) } else { Finding::warning(text) });
    let outside = outside_box(replay);
    if let Some(line) = outside.first() {
        found.push(Finding::warning(format!(
            "Outside the box that the table was fitted in: {} of them, the first in line {line}. What they teach rests on what the table \
             says there by extrapolation.",
            outside.len()
        )));
    }
    let unknown = unknown(replay);
    if !unknown.is_empty() {
        found.push(Finding::warning(format!(
            "What was touched so far tells little of {}: more than half of the variance from before the first reading is left.",
            unknown.join(", ")
        )));
    }
    found
}

/// How sure the verdict is, and what to do: for the page, which has more room than a terminal.
pub(super) fn advice(replay: &Replay) -> [Finding; 2] {
    let [standing, blurred] = standing(replay);
    let sizes: Vec<_> =
        standing.iter().map(|(_, alarm)| format!("{:.0}", (alarm.change / alarm.deviation).abs())).collect();
    let names: Vec<_> = standing.iter().map(|(n, _)| named(replay.learn.amplitudes[*n].amplitude)).collect();
    let sure = if taken_in(replay) == 0 {
        "nothing is known beyond the settings.".to_owned()
    } else if !blurred.is_empty() {
        "that something has changed is sure, where it is not: see below.".to_owned()
    } else if standing.is_empty() {
        "what is known of each amplitude stands in the table: a change within its interval would not be seen."
            .to_owned()
    } else {
        format!(
            "the change is {} times its standard deviation; the curves below show when it came.",
            sizes.join(" and ")
        )
    };
    let todo = if were_mostly_refused(replay) {
        "find out why most readings were refused: sensor, sign, units, or a machine that is not this one.".to_owned()
    } else if let Some(last) = refused_at_end(replay) {
        format!(
            "find out why the last {} readings were refused: sensor, load, clock, or the machine itself.",
            last.len()
        )
    } else if !blurred.is_empty() {
        "touch loads that tell the amplitudes apart: --next proposes them.".to_owned()
    } else if !standing.is_empty() {
        let names = names.join(" and ");
        format!("inspect {names}; repair it, or make a new table and accept the machine as it is now.")
    } else if !of_settings(replay).is_empty() {
        "change the settings that are doubted below (--learn), and replay the log again.".to_owned()
    } else if unknown(replay).is_empty() {
        "nothing; go on touching known loads.".to_owned()
    } else {
        let which = if replay.next.is_empty() { "that --next proposes" } else { "that are proposed below" };
        format!("touch the loads {which}: what was touched so far leaves some amplitudes unknown.")
    };
    [Finding::good(sure).sure(), Finding::good(todo).todo()]
}

/// Amplitudes of which the log tells hardly anything.
fn unknown(replay: &Replay) -> Vec<String> {
    let values = replay.steps.last().map_or(&[][..], |step| &step.values);
    let own = replay.learn.amplitudes.iter().zip(values);
    own.filter(|(own, value)| variance_left(own, value) > UNKNOWN).map(|(own, _)| named(own.amplitude)).collect()
}
