//! Writes the seeds of every target into the given folder, one folder per target.

use std::fs;
use std::path::PathBuf;

fn main() -> std::io::Result<()> {
    let corpus = PathBuf::from(std::env::args().nth(1).expect("seeds FOLDER"));
    for (target, _) in motorlink_fuzz::TARGETS {
        let folder = corpus.join(target);
        fs::create_dir_all(&folder)?;
        for (n, seed) in motorlink_fuzz::seeds::of(target).into_iter().enumerate() {
            fs::write(folder.join(format!("seed-{n}")), seed)?;
        }
    }
    Ok(())
}
