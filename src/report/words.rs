//! Numbers in words, for reports.

/// Formats a number with its digits in groups of three.
pub(crate) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// Formats a count with its noun: `1 group`, `1,234 groups`, `2 meshes`.
pub(crate) fn counted(count: usize, what: &str) -> String {
    format!("{} {}", grouped(count as u64), plural(count, what))
}

/// States that instances stay: `1 instance stays`, `2 instances stay`.
pub(crate) fn instances_stay(count: usize) -> String {
    format!("{} {}", counted(count, "instance"), if count == 1 { "stays" } else { "stay" })
}

/// The singular or plural form for a count.
pub(crate) fn plural(count: usize, what: &str) -> String {
    if count == 1 {
        return what.to_owned();
    }
    match (what.strip_suffix("ex"), what.strip_suffix('y')) {
        (Some(stem), _) => format!("{stem}ices"),
        (_, Some(stem)) => format!("{stem}ies"),
        _ if what.ends_with("sh") || what.ends_with('x') => format!("{what}es"),
        _ => format!("{what}s"),
    }
}

/// Formats a size in binary units.
pub(crate) fn bytes(size: u64) -> String {
    let units = ["B", "KiB", "MiB", "GiB", "TiB"];
    let mut value = size as f64;
    let mut unit = 0;
    while value >= 1024.0 && unit + 1 < units.len() {
        value /= 1024.0;
        unit += 1;
    }
    if unit == 0 { format!("{size} B") } else { format!("{value:.1} {}", units[unit]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_stand_in_groups_of_three() {
        assert_eq!([0, 999, 1000, 1_234_567].map(grouped), ["0", "999", "1,000", "1,234,567"]);
    }

    #[test]
    fn one_is_singular_and_all_else_plural() {
        assert_eq!([0, 1, 2].map(|n| counted(n, "group")), ["0 groups", "1 group", "2 groups"]);
        let words = ["mesh", "vertex", "geometry", "box"].map(|what| counted(2000, what));
        assert_eq!(words, ["2,000 meshes", "2,000 vertices", "2,000 geometries", "2,000 boxes"]);
        assert_eq!(counted(2, "copy"), "2 copies");
        assert_eq!([1, 2000].map(instances_stay), ["1 instance stays", "2,000 instances stay"]);
    }

    #[test]
    fn sizes_use_the_largest_unit_below_them() {
        assert_eq!([0, 1023, 1024, 3 << 29].map(bytes), ["0 B", "1023 B", "1.0 KiB", "1.5 GiB"]);
    }
}
