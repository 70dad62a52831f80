//! Whether the length that is in force at a cut is that of the tool in hand.

use super::loads::Loads;
use super::modal::Modal;
use crate::tools::Called;

/// Tools that cut with another length than their own.
#[derive(Default)]
pub(super) struct Lengths(Vec<OddLength>);

struct OddLength {
    tool: f64,
    /// By M6, and not by a T alone.
    is_put_in: bool,
    warning: String,
}

impl Lengths {
    /// Looks at the tool in hand at a cut, the first of each.
    pub fn check(&mut self, loads: &Loads, modal: &Modal<'_>, place: &str) {
        let Some(Called { number: tool, line }) = loads.called_in_hand() else { return };
        let (tools, is_put_in) = (&modal.setup.tools, loads.has_changed_tool());
        let length_mm = tools.length_mm(tool).filter(|length_mm| *length_mm != modal.length_mm);
        let is_said = || self.0.iter().any(|odd| odd.tool == tool && odd.is_put_in == is_put_in);
        let Some(length_mm) = length_mm.filter(|_| !is_said()) else { return };
        let warning = match modal.length_of {
            None => format!(
                "{place}: T{tool} (line {line}) is {length_mm} mm long in {}, and no length is in force at this cut: write G43 H{tool} \
                 before it, or length_mm = 0 there if the machine file's flange_mm holds the tool's length",
                tools.file
            ),
            Some(Called { number: other, line: at }) => format!(
                "{place}: H{other} (line {at}), {} mm long, is not the tool in hand at this cut, which is T{tool} (line {line}), \
                 {length_mm} mm long: write G43 H{tool} before it",
                modal.length_mm
            ),
        };
        self.0.push(OddLength { tool, is_put_in, warning });
    }

    /// What there is to say. Where M6 changes tools, a T before the first M6 only called one.
    pub fn warnings(self, loads: &Loads) -> impl Iterator<Item = String> {
        let with_changes = loads.has_changed_tool();
        self.0.into_iter().filter(move |odd| odd.is_put_in || !with_changes).map(|odd| odd.warning)
    }
}
