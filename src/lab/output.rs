//! Writes the tables to files: staged in a hidden folder beside their destination, then renamed.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use raykiln_formats::staging::{Folder, Hold};

use super::LabError;
use super::error_vs_time;
use super::fit::Fit;
use super::quality::Quality;
use super::rows::{Row, to_csv, to_json_lines};
use super::{flags, motion};
use crate::choose::model::{Class, Prices};
use crate::report::json::to_json;
use crate::verify::MachineKind;

/// The names of all files that may be written.
const NAMES: [&str; 4] = ["layouts.csv", "layouts.jsonl", "fit.json", "fit.md"];

/// Rejects a folder that cannot be written to, before any work is done.
pub(super) fn check(out: &Path) -> Result<(), LabError> {
    let bad = |cause: &str| Err(LabError::file(out, cause));
    let parent = parent(out);
    match () {
        () if out.exists() && !out.is_dir() => bad("is not a folder"),
        () if !parent.is_dir() => bad(&format!("there is no folder {}", parent.display())),
        () if NAMES
            .iter()
            .chain(&error_vs_time::NAMES)
            .chain(&motion::NAMES)
            .chain(&motion::SUMMARIES)
            .chain(&flags::NAMES)
            .any(|name| out.join(name).is_dir()) =>
        {
            bad("holds a folder where a table belongs")
        }
        () => Folder::new_in(parent).map(|_| ()).map_err(|e| LabError::file(parent, e)),
    }
}

/// Writes the tables and, if there is one, the fit; removes files of an earlier run that are not replaced.
pub(super) fn write(out: &Path, rows: &[Row], fit: Option<(&Fit, Class)>) -> Result<(), LabError> {
    let csv = to_csv(rows).map_err(|e| LabError::file(&out.join(NAMES[0]), e))?;
    let fitted = fit.map(|(fit, class)| [to_json(fit), markdown(fit, class)].map(String::into_bytes));
    let [json, text] = fitted.map_or([None, None], |both| both.map(Some));
    let tables = [Some(csv), Some(to_json_lines(rows)), json, text];

    let parent = parent(out);
    let folder = Folder::new_in(parent).map_err(|e| LabError::file(parent, e))?;
    for (name, table) in NAMES.iter().zip(&tables) {
        if let Some(table) = table {
            fs::write(folder.path().join(name), table).map_err(|e| LabError::file(&out.join(name), e))?;
        }
    }
    let _hold = Hold::new();
    fs::create_dir_all(out).map_err(|e| LabError::file(out, e))?;
    for (name, table) in NAMES.iter().zip(&tables) {
        let place = out.join(name);
        let placed = match table {
            Some(_) => fs::rename(folder.path().join(name), &place),
            None if place.exists() => fs::remove_file(&place),
            None => Ok(()),
        };
        placed.map_err(|e| LabError::file(&place, e))?;
    }
    Ok(())
}

/// The folder that holds a folder.
pub(super) fn parent(out: &Path) -> &Path {
    out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A fit as Markdown, including its prices as they appear in `src/choose/model.rs`.
pub(super) fn markdown(fit: &Fit, class: Class) -> String {
    let Fit { class: name, device, device_kind, layouts, scenes, .. } = fit;
    let mut text = format!(
        "# Prices of `{name}`, fitted to {layouts} layouts of {scenes} scenes on {device} ({})\n\n",
        device_kind.name()
    );
    if *device_kind != MachineKind::Gpu {
        text += "These were not timed on a GPU and say nothing of one.\n\n";
    }
    text += "| kind | picoseconds per ray (T TLAS nodes, E entries, N BLAS nodes) | RMS relative error |\n| --- | --- | --- |\n";
    for k in &fit.kinds {
        let Prices { ray, top, entry, bottom } = k.prices;
        let error = 100.0 * k.rms_relative_error;
        let _ = writeln!(text, "| {} | {ray:.1} + {top:.1} T + {entry:.1} E + {bottom:.1} N | {error:.1} % |", k.kind);
    }
    text += "\nAgainst the single BLAS, each scene predicted by prices fitted to the others, and by the present table:\n\n\
             | kind | prices | correlation of log ratios | RMS error of the ratio | pick over best: mean | worst |\n\
             | --- | --- | --- | --- | --- | --- |\n";
    let kinds = fit.kinds.iter().map(|k| (k.kind, &k.predicted)).chain([("overall", &fit.overall)]);
    for (kind, predicted) in kinds {
        text += &quality_line(kind, "fitted", predicted.left_out.as_ref());
        text += &quality_line(kind, "table", predicted.by_table.as_ref());
    }
    text += &format!("\nFor the table in `src/choose/model.rs`:\n\n```rust\nClass::{class:?} => [\n");
    for k in &fit.kinds {
        let Prices { ray, top, entry, bottom } = k.prices;
        let error = 100.0 * k.rms_relative_error;
        let prices = format!("prices({ray:.1}, {top:.1}, {entry:.1}, {bottom:.1}),");
        let _ = writeln!(text, "    {prices} // {}: residual {error:.1} %", k.kind);
    }
    text + "],\n```\n"
}

fn quality_line(kind: &str, prices: &str, quality: Option<&Quality>) -> String {
    let Some(q) = quality else { return format!("| {kind} | {prices} | - | - | - | - |\n") };
    let correlation = q.correlation.map_or("-".to_owned(), |c| format!("{c:.2}"));
    let error = 100.0 * q.rms_ratio_error;
    format!(
        "| {kind} | {prices} | {correlation} | {error:.0} % | {:.3} | {:.3} |\n",
        q.picked_mean_ratio, q.picked_worst_ratio
    )
}

#[cfg(test)]
mod tests {
    use super::super::fit::{KindFit, Predicted, SCHEMA};
    use super::*;
    use crate::verify::rays::RayKind;

    fn fit() -> Fit {
        let predicted = Predicted { left_out: None, by_table: None };
        let prices = Prices { ray: 38.04, top: 2.5, entry: 24.1, bottom: 0.0 };
        let kind = |kind| KindFit {
            kind,
            prices,
            rms_relative_error: 0.123,
            table: prices,
            table_rms_relative_error: 0.1,
            predicted,
        };
        Fit {
            schema: SCHEMA,
            raykiln_version: "0",
            class: "rt-cores",
            device: "a GPU".into(),
            device_kind: MachineKind::Gpu,
            layouts: 8,
            scenes: 2,
            kinds: RayKind::ALL.map(|of| kind(of.name())).into(),
            overall: predicted,
        }
    }

    #[test]
    fn prices_are_written_as_the_source_has_them_with_their_residual() {
        let text = markdown(&fit(), Class::RtCores);
        assert!(
            text.contains("Class::RtCores => [\n    prices(38.0, 2.5, 24.1, 0.0), // primary: residual 12.3 %\n"),
            "{text}"
        );
        assert!(text.contains("| shadow | 38.0 + 2.5 T + 24.1 E + 0.0 N | 12.3 % |"), "{text}");
        assert!(text.contains("| overall | table | - | - | - | - |") && !text.contains("say nothing"), "{text}");
    }

    #[test]
    fn tables_of_an_earlier_run_do_not_stay_and_other_files_do() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let out = folder.path().join("out");
        write(&out, &[Row::default()], Some((&fit(), Class::RtCores))).expect("written");
        fs::write(out.join("mine.txt"), "notes").expect("writable");
        assert!(out.join("fit.json").is_file());
        write(&out, &[], None).expect("written");
        let mut names: Vec<_> =
            fs::read_dir(&out).expect("a folder").map(|e| e.expect("readable").file_name()).collect();
        names.sort();
        assert_eq!(names, ["layouts.csv", "layouts.jsonl", "mine.txt"]);
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 1, "the hidden folder is gone");
    }

    #[test]
    fn places_that_cannot_be_written_are_refused_beforehand() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::write(folder.path().join("file"), "").expect("writable");
        fs::create_dir_all(folder.path().join("out/fit.md")).expect("writable");
        assert!(check(&folder.path().join("new")).is_ok());
        for (name, words) in [("file", "is not a folder"), ("no/out", "there is no folder"), ("out", "holds a folder")]
        {
            let error = check(&folder.path().join(name)).expect_err(name).to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
