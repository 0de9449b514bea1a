//! Warnings, each reported once with its number of occurrences.

use std::collections::HashMap;

use crate::Warning;

/// Collects warnings, in order of first appearance.
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
    /// Counts one more occurrence of `message`; the place of the first is kept.
    pub(super) fn add(&mut self, place: impl FnOnce() -> String, message: &str) {
        self.add_many(place, message, 1);
    }

    /// Counts `count` more occurrences of `message`; zero adds nothing.
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

    /// Returns the warnings, with counts in words.
    pub(super) fn into_warnings(self) -> Vec<Warning> {
        let words = |e: &Entry| match e.count {
            1 => e.message.clone(),
            n => format!("{} ({n} in all)", e.message),
        };
        self.entries.iter().map(|e| Warning { message: words(e), place: e.place.clone() }).collect()
    }
}
