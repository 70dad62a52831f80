//! A progress bar on a terminal's standard error.

use std::io::IsTerminal as _;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::say;

/// Characters of a full bar.
const WIDTH: u64 = 30;

/// Draws the [`progress`](crate::progress::Progress) of one computation after another. A bar is shown when it has run for a second, and
/// cleared in the end; where standard error is no terminal nothing is drawn.
pub fn bar() -> impl Fn(&str, u64, u64) + Sync {
    let terminal = std::io::stderr().is_terminal();
    let shown: Mutex<Option<Bar>> = Mutex::new(None);
    move |what, done, of| {
        let mut shown = shown.lock().unwrap_or_else(PoisonError::into_inner);
        if done == of {
            *shown = None;
        } else if done == 0 && terminal {
            *shown = Some(Bar { begun: Instant::now(), drawn: None, done });
        }
        if let Some(bar) = shown.as_mut() {
            bar.draw(what, done, of);
        }
    }
}

struct Bar {
    begun: Instant,
    drawn: Option<Instant>,
    done: u64,
}

impl Bar {
    /// At most ten times a second. Threads may report out of order: the bar never goes back.
    fn draw(&mut self, what: &str, done: u64, of: u64) {
        self.done = self.done.max(done);
        let gone = self.begun.elapsed();
        let lately = self.drawn.is_some_and(|drawn| drawn.elapsed() < Duration::from_millis(100));
        if self.done == 0 || gone < Duration::from_secs(1) || lately {
            return;
        }
        self.drawn = Some(Instant::now());
        let full = (WIDTH * self.done / of).min(WIDTH) as usize;
        let empty = WIDTH as usize - full;
        let left_s = gone.as_secs_f64() * of.saturating_sub(self.done) as f64 / self.done as f64;
        let hint = if cfg!(debug_assertions) { " (much sooner in a build with --release)" } else { "" };
        say(&format!(
            "\r\x1b[K{what} {}{} {}/{of}, {left_s:.0} s left{hint}",
            "█".repeat(full),
            "░".repeat(empty),
            self.done
        ));
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        if self.drawn.is_some() {
            say("\r\x1b[K");
        }
    }
}
