//! Warnings, each once with the number of times it applied.

use std::collections::HashMap;

use crate::Warning;

/// Warnings in the making, in order of first appearance.
#[derive(Debug, Default)]
pub(super) struct Notes {
    entries: Vec<Entry>,
    index: HashMap<String, usize>,
}

#[derive(Debug)]
struct Entry {
    place: String,
    message: String,
    count: usize,
}

impl Notes {
    /// Counts one more case of `message`; the place of the first case is kept.
    pub(super) fn add(&mut self, place: impl FnOnce() -> String, message: &str) {
        self.add_many(place, message, 1);
    }

    /// Counts `count` more cases of `message`; none is no case.
    pub(super) fn add_many(&mut self, place: impl FnOnce() -> String, message: &str, count: usize) {
        if count == 0 {
            return;
        }
        if let Some(&i) = self.index.get(message) {
            self.entries[i].count += count;
            return;
        }
        self.index.insert(message.to_owned(), self.entries.len());
        self.entries.push(Entry { place: place(), message: message.to_owned(), count });
    }

    /// The warnings, counts in words.
    pub(super) fn into_warnings(self) -> Vec<Warning> {
        let words = |e: &Entry| match e.count {
            1 => e.message.clone(),
            n => format!("{} ({n} in all)", e.message),
        };
        self.entries.iter().map(|e| Warning { message: words(e), place: e.place.clone() }).collect()
    }
}
