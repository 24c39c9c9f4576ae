//! Both ends of both protocols, and the slave in either profile.
#![no_std]
#![no_main]

use core::hint::black_box;

use motorlink_proto::rmd::{Drive, Host};
use motorlink_proto::st::{Master, MasterConfig, MotorNumber, Profile, Slave};

type Ends = (Slave, Master, Drive, Host);

fn new() -> Ends {
    let slave = Slave::new(black_box(Profile::Mcsdk54), black_box(MotorNumber::FIRST));
    (slave, Master::new(MasterConfig::default()), probe::new_rmd_drive(), Host::new())
}

fn calls((slave, master, drive, host): &mut Ends) {
    probe::st_slave(slave);
    probe::st_master(master);
    probe::rmd_drive(drive);
    probe::rmd_host(host);
}

probe::program!(Ends, new(), calls);
