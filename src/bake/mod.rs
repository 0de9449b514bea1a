//! From a layout to a document.
