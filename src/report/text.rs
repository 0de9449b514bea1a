//! Reports as text.

use std::fmt::Write as _;

use super::files;
use super::motion;
use super::precision;
use super::speed;
use super::words::{bytes, counted, grouped};
use super::{BakeReport, DecidedBy, Device, DevicesReport, Finding, Input, InspectReport, MethodReport};
use super::{ReadingError, Speed, VerifyReport, candidates, verdict};
use crate::choose::PassId;
use crate::cost::Metrics;
use crate::layout::BlasPer;
use crate::motion::advice::Advice;
use crate::verify::seams::Seams;
use crate::verify::verdict::Verdict;
use crate::verify::{Sides, Verification};

/// Number of warnings or notes shown without `-v`.
const FEW: usize = 3;

/// Returns a bake's report as text.
pub fn bake(report: &BakeReport, verbose: bool) -> String {
    let mut text = format!("{} -> {}\n", report.input.path.display(), report.output.display());
    text += &input_line(&report.input);
    text += &list("warning", &report.warnings, verbose);
    text += &method(report);
    text += &list("note", &report.notes, verbose);
    if verbose || report.method.candidates.len() > 1 {
        text += &candidates::table(&report.method, verbose);
    }
    if verbose {
        text += &passes(report);
        text += &rounds(report);
    }
    let metrics = Sides { before: &report.before, after: &report.after };
    text += &before_and_after(report.blas_per, metrics, &report.verify, &report.overall);
    text += &findings_of_input(&report.findings, verbose);
    text += &moving(&report.motion);
    text += &files::words(report);
    text += &seconds(report);
    let verdict = match report.verdict {
        Verdict::Faster => "faster",
        Verdict::NotFaster => "not faster",
        Verdict::LeftAlone => "left alone",
        Verdict::CannotTell => "cannot tell",
        Verdict::Failed => "failed",
    };
    text + "\n" + &paragraph(&format!("verdict: {verdict}: {}", report.verdict_reason))
}

/// The findings about the first of two files: their rules, or in full.
fn findings_of_input(findings: &[Finding], verbose: bool) -> String {
    if findings.is_empty() {
        return String::new();
    }
    if verbose {
        return format!("\nfindings about the input\n{}\n", findings.iter().map(finding).collect::<String>());
    }
    let mut rules: Vec<String> = findings.iter().map(|f| format!("{} ({})", f.rule.id(), f.title)).collect();
    rules.dedup();
    let mut gone: Vec<&str> = findings.iter().filter(|f| f.gone_after == Some(true)).map(|f| f.rule.id()).collect();
    gone.dedup();
    let gone = if gone.is_empty() { String::new() } else { format!("; gone in the output: {}", gone.join(", ")) };
    paragraph(&format!("findings about the input, in full with -v: {}{gone}", rules.join(", ")))
}

/// Whether what moves can be refitted.
fn moving(motion: &[Advice]) -> String {
    let sentences: String = motion.iter().flat_map(motion::sentences).map(|s| paragraph(&s)).collect();
    if sentences.is_empty() { sentences } else { format!("\nwhat moves\n{sentences}") }
}

/// What was chosen, by user or `auto`, and whether copies are shared.
fn method(report: &BakeReport) -> String {
    let MethodReport { chosen, chosen_candidate: id, reason, decided_by, .. } = &report.method;
    let copies = report.passes.iter().find(|pass| pass.id == PassId::FindCopies && pass.applied);
    let and_copies = if copies.is_some() { ", with copies shared" } else { "" };
    let how = match decided_by {
        DecidedBy::Request => format!("method {chosen}{and_copies}"),
        DecidedBy::Plan => format!("the plan chose `{id}`{and_copies}"),
        _ if id.is_input() && copies.is_some() => "auto chose the layout of the input, with copies shared".to_owned(),
        _ if id.is_input() => "auto chose the input as it is".to_owned(),
        _ => format!("auto chose `{id}`{and_copies}"),
    };
    let copies = copies.map(|pass| format!("copies: {}\n", pass.reason)).unwrap_or_default();
    format!("\n{}{copies}", paragraph(&format!("{how} ({reason})")))
}

/// The metrics of both layouts, and the results of tracing them.
fn before_and_after(per: BlasPer, metrics: Sides<&Metrics>, verification: &Verification, overall: &Speed) -> String {
    let heading = match per {
        BlasPer::Mesh => "",
        BlasPer::Primitive => "built as one BLAS per primitive",
    };
    let mut text = format!("\n{}\n", table(&[heading, "before", "after"], &comparison(metrics)));
    text += &structures(verification);
    text += &speed::rays(verification, overall);
    text += &errors(verification);
    text += &precision::errors(&verification.errors);
    text + &seams(&verification.seams)
}

/// How many rays pass through edges and vertices.
fn seams(seams: &Seams) -> String {
    if seams.rays == 0 {
        return "cracks: not looked for: no edge has a triangle on either side, no vertex triangles all around\n"
            .to_owned();
    }
    let [before, after] =
        [seams.before_lost_per_million, seams.after_lost_per_million].map(|n| grouped(n.round() as u64));
    format!(
        "cracks: of {} rays aimed at shared edges and vertices, {before} per million pass through the input, {after} through \
         the output\n",
        grouped(seams.rays)
    )
}

/// Returns a comparison of two files as text.
pub fn verify(report: &VerifyReport, verbose: bool) -> String {
    let mut text = format!("{} against {}\n", report.output.display(), report.input.path.display());
    text += &input_line(&report.input);
    text += &list("warning", &report.warnings, verbose);
    text += &list("note", &report.notes, verbose);
    if report.verify.structure.is_none() {
        text += "only surfaces are compared: triangles are not matched\n";
    }
    let metrics = Sides { before: &report.before, after: &report.after };
    text += &before_and_after(report.blas_per, metrics, &report.verify, &report.overall);
    text += &findings_of_input(&report.findings, verbose);
    let shown = match report.verdict {
        Verdict::Failed => "failed: the files do not show the same".to_owned(),
        Verdict::CannotTell => report.verify.to_string(),
        _ => format!("the same surfaces; {}", verdict::measured(report.verdict, &report.overall, &report.verify)),
    };
    let _ = writeln!(text, "{:.2} seconds\n\nverdict: {shown}", report.seconds);
    text
}

/// Returns an inspection's report as text.
pub fn inspect(report: &InspectReport) -> String {
    let mut text = format!("{}\n", report.input.path.display());
    text += &input_line(&report.input);
    text += &list("warning", &report.warnings, true);
    text.push('\n');
    let with_core = has_core(&report.before);
    let rows: Vec<Vec<String>> =
        metric_rows(&report.before, with_core).into_iter().map(|(name, value)| vec![name.into(), value]).collect();
    text += &table(&["", "as it is"], &rows);
    if !report.worst_pairs.is_empty() {
        let of = if with_core { "area of the scene's core" } else { "scene's area" };
        let _ = writeln!(text, "\nworst overlapping pairs (intersection over the {of})");
        let rows: Vec<Vec<String>> = report
            .worst_pairs
            .iter()
            .map(|p| vec![format!("{:.4}", p.overlap_ratio), p.a.clone(), p.b.clone()])
            .collect();
        text += &table(&["overlap", "object", "object"], &rows);
    }
    let _ = writeln!(text, "\n{}", precision::of_device(&report.device_error));
    text += &moving(&report.motion);
    if report.findings.is_empty() {
        let checked = report.rules_checked.len();
        let _ = writeln!(text, "\nnone of the {} checked is broken (docs/inspect.md)", counted(checked, "vendor rule"));
    } else {
        text += "\nfindings\n";
        text += &report.findings.iter().map(finding).collect::<String>();
    }
    text
}

/// Returns a list of devices as text.
pub fn devices(report: &DevicesReport) -> String {
    let mut text: String = report.devices.iter().map(device).collect();
    text.extend(report.note.iter().map(|why| format!("{why}\n")));
    text
}

fn device(d: &Device) -> String {
    let kind = if d.is_software { ", software" } else { "" };
    let mut text = format!("{}: {} ({}, Vulkan {}{kind})\n", d.index, d.name, d.driver, d.vulkan_version);
    let able =
        if d.can_trace { "traces rays".to_owned() } else { format!("no ray tracing: lacks {}", d.missing.join(", ")) };
    let _ = writeln!(text, "   {able}; memory {}", bytes(d.memory_bytes));
    if let Some(limits) = d.limits {
        let _ = writeln!(
            text,
            "   at most {} instances, {} geometries and {} triangles a BLAS, {} an allocation, {} rays a launch",
            grouped(limits.instances),
            grouped(limits.geometries),
            grouped(limits.primitives),
            bytes(limits.max_allocation_bytes),
            grouped(limits.rays_per_launch),
        );
    }
    if !d.extensions.is_empty() {
        let _ = writeln!(text, "   {}", d.extensions.join(" "));
    }
    text
}

fn input_line(input: &Input) -> String {
    let pinned = match input.pinned_instances {
        0 => String::new(),
        n => format!(" ({n} pinned)"),
    };
    let counts = [
        (input.triangles, "triangle"),
        (input.vertices, "vertex"),
        (input.objects, "object"),
        (input.materials, "material"),
        (input.nodes, "node"),
        (input.instances, "instance"),
    ];
    let counts = counts.map(|(count, what)| counted(count as usize, what));
    format!("{}{pinned}\n{}", counts.join(", "), input.reading_error.as_ref().map(reading).unwrap_or_default())
}

fn reading(error: &ReadingError) -> String {
    let ReadingError { max, ratio_of_object, object } = error;
    format!(
        "reading error: at most {max:.1e} units; at most {ratio_of_object:.1e} of an object's own size (`{object}`)\n"
    )
}

/// One line per message, or the first few and the number of the rest.
fn list(kind: &str, messages: &[String], all: bool) -> String {
    let shown = if all { messages.len() } else { messages.len().min(FEW) };
    let mut text: String = messages[..shown].iter().map(|m| format!("{kind}: {m}\n")).collect();
    if shown < messages.len() {
        let _ = writeln!(text, "{kind}: {} more (-v shows all)", messages.len() - shown);
    }
    text
}

fn passes(report: &BakeReport) -> String {
    let line = |p: &super::Pass| {
        let done = if p.applied { "applied" } else { "left out" };
        format!("pass {}: {done}: {} ({:.3} s)\n", p.id.name(), p.reason, p.seconds)
    };
    report.passes.iter().map(line).collect()
}

/// Says what the rounds of `overlap` did.
fn rounds(report: &BakeReport) -> String {
    let Some(rounds) = &report.overlap_rounds else { return String::new() };
    let last = rounds.list.len() - 1;
    let taken = rounds.taken.map_or("none taken".to_owned(), |taken| format!("taken: {taken}"));
    let ratio = |at: usize| rounds.list[at].overlap_ratio;
    format!(
        "rounds: {last} ({taken}), {} splits and {} merges, overlap ratio {:.3} to {:.3}\n",
        rounds.splits,
        rounds.merges,
        ratio(0),
        ratio(rounds.taken.unwrap_or(last))
    )
}

fn comparison(metrics: Sides<&Metrics>) -> Vec<Vec<String>> {
    let with_core = has_core(metrics.before) || has_core(metrics.after);
    let Sides { before, after } = metrics.map(|m| metric_rows(m, with_core));
    before.into_iter().zip(after).map(|((name, before), (_, after))| vec![name.into(), before, after]).collect()
}

/// Whether the ratio of the core says something that the overlap ratio does not.
fn has_core(m: &Metrics) -> bool {
    m.core_overlap_ratio != m.overlap_ratio
}

fn metric_rows(m: &Metrics, with_core: bool) -> Vec<(&'static str, String)> {
    let mut rows = vec![
        ("mesh groups (BLAS)", grouped(m.mesh_groups)),
        ("geometries", grouped(m.geometries)),
        ("instances (TLAS)", grouped(m.instances)),
        ("triangles stored", grouped(m.triangles_stored)),
        ("triangles placed", grouped(m.triangles_placed)),
        ("overlap ratio", format!("{:.3}", m.overlap_ratio)),
        ("SAH cost", format!("{:.2}", m.sah_cost)),
        ("two-level cost", format!("{:.2}", m.two_level_cost)),
        (
            "boxes per surface point",
            format!("{:.2} (p95 {}, max {})", m.boxes_per_point_mean, m.boxes_per_point_p95, m.boxes_per_point_max),
        ),
        ("predicted bytes", format!("{} + {}", bytes(m.blas_bytes), bytes(m.tlas_bytes))),
    ];
    if with_core {
        rows.insert(6, ("overlap ratio of the core", format!("{:.3}", m.core_overlap_ratio)));
    }
    rows
}

/// The structures that the device built; empty on the CPU.
fn structures(verify: &Verification) -> String {
    let Some(s) = &verify.structures else { return String::new() };
    let row = |name: &str, of: Sides<String>| vec![name.to_owned(), of.before, of.after];
    let of_bytes = |of: Sides<u64>| of.map(bytes);
    let ms = |of: Sides<f64>| of.map(|ms| format!("{ms:.2} ms"));
    let count = |of: Sides<u64>| of.map(grouped);
    let mut rows = vec![row("BLASes", count(s.blases)), row("BLAS bytes as built", of_bytes(s.blas_bytes))];
    rows.extend(s.blas_bytes_compacted.map(|both| row("BLAS bytes compacted", of_bytes(both))));
    rows.extend([
        row("TLAS instances", count(s.tlas_instances)),
        row("TLAS bytes", of_bytes(s.tlas_bytes)),
        row("BLAS build", ms(s.blas_build_ms)),
        row("TLAS build", ms(s.tlas_build_ms)),
        row("any-hit invocations", count(s.any_hit_invocations)),
    ]);
    format!("{}\n", table(&["on the device", "before", "after"], &rows))
}

fn errors(v: &Verification) -> String {
    let position = match v.position_error_ratio.is_nan() {
        true => String::new(),
        false => format!(", position error {:.1e} of the diagonal", v.position_error_ratio),
    };
    format!(
        "{} rays, {} hits, {} mismatches, {} far hits; distance error at most {:.1e} (rms {:.1e}){position}\n",
        grouped(v.rays),
        grouped(v.hits),
        grouped(v.mismatches),
        grouped(v.far_hits),
        v.max_relative_distance_error,
        v.rms_relative_distance_error,
    )
}

fn seconds(report: &BakeReport) -> String {
    let s = &report.seconds;
    let memory = report.peak_memory_bytes.map(|b| format!("; peak memory {}", bytes(b))).unwrap_or_default();
    format!(
        "seconds: read {:.2}, analyse {:.2}, optimise {:.2}, write {:.2}, verify {:.2}, total {:.2}{memory}\n",
        s.read, s.analyse, s.optimise, s.write, s.verify, s.total
    )
}

/// A finding, with the objects, what it costs and what to do, in lines of limited length.
fn finding(f: &Finding) -> String {
    let indented = |what: &str, text: &str| {
        let lines = wrapped(&format!("{what}: {text}"), candidates::WIDTH - 8);
        lines
            .iter()
            .enumerate()
            .map(|(i, line)| format!("{}{line}\n", if i == 0 { "    " } else { "        " }))
            .collect::<String>()
    };
    let mut text = paragraph(&format!("{} {} ({}): {}", f.rule.id(), f.severity.name(), f.title, f.message));
    if !f.objects.is_empty() {
        text += &indented("objects", &names(f));
    }
    text += &indented("costs", &f.cost.text);
    text += &indented("by hand", &f.by_hand);
    text += &indented("bake", &f.by_bake);
    match f.gone_after {
        Some(true) => text + &indented("output", "the finding is gone"),
        Some(false) => text + &indented("output", "the finding remains"),
        None => text,
    }
}

/// The names of the first objects of a finding, and how many there are beyond these.
fn names(f: &Finding) -> String {
    let named: Vec<String> = f.objects.iter().map(|name| format!("`{name}`")).collect();
    let more = f.count.saturating_sub(named.len() as u64);
    let more = if more > 0 { format!(" and {} more", grouped(more)) } else { String::new() };
    format!("{}{more}", named.join(", "))
}

/// A table with columns as wide as their widest cell; the first is left-aligned, the others right-aligned.
pub(super) fn table(heading: &[&str], rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        let cells = rows.iter().map(|r| r[column].chars().count());
        cells.chain([heading[column].chars().count()]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..heading.len()).map(width).collect();
    let line = |cells: Vec<&str>| {
        let padded = cells.iter().zip(&widths).enumerate().map(|(column, (cell, &width))| {
            if column == 0 { padded(cell, width, false) } else { format!("  {}", padded(cell, width, true)) }
        });
        format!("{}\n", padded.collect::<String>().trim_end())
    };
    let body = rows.iter().map(|r| line(r.iter().map(String::as_str).collect()));
    std::iter::once(line(heading.to_vec())).chain(body).collect()
}

/// Pads a cell to the width of its column, right- or left-aligned.
pub(super) fn padded(cell: &str, width: usize, right: bool) -> String {
    if right { format!("{cell:>width$}") } else { format!("{cell:<width$}") }
}

/// Wraps a text into lines, all but the first indented.
fn paragraph(text: &str) -> String {
    wrapped(text, candidates::WIDTH - 2).join("\n  ") + "\n"
}

/// Wraps a text into lines of at most `width` characters, broken between words; longer words get a line of their own.
/// Returns at least one line.
pub(super) fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.is_empty() => *line = word.to_owned(),
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => *line += &format!(" {word}"),
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reading_error_follows_the_counts() {
        let error = ReadingError { max: 2.5e-8, ratio_of_object: 3e-8, object: "cup".into() };
        let scene = crate::scene::Scene::default();
        let input = Input { reading_error: Some(error), ..Input::of("scene.obj".into(), None, &scene) };
        let line = "reading error: at most 2.5e-8 units; at most 3.0e-8 of an object's own size (`cup`)\n";
        assert!(input_line(&input).ends_with(&format!("0 instances\n{line}")), "{}", input_line(&input));
        assert!(!input_line(&Input { reading_error: None, ..input }).contains("error"));
    }

    #[test]
    fn cracks_are_reported_even_if_none_can_be_looked_for() {
        assert!(seams(&Seams::default()).starts_with("cracks: not looked for: "));
        let found = Seams {
            rays: 16_384,
            after_lost: 20,
            after_lost_per_million: 20e6 / 16_384.0,
            opened: 20,
            ..Seams::default()
        };
        assert_eq!(
            seams(&found),
            "cracks: of 16,384 rays aimed at shared edges and vertices, 0 per million pass through the input, 1,221 \
             through the output\n"
        );
        let failure = crate::verify::Failure::Seams(found).to_string();
        assert!(
            failure.contains("of 16,384 rays") && failure.contains("20 pass through the output and 0"),
            "{failure}"
        );
    }

    #[test]
    fn columns_line_up() {
        let rows = vec![vec!["a".into(), "1".into()], vec!["long".into(), "22".into()]];
        assert_eq!(table(&["x", "before"], &rows), "x     before\na          1\nlong      22\n");
    }

    #[test]
    fn text_is_broken_between_words() {
        assert_eq!(wrapped("one two three", 7), ["one two", "three"]);
        assert_eq!(wrapped("a unbreakable b", 4), ["a", "unbreakable", "b"]);
        assert_eq!(wrapped("", 4), [""]);
    }
}
