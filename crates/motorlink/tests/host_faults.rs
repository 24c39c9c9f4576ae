//! Ports that fail: cables and adapters are pulled, reset, and plugged in elsewhere.
//! docs/HOST-FAULTS.md tells users what to expect.

use std::fs::{self, File};
use std::io::{Read, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::symlink;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use motorlink::rmd::{self};
use motorlink::slcan::Device as Adapter;
use motorlink::st::{self, MotorNumber, Profile, Slave};
use motorlink::{LinkState, time};
use motorlink_sim::rmd::RmdBus;
use motorlink_sim::st::StDrive;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

/// A device on a pty, with a link to it, that can be unplugged.
struct Device {
    link: PathBuf,
    control: UnixStream,
    thread: Option<JoinHandle<()>>,
}

/// What a device does with what it gets; `false` unplugs it when the reply is out.
type Answer = Box<dyn FnMut(&[u8], &mut Vec<u8>) -> bool + Send>;

impl Device {
    fn plug(link: &Path, mut answer: Answer) -> Self {
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = openpt(flags).expect("a pty");
        grantpt(&master).expect("it is ours");
        unlockpt(&master).expect("it is ours");
        let name = ptsname(&master, Vec::new()).expect("it has a name");
        let _ = fs::remove_file(link);
        symlink(name.to_str().expect("ASCII"), link).expect("linked");
        let (control, stop) = UnixStream::pair().expect("a pair");
        let thread = std::thread::spawn(move || {
            let mut master = File::from(master);
            let (mut bytes, mut reply) = ([0; 256], Vec::new());
            loop {
                let mut fds = [
                    PollFd::new(&master, PollFlags::IN),
                    PollFd::from_borrowed_fd(stop.as_fd(), PollFlags::IN),
                ];
                poll(&mut fds, None).expect("polled");
                if !fds[1].revents().is_empty() {
                    return;
                }
                // The port is not open at the moment.
                let Ok(size) = master.read(&mut bytes) else {
                    std::thread::sleep(Duration::from_millis(1));
                    continue;
                };
                reply.clear();
                let stays = answer(&bytes[..size], &mut reply);
                master.write_all(&reply).expect("written");
                if !stays {
                    return;
                }
            }
        });
        Device { link: link.to_owned(), control, thread: Some(thread) }
    }

    fn unplug(self) {}
}

impl Drop for Device {
    fn drop(&mut self) {
        let _ = self.control.write_all(b"x");
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        let _ = fs::remove_file(&self.link);
    }
}

fn path(name: &str) -> PathBuf {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    std::env::temp_dir().join(format!("motorlink-{name}-{}-{number}", std::process::id()))
}

/// An ST drive; after `requests` replies it is unplugged in the middle of one.
fn st_drive(mut requests: u32) -> Answer {
    let mut slave = Slave::new(Profile::Spec, MotorNumber::FIRST);
    let mut drive = StDrive::demo(time::Instant(0));
    Box::new(move |bytes, reply| {
        for &byte in bytes {
            if let Some(answer) = slave.receive(time::Instant(0), byte, &mut drive) {
                let stays = requests > 0;
                let size = if stays { answer.len() } else { answer.len() / 2 };
                reply.extend_from_slice(&answer[..size]);
                if !stays {
                    return false;
                }
                requests -= 1;
            }
        }
        true
    })
}

/// An slcan adapter with motors 1 to 4 behind it. `reset` makes it forget its channel, once, and
/// `opened` counts how often it was opened.
fn adapter(reset: Arc<AtomicBool>, opened: Arc<AtomicU32>) -> Answer {
    let mut adapter = Adapter::default();
    let mut bus = RmdBus::demo(time::Instant(0));
    Box::new(move |bytes, reply| {
        if reset.swap(false, Ordering::SeqCst) {
            adapter = Adapter::default();
        }
        for &byte in bytes {
            opened.fetch_add(u32::from(byte == b'O'), Ordering::SeqCst);
            if let Some(frame) = adapter.receive(byte, |answer| reply.extend_from_slice(answer)) {
                bus.receive(time::Instant(0), &frame, |answer| {
                    adapter
                        .deliver(time::Instant(0), &answer, |line| reply.extend_from_slice(line));
                });
            }
        }
        true
    })
}

fn new_adapter() -> Answer {
    adapter(Arc::default(), Arc::default())
}

fn until(what: &str, mut reached: impl FnMut() -> bool) {
    let give_up = Instant::now() + Duration::from_secs(20);
    while !reached() {
        assert!(Instant::now() < give_up, "{what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn open_st(link: &Path) -> st::Client {
    let port = link.to_str().expect("UTF-8").parse().expect("a port");
    st::Client::open(&port, st::Options::default()).expect("opened")
}

fn open_rmd(link: &Path) -> rmd::Client {
    let port = format!("slcan:{}", link.display()).parse().expect("a port");
    let options = rmd::Options { timeout: Duration::from_secs(1), ..rmd::Options::default() };
    rmd::Client::open(&port, options).expect("opened")
}

#[test]
fn an_st_drive_unplugged_in_the_middle_of_a_reply_is_told_and_comes_back() {
    let link = path("unplug-st");
    let device = Device::plug(&link, st_drive(4));
    let client = open_st(&link);
    client.board_info().expect("it answers three questions, and then this");
    let lost = client.board_info().expect_err("half a reply");
    assert!(lost.to_string().contains("hung up or was unplugged"), "{lost}");
    assert!(matches!(client.link_state(), LinkState::Closed { .. }));
    device.unplug();
    let absent = client.board_info().expect_err("there is nothing");
    assert!(absent.to_string().contains("is it plugged in?"), "{absent}");

    let _device = Device::plug(&link, st_drive(u32::MAX));
    until("the drive answers again", || client.board_info().is_ok());
}

#[test]
fn an_adapter_that_was_unplugged_is_set_up_anew() {
    let link = path("unplug-rmd");
    let device = Device::plug(&link, new_adapter());
    let bus = open_rmd(&link);
    let motor = bus.motor(1).expect("an ID");
    motor.status().expect("it answers");
    device.unplug();
    let lost = motor.status().expect_err("there is nothing");
    assert!(lost.to_string().contains("hung up or was unplugged"), "{lost}");

    let opened = Arc::new(AtomicU32::new(0));
    let _device = Device::plug(&link, adapter(Arc::default(), Arc::clone(&opened)));
    until("the motor answers again", || motor.status().is_ok());
    assert_eq!(opened.load(Ordering::SeqCst), 1);
}

#[test]
fn an_adapter_that_forgot_its_channel_is_told_and_set_up_anew() {
    let link = path("reset");
    let (reset, opened) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU32::new(0)));
    let _device = Device::plug(&link, adapter(Arc::clone(&reset), Arc::clone(&opened)));
    let bus = open_rmd(&link);
    let motor = bus.motor(1).expect("an ID");
    motor.status().expect("it answers");
    reset.store(true, Ordering::SeqCst);
    // One refusal may be a full queue.
    let refused = motor.status().expect_err("its channel is closed");
    assert!(refused.to_string().contains("does not answer"), "{refused}");
    let refused = motor.status().expect_err("its channel is closed");
    assert!(refused.to_string().contains("was it reset"), "{refused}");
    motor.status().expect("its channel is open again");
    assert_eq!(opened.load(Ordering::SeqCst), 2);
}

#[test]
fn a_device_that_comes_back_under_another_name_is_found_by_its_link() {
    let (first, second, by_id) = (path("ttyACM0"), path("ttyACM1"), path("by-id"));
    let device = Device::plug(&first, st_drive(u32::MAX));
    symlink(&first, &by_id).expect("linked");
    let client = open_st(&by_id);
    client.board_info().expect("it answers");
    device.unplug();
    assert!(client.board_info().is_err());

    let _device = Device::plug(&second, st_drive(u32::MAX));
    fs::remove_file(&by_id).expect("removed");
    symlink(&second, &by_id).expect("linked");
    until("the drive answers again", || client.board_info().is_ok());
    assert!(client.motor(1).and_then(|motor| motor.status()).is_ok());
    fs::remove_file(&by_id).expect("removed");
}
