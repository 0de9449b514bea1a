//! Pages of a study ([`Study`]) as HTML that needs no network.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use minijinja::value::Serde;
use minijinja::{Value, context};
use serde::Serialize;

use super::environment;
use crate::report::study::{Figure, Picture, Section, Study, Table};

#[derive(Serialize)]
struct ShownSection<'a> {
    id: String,
    heading: &'a str,
    sentences: &'a [String],
    tables: Vec<ShownTable<'a>>,
    figures: Vec<ShownFigure<'a>>,
}

#[derive(Serialize)]
struct ShownTable<'a> {
    caption: &'a str,
    head: &'a [String],
    rows: &'a [Vec<String>],
    notes: &'a [String],
}

#[derive(Serialize)]
struct ShownFigure<'a> {
    caption: &'a str,
    /// SVG, which the template does not escape: this program made it.
    svg: Option<&'a str>,
    /// A PNG as the address of an image.
    image: Option<String>,
}

/// Returns a study as a page.
pub fn study(study: &Study) -> String {
    let environment = environment("study", include_str!("assets/study.html"));
    let template = environment.get_template("study").expect("it was added");
    let sections: Vec<ShownSection> = study.sections.iter().enumerate().map(section).collect();
    let rendered = template.render(context! {
        version => env!("CARGO_PKG_VERSION"),
        title => &study.title,
        sentences => &study.sentences,
        sections => Value::from(Serde(&sections)),
        style => Value::from_safe_string(include_str!("assets/page.css").to_owned()),
    });
    rendered.expect("the template names what is there")
}

fn section((number, section): (usize, &Section)) -> ShownSection<'_> {
    ShownSection {
        id: format!("section-{number}"),
        heading: &section.heading,
        sentences: &section.sentences,
        tables: section.tables.iter().map(shown_table).collect(),
        figures: section.figures.iter().map(shown_figure).collect(),
    }
}

fn shown_table(table: &Table) -> ShownTable<'_> {
    ShownTable { caption: &table.caption, head: &table.head, rows: &table.rows, notes: &table.notes }
}

fn shown_figure(figure: &Figure) -> ShownFigure<'_> {
    let (svg, image) = match &figure.content {
        Picture::Svg(text) => (Some(text.as_str()), None),
        Picture::Png(bytes) => (None, Some(format!("data:image/png;base64,{}", STANDARD.encode(bytes)))),
    };
    ShownFigure { caption: &figure.caption, svg, image }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_shows_tables_and_figures_and_escapes_names() {
        let table = Table {
            caption: "A <table>".into(),
            head: vec!["scene".into()],
            rows: vec![vec!["<b>".into()]],
            notes: vec!["a note".into()],
        };
        let svg =
            Figure { caption: "bars".into(), file: "x.svg".into(), content: Picture::Svg("<svg id='x'/>".into()) };
        let png = Figure { caption: "a picture".into(), file: "x.png".into(), content: Picture::Png(vec![1; 3000]) };
        let of =
            Section { heading: "Part".into(), sentences: Vec::new(), tables: vec![table], figures: vec![svg, png] };
        let page = study(&Study { title: "T & U".into(), sentences: vec!["Words.".into()], sections: vec![of] });
        let whole = format!("base64,{}\"", "AQEB".repeat(1000));
        for words in ["T &amp; U", "Words.", "A &lt;table&gt;", "&lt;b&gt;", "a note", "<svg id='x'/>", &whole] {
            assert!(page.contains(words), "{words}");
        }
    }
}
