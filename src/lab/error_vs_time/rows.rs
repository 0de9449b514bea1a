//! The table of an experiment, written row by row.

use serde::Serialize;
use std::collections::BTreeMap;

use super::settings::Value;
use crate::verify::MachineKind;

/// The names of the tables.
pub(in crate::lab) const NAMES: [&str; 2] = ["error-vs-time.csv", "error-vs-time.jsonl"];

/// A layout of a scene, traced by one tracer. `docs/lab.md` describes the columns.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ErrorRow {
    /// The scene's path as the configuration has it, or the name of a generated scene.
    pub scene: String,
    /// `as-is`, `far` or `stretched`.
    pub placement: &'static str,
    /// The method asked for.
    pub method: &'static str,
    /// The layout it came to.
    pub layout: String,
    /// The swept settings that apply to the method.
    pub settings: BTreeMap<&'static str, Option<Value>>,
    /// `f32-fast`, `f32-watertight`, `f32-recentred`, `f64` or `device`.
    pub tracer: &'static str,
    /// What traced.
    pub device: String,
    /// `gpu`, `software driver` or `cpu`.
    pub device_kind: MachineKind,
    /// Triangles placed.
    pub triangles: u64,
    /// Mesh groups (BLASes).
    pub groups: u64,
    /// Instances (TLAS entries).
    pub instances: u64,
    /// Largest distance between a corner and its place in the input, over the scene's diagonal.
    pub position_error_ratio: f64,
    /// Largest such distance over the diagonal of the corner's own object.
    pub object_position_error_ratio: f64,
    /// Largest error of a distance, relative to the true one.
    pub largest_distance_error: f64,
    /// What one error of a distance in a thousand exceeds.
    pub p999_distance_error: f64,
    /// Root mean square of the errors of distances.
    pub rms_distance_error: f64,
    /// Rays per million that hit something else, far from the true hit.
    pub far_hits_per_million: f64,
    /// Rays per million of those aimed at closed edges and vertices that pass through.
    pub lost_per_million: Option<f64>,
    /// Two-level cost.
    pub two_level_cost: f64,
    /// Two-level cost over the least of all layouts of the scene in this experiment; at least 1.
    pub cost_over_best_ratio: f64,
    /// Seconds to choose and make the layout.
    pub layout_seconds: f64,
    /// Measured, weighted over ray kinds.
    pub nanoseconds_per_ray: f64,
}

impl ErrorRow {
    /// Returns a row that holds nothing but the names of settings.
    pub(super) fn of_settings(settings: &[&'static str]) -> ErrorRow {
        ErrorRow { settings: settings.iter().map(|name| (*name, None)).collect(), ..ErrorRow::default() }
    }

    /// Its fields as columns: names and values.
    pub(super) fn columns(&self) -> Vec<(&'static str, String)> {
        let mut columns = vec![
            ("scene", self.scene.clone()),
            ("placement", self.placement.to_owned()),
            ("method", self.method.to_owned()),
            ("layout", self.layout.clone()),
        ];
        let value = |value: &Option<Value>| value.as_ref().map_or(String::new(), ToString::to_string);
        columns.extend(self.settings.iter().map(|(name, of)| (*name, value(of))));
        columns.extend([
            ("tracer", self.tracer.to_owned()),
            ("device", self.device.clone()),
            ("device_kind", self.device_kind.name().to_owned()),
            ("triangles", self.triangles.to_string()),
            ("groups", self.groups.to_string()),
            ("instances", self.instances.to_string()),
            ("position_error_ratio", Value::Number(self.position_error_ratio).to_string()),
            ("object_position_error_ratio", Value::Number(self.object_position_error_ratio).to_string()),
            ("largest_distance_error", Value::Number(self.largest_distance_error).to_string()),
            ("p999_distance_error", Value::Number(self.p999_distance_error).to_string()),
            ("rms_distance_error", Value::Number(self.rms_distance_error).to_string()),
            ("far_hits_per_million", self.far_hits_per_million.to_string()),
            ("lost_per_million", self.lost_per_million.map_or(String::new(), |lost| lost.to_string())),
            ("two_level_cost", self.two_level_cost.to_string()),
            ("cost_over_best_ratio", self.cost_over_best_ratio.to_string()),
            ("layout_seconds", self.layout_seconds.to_string()),
            ("nanoseconds_per_ray", self.nanoseconds_per_ray.to_string()),
        ]);
        columns
    }

    /// The swept settings in words, for labels: values, with names only where a value does not tell.
    pub(super) fn settings_in_words(&self) -> String {
        let short = |name: &str| name.trim_end_matches("_ratio").replace('_', " ");
        let words =
            self.settings.iter().filter_map(|(name, value)| Some(format!("{} {}", short(name), value.as_ref()?)));
        words.collect::<Vec<_>>().join(", ")
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::lab::tables::Tables;

    #[test]
    fn every_row_is_in_both_files_once_it_is_appended() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut tables =
            Tables::create(folder.path(), NAMES, &ErrorRow::of_settings(&["effort"]).columns()).expect("created");
        let read = || NAMES.map(|name| fs::read_to_string(folder.path().join(name)).expect("readable"));
        let header = read()[0].clone();
        assert!(header.starts_with("scene,placement,method,layout,effort,tracer,") && header.ends_with('\n'));
        for count in 1..=3 {
            let settings = [("effort", Some(Value::Whole(count)))].into();
            let row = ErrorRow { scene: "a \"b\", c.glb".into(), settings, ..ErrorRow::default() };
            tables.append(&row.columns(), &row).expect("appended");
            let [csv, lines] = read();
            let mut reader = csv::Reader::from_reader(csv.as_bytes());
            let records: Vec<csv::StringRecord> = reader.records().collect::<Result<_, _>>().expect("sound");
            assert_eq!((records.len() as u64, &records[0][0], &records[0][4]), (count, row.scene.as_str(), "1"));
            let last: serde_json::Value = serde_json::from_str(lines.lines().last().expect("a line")).expect("JSON");
            assert_eq!((lines.lines().count() as u64, last["settings"]["effort"].as_u64()), (count, Some(count)));
        }
    }
}
