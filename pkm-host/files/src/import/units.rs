//! Units that exports write, and numbers converted to the unit of a column.

use crate::pose::tidy;

/// What a column of a measured file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Names and marks, without unit.
    Text,
    /// A length, in mm or µm.
    Length,
    /// An angle, in ° or µrad.
    Angle,
    /// A force in N.
    Force,
    /// A moment in N·m.
    Moment,
    /// A temperature in °C.
    Temperature,
    /// A time in s.
    Time,
    /// A number without unit.
    Ratio,
}

/// The size of a unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Size {
    /// A power of ten of the SI unit.
    Decimal(i32),
    /// Another multiple of the SI unit.
    Times(f64),
    /// An angle in degrees.
    Degrees(f64),
    /// Kelvins: 273.15 lies between them and °C.
    Kelvin,
    /// °F.
    Fahrenheit,
}
use Size::{Decimal, Degrees, Fahrenheit, Kelvin, Times};

/// Standard gravity, m/s²: makes kilograms forces.
pub const GRAVITY: f64 = 9.806_65;
/// Pound, kg.
const POUND_KG: f64 = 0.453_592_37;
/// Pound-force, N.
pub const POUND_N: f64 = POUND_KG * GRAVITY;
/// Foot, m.
pub const FOOT_M: f64 = 0.3048;
/// Inch, m.
const INCH_M: f64 = FOOT_M / 12.0;

/// A unit with the ways to write it, the usual one first.
pub struct Unit {
    names: &'static [&'static str],
    quantity: Quantity,
    size: Size,
}

impl Unit {
    /// As it is usually written.
    pub fn name(&self) -> &'static str {
        self.names[0]
    }

    /// Whether it is written so but for the case of letters.
    fn is_alike(&self, text: &str) -> bool {
        self.names.iter().any(|name| name.to_lowercase() == text.to_lowercase())
    }
}

const fn unit(quantity: Quantity, size: Size, names: &'static [&'static str]) -> Unit {
    Unit { names, quantity, size }
}

/// All units that are known, without spaces, `u` for µ, and neither dots nor stars between factors. The case of letters counts:
/// `mN` and `MN` differ.
const UNITS: [Unit; 34] = [
    unit(Quantity::Length, Decimal(0), &["m"]),
    unit(Quantity::Length, Decimal(-2), &["cm"]),
    unit(Quantity::Length, Decimal(-3), &["mm"]),
    unit(Quantity::Length, Decimal(-6), &["µm", "um", "micron", "microns", "micrometer", "micrometers"]),
    unit(Quantity::Length, Decimal(-9), &["nm"]),
    unit(Quantity::Length, Times(INCH_M), &["inch", "in", "inches"]),
    unit(Quantity::Angle, Degrees(1.0), &["°", "º", "˚", "deg", "degree", "degrees", "Grad"]),
    unit(Quantity::Angle, Degrees(1.0 / 60.0), &["arcmin"]),
    unit(Quantity::Angle, Degrees(1.0 / 3600.0), &["arcsec"]),
    unit(Quantity::Angle, Decimal(0), &["rad"]),
    unit(Quantity::Angle, Decimal(-3), &["mrad"]),
    unit(Quantity::Angle, Decimal(-6), &["µrad", "urad"]),
    unit(Quantity::Force, Decimal(-3), &["mN"]),
    unit(Quantity::Force, Decimal(0), &["N", "Newton", "newtons"]),
    unit(Quantity::Force, Decimal(1), &["daN"]),
    unit(Quantity::Force, Decimal(3), &["kN"]),
    unit(Quantity::Force, Decimal(6), &["MN"]),
    unit(Quantity::Force, Times(GRAVITY), &["kgf", "kp", "kg"]),
    unit(Quantity::Force, Times(POUND_N), &["lbf", "lb", "lbs"]),
    unit(Quantity::Moment, Decimal(-3), &["N·mm", "Nmm"]),
    unit(Quantity::Moment, Decimal(-2), &["N·cm", "Ncm"]),
    unit(Quantity::Moment, Decimal(0), &["N·m", "Nm"]),
    unit(Quantity::Moment, Decimal(1), &["daN·m", "daNm"]),
    unit(Quantity::Moment, Decimal(3), &["kN·m", "kNm"]),
    unit(Quantity::Moment, Times(GRAVITY), &["kgf·m", "kgfm", "kpm"]),
    unit(Quantity::Moment, Times(POUND_N * FOOT_M), &["lbf·ft", "lbfft", "ftlbf", "ftlb", "lbft"]),
    unit(Quantity::Moment, Times(POUND_N * INCH_M), &["lbf·in", "lbfin", "inlbf", "inlb", "lbin"]),
    unit(Quantity::Temperature, Decimal(0), &["°C", "degC", "C", "Celsius"]),
    unit(Quantity::Temperature, Kelvin, &["K"]),
    unit(Quantity::Temperature, Fahrenheit, &["°F", "degF", "Fahrenheit"]),
    unit(Quantity::Time, Decimal(0), &["s", "sec", "seconds", "Sekunden"]),
    unit(Quantity::Time, Decimal(-3), &["ms", "msec"]),
    unit(Quantity::Time, Times(60.0), &["min", "minutes", "Minuten"]),
    unit(Quantity::Time, Times(3600.0), &["h", "hours", "Stunden"]),
];

/// Without spaces and signs of multiplication, µ as `u`.
fn plain(text: &str) -> String {
    let skipped = |c: &char| !c.is_whitespace() && !"·.*⋅-\u{200b}".contains(*c);
    text.chars().filter(skipped).map(|c| if matches!(c, 'µ' | 'μ') { 'u' } else { c }).collect()
}

/// The unit of a quantity that is written so; in letters of another case, as in a header of capitals, where it can be no other.
pub fn find(quantity: Quantity, text: &str) -> Option<&'static Unit> {
    let text = plain(text);
    let mut own = UNITS.iter().filter(|u| u.quantity == quantity);
    let exact = own.clone().find(|u| u.names.contains(&text.as_str()));
    exact.or_else(|| {
        let first = own.find(|u| u.is_alike(&text))?;
        own.all(|u| !u.is_alike(&text)).then_some(first)
    })
}

/// Whether a text is a unit of anything. Not of minutes and hours: `dx min` is a least value.
pub fn is_any(text: &str) -> bool {
    let text = plain(text);
    let is_long = |u: &Unit| u.quantity == Quantity::Time && matches!(u.size, Times(_));
    UNITS.iter().any(|u| u.is_alike(&text) && !is_long(u))
}

/// The known units of a quantity, for a message.
pub fn known(quantity: Quantity) -> String {
    let own = UNITS.iter().filter(|u| u.quantity == quantity);
    own.map(|u| u.names[0]).collect::<Vec<_>>().join(", ")
}

/// A number, written with a decimal point or comma, from a unit to another of the same quantity. Powers of ten move the point, so
/// that the result has the very digits of the file; `None` for what is no plain number.
pub fn converted(text: &str, from: &Unit, to: &Unit) -> Option<String> {
    match (from.size, to.size) {
        (a, b) if a == b => Some(text.to_owned()),
        (Decimal(a), Decimal(b)) => shifted(text, a - b),
        (a, b) => {
            let value: f64 = text.replace(',', ".").parse().ok()?;
            let converted = match (a, b) {
                (Degrees(a), Degrees(b)) => value * a / b,
                (Degrees(a), Decimal(b)) => (value * a).to_radians() * 10_f64.powi(-b),
                (Decimal(a), Degrees(b)) => (value * 10_f64.powi(a)).to_degrees() / b,
                (Times(a), Times(b)) => value * a / b,
                (Times(a), Decimal(b)) => value * a * 10_f64.powi(-b),
                (Decimal(a), Times(b)) => value * 10_f64.powi(a) / b,
                (Kelvin, _) => tidy(value - 273.15),
                (Fahrenheit, _) => tidy((value - 32.0) / 1.8),
                _ => return None,
            };
            Some(converted.to_string())
        }
    }
}

/// Moves the decimal point of a number to the right.
fn shifted(text: &str, places: i32) -> Option<String> {
    let (sign, digits) = match text.strip_prefix(['+', '-']) {
        Some(rest) => (if text.starts_with('-') { "-" } else { "" }, rest),
        None => ("", text),
    };
    if let Some((mantissa, exponent)) = digits.split_once(['e', 'E']) {
        let exponent: i32 = exponent.parse().ok()?;
        return Some(format!("{sign}{mantissa}e{}", exponent.checked_add(places)?));
    }
    let (whole, fraction) = digits.split_once(['.', ',']).unwrap_or((digits, ""));
    let all = format!("{whole}{fraction}");
    if all.is_empty() || !all.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let point = i32::try_from(whole.len()).ok()? + places;
    let before = usize::try_from(point).unwrap_or(0);
    // zeros in front or behind, where the point leaves the digits
    let padded = format!("{}{all}", "0".repeat(usize::try_from(-point).unwrap_or(0)));
    let padded = format!("{padded:0<before$}");
    let (whole, fraction) = padded.split_at(before);
    let whole = whole.trim_start_matches('0');
    let whole = if whole.is_empty() { "0" } else { whole };
    let mark = if fraction.is_empty() {
        ""
    } else if text.contains(',') {
        ","
    } else {
        "."
    };
    Some(format!("{sign}{whole}{mark}{fraction}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_ten_keep_the_digits() {
        for (text, places, expected) in [
            ("0.06531", 3, "65.31"),
            ("-0,06531", 3, "-65,31"),
            ("65.31", -3, "0.06531"),
            ("12", 3, "12000"),
            ("1.2", 3, "1200"),
            ("1.50", 1, "15.0"),
            (".5", 3, "500"),
            ("0", 6, "0"),
            ("+0.000", 3, "0"),
            ("1.5E-3", 3, "1.5e0"),
            ("530", -3, "0.530"),
        ] {
            assert_eq!(shifted(text, places).as_deref(), Some(expected), "{text} by {places}");
        }
        for text in ["", "-", ".", "1.2.3", "12 mm", "1e", "nan"] {
            assert_eq!(shifted(text, 3), None, "{text}");
        }
    }

    #[test]
    fn units_are_known_by_all_their_names() {
        let of = |quantity, from, to, text: &str| {
            converted(text, find(quantity, from).unwrap(), find(quantity, to).unwrap()).unwrap()
        };
        assert_eq!(of(Quantity::Moment, "N·mm", "N·m", "5500"), "5.500");
        assert_eq!(of(Quantity::Moment, "kN m", "N·m", "0.5"), "500");
        assert_eq!(of(Quantity::Length, "μm", "µm", "12.50"), "12.50");
        assert_eq!(of(Quantity::Temperature, "K", "°C", "294.65"), "21.5");
        assert_eq!(of(Quantity::Temperature, "°F", "°C", "70.7"), "21.5");
        assert_eq!(of(Quantity::Angle, "mrad", "µrad", "0,0118"), "11,8");
        let degrees: f64 = of(Quantity::Angle, "rad", "°", "0.1").parse().unwrap();
        assert_eq!(degrees, 0.1_f64.to_degrees());
        let micro: f64 = of(Quantity::Angle, "°", "µrad", "0.001").parse().unwrap();
        assert!((micro - 17.453_292_519_943_295).abs() < 1e-12);
        assert_eq!(of(Quantity::Length, "MM", "UM", "0.5"), "500");
        assert_eq!(of(Quantity::Length, "in", "mm", "20.5"), "520.7");
        assert_eq!(of(Quantity::Force, "MN", "N", "0.5"), "500000");
        assert!(find(Quantity::Force, "mn").is_none(), "millinewtons or meganewtons");
        assert!(find(Quantity::Force, "tons").is_none() && find(Quantity::Length, "N").is_none());
        // one pound-force is 4.448 221 615 260 5 N, by definition
        let pound: f64 = of(Quantity::Force, "lbf", "N", "1").parse().unwrap();
        assert!((pound - 4.448_221_615_260_5).abs() < 1e-12);
        let inch_pound: f64 = of(Quantity::Moment, "in-lb", "N·m", "1").parse().unwrap();
        assert!((inch_pound - 0.112_984_829_027_6).abs() < 1e-12);
        let kilograms: f64 = of(Quantity::Force, "kgf", "N", "10").parse().unwrap();
        assert!((kilograms - 98.066_5).abs() < 1e-12);
        assert_eq!(
            (of(Quantity::Time, "ms", "s", "1250"), of(Quantity::Time, "min", "s", "2,5")),
            ("1.250".into(), "150".into())
        );
        assert!(is_any("N*m") && is_any("s") && !is_any("load") && !is_any("min"));
    }
}
