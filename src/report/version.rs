//! What this program is, for programs.

use serde::Serialize;

/// What `raykiln --version --json` prints.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct VersionReport {
    /// [`VersionReport::SCHEMA`].
    pub schema: &'static str,
    /// Version of the program.
    pub raykiln_version: &'static str,
    /// What the environment variable `RAYKILN_BUILD` of the compiler named; `None`: nothing.
    pub build: Option<&'static str>,
    /// The processor architecture.
    pub architecture: &'static str,
    /// The operating system.
    pub system: &'static str,
    /// The features that the program was built with.
    pub features: Vec<&'static str>,
}

impl VersionReport {
    /// Identifies the JSON form: see `docs/schemas`.
    pub const SCHEMA: &str = "raykiln.version/1";

    /// Returns what this program is.
    pub fn of_this_program() -> VersionReport {
        let features =
            [("cli", cfg!(feature = "cli")), ("lab", cfg!(feature = "lab")), ("vulkan", cfg!(feature = "vulkan"))];
        VersionReport {
            schema: Self::SCHEMA,
            raykiln_version: env!("CARGO_PKG_VERSION"),
            build: option_env!("RAYKILN_BUILD"),
            architecture: std::env::consts::ARCH,
            system: std::env::consts::OS,
            features: features.into_iter().filter(|(_, is_on)| *is_on).map(|(name, _)| name).collect(),
        }
    }
}
