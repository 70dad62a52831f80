//! What a cutting force is estimated from: the material, the tool, and the chip.

/// A workpiece's material, after Kienzle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Specific cutting force at a chip of 1 mm by 1 mm, N/mm².
    pub kc1_1_n_per_mm2: f64,
    /// Exponent of the chip's thickness.
    pub mc: f64,
    /// How far the estimated force may be off, as a share of it.
    pub u_rel: f64,
    /// Radial over tangential force on an edge.
    pub radial_ratio: f64,
    /// Axial over tangential force on an edge; positive pushes the tool back into its holder.
    pub axial_ratio: f64,
}

/// On which side of a mill the material lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The chip ends at nothing: on the right of the feed with a spindle that turns clockwise.
    Climb,
    /// The chip begins at nothing.
    Conventional,
    /// Even on both sides, as in face milling.
    Centre,
}

/// How a mill is engaged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Engagement {
    /// a_p, along the tool's axis, mm.
    pub depth_mm: f64,
    /// a_e, across axis and feed, mm; at most the diameter.
    pub width_mm: f64,
    /// Where the material lies.
    pub side: Side,
}

/// The edges of a tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cutter {
    /// mm.
    pub diameter_mm: f64,
    /// Edges.
    pub teeth: u32,
    /// Between the edges and the feed, as in turning: 90° on a shoulder mill, half the point angle of a drill.
    pub lead_deg: f64,
    /// Of a mill; `None` of a drill.
    pub engagement: Option<Engagement>,
}

/// A cut, as far as the program says it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// Of the workpiece.
    pub material: Material,
    /// In hand.
    pub cutter: Cutter,
    /// mm.
    pub feed_per_tooth_mm: f64,
}
