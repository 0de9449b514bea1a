//! Statements for `tobj` that need no copy: references to the text in which `tobj` can read them.

use std::ops::Range;

use bytes::Bytes;

/// Consecutive statements, in the text of a block or in the replacements of its other lines.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Piece {
    pub(super) origin: Origin,
    pub(super) range: Range<usize>,
}

/// Location of a piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Origin {
    /// In the text of the block.
    Text,
    /// Among the replacement statements.
    Mended,
}

impl Piece {
    pub(super) fn text(range: Range<usize>) -> Piece {
        Piece { origin: Origin::Text, range }
    }

    pub(super) fn mended(range: Range<usize>) -> Piece {
        Piece { origin: Origin::Mended, range }
    }

    /// Extends the piece by the next one; returns `false` if they are not adjacent.
    pub(super) fn extend(&mut self, next: &Piece) -> bool {
        let follows = self.origin == next.origin && self.range.end == next.range.start;
        if follows {
            self.range.end = next.range.end;
        }
        follows
    }
}

/// Appends a piece, joined with the last one if adjacent.
pub(super) fn push(pieces: &mut Vec<Piece>, piece: Piece) {
    if !pieces.last_mut().is_some_and(|last| last.extend(&piece)) {
        pieces.push(piece);
    }
}

/// The texts that the pieces of a block refer to. Alive as long as one of the slices.
#[derive(Debug)]
pub(super) struct Sources {
    text: Bytes,
    mended: Bytes,
}

impl Sources {
    pub(super) fn new(text: String, mended: String) -> Self {
        Sources { text: text.into_bytes().into(), mended: mended.into_bytes().into() }
    }

    pub(super) fn slice(&self, piece: &Piece) -> Bytes {
        match piece.origin {
            Origin::Text => self.text.slice(piece.range.clone()),
            Origin::Mended => self.mended.slice(piece.range.clone()),
        }
    }
}
