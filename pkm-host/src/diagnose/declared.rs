//! Stiffnesses that the machine file declares, alone and in classes that may be wrong together.

use pkm_core::MachineParameters;
use pkm_core::machine::{Joint, Tube};

use crate::files::machine::Uncertainty;

/// A declared stiffness of the machine file. Young's and shear modulus count for rod and screw together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Declared {
    /// 0, 1, 2.
    pub limb: usize,
    /// Which part.
    pub part: Part,
}

/// A part of a limb with a declared stiffness.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs)] // the keys of the machine file
pub enum Part {
    BaseLinear(usize),
    BaseAngular(usize),
    PlatformLinear(usize),
    PlatformAngular(usize),
    Young,
    Shear,
}

impl Declared {
    /// Every declared stiffness that is not 0.
    pub fn all(parameters: &MachineParameters) -> Vec<Self> {
        let mut all = Vec::new();
        for (limb, l) in parameters.limbs.iter().enumerate() {
            let mut joint = |j: &Joint, linear: fn(usize) -> Part, angular: fn(usize) -> Part| {
                for axis in 0..3 {
                    all.push(Self { limb, part: linear(axis) });
                    if j.angular_nm_per_rad[axis] > 0.0 {
                        all.push(Self { limb, part: angular(axis) });
                    }
                }
            };
            joint(&l.base_joint, Part::BaseLinear, Part::BaseAngular);
            joint(&l.platform_joint, Part::PlatformLinear, Part::PlatformAngular);
            all.push(Self { limb, part: Part::Young });
            // the S joint of limb 3 passes no torque on
            if limb < 2 {
                all.push(Self { limb, part: Part::Shear });
            }
        }
        all
    }

    /// As in the machine file, without the axis.
    pub fn key(&self) -> String {
        let limb = self.limb + 1;
        match self.part {
            Part::BaseLinear(_) => format!("limb.{limb}.base_joint.linear_n_per_m"),
            Part::BaseAngular(_) => format!("limb.{limb}.base_joint.angular_nm_per_rad"),
            Part::PlatformLinear(_) => format!("limb.{limb}.platform_joint.linear_n_per_m"),
            Part::PlatformAngular(_) => format!("limb.{limb}.platform_joint.angular_nm_per_rad"),
            Part::Young => format!("limb.{limb}.body.young_gpa"),
            Part::Shear => format!("limb.{limb}.body.shear_gpa"),
        }
    }

    /// Relative standard deviation with which it is declared.
    pub fn uncertainty(&self, of: &Uncertainty) -> f64 {
        if self.is_of_body() { of.body } else { of.joint }
    }

    /// Of a body rather than a joint.
    pub fn is_of_body(&self) -> bool {
        matches!(self.part, Part::Young | Part::Shear)
    }

    /// Axis of a joint's stiffness.
    pub fn axis(&self) -> Option<usize> {
        match self.part {
            Part::BaseLinear(i) | Part::BaseAngular(i) | Part::PlatformLinear(i) | Part::PlatformAngular(i) => Some(i),
            Part::Young | Part::Shear => None,
        }
    }

    /// Calls `change` with every number that it stands for.
    pub(super) fn each(&self, parameters: &mut MachineParameters, mut change: impl FnMut(&mut f64)) {
        let l = &mut parameters.limbs[self.limb];
        let tubes = |b: &mut pkm_core::machine::Body, change: &mut dyn FnMut(&mut Tube)| {
            change(&mut b.rod);
            change(&mut b.screw);
        };
        match self.part {
            Part::BaseLinear(i) => change(&mut l.base_joint.linear_n_per_m[i]),
            Part::BaseAngular(i) => change(&mut l.base_joint.angular_nm_per_rad[i]),
            Part::PlatformLinear(i) => change(&mut l.platform_joint.linear_n_per_m[i]),
            Part::PlatformAngular(i) => change(&mut l.platform_joint.angular_nm_per_rad[i]),
            Part::Young => tubes(&mut l.body, &mut |t| change(&mut t.young_pa)),
            Part::Shear => tubes(&mut l.body, &mut |t| change(&mut t.shear_pa)),
        }
    }

    /// Its value, of the rod for a body; moduli in GPa.
    pub fn value(&self, parameters: &MachineParameters) -> f64 {
        let mut found = Vec::new();
        self.each(&mut parameters.clone(), |v| found.push(*v));
        let unit = if self.is_of_body() { 1e-9 } else { 1.0 };
        found[0] * unit
    }
}

/// Declared stiffnesses that go wrong together: one stiffness, one part of a limb, the same part of two or three limbs.
#[derive(Clone, Debug, PartialEq)]
pub struct Class {
    /// What it holds.
    pub members: Vec<Declared>,
}

impl Class {
    /// Every class of a machine.
    pub fn all(parameters: &MachineParameters) -> Vec<Self> {
        let all = Declared::all(parameters);
        let mut classes: Vec<Self> = Vec::new();
        let mut add = |members: Vec<Declared>| {
            let class = Self { members };
            if !class.members.is_empty() && !classes.contains(&class) {
                classes.push(class);
            }
        };
        for limbs in [&[0][..], &[1], &[2], &[0, 1], &[0, 1, 2]] {
            let of = |d: &&Declared| limbs.contains(&d.limb);
            let like = |part: Part| all.iter().filter(of).filter(|d| d.part == part).copied().collect::<Vec<_>>();
            // the key without `limb.N.`
            let kind = |d: &Declared| d.key()[7..].to_owned();
            let mut kinds: Vec<String> = all.iter().filter(of).map(kind).collect();
            kinds.dedup();
            // joints of limb 3 are others than those of 1 and 2
            if limbs.len() < 3 {
                for d in all.iter().filter(of) {
                    add(like(d.part));
                }
                for k in &kinds {
                    add(all.iter().filter(of).filter(|d| kind(d) == *k).copied().collect());
                }
            } else {
                add(like(Part::Young));
            }
        }
        classes
    }

    /// Keys of the machine file, each once.
    pub fn keys(&self) -> Vec<String> {
        let mut keys: Vec<String> = self.members.iter().map(Declared::key).collect();
        keys.sort();
        keys.dedup();
        keys
    }
}
