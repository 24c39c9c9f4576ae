//! Frames that were seen on a wire: file formats of captures, and their meaning.
