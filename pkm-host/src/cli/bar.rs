//! Progress bars on a terminal's standard error.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressFinish, ProgressStyle};

/// Draws the [`progress`](crate::progress::Progress) of one computation after another. A bar is shown when it has run for a second.
pub fn bar() -> impl Fn(&str, u64, u64) + Sync {
    let shown: Mutex<Option<ProgressBar>> = Mutex::new(None);
    move |what, done, of| {
        let mut shown = shown.lock().unwrap_or_else(PoisonError::into_inner);
        if done == of {
            *shown = None;
        } else if done == 0 {
            let style = ProgressStyle::with_template("{msg} {bar:30} {pos}/{len}, {eta} left");
            let bar = ProgressBar::with_draw_target(Some(of), ProgressDrawTarget::hidden());
            bar.set_style(style.expect("a template of this program"));
            *shown = Some(bar.with_finish(ProgressFinish::AndClear));
        }
        if let Some(bar) = shown.as_ref() {
            bar.set_message(what.to_owned());
            bar.set_position(bar.position().max(done));
            if bar.is_hidden() && bar.elapsed() > Duration::from_secs(1) {
                bar.set_draw_target(ProgressDrawTarget::stderr_with_hz(10));
            }
        }
    }
}
