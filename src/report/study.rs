//! Pages of a study: tables and figures with what they show in words, as HTML and Markdown.

use std::fmt::Write;

/// A page of a study.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Study {
    /// The heading of the page.
    pub title: String,
    /// Sentences below it.
    pub sentences: Vec<String>,
    /// The parts of the page.
    pub sections: Vec<Section>,
}

/// A part of a page.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Section {
    /// Its heading.
    pub heading: String,
    /// Sentences below it.
    pub sentences: Vec<String>,
    /// Its tables.
    pub tables: Vec<Table>,
    /// Its figures.
    pub figures: Vec<Figure>,
}

/// A table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// What it shows.
    pub caption: String,
    /// The names of its columns.
    pub head: Vec<String>,
    /// Its rows, as long as `head`.
    pub rows: Vec<Vec<String>>,
    /// Notes below it.
    pub notes: Vec<String>,
}

/// A figure.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// What it shows.
    pub caption: String,
    /// Its file, relative to the page.
    pub file: String,
    /// The figure itself.
    pub content: Picture,
}

/// What a figure consists of.
#[derive(Clone, Debug, PartialEq)]
pub enum Picture {
    /// The text of an SVG image, made by this program.
    Svg(String),
    /// The bytes of a PNG image.
    Png(Vec<u8>),
}

impl Default for Picture {
    fn default() -> Picture {
        Picture::Svg(String::new())
    }
}

impl Study {
    /// Returns the page as Markdown; figures are links to their files below `folder`.
    pub fn to_markdown(&self, folder: &str) -> String {
        let mut text = format!("# {}\n\n", self.title);
        add_sentences(&mut text, &self.sentences);
        for section in &self.sections {
            let _ = write!(text, "## {}\n\n", section.heading);
            add_sentences(&mut text, &section.sentences);
            section.tables.iter().for_each(|table| table.add_to(&mut text));
            for Figure { caption, file, .. } in &section.figures {
                let _ = write!(text, "![{}]({folder}{file})\n\n{caption}\n\n", plain(caption));
            }
        }
        text.trim_end().to_owned() + "\n"
    }
}

impl Table {
    fn add_to(&self, text: &mut String) {
        let _ = write!(text, "**{}**\n\n", self.caption);
        let line = |cells: &[String]| {
            format!("| {} |\n", cells.iter().map(|cell| plain(cell)).collect::<Vec<_>>().join(" | "))
        };
        *text += &line(&self.head);
        *text += &line(&vec!["---".to_owned(); self.head.len()]);
        self.rows.iter().for_each(|row| *text += &line(row));
        *text += "\n";
        add_sentences(text, &self.notes);
    }
}

fn add_sentences(text: &mut String, sentences: &[String]) {
    for sentence in sentences {
        let _ = write!(text, "{sentence}\n\n");
    }
}

/// Returns a text that neither ends a cell of a table nor a line.
fn plain(text: &str) -> String {
    text.replace('|', "\\|").replace('\n', " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markdown_has_every_table_and_figure() {
        let table = Table {
            caption: "Speeds".into(),
            head: vec!["scene".into(), "speed".into()],
            rows: vec![vec!["a|b".into(), "3".into()]],
            notes: vec!["Timed on a CPU.".into()],
        };
        let figure = Figure { caption: "Bars.".into(), file: "bars.svg".into(), content: Picture::default() };
        let section = Section {
            heading: "One".into(),
            sentences: vec!["It is so.".into()],
            tables: vec![table],
            figures: vec![figure],
        };
        let study = Study { title: "A study".into(), sentences: vec!["Of something.".into()], sections: vec![section] };
        let expected = "# A study\n\nOf something.\n\n## One\n\nIt is so.\n\n**Speeds**\n\n| scene | speed |\n| --- | --- |\n\
                        | a\\|b | 3 |\n\nTimed on a CPU.\n\n![Bars.](figures/bars.svg)\n\nBars.\n";
        assert_eq!(study.to_markdown("figures/"), expected);
    }
}
