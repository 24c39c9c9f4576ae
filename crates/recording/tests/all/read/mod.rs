//! Files that are whole, cut, damaged, and written by others.

mod appended;
mod damage;
mod files;
mod repair;
mod tables;
mod whole;
