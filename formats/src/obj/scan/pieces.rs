//! Statements for `tobj` that need no copy: where they stand in the text as `tobj` is to read them.

use std::ops::Range;

use bytes::Bytes;

/// Consecutive statements, in the text of a block or in what is written in place of its other lines.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Piece {
    pub(super) origin: Origin,
    pub(super) range: Range<usize>,
}

/// Where a piece stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Origin {
    /// In the text.
    Text,
    /// Among the mended statements.
    Mended,
}

impl Piece {
    pub(super) fn text(range: Range<usize>) -> Piece {
        Piece { origin: Origin::Text, range }
    }

    pub(super) fn mended(range: Range<usize>) -> Piece {
        Piece { origin: Origin::Mended, range }
    }

    /// Takes in the piece that follows; `false` where it lies elsewhere.
    pub(super) fn extend(&mut self, next: &Piece) -> bool {
        let follows = self.origin == next.origin && self.range.end == next.range.start;
        if follows {
            self.range.end = next.range.end;
        }
        follows
    }
}

/// Appends a piece, joined with the last if it follows that.
pub(super) fn push(pieces: &mut Vec<Piece>, piece: Piece) {
    if !pieces.last_mut().is_some_and(|last| last.extend(&piece)) {
        pieces.push(piece);
    }
}

/// What the pieces of a block refer to. It lives as long as one of the slices does.
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
