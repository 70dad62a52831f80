//! Progress bars on a terminal's standard error.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A bar that is shown from the beginning.
pub fn bar(length: u64, template: &str) -> ProgressBar {
    let bar = ProgressBar::new(length);
    bar.set_style(ProgressStyle::with_template(template).expect("a template of this program"));
    bar
}

/// A bar for what may be done in a second, which needs none: it is shown later, if [`advance`] moves it.
pub fn late_bar(length: u64, template: &str) -> ProgressBar {
    let bar = bar(length, template);
    bar.set_draw_target(ProgressDrawTarget::hidden());
    bar
}

/// Moves a [`late_bar`].
pub fn advance(bar: &ProgressBar, by: u64) {
    bar.inc(by);
    if bar.is_hidden() && bar.elapsed() > Duration::from_secs(1) {
        bar.set_draw_target(ProgressDrawTarget::stderr_with_hz(10));
    }
}
