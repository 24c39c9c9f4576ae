use std::fs;
use std::os::unix::fs::symlink;
use std::os::unix::net::UnixListener;
use std::process::Command;

use super::*;

fn folder(name: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("motorlink-{name}-{}", std::process::id()));
    let _ = fs::remove_dir_all(&path);
    path
}

#[test]
fn a_rom_keeps_its_old_content_until_the_new_one_is_stored() {
    let path = folder("rom-store");
    let rom = RomFolder::open(&path).unwrap();
    let motor = RmdConfig::with_id(7);
    assert_eq!(rom.load(1, &motor).unwrap(), motor.factory_rom());
    let mut settings = Settings { encoder_offset: 1234, ..motor.factory_rom() };
    rom.store(1, &motor, &settings).unwrap();
    assert_eq!(rom.load(1, &motor).unwrap(), settings);
    assert_eq!(rom.load(2, &motor).unwrap(), motor.factory_rom(), "another bus");

    // The process was ended at any point of the next write.
    let whole = Image::new(&motor, &Settings { encoder_offset: 99, ..settings }).to_bytes();
    for written in 0..=whole.len() {
        fs::write(path.join("bus1-motor7.new"), &whole[..written]).unwrap();
        assert_eq!(rom.load(1, &motor).unwrap(), settings);
    }
    settings.encoder_offset = 5;
    rom.store(1, &motor, &settings).unwrap();
    assert_eq!(rom.load(1, &motor).unwrap(), settings);
    fs::remove_dir_all(&path).unwrap();
}

#[test]
fn damaged_and_foreign_files_are_refused_and_not_changed() {
    let path = folder("rom-damage");
    let rom = RomFolder::open(&path).unwrap();
    let motor = RmdConfig::with_id(1);
    let file = path.join("bus1-motor1.rom");
    rom.store(1, &motor, &motor.factory_rom()).unwrap();
    let good = fs::read(&file).unwrap();
    let refused = |bytes: &[u8]| {
        fs::write(&file, bytes).unwrap();
        let error = rom.load(1, &motor).unwrap_err();
        assert!(matches!(error, RomError::Unusable { .. }), "{error}");
        assert_eq!(fs::read(&file).unwrap(), bytes);
        error.to_string()
    };
    for len in 0..good.len() {
        refused(&good[..len]);
    }
    for place in 0..good.len() {
        for bit in 0..8 {
            let mut damaged = good.clone();
            damaged[place] ^= 1 << bit;
            refused(&damaged);
        }
    }
    refused(&[&good[..], &good[..]].concat());
    assert!(refused(b"precious").contains("its end is missing"));
    let other = RmdConfig::with_id(2);
    let others = Image::new(&other, &other.factory_rom()).to_bytes();
    assert!(refused(&others).contains("belongs to motor 2"));
    fs::remove_dir_all(&path).unwrap();
}

#[test]
fn a_folder_is_used_by_one_process() {
    let path = folder("rom-owner");
    let rom = RomFolder::open(&path).unwrap();
    assert!(matches!(RomFolder::open(&path), Err(RomError::Taken { .. })));
    drop(rom);
    RomFolder::open(&path).unwrap();
    fs::remove_dir_all(&path).unwrap();
}

fn make_fifo(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}

/// Makes something that is not Motorlink's.
type Make = fn(&Path);

/// What can be in the folder and is not Motorlink's, with the word for it.
const FOREIGN: [(Make, &str); 6] = [
    (|path| make_fifo(path), "a FIFO"),
    (|path| symlink(path.with_file_name("elsewhere"), path).unwrap(), "a symbolic link"),
    (|path| symlink(path.with_file_name("nothing"), path).unwrap(), "a symbolic link"),
    (|path| fs::create_dir(path).unwrap(), "a folder"),
    (|path| drop(UnixListener::bind(path).unwrap()), "a socket"),
    (|path| fs::write(path, "precious").unwrap(), "not"),
];

#[test]
fn only_files_of_motorlink_are_read_replaced_or_removed() {
    let motor = RmdConfig::with_id(1);
    for (make, word) in FOREIGN {
        for name in ["bus1-motor1.rom", "bus1-motor1.new", LOCK] {
            for is_there_from_the_beginning in [true, false] {
                let path = folder("rom-foreign");
                fs::create_dir(&path).unwrap();
                fs::write(path.join("elsewhere"), "another program's").unwrap();
                let early = is_there_from_the_beginning || name == LOCK;
                if early {
                    make(&path.join(name));
                }
                let open = || -> Result<(), RomError> {
                    let rom = RomFolder::open(&path)?;
                    let settings = rom.load(1, &motor)?;
                    if !early {
                        make(&path.join(name));
                    }
                    rom.store(1, &motor, &settings)
                };
                let error = open().unwrap_err();
                assert!(matches!(error, RomError::Unusable { .. }), "{error}");
                let text = error.to_string();
                assert!(text.contains(name) && text.contains(word), "{text}");
                assert_eq!(fs::read(path.join("elsewhere")).unwrap(), b"another program's");
                assert!(!path.join("nothing").exists());
                assert!(fs::symlink_metadata(path.join(name)).is_ok(), "{name} is gone");
                let content = fs::symlink_metadata(path.join(name)).unwrap().is_file();
                assert!(!content || fs::read(path.join(name)).unwrap() == b"precious");
                fs::remove_dir_all(&path).unwrap();
            }
        }
    }
}

#[test]
fn the_folder_itself_is_a_folder() {
    let path = folder("rom-place");
    let elsewhere = folder("rom-elsewhere");
    fs::create_dir(&elsewhere).unwrap();
    symlink(&elsewhere, &path).unwrap();
    let error = RomFolder::open(&path).unwrap_err().to_string();
    assert!(error.contains("a symbolic link"), "{error}");
    assert_eq!(fs::read_dir(&elsewhere).unwrap().count(), 0);
    fs::remove_file(&path).unwrap();
    make_fifo(&path);
    let error = RomFolder::open(&path).unwrap_err().to_string();
    assert!(error.contains("not a folder"), "{error}");
    fs::remove_file(&path).unwrap();
    fs::remove_dir(&elsewhere).unwrap();
}

#[test]
fn a_folder_that_was_renamed_is_the_same_folder() {
    let (path, moved) = (folder("rom-before"), folder("rom-after"));
    let rom = RomFolder::open(&path).unwrap();
    let motor = RmdConfig::with_id(1);
    fs::rename(&path, &moved).unwrap();
    fs::create_dir(&path).unwrap();
    rom.store(1, &motor, &motor.factory_rom()).unwrap();
    assert!(moved.join("bus1-motor1.rom").exists());
    assert_eq!(fs::read_dir(&path).unwrap().count(), 0);
    fs::remove_dir(&path).unwrap();
    fs::remove_dir_all(&moved).unwrap();
}
