//! The machine at a pose as an input deck for CalculiX, SI, in A-uvw with A as the origin.
//!
//! Kinematics stand here once more, on purpose: what is computed here is what the core is compared with.

use std::fmt::Write as _;

use nalgebra::{Isometry3, Matrix3, Rotation3, Vector3};
use pkm_core::Pose;
use pkm_core::machine::{Joint, MachineParameters};

use super::mesh::{self, Mesh, PlateMesh};
use crate::files::solid::{Bar, LimbSolid, Plate, Solid, Telescope};

/// Least overlap of tube and ram: as in the core's effect, less in a small machine.
fn least_overlap_m(q: f64) -> f64 {
    (0.02 * q).min(0.010)
}

/// Least distance of two rigid rings on one bar.
fn least_apart_m(q: f64) -> f64 {
    (0.004 * q).min(0.002)
}

/// A rigid body's two nodes in CalculiX, or two nodes of the ground: translations are the first one's degrees of freedom, rotations the
/// second one's.
#[derive(Clone, Copy)]
struct Body {
    reference: usize,
    rotation: usize,
}

/// A solid of a [`Deck`].
pub struct Part {
    /// `TUBE1`, `PLATFORM`: as the deck calls it.
    pub name: String,
    /// In A-uvw.
    pub mesh: Mesh,
    /// Number of its node 0.
    first: usize,
    material: usize,
}

struct Spring {
    /// For who reads the deck.
    what: String,
    between: [usize; 2],
    /// Freedom of both nodes, 1 to 3, in axes of the orientation.
    freedom: usize,
    orientation: usize,
    stiffness: f64,
}

/// What a deck is made of.
pub struct Deck {
    parts: Vec<Part>,
    /// Nodes that belong to no element of a part.
    others: Vec<(usize, Vector3<f64>)>,
    next: usize,
    /// Young's modulus in Pa and Poisson's ratio.
    materials: Vec<(f64, f64)>,
    orientations: Vec<Matrix3<f64>>,
    rigid: Vec<(Vec<usize>, Body)>,
    springs: Vec<Spring>,
    fixed: Vec<usize>,
    /// Where the wrenches act.
    hub: Body,
    /// From A-uvw to the axes of B.
    base_axes: Rotation3<f64>,
}

/// Plates of a machine, meshed once for all poses; `None` is rigid.
pub struct Plates {
    platform: Option<PlateMesh>,
    base: Option<PlateMesh>,
    /// Of elements, relative to the usual.
    pub size: f64,
}

/// Bores of a plate with their diameters.
type Bores = fn(&Plate, &MachineParameters) -> Vec<([f64; 2], f64)>;

impl Plates {
    /// Meshes them.
    ///
    /// # Errors
    /// A plate that takes too many elements.
    pub fn new(solid: &Solid, machine: &MachineParameters, size: f64) -> Result<Self, String> {
        let meshed = |name: &str, plate: &Option<Plate>, bores: Bores, size: f64| {
            let Some(plate) = plate else { return Ok(None) };
            let mesh = mesh::plate(plate, &bores(plate, machine), size);
            let too_many =
                || format!("the {name} takes too many elements: make it thicker, or its bores and rim wider");
            mesh.map(Some).ok_or_else(too_many)
        };
        // the moving platform gives a hundred times more than the base, which is held along its edge
        Ok(Self {
            platform: meshed("platform", &solid.platform, Solid::platform_bores, 0.7 * size)?,
            base: meshed("base", &solid.base, Solid::base_bores, 1.5 * size)?,
            size,
        })
    }
}

/// A limb at a pose: where it begins, its axes (z along it) and its length.
struct Line {
    limb: usize,
    from: Vector3<f64>,
    axes: Matrix3<f64>,
    length_m: f64,
}

impl Line {
    fn at(&self, s: f64) -> Vector3<f64> {
        self.from + self.axes.column(2) * s
    }
}

/// Why solids don't fit at a pose, in words.
pub type Collision = String;

/// Where the base platform's axes and its point B are, seen from A.
fn base_frame(pose: &Pose<f64>) -> Isometry3<f64> {
    let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), pose.theta_rad)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), pose.sigma_rad);
    Isometry3::from_parts(pose.a_in_b_m().into(), turn.into()).inverse()
}

impl Deck {
    /// The machine at a pose.
    ///
    /// # Errors
    /// What collides.
    pub fn new(
        solid: &Solid,
        machine: &MachineParameters,
        pose: &Pose<f64>,
        plates: &Plates,
    ) -> Result<Self, Collision> {
        let b_in_a = base_frame(pose);
        let nowhere = Body { reference: 0, rotation: 0 };
        let mut deck = Self {
            parts: Vec::new(),
            others: Vec::new(),
            next: 1,
            materials: Vec::new(),
            orientations: Vec::new(),
            rigid: Vec::new(),
            springs: Vec::new(),
            fixed: Vec::new(),
            hub: nowhere,
            base_axes: b_in_a.rotation.inverse().into(),
        };
        let g = &machine.geometry;
        let base = [[0.0, -g.b1_m, 0.0], [0.0, g.b1_m, 0.0], [g.b2_m, 0.0, 0.0]]
            .map(|p| b_in_a.transform_point(&p.into()).coords);
        let platform: [Vector3<f64>; 3] = {
            let flat = [[0.0, -g.a1_m], [0.0, g.a1_m], [g.a2_m, 0.0]];
            std::array::from_fn(|i| Vector3::new(flat[i][0], flat[i][1], solid.offset_m[i]))
        };
        let (y_b, z_b) = (b_in_a * Vector3::y(), b_in_a * Vector3::z());
        let lines: [Line; 3] = std::array::from_fn(|limb| {
            let along = platform[limb] - base[limb];
            let z = along.normalize();
            // u, or y of B, which is square to the limb unless A_i is out of its plane
            let x = if limb == 2 { y_b } else { Vector3::x() };
            let x = (x - z * z.dot(&x)).normalize();
            Line { limb, from: base[limb], axes: Matrix3::from_columns(&[x, z.cross(&x), z]), length_m: along.norm() }
        });
        check_room(solid, &lines, &z_b)?;

        let stands = deck.base(solid, plates, &base, &b_in_a);
        let carries = deck.platform(solid, plates, &platform);
        for (line, part) in lines.iter().zip(&solid.limbs) {
            let (foot, head) = match part {
                LimbSolid::Uniform { rod, screw } => deck.uniform(line, [rod, screw], plates.size),
                LimbSolid::Telescopic(t) => deck.telescope(line, t, plates.size)?,
            };
            let joints = &machine.limbs[line.limb];
            let base_axes = match line.limb {
                2 => line.axes,
                _ => Matrix3::from_columns(&[Vector3::x(), y_b, Vector3::x().cross(&y_b)]),
            };
            let name = |end: &str| format!("{end} joint of limb {}", line.limb + 1);
            deck.joint(&name("base"), [stands[line.limb], foot], &base_axes, &joints.base_joint);
            deck.joint(&name("platform"), [head, carries[line.limb]], &line.axes, &joints.platform_joint);
        }
        Ok(deck)
    }

    fn node(&mut self, at: Vector3<f64>) -> usize {
        self.others.push((self.next, at));
        self.next += 1;
        self.next - 1
    }

    /// Two nodes at a place, free.
    fn body(&mut self, at: Vector3<f64>) -> Body {
        Body { reference: self.node(at), rotation: self.node(at) }
    }

    /// Makes nodes one rigid body that is held and moved at a place.
    fn rigid(&mut self, nodes: Vec<usize>, at: Vector3<f64>) -> Body {
        let body = self.body(at);
        self.rigid.push((nodes, body));
        body
    }

    /// Adds a part and gives the number of its first node.
    fn part(&mut self, name: String, mut mesh: Mesh, place: &Isometry3<f64>, of: (f64, f64)) -> usize {
        for node in &mut mesh.nodes {
            *node = place.transform_point(&(*node).into()).coords.into();
        }
        let material = self.materials.iter().position(|m| *m == of).unwrap_or_else(|| {
            self.materials.push(of);
            self.materials.len() - 1
        });
        let first = self.next;
        self.next += mesh.nodes.len();
        self.parts.push(Part { name, mesh, first, material });
        first
    }

    /// Springs along and about axes (columns) between two bodies at one place; 0 is free.
    fn connect(&mut self, what: &str, [a, b]: [Body; 2], axes: &Matrix3<f64>, stiffness: [f64; 6]) {
        let orientation = self.orientations.iter().position(|o| o == axes).unwrap_or_else(|| {
            self.orientations.push(*axes);
            self.orientations.len() - 1
        });
        for (i, stiffness) in stiffness.into_iter().enumerate().filter(|(_, k)| *k != 0.0) {
            let between = if i < 3 { [a.reference, b.reference] } else { [a.rotation, b.rotation] };
            self.springs.push(Spring { what: what.to_owned(), between, freedom: i % 3 + 1, orientation, stiffness });
        }
    }

    fn joint(&mut self, what: &str, between: [Body; 2], axes: &Matrix3<f64>, joint: &Joint) {
        let ([a, b, c], [d, e, f]) = (joint.linear_n_per_m, joint.angular_nm_per_rad);
        self.connect(what, between, axes, [a, b, c, d, e, f]);
    }

    /// What the base joints stand on.
    fn base(&mut self, solid: &Solid, plates: &Plates, at: &[Vector3<f64>; 3], place: &Isometry3<f64>) -> [Body; 3] {
        let Some((plate, mesh)) = solid.base.as_ref().zip(plates.base.as_ref()) else {
            return at.map(|at| {
                let ground = self.body(at);
                self.fixed.extend([ground.reference, ground.rotation]);
                ground
            });
        };
        let first = self.part("BASE".to_owned(), mesh.mesh.clone(), place, (plate.young_pa, plate.poisson));
        self.fixed.extend(mesh.edge.iter().map(|n| first + n));
        std::array::from_fn(|i| self.rigid(mesh.bores[i].iter().map(|n| first + n).collect(), at[i]))
    }

    /// What the platform joints carry.
    fn platform(&mut self, solid: &Solid, plates: &Plates, at: &[Vector3<f64>; 3]) -> [Body; 3] {
        let Some((plate, mesh)) = solid.platform.as_ref().zip(plates.platform.as_ref()) else {
            let corners = at.map(|at| self.node(at));
            self.hub = self.rigid(corners.into(), Vector3::zeros());
            return corners.map(|reference| Body { reference, rotation: self.hub.rotation });
        };
        let of = (plate.young_pa, plate.poisson);
        let first = self.part("PLATFORM".to_owned(), mesh.mesh.clone(), &Isometry3::identity(), of);
        let wall = |bore: &[usize]| bore.iter().map(|n| first + n).collect();
        self.hub = self.rigid(wall(&mesh.bores[3]), Vector3::zeros());
        std::array::from_fn(|i| self.rigid(wall(&mesh.bores[i]), at[i]))
    }

    /// A bar that starts at a place of a limb, and its nodes at stations, which are measured from its start.
    fn bar(
        &mut self,
        name: &str,
        line: &Line,
        from_m: f64,
        bar: &Bar,
        stations_m: &[f64],
        size: f64,
    ) -> Vec<Vec<usize>> {
        let meshed = mesh::bar(bar, stations_m, size);
        let turn = Rotation3::from_matrix_unchecked(line.axes);
        let place = Isometry3::from_parts(line.at(from_m).into(), turn.into());
        let first = self.part(format!("{name}{}", line.limb + 1), meshed.mesh, &place, (bar.young_pa, bar.poisson));
        meshed.sections.into_iter().map(|s| s.into_iter().map(|n| first + n).collect()).collect()
    }

    fn uniform(&mut self, line: &Line, bars: [&Bar; 2], size: f64) -> (Body, Body) {
        let (mut feet, mut heads) = (Vec::new(), Vec::new());
        for (name, bar) in ["ROD", "SCREW"].into_iter().zip(bars) {
            let mut ends = self.bar(name, line, 0.0, bar, &[0.0, line.length_m], size).into_iter();
            feet.extend(ends.next().into_iter().flatten());
            heads.extend(ends.next().into_iter().flatten());
        }
        (self.rigid(feet, line.from), self.rigid(heads, line.at(line.length_m)))
    }

    fn telescope(&mut self, line: &Line, t: &Telescope, size: f64) -> Result<(Body, Body), Collision> {
        let (q, number, mm) = (line.length_m, line.limb + 1, 1e3);
        let (overlap, apart) = (least_overlap_m(q), least_apart_m(q));
        // the rear end's ring and the joint's are one unless there is room for two
        let rear = if t.behind_m < apart { 0.0 } else { -t.behind_m };
        let mouth = t.tube_m;
        let mut inner = q - t.ram_m;
        let collision = |what: &str, left: f64, needed: f64| {
            Err(format!(
                "limb {number}, {:.1} mm long: {what}: {:.1} mm, at least {:.1} mm are needed; see [solid] tube and ram",
                q * mm,
                left * mm,
                needed * mm
            ))
        };
        if mouth - inner < overlap {
            return collision("the ram leaves the tube, overlap", mouth - inner, overlap);
        }
        if inner - rear < apart {
            return collision("the ram's inner end meets the tube's rear end, room", inner - rear, apart);
        }
        if q - mouth < apart {
            return collision("the tube's mouth is at the platform joint, room", q - mouth, apart);
        }
        // one ring can't be held by the joint and carry a guide
        if rear < 0.0 && inner.abs() < apart {
            inner = apart;
        }
        let mut places = vec![rear, 0.0, inner, mouth];
        places.dedup();
        places.sort_by(f64::total_cmp);
        let from_rear: Vec<f64> = places.iter().map(|s| s - rear).collect();
        let rings = self.bar("TUBE", line, rear, &t.tube, &from_rear, size);
        let tube: Vec<Body> = rings.into_iter().zip(&places).map(|(ring, s)| self.rigid(ring, line.at(*s))).collect();
        let at = |s: f64| places.iter().position(|p| *p == s).expect("one of its stations");
        let rings = self.bar("RAM", line, inner, &t.ram, &[0.0, mouth - inner, q - inner], size);
        let ram: Vec<Body> =
            rings.into_iter().zip([inner, mouth, q]).map(|(ring, s)| self.rigid(ring, line.at(s))).collect();
        let ends = self.bar("SCREW", line, rear, &t.screw, &[0.0, inner - rear], size);
        let screw: Vec<Body> =
            ends.into_iter().zip([rear, inner]).map(|(ring, s)| self.rigid(ring, line.at(s))).collect();

        let (o, g) = (0.0, t.guide_n_per_m);
        let radial = t.bearing.radial_n_per_m;
        // the drive holds the screw; nothing else turns it, so that any stiffness will do
        let held = t.key_nm_per_rad;
        let name = |part: &str| format!("{part} of limb {number}");
        let axial = t.bearing.axial_n_per_m;
        self.connect(&name("bearing"), [tube[at(rear)], screw[0]], &line.axes, [radial, radial, axial, o, o, held]);
        let radial = t.nut.radial_n_per_m;
        self.connect(&name("nut"), [screw[1], ram[0]], &line.axes, [radial, radial, t.nut.axial_n_per_m, o, o, o]);
        self.connect(&name("inner guide"), [tube[at(inner)], ram[0]], &line.axes, [g, g, o, o, o, o]);
        let key = t.key_nm_per_rad;
        self.connect(&name("guide at the mouth"), [tube[at(mouth)], ram[1]], &line.axes, [g, g, o, o, o, key]);
        Ok((tube[at(0.0)], ram[2]))
    }

    /// Nodes and elements.
    pub fn size(&self) -> (usize, usize) {
        let elements: usize = self.parts.iter().map(|p| p.mesh.hexahedra.len() + p.mesh.wedges.len()).sum();
        (self.next - 1, elements + self.springs.len())
    }

    /// Turns A-uvw into the axes of B.
    pub fn base_axes(&self) -> Rotation3<f64> {
        self.base_axes
    }

    /// The solids.
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// What `ccx` reads: six unit wrenches at A, and its displacement under each.
    pub fn text(&self, title: &str) -> String {
        let mut s = format!("** {title}\n** SI, in A-uvw with A as the origin\n*NODE, NSET=ALL\n");
        let mut line = |n: usize, p: [f64; 3]| {
            _ = writeln!(s, "{n},{:.9e},{:.9e},{:.9e}", p[0], p[1], p[2]);
        };
        for part in &self.parts {
            (part.first..).zip(&part.mesh.nodes).for_each(|(n, p)| line(n, *p));
        }
        self.others.iter().for_each(|(n, p)| line(*n, (*p).into()));
        let mut element = 0;
        let mut topology = |s: &mut String, nodes: &[usize], first: usize| {
            element += 1;
            let all: Vec<String> =
                std::iter::once(element).chain(nodes.iter().map(|n| first + n)).map(|n| n.to_string()).collect();
            let rows: Vec<String> = all.chunks(16).map(|row| row.join(",")).collect();
            _ = writeln!(s, "{}", rows.join(",\n"));
        };
        for part in &self.parts {
            let name = &part.name;
            if !part.mesh.hexahedra.is_empty() {
                _ = writeln!(s, "*ELEMENT, TYPE=C3D20R, ELSET={name}");
                part.mesh.hexahedra.iter().for_each(|e| topology(&mut s, e, part.first));
            }
            if !part.mesh.wedges.is_empty() {
                _ = writeln!(s, "*ELEMENT, TYPE=C3D15, ELSET={name}");
                part.mesh.wedges.iter().for_each(|e| topology(&mut s, e, part.first));
            }
        }
        for (i, (young, poisson)) in self.materials.iter().enumerate() {
            _ = writeln!(s, "*MATERIAL, NAME=M{i}\n*ELASTIC\n{young:.9e},{poisson:.9e}");
        }
        for part in &self.parts {
            _ = writeln!(s, "*SOLID SECTION, ELSET={}, MATERIAL=M{}", part.name, part.material);
        }
        for (i, o) in self.orientations.iter().enumerate() {
            let c: Vec<String> = o.columns(0, 2).iter().map(|v| format!("{v:.12e}")).collect();
            _ = writeln!(s, "*ORIENTATION, NAME=O{i}\n{}", c.join(","));
        }
        for (i, spring) in self.springs.iter().enumerate() {
            _ = writeln!(s, "** {}\n*ELEMENT, TYPE=SPRING2, ELSET=SPRING{i}", spring.what);
            topology(&mut s, &spring.between, 0);
            let (f, o, k) = (spring.freedom, spring.orientation, spring.stiffness);
            // a stiffness without a point would be read as degrees of freedom
            _ = writeln!(s, "*SPRING, ELSET=SPRING{i}, ORIENTATION=O{o}\n{f},{f}\n{k:.9e}");
        }
        for (i, (nodes, body)) in self.rigid.iter().enumerate() {
            _ = writeln!(s, "*NSET, NSET=RIGID{i}");
            for row in nodes.chunks(12) {
                let row: Vec<String> = row.iter().map(usize::to_string).collect();
                _ = writeln!(s, "{},", row.join(","));
            }
            _ = writeln!(s, "*RIGID BODY, NSET=RIGID{i}, REF NODE={}, ROT NODE={}", body.reference, body.rotation);
        }
        _ = writeln!(s, "*BOUNDARY");
        self.fixed.iter().for_each(|n| _ = writeln!(s, "{n},1,3"));
        let hub = [self.hub.reference, self.hub.rotation];
        _ = writeln!(s, "*NSET, NSET=HUB\n{},{}\n*STEP\n*GREEN\n*CLOAD", hub[0], hub[1]);
        for node in hub {
            (1..=3).for_each(|freedom| _ = writeln!(s, "{node},{freedom},1."));
        }
        s.push_str("*NODE PRINT, NSET=HUB\nU\n*END STEP\n");
        s
    }
}

/// Refuses limbs that go through each other or through a plate.
fn check_room(solid: &Solid, lines: &[Line; 3], z_b: &Vector3<f64>) -> Result<(), Collision> {
    let radius = |limb: &LimbSolid| match limb {
        LimbSolid::Uniform { rod, screw } => 0.5 * rod.outer_m.max(screw.outer_m),
        LimbSolid::Telescopic(t) => 0.5 * t.tube.outer_m,
    };
    for (i, line) in lines.iter().enumerate() {
        // the limb leaves its joint through the bore; it must be out of the plate before it reaches its edge
        let plates = [("base", solid.base, *z_b), ("platform", solid.platform, Vector3::z())];
        for (name, plate, normal) in plates {
            let Some(plate) = plate else { continue };
            let upright = line.axes.column(2).dot(&normal);
            let needed = 0.5 * plate.thickness_m / (0.5 * plate.bore_m + plate.rim_m).hypot(0.5 * plate.thickness_m);
            if upright < needed {
                return Err(format!(
                    "limb {} goes through the {name}: {:.1}° from its plane, at least {:.1}° are needed; see [solid] {name}: \
                     thinner, a narrower rim, or kind = \"rigid\"",
                    i + 1,
                    upright.asin().to_degrees(),
                    needed.asin().to_degrees()
                ));
            }
        }
        for (j, other) in lines.iter().enumerate().take(i) {
            let needed = radius(&solid.limbs[i]) + radius(&solid.limbs[j]);
            let apart = distance([(line, &solid.limbs[i]), (other, &solid.limbs[j])]);
            if apart < needed {
                return Err(format!(
                    "limbs {} and {} meet: {:.1} mm between their axes, at least {:.1} mm are needed",
                    j + 1,
                    i + 1,
                    apart * 1e3,
                    needed * 1e3
                ));
            }
        }
    }
    Ok(())
}

/// Between two limbs' axes, with what reaches behind the base joints.
fn distance([(a, limb_a), (b, limb_b)]: [(&Line, &LimbSolid); 2]) -> f64 {
    let (u, v, w) = (a.axes.column(2), b.axes.column(2), a.from - b.from);
    let c = u.dot(&v);
    let square = 1.0 - c * c;
    let rear = |limb: &LimbSolid| match limb {
        LimbSolid::Uniform { .. } => 0.0,
        LimbSolid::Telescopic(t) => -t.behind_m,
    };
    let clamp = |s: f64, line: &Line, limb: &LimbSolid| s.clamp(rear(limb), line.length_m);
    let mut s = if square > 1e-12 { clamp((c * v.dot(&w) - u.dot(&w)) / square, a, limb_a) } else { 0.0 };
    // the nearest point of one to the other's, in turn, until both lie within their limbs
    let mut t = 0.0;
    for _ in 0..3 {
        t = clamp(v.dot(&(a.at(s) - b.from)), b, limb_b);
        s = clamp(u.dot(&(b.at(t) - a.from)), a, limb_a);
    }
    (a.at(s) - b.at(t)).norm()
}
