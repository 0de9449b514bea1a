//! A depfile: which files an output was made from, as a rule for Make, which Ninja reads, too.

use std::path::Path;

/// Returns the rule that `output` depends on `inputs`.
pub fn depfile<'a>(output: &Path, inputs: impl IntoIterator<Item = &'a Path>) -> String {
    let inputs: String = inputs.into_iter().map(|input| format!(" \\\n  {}", escaped(input))).collect();
    format!("{}:{inputs}\n", escaped(output))
}

/// Escapes what has a meaning in a rule: as GCC does, blanks and `#` by a backslash, backslashes before a blank by another,
/// `$` by a second one.
fn escaped(path: &Path) -> String {
    let (mut out, mut backslashes) = (String::new(), 0);
    for c in path.to_string_lossy().chars() {
        match c {
            ' ' | '\t' => out.extend(std::iter::repeat_n('\\', backslashes + 1)),
            '#' => out.push('\\'),
            '$' => out.push('$'),
            _ => {}
        }
        backslashes = if c == '\\' { backslashes + 1 } else { 0 };
        out.push(c);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_a_meaning_in_a_rule_is_escaped() {
        let inputs = ["a b.glb", "c#1$.bin", "d\\ e"].map(Path::new);
        assert_eq!(
            depfile(Path::new("out put.glb"), inputs),
            "out\\ put.glb: \\\n  a\\ b.glb \\\n  c\\#1$$.bin \\\n  d\\\\\\ e\n"
        );
        assert_eq!(depfile(Path::new("o"), []), "o:\n");
    }
}
