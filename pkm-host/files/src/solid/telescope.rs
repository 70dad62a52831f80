//! Limbs of two tubes with a screw in them: what a file leaves open follows from the declared bodies.

use pkm_core::MachineParameters;
use toml::Spanned;

use super::{Bar, Checked, MM, POSITIVE, RawSeat, RawSolid, Seat, Telescope, misfit, three};

impl RawSolid {
    pub(super) fn telescopes(&self, machine: &MachineParameters, bodies: &[[Bar; 2]]) -> Checked<[Telescope; 3]> {
        let rods: [Bar; 3] = std::array::from_fn(|i| bodies[i][0]);
        let screws: [Bar; 3] = std::array::from_fn(|i| bodies[i][1]);
        let (min, max) = (machine.travel.min_m, machine.travel.max_m);
        // the ram is the declared rod
        let ram_outer = three("solid.ram.outer_mm", &self.ram.outer_mm, MM, POSITIVE, rods.map(|b| b.outer_m))?;
        let ram_inner = three("solid.ram.inner_mm", &self.ram.inner_mm, MM, 0.0, rods.map(|b| b.inner_m))?;
        let screw_outer = three("solid.screw.outer_mm", &self.screw.outer_mm, MM, POSITIVE, screws.map(|b| b.outer_m))?;
        let screw_inner = three("solid.screw.inner_mm", &self.screw.inner_mm, MM, 0.0, screws.map(|b| b.inner_m))?;
        // the tube goes round it with a gap, and bends as the declared body does
        let inner = std::array::from_fn(|i| 1.06 * ram_outer[i].max(screw_outer[i]));
        let tube_inner = three("solid.tube.inner_mm", &self.tube.inner_mm, MM, POSITIVE, inner)?;
        let outer = std::array::from_fn(|i| {
            let declared = rods[i].inertia_m4() + screws[i].inertia_m4() * screws[i].young_pa / rods[i].young_pa;
            (declared * 64.0 / std::f64::consts::PI + tube_inner[i].powi(4)).powf(0.25)
        });
        let tube_outer = three("solid.tube.outer_mm", &self.tube.outer_mm, MM, POSITIVE, outer)?;
        // room to the joints at both ends of travel; the overlap is the rest, unless it takes a tube that reaches behind
        let room = max.map(|q| 0.02 * q);
        let tube_m = std::array::from_fn(|i| (min[i] - room[i]).max(0.2 * min[i]));
        let tube_m = three("solid.tube.length_mm", &self.tube.length_mm, MM, POSITIVE, tube_m)?;
        let ram_m = std::array::from_fn(|i| (min[i] - room[i]).max(1.05 * max[i] - tube_m[i]));
        let ram_m = three("solid.ram.length_mm", &self.ram.length_mm, MM, POSITIVE, ram_m)?;
        let behind_m = std::array::from_fn(|i| (ram_m[i] - min[i] + room[i]).max(0.0));
        let behind_m = three("solid.tube.behind_mm", &self.tube.behind_mm, MM, 0.0, behind_m)?;
        // what is bought grows with the screw: 3.5e8 N/m with its housing for one of 32 mm
        let bought: [f64; 3] = std::array::from_fn(|i| 0.053 * screws[i].young_pa * screw_outer[i]);
        let seat = |name: &str, raw: &RawSeat| -> Checked<[Seat; 3]> {
            let axial = three(&format!("solid.{name}.axial_n_per_m"), &raw.axial_n_per_m, 1.0, POSITIVE, bought)?;
            let radial = three(&format!("solid.{name}.radial_n_per_m"), &raw.radial_n_per_m, 1.0, POSITIVE, bought)?;
            Ok(std::array::from_fn(|i| Seat { axial_n_per_m: axial[i], radial_n_per_m: radial[i] }))
        };
        let (bearing, nut) = (seat("bearing", &self.bearing)?, seat("nut", &self.nut)?);
        let guide = std::array::from_fn(|i| 0.24 * rods[i].young_pa * ram_outer[i]);
        let guide = three("solid.guide.radial_n_per_m", &self.guide.radial_n_per_m, 1.0, POSITIVE, guide)?;
        let key = std::array::from_fn(|i| 0.2 * rods[i].young_pa * ram_outer[i].powi(3));
        let key = three("solid.guide.key_nm_per_rad", &self.guide.key_nm_per_rad, 1.0, POSITIVE, key)?;
        let telescopes = std::array::from_fn(|i| Telescope {
            tube: Bar { outer_m: tube_outer[i], inner_m: tube_inner[i], ..rods[i] },
            tube_m: tube_m[i],
            behind_m: behind_m[i],
            ram: Bar { outer_m: ram_outer[i], inner_m: ram_inner[i], ..rods[i] },
            ram_m: ram_m[i],
            screw: Bar { outer_m: screw_outer[i], inner_m: screw_inner[i], ..screws[i] },
            bearing: bearing[i],
            nut: nut[i],
            guide_n_per_m: guide[i],
            key_nm_per_rad: key[i],
        });
        self.fit_together(&telescopes, max)?;
        Ok(telescopes)
    }

    /// Whether the parts of each limb go into one another and reach far enough.
    fn fit_together(&self, telescopes: &[Telescope; 3], longest_m: [f64; 3]) -> Checked<()> {
        let (of_ram, of_screw, of_tube) = (&self.ram.inner_mm, &self.screw.inner_mm, &self.tube.inner_mm);
        let mm = |m: f64| (m / MM * 1e3).round() / 1e3;
        for (limb, (Telescope { tube, tube_m, ram, ram_m, screw, .. }, longest_m)) in
            (1..).zip(telescopes.iter().zip(longest_m))
        {
            let rules = [
                (ram.inner_m < ram.outer_m, "ram.inner_mm", of_ram, "a bore below the ram's outer_mm"),
                (screw.inner_m < screw.outer_m, "screw.inner_mm", of_screw, "a bore below the screw's outer_mm"),
                (tube.inner_m < tube.outer_m, "tube.inner_mm", of_tube, "a bore below the tube's outer_mm"),
                (
                    ram.outer_m.max(screw.outer_m) <= tube.inner_m,
                    "tube.inner_mm",
                    of_tube,
                    "a bore that ram and screw fit in",
                ),
                (
                    *tube_m < longest_m,
                    "tube.length_mm",
                    &self.tube.length_mm,
                    "a tube that ends before the platform joint",
                ),
                (
                    tube_m + ram_m > longest_m,
                    "ram.length_mm",
                    &self.ram.length_mm,
                    "tube and ram long enough together for the greatest screw length",
                ),
            ];
            if let Some((_, key, raw, expected)) = rules.into_iter().find(|(holds, ..)| !holds) {
                let message = format!(
                    "limb {limb}: expected {expected}; tube {}/{} mm, {} mm long, ram {}/{} mm, {} mm long",
                    mm(tube.outer_m),
                    mm(tube.inner_m),
                    mm(*tube_m),
                    mm(ram.outer_m),
                    mm(ram.inner_m),
                    mm(*ram_m)
                );
                return misfit(format!("solid.{key}"), raw.as_ref().map(Spanned::span), message);
            }
        }
        Ok(())
    }
}
