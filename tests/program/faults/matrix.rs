//! Every kind of fault is found in the outputs of every method, whatever they record of their triangles.

use std::path::Path;

use fastrand::Rng;
use raykiln::scene::{LoadOptions, Scene, load};
use raykiln::verify::contents::{self, ContentsReport, DifferenceKind, Inputs, Severity, Tolerance};
use raykiln::verify::identity::Identity;
use raykiln::verify::structure::Structure;
use raykiln::verify::{FaultKind, Sides, surface};
use raykiln_formats::Document;
use raykiln_formats::edit::RecordPlace;
use raykiln_formats::record::{Origins, Provenance};
use tempfile::TempDir;

use super::everything::everything;
use super::planting::Fault;
use super::{geometry, library};
use crate::common::{assert_section, bake, methods, samples};

/// Trials of each kind of fault.
const TRIALS: u64 = 20;

/// A file, what it shows, and the outputs of all methods.
struct Subject {
    document: Document,
    scene: Scene,
    outputs: Vec<(&'static str, Document)>,
}

impl Subject {
    fn of(path: &Path, methods: &[&'static str]) -> Subject {
        let document = raykiln_formats::read(path).unwrap_or_else(|e| panic!("{e}"));
        let folder = TempDir::new().expect("a folder");
        let output = |method: &&'static str| {
            let output = folder.path().join(format!("{method}.glb"));
            bake(path, &output, &["--method", method]);
            (*method, raykiln_formats::read(&output).unwrap_or_else(|e| panic!("{e}")))
        };
        Subject { scene: shown(&document), document, outputs: methods.iter().map(output).collect() }
    }

    fn compare(&self, after: &Document) -> Found {
        let scene = shown(after);
        let (triangles, pairs) = surface::compare(&Identity::new(&self.scene, &scene), 1e-6);
        let documents = Sides { before: &self.document, after };
        let inputs =
            Inputs { documents, scenes: Sides { before: &self.scene, after: &scene }, pairs: &pairs, staged: None };
        let contents = contents::compare(inputs, &Tolerance::default()).unwrap_or_else(|e| panic!("{e}"));
        Found { triangles, contents }
    }
}

/// What a comparison found.
#[derive(Debug)]
struct Found {
    triangles: Structure,
    contents: ContentsReport,
}

impl Found {
    /// The differences that fail a file.
    fn errors(&self) -> (Vec<FaultKind>, Vec<DifferenceKind>) {
        let faults = self.triangles.faults().into_iter().filter(|(_, fault)| fault.count > 0).map(|(kind, _)| kind);
        let errors = self.contents.differences.iter().filter(|difference| difference.severity == Severity::Error);
        (faults.collect(), errors.map(|difference| difference.kind).collect())
    }

    fn is(&self, fault: &Fault) -> bool {
        let (triangles, contents) = self.errors();
        triangles.iter().any(|kind| fault.triangles.contains(kind))
            || contents.iter().any(|kind| fault.found_as.contains(kind))
    }
}

/// All kinds of faults.
fn faults() -> impl Iterator<Item = &'static Fault> {
    geometry::FAULTS.iter().chain(library::FAULTS)
}

fn shown(document: &Document) -> Scene {
    load(document, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}")).0
}

/// What an output records of its triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Record {
    Kept,
    Dropped,
    Stale,
}

impl Record {
    const ALL: [Record; 3] = [Record::Kept, Record::Dropped, Record::Stale];

    /// Changes what a document records of its triangles and nodes; what it keeps of the input's meshes stays.
    fn apply(self, document: &mut Document) {
        if self == Record::Kept {
            return;
        }
        let contents = document.contents(Default::default()).unwrap_or_else(|e| panic!("{e}"));
        let Provenance::Recorded(record) = contents.provenance else { return };
        let mut record = (*record).clone();
        for origins in record.lists.iter_mut().flatten() {
            if let Origins::Each { sources, .. } = origins {
                sources.rotate_left(1);
            }
        }
        let place = if self == Record::Stale { RecordPlace::File } else { RecordPlace::None };
        assert!(document.set_record(&record, place));
        if self == Record::Dropped {
            document.forget_node_records(false);
        }
    }
}

/// The documents that faults are planted in: one with everything, and a sample with extensions that no one knows.
fn subjects() -> [Subject; 2] {
    let folder = TempDir::new().expect("a folder");
    let path = folder.path().join("everything.glb");
    everything().stage(&path).and_then(|staged| staged.commit()).unwrap_or_else(|e| panic!("{e}"));
    let hierarchy = samples().into_iter().find(|sample| sample.name == "hierarchy").expect("the sample is there").scene;
    [Subject::of(&path, &methods()), Subject::of(&hierarchy, &["keep", "single"])]
}

#[test]
fn every_kind_of_fault_is_found_in_every_trial() {
    let subjects = subjects();
    let outputs: Vec<(&Subject, &str, &Document)> =
        subjects.iter().flat_map(|s| s.outputs.iter().map(move |(method, doc)| (s, *method, doc))).collect();
    for (subject, method, output) in &outputs {
        for record in Record::ALL {
            let mut output = (*output).clone();
            record.apply(&mut output);
            let found = subject.compare(&output);
            assert_eq!(found.errors(), (vec![], vec![]), "{method}, record {record:?}, without a fault: {found:#?}");
        }
    }
    let mut missed = Vec::new();
    for fault in faults() {
        let mut trials = 0;
        for seed in 0..8 * TRIALS {
            let (subject, method, output) = outputs[seed as usize % outputs.len()];
            let (mut damaged, mut rng) = (output.clone(), Rng::with_seed(seed));
            let record = Record::ALL[rng.usize(..3)];
            record.apply(&mut damaged);
            let Some(planted) = (fault.plant)(&mut damaged, &mut rng) else { continue };
            let found = subject.compare(&damaged);
            if !found.is(fault) {
                let found = found.errors();
                missed.push(format!("{}, {method}, record {record:?}, seed {seed}, {planted}: {found:?}", fault.name));
            }
            trials += 1;
            if trials == TRIALS {
                break;
            }
        }
        assert_eq!(trials, TRIALS, "{}: planted too seldom", fault.name);
    }
    assert!(missed.is_empty(), "{missed:#?}");
}

#[test]
fn outputs_without_fault_pass() {
    for (sample, method) in samples().iter().zip(["single", "cluster"].into_iter().cycle()) {
        let subject = Subject::of(&sample.scene, &[method]);
        for (method, output) in &subject.outputs {
            let found = subject.compare(output);
            assert_eq!(found.errors(), (vec![], vec![]), "{} by {method}: {found:#?}", sample.name);
        }
    }
}

#[test]
fn the_documentation_lists_all_faults_and_kinds_of_differences() {
    let mut table = String::from("| fault | found as |\n| --- | --- |\n");
    for fault in faults() {
        let triangles = fault.triangles.iter().map(|kind| format!("triangles {kind}"));
        let contents = fault.found_as.iter().map(|kind| format!("`{}`", kind.name()));
        let kinds: Vec<String> = triangles.chain(contents).collect();
        table += &format!("| {} | {} |\n", fault.name, kinds.join(", "));
    }
    assert_section("docs/verification.md", "faults in contents", &table);
    let mut kinds = String::from("| difference | severity | what differs |\n| --- | --- | --- |\n");
    for kind in DifferenceKind::ALL {
        let severity = if kind.severity() == Severity::Error { "error" } else { "note" };
        let meaning = kind.meaning().trim_end_matches('.');
        kinds += &format!("| `{}` | {severity} | {meaning} |\n", kind.name());
    }
    assert_section("docs/verification.md", "kinds of differences", &kinds);
}
