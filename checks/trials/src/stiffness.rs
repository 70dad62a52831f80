//! Stiffness of machines with elastic platforms over a wide box: data of the case study, and of the X150.

use crate::effects::Effect;
use crate::machine::{Machine, Pose};
use crate::truth::World;

/// A machine whose stiffness [`csv`] writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Stiff {
    /// That of `fixtures/machines/reference.toml`.
    Reference,
    /// That of `fixtures/machines/x150.toml`.
    X150,
}

/// Stiffness at A in A-uvw of a machine with an elastic moving platform and an elastic base, by dense frames, over a box
/// that is as wide as travel lets it be: where nothing but the machine's own physics is wrong with the model.
///
/// # Errors
/// A machine that does not stand.
pub fn csv(of: Stiff) -> Result<String, String> {
    // θ and σ in degrees, Z0 in mm: least, greatest, step
    let (name, machine, grid): (_, _, [[i32; 3]; 3]) = match of {
        Stiff::Reference => ("reference", Machine::reference(), [[-36, 36, 9], [-24, 24, 8], [440, 620, 36]]),
        Stiff::X150 => ("X150", Machine::x150(), [[-6, 18, 3], [-8, 8, 4], [244, 272, 4]]),
    };
    let elastic = |id, amplitude| Effect { id, variant: 0, amplitude, shape: [0.0; 8] };
    let effects = vec![elastic("moving-platform-compliance", 3.0), elastic("base-compliance", 2.0)];
    let world = World::new(machine.clone(), machine, effects);
    let names: Vec<String> = (1..=6).flat_map(|i| (i..=6).map(move |j| format!("k{i}{j}"))).collect();
    let mut csv = format!(
        "# terminal stiffness of the {name} machine with an elastic moving platform and base, by dense frames; simulated\n\
         # K at A in A-uvw, SI\npose,theta_deg,sigma_deg,z0_mm,{}\n",
        names.join(",")
    );
    let mut count = 0;
    let [thetas, sigmas, heights] = grid.map(|[least, most, step]| (least..=most).step_by(step as usize));
    for theta in thetas {
        for sigma in sigmas.clone() {
            for z0 in heights.clone() {
                let pose = Pose([f64::from(theta).to_radians(), f64::from(sigma).to_radians(), f64::from(z0) / 1e3]);
                if !world.nominal.reaches(&pose) {
                    continue;
                }
                count += 1;
                let k = world.reduced(&pose, 20.0).c.try_inverse().ok_or("a compliance that has no inverse")?;
                let upper = (0..6).flat_map(|i| (i..6).map(move |j| (i, j)));
                let cells: Vec<String> = upper.map(|(i, j)| format!("{:.9e}", 0.5 * (k[(i, j)] + k[(j, i)]))).collect();
                csv.push_str(&format!("W{count:03},{theta},{sigma},{z0},{}\n", cells.join(",")));
            }
        }
    }
    Ok(csv)
}
