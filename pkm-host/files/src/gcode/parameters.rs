//! Parameters of a program, as RS-274NGC has them: `#1`, `#<name>`.

use std::collections::HashMap;
use std::fmt;

use super::Refusal;

/// `#1` to `#30` are a subroutine's own: its arguments.
pub(super) const ARGUMENTS: usize = 30;
/// Those above belong to the control: probed places, offsets, tools, positions.
const MAX_NUMBER: f64 = 5000.0;
/// How far a number may be from the whole one that it stands for.
const WHOLE_TOLERANCE: f64 = 1e-4;

/// One of a program's parameters.
#[derive(Clone, PartialEq)]
pub(super) enum Parameter {
    Numbered(u16),
    /// In lower case, without blanks. Those that begin with `_` are known everywhere, others in their own subroutine.
    Named(String),
}

impl Parameter {
    pub fn numbered(number: f64) -> Result<Self, Refusal> {
        let whole = number.round();
        if (number - whole).abs() > WHOLE_TOLERANCE || whole < 1.0 {
            return Err(format!("#{number}: expected a parameter's number, a whole one from 1"));
        }
        if whole > MAX_NUMBER {
            let message = format!(
                "#{whole}: parameters above #{MAX_NUMBER} are the control's own (places, offsets, tools), and what it keeps in them is \
                 not known here: write the number, or have LinuxCNC's interpreter read the program (--interpreter rs274)"
            );
            return Err(message);
        }
        Ok(Self::Numbered(whole as u16))
    }

    pub fn named(name: &str) -> Self {
        Self::Named(name.chars().filter(|c| !c.is_whitespace()).collect::<String>().to_ascii_lowercase())
    }
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Numbered(number) => write!(f, "#{number}"),
            Self::Named(name) => write!(f, "#<{name}>"),
        }
    }
}

/// What the parameters hold.
#[derive(Default)]
pub(super) struct Parameters {
    numbered: HashMap<u16, f64>,
    global: HashMap<String, f64>,
    main: Local,
    /// Subroutines that were called, the innermost last.
    called: Vec<Local>,
}

/// Parameters that each subroutine has for itself.
#[derive(Default)]
struct Local {
    arguments: [Option<f64>; ARGUMENTS],
    named: HashMap<String, f64>,
}

impl Parameters {
    /// A subroutine begins; arguments that it is not given are 0.
    pub fn enter(&mut self, arguments: &[f64]) {
        let arguments = std::array::from_fn(|i| Some(arguments.get(i).copied().unwrap_or(0.0)));
        self.called.push(Local { arguments, named: HashMap::new() });
    }

    /// A subroutine ends, with a value or without.
    pub fn leave(&mut self, value: Option<f64>) {
        self.called.pop();
        self.global.insert("_value".into(), value.unwrap_or(0.0));
        self.global.insert("_value_returned".into(), f64::from(u8::from(value.is_some())));
    }

    fn local(&self) -> &Local {
        self.called.last().unwrap_or(&self.main)
    }

    fn held(&self, parameter: &Parameter) -> Option<f64> {
        match parameter {
            Parameter::Numbered(number) => match self.local().arguments.get(usize::from(*number) - 1) {
                Some(argument) => *argument,
                None => self.numbered.get(number).copied(),
            },
            Parameter::Named(name) if name.starts_with('_') => self.global.get(name).copied(),
            Parameter::Named(name) => self.local().named.get(name).copied(),
        }
    }

    /// Whether it holds a value.
    pub fn has(&self, parameter: &Parameter) -> bool {
        self.held(parameter).is_some()
    }

    pub fn get(&self, parameter: &Parameter) -> Result<f64, Refusal> {
        let missing = || {
            let of_the_control = "what a control keeps in it from before is not known here";
            let why = match parameter {
                Parameter::Named(name) if !name.starts_with('_') => {
                    "a subroutine knows its own names and those with `_`"
                }
                _ => of_the_control,
            };
            format!("{parameter} has no value: set it in the program before this line ({why})")
        };
        self.held(parameter).ok_or_else(missing)
    }

    pub fn set(&mut self, parameter: Parameter, value: f64) {
        let local = self.called.last_mut().unwrap_or(&mut self.main);
        match parameter {
            Parameter::Numbered(number) => match local.arguments.get_mut(usize::from(number) - 1) {
                Some(argument) => *argument = Some(value),
                None => drop(self.numbered.insert(number, value)),
            },
            Parameter::Named(name) if name.starts_with('_') => drop(self.global.insert(name, value)),
            Parameter::Named(name) => drop(local.named.insert(name, value)),
        }
    }
}
