//! What there is to know about a layout; [`crate::report`] puts it into words.

/// Something that a method did or left out, and why.
#[derive(Clone, Debug, PartialEq)]
pub enum Note {
    /// No round of splitting and merging objects lowers the overlap ratio below that of the input.
    OverlapNotLowered {
        /// The input's overlap ratio.
        of_input: f64,
    },
    /// No object is split, because trees may not have more nodes than there are objects.
    NothingSplit {
        /// Tree nodes allowed.
        allowed: u64,
        /// Objects.
        objects: usize,
    },
    /// All instances of some meshes stay, because writing them out would exceed a limit.
    BeyondLimit {
        /// How many instances.
        instances: u64,
        /// How many meshes they place.
        meshes: usize,
        /// Which limit.
        limit: Limit,
    },
    /// Instances of a mesh are written out or opened.
    Changed(Changed),
    /// Instances of this many further meshes are written out or opened.
    ChangedLikewise(usize),
    /// Instances stay.
    Stay {
        /// Of which meshes.
        of: Meshes,
        /// How many.
        instances: usize,
        /// Why.
        why: Stay,
    },
}

/// What writing instances out would exceed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// Predicted bytes of acceleration structures.
    Bytes,
    /// Triangles that the file may hold.
    Triangles,
}

/// What became of the instances of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Changed {
    /// The mesh's name.
    pub mesh: String,
    /// How many are written out.
    pub baked: usize,
    /// How many are opened.
    pub opened: usize,
    /// Into how many pieces; into one if they are only stored in another frame.
    pub pieces: usize,
    /// How many stay.
    pub kept: usize,
    /// Boxes of them that a ray enters, in the mean over the rays that meet them.
    pub boxes_per_ray: f64,
    /// Their predicted cost over that of all of them as they are.
    pub cost_ratio: f64,
}

/// Some meshes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Meshes {
    /// All that several instances place.
    All,
    /// One, by its name.
    One(String),
    /// So many.
    Several(usize),
}

/// Why instances stay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stay {
    /// No two instance boxes overlap.
    Apart,
    /// Too few rays meet them.
    Rare,
    /// More bytes than allowed would be needed.
    Bytes {
        /// Bytes allowed over the input's.
        allowed: f64,
    },
    /// Changing them is predicted to gain too little.
    NoGain,
}
