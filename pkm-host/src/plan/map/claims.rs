//! What the paper's Section 5.2 says of its Fig. 7, compared with a map.
//!
//! Each claim is given a sense that can be computed from the CSV alone, over all points that have a stiffness or over
//! those inside the table's box. The X0 extent of these points is cut into three equal parts, left (least X0), middle
//! and right: the paper's [−400, −200] and [200, 400] mm are the outer parts of its own workspace.

use serde_json::{Map as Object, Value as Json, json};

use super::{Map, Point};
use crate::pose::ROTATION_ARM_M;

const NAMES: [&str; 6] = ["k11", "k22", "k33", "k44", "k55", "k66"];
const PARTS: [&str; 3] = ["left", "middle", "right"];

/// Half an order of magnitude: "about an order" is within it of 10, "much better" is beyond it.
const HALF_ORDER: f64 = 3.162_277_660_168_379_5;

/// A claim of the paper and how often it holds.
pub struct Claim {
    /// In words that say how it is decided.
    pub claim: String,
    /// Whether it is true of this map.
    pub holds: bool,
    /// What decides.
    pub figures: Json,
    /// The same in short, for the terminal.
    pub text: String,
}

/// All claims over the points of a map that have a stiffness, or those of them inside the table's box alone; none when
/// these are not at least two wide and two high.
pub fn check(map: &Map, inside_alone: bool) -> Vec<Claim> {
    let field = Field::new(map, inside_alone);
    if field.extent[0] >= field.extent[1] || field.pairs([0, 1]).next().is_none() {
        return Vec::new();
    }
    vec![
        field.large_in("k11, k22, k33 are large at negative X0", &[0, 1, 2], 0),
        field.falls_with_z0(),
        field.ratio(
            "k33 is about an order of magnitude above k11 and k22",
            &[(2, 0), (2, 1)],
            [10.0 / HALF_ORDER, 10.0 * HALF_ORDER],
        ),
        field.ratio("k11 is similar to k22", &[(0, 1)], [0.5, 2.0]),
        field.large_in("k44, k55 are large at positive X0", &[3, 4], 2),
        field.large_in("k66 is large at negative X0", &[5], 0),
        field.linear_beats_rotational(),
    ]
}

/// The values that count, where they stand on the grid.
struct Field<'a> {
    map: &'a Map,
    values: Vec<Option<[f64; 6]>>,
    extent: [f64; 2],
}

impl<'a> Field<'a> {
    fn new(map: &'a Map, inside_alone: bool) -> Self {
        let value = |p: &Point| p.value.ok().filter(|v| !inside_alone || v.inside == Some(true)).map(|v| v.principal);
        let values: Vec<_> = map.points.iter().map(value).collect();
        let taken = map.points.iter().zip(&values).filter(|(_, v)| v.is_some()).map(|(p, _)| p.x0_mm);
        let extent = taken.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
        Self { map, values, extent }
    }

    fn all(&self) -> impl Iterator<Item = &[f64; 6]> {
        self.values.iter().flatten()
    }

    /// Values of neighbours, the second a number of columns and rows further.
    fn pairs(&self, [column, row]: [usize; 2]) -> impl Iterator<Item = [&[f64; 6]; 2]> {
        let width = self.map.grid.count[0];
        self.values
            .iter()
            .enumerate()
            .filter(move |(i, _)| i % width + column < width)
            .filter_map(move |(i, v)| Some([v.as_ref()?, self.values.get(i + column + row * width)?.as_ref()?]))
    }

    fn share(&self, step: [usize; 2], test: impl Fn([&[f64; 6]; 2]) -> bool) -> f64 {
        let (mut hits, mut all) = (0.0, 0.0_f64);
        for pair in self.pairs(step) {
            all += 1.0;
            hits += f64::from(u8::from(test(pair)));
        }
        hits / all.max(1.0)
    }

    /// Means of a stiffness in the three parts of the X0 extent.
    fn means(&self, k: usize) -> [f64; 3] {
        let [low, high] = self.extent;
        let (mut sums, mut counts) = ([0.0; 3], [0.0; 3]);
        for (point, value) in self.map.points.iter().zip(&self.values) {
            let Some(value) = value else { continue };
            let part = ((point.x0_mm - low) / (high - low) * 3.0).clamp(0.0, 2.0) as usize;
            sums[part] += value[k];
            counts[part] += 1.0;
        }
        // NaN, which is above nothing, for a part without points
        std::array::from_fn(|part| sums[part] / counts[part])
    }

    fn large_in(&self, words: &str, stiffnesses: &[usize], part: usize) -> Claim {
        let (mut figures, mut texts, mut holds) = (Object::new(), Vec::new(), true);
        for &k in stiffnesses {
            let means = self.means(k);
            holds &= (0..3).all(|other| other == part || means[part] > means[other]);
            let rises = self.share([1, 0], |[here, right]| right[k] > here[k]);
            figures.insert(
                NAMES[k].into(),
                json!({ "mean_left": means[0], "mean_middle": means[1], "mean_right": means[2], "rises_with_x0_share": rises }),
            );
            let mean = means.map(|m| format!("{:.2}", m / means[1])).join(" : ");
            texts.push(format!("{} {mean}, rises with X0 at {:.0} % of points", NAMES[k], 100.0 * rises));
        }
        let claim = format!("{words}: mean in the {} third of X0 above those in the other two", PARTS[part]);
        Claim { claim, holds, figures: figures.into(), text: format!("left : middle : right: {}", texts.join("; ")) }
    }

    fn falls_with_z0(&self) -> Claim {
        let shares = [0, 1, 2].map(|k| self.share([0, 1], |[here, above]| above[k] < here[k]));
        let text = |k: usize| format!("{} at {:.1} % of points", NAMES[k], 100.0 * shares[k]);
        Claim {
            claim: "k11, k22, k33 fall with growing Z0 at fixed X0: between all neighbours".into(),
            holds: shares.iter().all(|s| *s == 1.0),
            figures: [0, 1, 2]
                .map(|k| (NAMES[k].to_owned(), json!({ "falls_with_z0_share": shares[k] })))
                .into_iter()
                .collect::<Object<_, _>>()
                .into(),
            text: format!("falls: {}", [0, 1, 2].map(text).join(", ")),
        }
    }

    fn ratio(&self, words: &str, pairs: &[(usize, usize)], [low, high]: [f64; 2]) -> Claim {
        let (mut figures, mut texts, mut holds) = (Object::new(), Vec::new(), true);
        for &(a, b) in pairs {
            let ratio = Spread::new(self.all().map(|v| v[a] / v[b]));
            holds &= low <= ratio.mean && ratio.mean <= high;
            let name = format!("{}/{}", NAMES[a], NAMES[b]);
            texts.push(format!("{name} {:.2} ({:.2} … {:.2})", ratio.mean, ratio.least, ratio.greatest));
            figures.insert(name, ratio.to_json());
        }
        let claim = format!("{words}: geometric mean of the ratio within {low:.2} … {high:.2}");
        Claim { claim, holds, figures: figures.into(), text: texts.join(", ") }
    }

    /// N/m and N·m/rad compare only at an arm r: a turn of 1 rad moves its end by r under a force of M/r, so that a
    /// rotational stiffness counts as k/r².
    fn linear_beats_rotational(&self) -> Claim {
        let arm2 = ROTATION_ARM_M * ROTATION_ARM_M;
        let least = |v: &[f64; 6]| v[0].min(v[1]).min(v[2]);
        let greatest = |v: &[f64; 6]| v[3].max(v[4]).max(v[5]);
        let ratio = Spread::new(self.all().map(|v| least(v) * arm2 / greatest(v)));
        let arm = Spread::new(self.all().map(|v| (greatest(v) / least(v)).sqrt()));
        Claim {
            claim: format!(
                "linear stiffness is much better than rotational: least of k11, k22, k33 over greatest of k44, k55, k66 \
                 taken at an arm of {ROTATION_ARM_M} m (k/arm²), geometric mean above {HALF_ORDER:.2}"
            ),
            holds: ratio.mean > HALF_ORDER,
            text: format!(
                "{:.2} ({:.2} … {:.2}); equal at an arm of {:.3} m ({:.3} … {:.3}), so that it depends on the arm",
                ratio.mean, ratio.least, ratio.greatest, arm.mean, arm.least, arm.greatest
            ),
            figures: json!({ "arm_m": ROTATION_ARM_M, "ratio": ratio.to_json(), "equal_at_arm_m": arm.to_json() }),
        }
    }
}

/// Of positive numbers.
struct Spread {
    mean: f64,
    least: f64,
    greatest: f64,
}

impl Spread {
    fn new(values: impl Iterator<Item = f64>) -> Self {
        let (mut logs, mut count, mut least, mut greatest) = (0.0, 0.0, f64::INFINITY, 0.0_f64);
        for v in values {
            (logs, count, least, greatest) = (logs + v.ln(), count + 1.0, v.min(least), v.max(greatest));
        }
        Self { mean: f64::exp(logs / count), least, greatest }
    }

    fn to_json(&self) -> Json {
        json!({ "geometric_mean": self.mean, "least": self.least, "greatest": self.greatest })
    }
}
