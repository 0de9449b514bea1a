//! The table of layouts.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::choose::model::{Counts, RayCost};
use crate::verify::{MachineKind, PerKind};

/// A layout of a scene. `docs/lab.md` describes the columns.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Row {
    /// The scene's path as the configuration has it.
    pub scene: String,
    /// The first plan that came to this layout.
    pub layout: String,
    /// Further plans that came to it.
    pub same_as: Vec<String>,
    /// What timed it.
    pub device: String,
    /// `gpu`, `software driver` or `cpu`.
    pub device_kind: MachineKind,
    /// Triangles placed.
    pub triangles: u64,
    /// Mesh groups (BLASes).
    pub groups: u64,
    /// Instances (TLAS entries).
    pub instances: u64,
    /// Predicted two-level cost.
    pub two_level_cost: f64,
    /// Predicted bytes of BLASes and TLAS.
    pub predicted_bytes: u64,
    /// Bytes that the device used for them, compacted.
    pub built_bytes: Option<u64>,
    /// Largest distance between a corner and its stored position, over the scene's diagonal.
    pub position_error_ratio: f64,
    /// Why it was not timed.
    pub failure: Option<String>,
    /// By kind of rays.
    pub kinds: PerKind<KindRow>,
}

/// Rays of a kind through a layout; counts and times are means a ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct KindRow {
    /// Nodes of the TLAS met, of 32 neighbouring rays the most.
    pub tlas_nodes: f64,
    /// Instances entered, in the same way.
    pub entries: f64,
    /// Nodes of BLASes met, in the same way.
    pub blas_nodes: f64,
    /// What the prices of the class make of these.
    pub predicted_picoseconds: f64,
    /// Measured.
    pub picoseconds: Option<f64>,
    /// Its speed over that of the input, measured in turns.
    pub speedup_ratio: Option<f64>,
    /// How far off that may be; none where it was timed less than three times.
    pub spread_ratio: Option<f64>,
}

impl KindRow {
    pub(super) fn of(predicted: RayCost) -> KindRow {
        let RayCost { counts, picoseconds } = predicted;
        KindRow {
            tlas_nodes: counts.top,
            entries: counts.entries,
            blas_nodes: counts.bottom,
            predicted_picoseconds: picoseconds,
            ..KindRow::default()
        }
    }

    pub(super) fn counts(&self) -> Counts {
        Counts { top: self.tlas_nodes, entries: self.entries, bottom: self.blas_nodes }
    }
}

impl Row {
    /// Whether a plan of that name came to it.
    pub(super) fn is(&self, plan: &str) -> bool {
        self.layout == plan || self.same_as.iter().any(|name| name == plan)
    }

    /// Its fields as columns: names and values, those of a kind of rays with its name before.
    fn columns(&self) -> Vec<(String, String)> {
        let text = |name: &str, value: String| (name.to_owned(), value);
        let mut columns = vec![
            text("scene", self.scene.clone()),
            text("layout", self.layout.clone()),
            text("same_as", self.same_as.join("; ")),
            text("device", self.device.clone()),
            text("device_kind", self.device_kind.name().to_owned()),
            text("triangles", self.triangles.to_string()),
            text("groups", self.groups.to_string()),
            text("instances", self.instances.to_string()),
            text("two_level_cost", self.two_level_cost.to_string()),
            text("predicted_bytes", self.predicted_bytes.to_string()),
            text("built_bytes", self.built_bytes.map_or(String::new(), |b| b.to_string())),
            text("position_error_ratio", self.position_error_ratio.to_string()),
            text("failure", self.failure.clone().unwrap_or_default()),
        ];
        for (kind, row) in self.kinds.iter() {
            let some = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
            for (name, value) in [
                ("tlas_nodes", row.tlas_nodes.to_string()),
                ("entries", row.entries.to_string()),
                ("blas_nodes", row.blas_nodes.to_string()),
                ("predicted_picoseconds", row.predicted_picoseconds.to_string()),
                ("picoseconds", some(row.picoseconds)),
                ("speedup_ratio", some(row.speedup_ratio)),
                ("spread_ratio", some(row.spread_ratio)),
            ] {
                columns.push((format!("{}_{name}", kind.name()), value));
            }
        }
        columns
    }
}

/// The rows as CSV with a header.
///
/// # Errors
/// None but those of the crate `csv`, which writes to memory.
pub(super) fn to_csv(rows: &[Row]) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(Row::default().columns().iter().map(|(name, _)| name))?;
    for row in rows {
        writer.write_record(row.columns().iter().map(|(_, value)| value))?;
    }
    writer.into_inner().map_err(|e| e.into_error().into())
}

/// The rows as JSON, one a line.
pub(super) fn to_json_lines(rows: &[Row]) -> Vec<u8> {
    let line = |row| serde_json::to_string(row).expect("rows hold no maps with other keys than strings") + "\n";
    rows.iter().map(line).collect::<String>().into_bytes()
}

/// The rows of each scene, in the order of the scenes' first rows.
pub(super) fn by_scene(rows: &[Row]) -> Vec<Vec<&Row>> {
    let mut places: BTreeMap<&str, usize> = BTreeMap::new();
    let mut scenes: Vec<Vec<&Row>> = Vec::new();
    for row in rows {
        let place = *places.entry(&row.scene).or_insert_with(|| {
            scenes.push(Vec::new());
            scenes.len() - 1
        });
        scenes[place].push(row);
    }
    scenes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commas_and_quotes_in_names_survive_csv() {
        let row = Row { scene: "a \"b\", c.glb".into(), layout: "cluster, entry 5".into(), ..Row::default() };
        let table = to_csv(std::slice::from_ref(&row)).expect("written");
        let mut reader = csv::Reader::from_reader(table.as_slice());
        let header = reader.headers().expect("a header").clone();
        assert_eq!(header.len(), 13 + 4 * 7);
        let record = reader.records().next().expect("a row").expect("sound");
        assert_eq!((&record[0], &record[1]), (row.scene.as_str(), row.layout.as_str()));
    }

    #[test]
    fn rows_of_a_scene_come_together() {
        let row = |scene: &str| Row { scene: scene.into(), ..Row::default() };
        let rows = ["b", "a", "b"].map(row);
        let scenes: Vec<usize> = by_scene(&rows).iter().map(Vec::len).collect();
        assert_eq!(scenes, [2, 1]);
        assert!(by_scene(&[]).is_empty());
    }
}
