//! Text that stands in a page: names are shown harmlessly, whatever they hold, and data is packed.

use std::borrow::Cow;
use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// Maximum characters of a text in the page. The JSON report has it whole.
pub(super) const MOST_CHARACTERS: usize = 400;

/// Returns a text as it is shown: control characters and those that change the direction of writing are replaced by
/// their code points, such as `U+202E`, and what exceeds a number of characters by an ellipsis.
pub(super) fn visible(text: &str, most: usize) -> Cow<'_, str> {
    let end = text.char_indices().nth(most).map(|(end, _)| end);
    if end.is_none() && !text.chars().any(is_invisible) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::new();
    for character in text[..end.unwrap_or(text.len())].chars() {
        match is_invisible(character) {
            true => _ = write!(shown, "\u{27e8}U+{:04X}\u{27e9}", u32::from(character)),
            false => shown.push(character),
        }
    }
    if end.is_some() {
        shown.push('\u{2026}');
    }
    Cow::Owned(shown)
}

/// Whether a character has no shape of its own, but changes how others are shown: controls, the marks, embeddings and
/// isolates of the Unicode Bidirectional Algorithm (Unicode Standard Annex 9), line separators and the byte order mark.
fn is_invisible(character: char) -> bool {
    let changes_direction =
        matches!(character, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let breaks_line = matches!(character, '\u{2028}' | '\u{2029}' | '\u{feff}');
    character.is_control() || changes_direction || breaks_line
}

/// Returns JSON that can stand in a `script` element: nothing in it ends the element or opens a comment.
pub(super) fn json_for_script(json: &str) -> String {
    let mut safe = String::with_capacity(json.len());
    for character in json.chars() {
        match character {
            '<' | '>' | '&' | '\u{7f}'..='\u{9f}' => _ = write!(safe, "\\u{:04x}", u32::from(character)),
            // Outside of strings there are only spaces and line feeds.
            c if is_invisible(c) && c != '\n' => _ = write!(safe, "\\u{:04x}", u32::from(c)),
            c => safe.push(c),
        }
    }
    safe
}

/// Returns the little-endian bytes of numbers in base 64.
pub(super) fn packed<T: bytemuck::NoUninit>(numbers: &[T]) -> String {
    // The page is little-endian, like all machines that run browsers and this program.
    STANDARD.encode(bytemuck::cast_slice::<T, u8>(numbers))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_text_stays() {
        assert!(matches!(visible("wall <b> \u{e9} \u{5d0}", 20), Cow::Borrowed("wall <b> \u{e9} \u{5d0}")));
    }

    #[test]
    fn what_changes_other_text_is_shown_as_its_code_point() {
        assert_eq!(
            visible("a\u{202e}b\u{7}c\n", 20),
            "a\u{27e8}U+202E\u{27e9}b\u{27e8}U+0007\u{27e9}c\u{27e8}U+000A\u{27e9}"
        );
    }

    #[test]
    fn long_text_ends_in_an_ellipsis() {
        let shown = visible(&"\u{e9}".repeat(10_000), 5).into_owned();
        assert_eq!(shown, "\u{e9}\u{e9}\u{e9}\u{e9}\u{e9}\u{2026}");
        assert_eq!(visible("12345", 5), "12345");
    }

    #[test]
    fn json_in_a_script_cannot_end_it_and_means_the_same() {
        let json = serde_json::to_string_pretty(&["</script><!--&\u{202e}\u{2028}", "\u{7f}\u{1}"]).expect("strings");
        let safe = json_for_script(&json);
        assert!(!safe.contains(['<', '>', '&', '\u{202e}', '\u{2028}', '\u{7f}']), "{safe}");
        let [before, after] = [&json, &safe].map(|json| serde_json::from_str::<Vec<String>>(json).expect("JSON"));
        assert_eq!(before, after);
    }

    #[test]
    fn numbers_are_packed_in_little_endian() {
        assert_eq!(packed(&[1u16, 0x0203]), "AQADAg==");
    }
}
