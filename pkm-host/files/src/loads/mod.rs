//! From a load cell's log to the load of each reading: what a shop has that pulls at a machine and records the cell beside its gauges.
//!
//! `clocks`: when readings were taken, by the log's clock. `window`: what the log says around a time. `meant`: which way the cell pulls, by
//! what the readings' file says. `checks`: what may be wrong and yet is read. Here: zero, mean and scatter of each reading.
//!
//! The load of a reading is the mean of the log's samples in a window around its time, less the zero of the cell. Its standard deviation is
//! that of a single sample, not of the mean: samples of a cell's amplifier follow one another far faster than what moves the load, and
//! nothing in a window of seconds tells how many of them count.

mod checks;
mod clocks;
mod meant;
mod table;
mod window;

use std::ops::Range;

use pkm_diagnosis::robust::upper_median;

use self::meant::Meant;
use self::window::{Window, between, steps};
use crate::clock::{self, Times};
use crate::csv::Sheet;
use crate::error::{Failure, Result};
use crate::load_log::{LoadLog, Sample};
use crate::pose::ROTATION_ARM_M;

/// Samples from which a window tells its own scatter.
const MIN_SAMPLES: usize = 3;

/// How a log is read beside its readings.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// From when to when around the time of a reading, s.
    pub window_s: [f64; 2],
    /// What the readings' clock is ahead of the log's, s.
    pub clock_s: f64,
    /// Where in the log nothing pulls: seconds from its first sample.
    pub zero_s: Option<[f64; 2]>,
}

/// The load of a reading.
struct Load {
    /// N and N·m, in A-uvw.
    wrench: [f64; 6],
    /// Standard deviation over the size of the load; `None` without a load.
    random: Option<f64>,
}

/// How the loads of all readings came about.
#[derive(Clone, Debug)]
pub struct Joined {
    /// Samples in the window of a reading: fewest, most.
    pub samples: [usize; 2],
    /// Stretches that the zero is taken from; 0 where the log is taken as it is.
    pub zeros: usize,
    /// Mean of these, N and N·m.
    pub zero: [f64; 6],
    /// Median and greatest of the relative scatter.
    pub random: [f64; 2],
    /// What is doubtful.
    pub warnings: Vec<String>,
}

/// Size of a load, moments over a lever.
fn size(load: &[f64; 6]) -> f64 {
    by_lever(load).iter().map(|v| v * v).sum::<f64>().sqrt()
}

fn by_lever(load: &[f64; 6]) -> [f64; 6] {
    std::array::from_fn(|c| if c < 3 { load[c] } else { load[c] / ROTATION_ARM_M })
}

/// See [`upper_median`]; 0 of no values.
fn median(mut values: Vec<f64>) -> f64 {
    upper_median(&mut values).unwrap_or(0.0)
}

/// Joins the loads of a log to readings and writes them into their sheet: the wrench and its scatter.
///
/// # Errors
/// Readings without times, or outside of the log; clocks that nothing compares; a direction that is not stated.
pub fn join(sheet: &mut Sheet, log: &LoadLog, options: &Options) -> Result<Joined> {
    let Some(times) = clock::times(sheet)? else {
        let why = ": each reading needs its time, as `time [s]`, `2026-03-14 09:26:53` or `09:26:53`, to find its load in the log";
        return Err(sheet.missing("time", why));
    };
    let meant = meant::of_rows(sheet, log.cell)?;
    let (at_s, doubt) = clocks::by_log(&times, log, options.clock_s).map_err(|failure| match failure.file {
        None => failure.in_file(&sheet.source.name).at_line(sheet.header_line()).at_column(times.column),
        Some(_) => failure,
    })?;
    let windows = windows(sheet, log, &times, &at_s, options)?;
    let zeros = zeros(log, &meant, &windows, options)?;
    let nearest = |w: &Range<usize>| {
        let distance = |zero: &&Window| zero.samples.start.abs_diff(w.start);
        zeros.iter().min_by_key(distance).map_or([0.0; 6], |zero| zero.mean)
    };
    let read: Vec<[f64; 6]> = (windows.iter())
        .map(|w| {
            let zero = nearest(&w.samples);
            std::array::from_fn(|c| w.mean[c] - zero[c])
        })
        .collect();
    let (wrenches, flipped) = meant::wrenches(&meant, &read, log.cell);
    let deviations = deviations(log, &windows);
    let loads: Vec<Load> = (wrenches.iter().zip(&read).zip(&deviations))
        .map(|((wrench, read), sd)| Load { wrench: *wrench, random: random(read, sd).filter(|_| size(wrench) > 0.0) })
        .collect();
    let joint = checks::Joint {
        sheet,
        log,
        times: &times,
        at_s: &at_s,
        windows: &windows,
        zeros: &zeros,
        meant: &meant,
        read: &read,
    };
    let mut warnings: Vec<String> = doubt.map(|what| joint.text(&[], times.column, &what)).into_iter().collect();
    warnings.extend(joint.warnings(&wrenches, &flipped, options));
    table::write(sheet, &loads)?;
    let scatter: Vec<f64> = loads.iter().filter_map(|l| l.random).collect();
    let count = |best: fn(usize, usize) -> usize| windows.iter().map(|w| w.samples.len()).reduce(best).unwrap_or(0);
    Ok(Joined {
        samples: [count(usize::min), count(usize::max)],
        zeros: zeros.len(),
        zero: std::array::from_fn(|c| zeros.iter().map(|z| z.mean[c]).sum::<f64>() / zeros.len().max(1) as f64),
        random: [median(scatter.clone()), scatter.iter().copied().fold(0.0, f64::max)],
        warnings,
    })
}

/// The window of each reading.
fn windows(sheet: &Sheet, log: &LoadLog, times: &Times, at_s: &[f64], options: &Options) -> Result<Vec<Window>> {
    let [from_s, to_s] = options.window_s;
    let samples = &log.samples;
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else { return Ok(Vec::new()) };
    let [earliest, latest] = [f64::min as fn(f64, f64) -> f64, f64::max]
        .map(|best| at_s.iter().copied().reduce(best).unwrap_or(first.time_s));
    let clocks = if latest + to_s < first.time_s {
        Some(format!("the log begins {} after the last reading", duration(first.time_s - latest)))
    } else if earliest + from_s > last.time_s {
        Some(format!("the log ends {} before the first reading", duration(earliest - last.time_s)))
    } else {
        None
    };
    if let Some(apart) = clocks {
        let message = format!(
            "{apart}: do its clock and that of the readings differ? --load-clock-s says what is added to the log's times"
        );
        return Err(sheet.failure(&sheet.rows[0], message).at_column(times.column));
    }
    let (mut windows, mut outside) = (Vec::new(), Vec::new());
    for (n, at) in at_s.iter().enumerate() {
        let own = between(samples, at + from_s, at + to_s);
        if own.is_empty() { outside.push(n) } else { windows.push(Window::of(samples, own)) }
    }
    let Some(n) = outside.first().copied() else {
        if windows.iter().any(|w| w.samples.len() >= MIN_SAMPLES) {
            return Ok(windows);
        }
        let message = format!(
            "no window holds {MIN_SAMPLES} samples, of which the scatter follows: the log has one every {:.3} s, the window is \
             {:.3} s long; widen it: --load-window-s",
            spacing_s(samples),
            to_s - from_s
        );
        return Err(sheet.failure(&sheet.rows[0], message).at_column(times.column));
    };
    let where_it_is = if at_s[n] < first.time_s {
        format!("{} before the log begins", duration(first.time_s - at_s[n]))
    } else if at_s[n] > last.time_s {
        format!("{} after the log ends", duration(at_s[n] - last.time_s))
    } else {
        let before = samples[samples.partition_point(|s| s.time_s < at_s[n]) - 1];
        format!("in a gap of the log, {} behind line {} of it", duration(at_s[n] - before.time_s), before.line)
    };
    let more = match outside.len() - 1 {
        0 => String::new(),
        more => format!(" ({more} more have none either)"),
    };
    let message = format!(
        "no load: the reading was taken {where_it_is}{more}. Leave such readings out, widen --load-window-s, or mend the clocks \
         with --load-clock-s"
    );
    Err(sheet.failure(&sheet.rows[n], message).at_column(times.column))
}

/// Some seconds, for people.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 600.0 => format!("{s:.1} s"),
        s if s < 36_000.0 => format!("{s:.0} s ({:.0} min)", s / 60.0),
        s => format!("{s:.0} s ({:.1} h)", s / 3600.0),
    }
}

/// Stretches of the log without a load: the stated one, or the windows of unloaded readings.
fn zeros(log: &LoadLog, meant: &[Meant], windows: &[Window], options: &Options) -> Result<Vec<Window>> {
    let Some([from_s, to_s]) = options.zero_s else {
        let unloaded = windows.iter().zip(meant).filter(|(_, meant)| matches!(meant, Meant::Unloaded));
        return Ok(unloaded.map(|(window, _)| window.clone()).collect());
    };
    let began = log.samples.first().map_or(0.0, |s| s.time_s);
    let own = between(&log.samples, began + from_s, began + to_s);
    if own.is_empty() {
        let last = log.samples.last().map_or(0.0, |s| s.time_s - began);
        let message = format!("--load-zero-s {from_s},{to_s}: no samples there; the log lasts {last:.3} s");
        return Err(Failure::usage(message));
    }
    Ok(vec![Window::of(&log.samples, own)])
}

/// Standard deviation of a sample in each window. Where it has too few to tell, and where its numbers are rounded, it is no less than
/// that of the other windows, and that of rounding.
fn deviations(log: &LoadLog, windows: &[Window]) -> Vec<[f64; 6]> {
    let rounding = steps(&log.samples).map(|step| step / 12.0_f64.sqrt());
    let usual: [f64; 6] = std::array::from_fn(|c| {
        median(windows.iter().filter(|w| w.samples.len() >= MIN_SAMPLES).map(|w| w.sd[c]).collect())
    });
    let own = |w: &Window| {
        let least = if w.samples.len() >= MIN_SAMPLES { [0.0; 6] } else { usual };
        std::array::from_fn(|c| w.sd[c].max(least[c]).max(rounding[c]))
    };
    windows.iter().map(own).collect()
}

/// Relative scatter of a load: along it, or that of the noisiest component if that is more.
fn random(read: &[f64; 6], sd: &[f64; 6]) -> Option<f64> {
    let (load, sd, size) = (by_lever(read), by_lever(sd), size(read));
    let along = load.iter().zip(&sd).map(|(load, sd)| (load / size * sd).powi(2)).sum::<f64>().sqrt();
    let random = sd.iter().copied().fold(along, f64::max) / size;
    random.is_finite().then_some(random)
}

/// Whether samples are shared.
fn overlap(a: &Range<usize>, b: &Range<usize>) -> bool {
    a.start < b.end && b.start < a.end
}

/// Time between two samples, usually.
fn spacing_s(samples: &[Sample]) -> f64 {
    median(samples.windows(2).map(|w| w[1].time_s - w[0].time_s).collect())
}
