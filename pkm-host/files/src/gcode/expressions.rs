//! Values as RS-274NGC writes them, numbers, parameters, functions and expressions in brackets, and lines in which numbers
//! take their place. Angles are degrees.

use super::Refusal;
use super::parameters::{Parameter, Parameters};
use super::words::{EXPONENT, letter, not_a_number, statement};

/// Most values inside each other.
const MAX_DEPTH: u32 = 50;
/// Numbers that are no farther apart are equal to `EQ` and `NE`, as in LinuxCNC.
const EQUAL: f64 = 1e-4;

/// Whether a line without its comments has more to it than letters with numbers.
pub(super) fn has_expressions(code: &str) -> bool {
    code.bytes().any(|b| b"#[]=".contains(&b))
}

/// The line with numbers in place of all values. What it sets its parameters to is in force from the next line on.
pub(super) fn expand(code: &str, parameters: &mut Parameters) -> Result<String, Refusal> {
    let mut words = String::with_capacity(code.len());
    let mut settings = Vec::new();
    let mut values = Values::new(code, parameters);
    while let Some(first) = values.first() {
        if first == '#' {
            let parameter = values.parameter()?;
            if !values.skip('=') {
                return Err(format!("{parameter}: expected `=`: outside of words and brackets parameters are set"));
            }
            settings.push((parameter, values.value()?));
            continue;
        }
        let letter = letter(values.rest)?;
        let word = values.rest;
        values.rest = &word[1..];
        let before = values.rest.trim();
        let value = values.value().map_err(|why| statement(word).unwrap_or_else(|| format!("{letter}: {why}")))?;
        let written = before[..before.len() - values.rest.trim_end().len()].trim();
        if !words.is_empty() {
            words.push(' ');
        }
        words.push(letter);
        if written.bytes().all(|b| b.is_ascii_digit() || b"+-.".contains(&b)) {
            words.push_str(written);
        } else {
            words.push_str(&as_word(letter, value).to_string());
        }
    }
    for (parameter, value) in settings {
        parameters.set(parameter, value);
    }
    Ok(words)
}

/// A computed number of a code is the code that it comes near, which has at most one decimal.
fn as_word(letter: char, value: f64) -> f64 {
    let code = (10.0 * value).round() / 10.0;
    if "GMTHNDL".contains(letter.to_ascii_uppercase()) && (value - code).abs() < EQUAL { code } else { value }
}

/// Reads values from the beginning of a text.
pub(super) struct Values<'a, 'p> {
    pub rest: &'a str,
    parameters: &'p Parameters,
    depth: u32,
}

impl<'a, 'p> Values<'a, 'p> {
    pub fn new(text: &'a str, parameters: &'p Parameters) -> Self {
        Self { rest: text, parameters, depth: 0 }
    }

    /// The first character that is not blank.
    pub fn first(&mut self) -> Option<char> {
        self.rest = self.rest.trim_start();
        self.rest.chars().next()
    }

    fn skip(&mut self, wanted: char) -> bool {
        let found = self.first() == Some(wanted);
        if found {
            self.rest = &self.rest[wanted.len_utf8()..];
        }
        found
    }

    /// `5`, `-[#1 + 2]`, `sin[30]`, `#<depth>`.
    fn value(&mut self) -> Result<f64, Refusal> {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err(format!("more than {MAX_DEPTH} brackets, signs and parameters inside each other"));
        }
        let value = match self.first() {
            Some('[') => self.bracketed()?,
            Some('#') => {
                let parameter = self.parameter()?;
                self.parameters.get(&parameter)?
            }
            Some('+') => {
                self.skip('+');
                self.value()?
            }
            Some('-') => {
                self.skip('-');
                -self.value()?
            }
            Some(c) if c.is_ascii_alphabetic() => self.function()?,
            _ => self.number()?,
        };
        self.depth -= 1;
        Ok(value)
    }

    fn number(&mut self) -> Result<f64, Refusal> {
        let digits = self.rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(self.rest.len());
        let value = self.rest[..digits].parse::<f64>().ok().filter(|v| v.is_finite());
        let value = value.ok_or_else(|| not_a_number(self.rest))?;
        self.rest = &self.rest[digits..];
        Ok(value)
    }

    /// `#1`, `##1`, `#[#1 + 2]`, `#<name>`.
    fn parameter(&mut self) -> Result<Parameter, Refusal> {
        self.skip('#');
        if !self.skip('<') {
            return Parameter::numbered(self.value()?);
        }
        let end = self.rest.find('>').ok_or("#<: the name is not closed: `>` is missing")?;
        let name = Parameter::named(&self.rest[..end]);
        self.rest = &self.rest[end + 1..];
        Ok(name)
    }

    /// An expression in brackets.
    pub fn bracketed(&mut self) -> Result<f64, Refusal> {
        if !self.skip('[') {
            return Err(format!("expected `[`, found `{}`", self.rest.trim_end()));
        }
        let value = self.expression(1)?;
        if self.skip(']') {
            return Ok(value);
        }
        Err(match self.first() {
            None => "a bracket is not closed: `]` is missing".into(),
            Some('e' | 'E') => format!("expected an operator or `]`, found `{}`: {EXPONENT}", self.rest.trim_end()),
            Some(_) => format!("expected an operator or `]`, found `{}`", self.rest.trim_end()),
        })
    }

    /// Operators that bind at least so strongly; of equal ones from left to right.
    fn expression(&mut self, strength: u8) -> Result<f64, Refusal> {
        let mut left = self.value()?;
        while let Some(operator) = self.operator(strength) {
            let right = self.expression(operator.strength() + 1)?;
            left = operator.apply(left, right)?;
        }
        Ok(left)
    }

    fn operator(&mut self, strength: u8) -> Option<Operator> {
        self.first();
        let begins = |name: &str| self.rest.get(..name.len()).is_some_and(|start| start.eq_ignore_ascii_case(name));
        let (name, operator) = OPERATORS.iter().find(|(name, _)| begins(name))?;
        if operator.strength() < strength {
            return None;
        }
        self.rest = &self.rest[name.len()..];
        Some(*operator)
    }

    fn function(&mut self) -> Result<f64, Refusal> {
        let start = self.rest;
        let letters = start.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(start.len());
        let name = start[..letters].to_ascii_lowercase();
        if !FUNCTIONS.contains(&name.as_str()) {
            return Err(not_a_number(start));
        }
        self.rest = &start[letters..];
        if name == "exists" {
            return self.exists();
        }
        let x = self.bracketed().map_err(|why| format!("{name}: {why}"))?;
        let value = match name.as_str() {
            "abs" => x.abs(),
            "acos" => x.acos().to_degrees(),
            "asin" => x.asin().to_degrees(),
            "atan" => {
                if !self.skip('/') {
                    return Err("atan has two brackets, atan[y]/[x]: `/` is missing".into());
                }
                x.atan2(self.bracketed()?).to_degrees()
            }
            "cos" => x.to_radians().cos(),
            "exp" => x.exp(),
            "fix" => x.floor(),
            "fup" => x.ceil(),
            "ln" => x.ln(),
            "round" => x.round(),
            "sin" => x.to_radians().sin(),
            "sqrt" => x.sqrt(),
            _ => x.to_radians().tan(),
        };
        if value.is_finite() { Ok(value) } else { Err(format!("{name}[{x}] has no value")) }
    }

    fn exists(&mut self) -> Result<f64, Refusal> {
        let message = "exists: expected a name, exists[#<depth>]";
        if !self.skip('[') || self.first() != Some('#') {
            return Err(message.into());
        }
        let name = self.parameter()?;
        if !self.skip(']') || !matches!(name, Parameter::Named(_)) {
            return Err(message.into());
        }
        Ok(f64::from(u8::from(self.parameters.has(&name))))
    }
}

const FUNCTIONS: [&str; 14] =
    ["abs", "acos", "asin", "atan", "cos", "exists", "exp", "fix", "fup", "ln", "round", "sin", "sqrt", "tan"];

#[derive(Clone, Copy, PartialEq)]
enum Operator {
    Power,
    Times,
    Over,
    Mod,
    Plus,
    Minus,
    Eq,
    Ne,
    Gt,
    Ge,
    Lt,
    Le,
    And,
    Or,
    Xor,
}

/// `**` is looked for before `*`.
const OPERATORS: [(&str, Operator); 15] = [
    ("**", Operator::Power),
    ("*", Operator::Times),
    ("/", Operator::Over),
    ("mod", Operator::Mod),
    ("+", Operator::Plus),
    ("-", Operator::Minus),
    ("eq", Operator::Eq),
    ("ne", Operator::Ne),
    ("gt", Operator::Gt),
    ("ge", Operator::Ge),
    ("lt", Operator::Lt),
    ("le", Operator::Le),
    ("and", Operator::And),
    ("or", Operator::Or),
    ("xor", Operator::Xor),
];

impl Operator {
    fn strength(self) -> u8 {
        match self {
            Self::Power => 5,
            Self::Times | Self::Over | Self::Mod => 4,
            Self::Plus | Self::Minus => 3,
            Self::Eq | Self::Ne | Self::Gt | Self::Ge | Self::Lt | Self::Le => 2,
            Self::And | Self::Or | Self::Xor => 1,
        }
    }

    fn apply(self, a: f64, b: f64) -> Result<f64, Refusal> {
        let truth = |is: bool| f64::from(u8::from(is));
        let equal = (a - b).abs() < EQUAL;
        let value = match self {
            Self::Over | Self::Mod if b == 0.0 => return Err("division by 0".into()),
            Self::Power => a.powf(b),
            Self::Times => a * b,
            Self::Over => a / b,
            Self::Mod => a.rem_euclid(b),
            Self::Plus => a + b,
            Self::Minus => a - b,
            Self::Eq => truth(equal),
            Self::Ne => truth(!equal),
            Self::Gt => truth(a > b),
            Self::Ge => truth(a >= b),
            Self::Lt => truth(a < b),
            Self::Le => truth(a <= b),
            Self::And => truth(a != 0.0 && b != 0.0),
            Self::Or => truth(a != 0.0 || b != 0.0),
            Self::Xor => truth((a != 0.0) != (b != 0.0)),
        };
        let name = || OPERATORS.iter().find(|(_, o)| *o == self).map_or("", |(name, _)| name);
        if value.is_finite() { Ok(value) } else { Err(format!("[{a} {} {b}] has no value", name())) }
    }
}
