//! A board that answers for an ST drive on USART1 and for four RMD drives, through slcan, on USART2,
//! with simulated motors behind them. USART3 is the clock port: a host that steps the board's time.
//!
//! It is for QEMU's netduinoplus2, an STM32F405 without clock control, pins, DMA and CAN: nothing here
//! waits for them. On a real board the UARTs and the CAN controller are those of its HAL, behind the
//! same ports of `motorlink-embedded`; the main loop stays.
#![no_std]
#![no_main]

mod clock;
mod uart;

use cortex_m::peripheral::NVIC;
use cortex_m_rt::{entry, exception};
use embedded_io::ReadReady;
use motorlink_embedded::rmd::DrivePort;
use motorlink_embedded::slcan::Adapter;
use motorlink_embedded::st::SlavePort;
use motorlink_proto::st::{Profile, Slave};
use panic_halt as _;
use plant::Plant;
use stm32f4::stm32f405::{Interrupt, Peripherals, USART1, USART2, USART3, interrupt};

use clock::Clock;
use uart::{Line, Uart};

static ST_LINE: Line = uart::line();
static RMD_LINE: Line = uart::line();
static CLOCK_LINE: Line = uart::line();

#[entry]
fn main() -> ! {
    let board = Peripherals::take().expect("nobody took them before");
    let core = cortex_m::Peripherals::take().expect("nobody took them before");
    let clock_port = Uart::new(board.USART3, &CLOCK_LINE);
    let mut clock = Clock::start(board.TIM2, core.SYST, clock_port);
    let now = clock.now();
    let mut plant = Plant::new(now).expect("the presets can be simulated");
    let slave = Slave::new(Profile::Spec, plant.st.last());
    let mut st = SlavePort::new(Uart::new(board.USART1, &ST_LINE), slave);
    let adapter = Adapter::new(Uart::new(board.USART2, &RMD_LINE));
    let mut rmd = DrivePort::new(adapter, Plant::rmd_drives());
    rmd.power_on(now, &mut plant.rmd);
    for interrupt in [Interrupt::USART1, Interrupt::USART2, Interrupt::USART3] {
        // SAFETY: no code relies on these interrupts being masked; what they share with the main
        // loop is behind critical sections.
        unsafe { NVIC::unmask(interrupt) };
    }
    loop {
        let caught_up = plant.advance(clock.now());
        // Bytes may have come while the motors advanced: their time is not the one before.
        let now = clock.now();
        // An error is an overrun, which the ports have answered for.
        let _ = st.poll(now, &mut plant.st);
        rmd.can_mut().set_time(now);
        let _ = rmd.poll(now, &mut plant.rmd);
        if caught_up {
            // An interrupt that comes here is pending, and ends the wait all the same.
            cortex_m::interrupt::free(|_| {
                let (st, rmd) = (st.uart_mut(), rmd.can_mut().uart_mut());
                let waiting = st.read_ready().unwrap_or(true) || rmd.read_ready().unwrap_or(true);
                if !waiting && !clock.serve(st.traffic() + rmd.traffic()) {
                    cortex_m::asm::wfi();
                }
            });
        }
    }
}

#[interrupt]
fn USART1() {
    // SAFETY: the main loop only writes what this only reads: the data register is two.
    let registers = unsafe { USART1::steal() };
    uart::interrupt(&registers, &ST_LINE);
}

#[interrupt]
fn USART2() {
    // SAFETY: as in USART1.
    let registers = unsafe { USART2::steal() };
    uart::interrupt(&registers, &RMD_LINE);
}

#[interrupt]
fn USART3() {
    // SAFETY: as in USART1.
    let registers = unsafe { USART3::steal() };
    uart::interrupt(&registers, &CLOCK_LINE);
}

/// Wakes the core each millisecond, for the motors and for deadlines.
#[exception]
fn SysTick() {}
