//! Files that are whole, cut, damaged, and written by others.

mod damage;
mod files;
mod whole;
