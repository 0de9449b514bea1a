//! Facts about a layout; [`crate::report`] phrases them.

/// Something that a method did or skipped, and why.
#[derive(Clone, Debug, PartialEq)]
pub enum Note {
    /// No round of splitting and merging objects lowers the overlap ratio below that of the input.
    OverlapNotLowered {
        /// The input's overlap ratio.
        of_input: f64,
    },
    /// No object is split, because the node budget allows no more than one node per object.
    NothingSplit {
        /// Number of tree nodes allowed.
        allowed: u64,
        /// Number of objects.
        objects: usize,
    },
    /// All instances of some meshes stay, because writing them out would exceed a limit.
    BeyondLimit {
        /// Number of instances.
        instances: u64,
        /// Number of meshes that they place.
        meshes: usize,
        /// The limit.
        limit: Limit,
    },
    /// Instances of a mesh are written out or opened.
    Changed(Changed),
    /// Instances of this many further meshes are written out or opened.
    ChangedLikewise(usize),
    /// Instances stay unchanged.
    Stay {
        /// The meshes of the instances.
        of: Meshes,
        /// Number of instances.
        instances: usize,
        /// The reason.
        why: Stay,
    },
}

/// The limit that writing out instances would exceed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// Predicted bytes of acceleration structures.
    Bytes,
    /// Triangles that the file may hold.
    Triangles,
}

/// Changes to the instances of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Changed {
    /// The mesh's name.
    pub mesh: String,
    /// Number of instances written out.
    pub baked: usize,
    /// Number of instances opened.
    pub opened: usize,
    /// Number of pieces that they are opened into; 1 if they are only stored in another frame.
    pub pieces: usize,
    /// Number of instances that stay unchanged.
    pub kept: usize,
    /// Mean number of their boxes that a ray enters, over the rays that meet any.
    pub boxes_per_ray: f64,
    /// Their predicted cost relative to that of all of them unchanged.
    pub cost_ratio: f64,
}

/// Some meshes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Meshes {
    /// All meshes that several instances place.
    All,
    /// One mesh, by its name.
    One(String),
    /// This number of meshes.
    Several(usize),
}

/// Why instances stay unchanged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stay {
    /// No two instance boxes overlap.
    Apart,
    /// Too few rays meet them.
    Rare,
    /// More bytes than allowed would be needed.
    Bytes {
        /// Bytes allowed beyond the input's.
        allowed: f64,
    },
    /// Changing them is predicted to gain too little.
    NoGain,
}
