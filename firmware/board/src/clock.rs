//! The board's time: that of a timer, or that of a host which steps it.

use core::ops::Deref;

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use embedded_io::{Read, ReadReady, Write};
use motorlink_proto::time::{Instant, Micros};
use stm32f4::stm32f405::TIM2;
use stm32f4::stm32f405::usart1::RegisterBlock;

use crate::uart::{Traffic, Uart};

/// What SysTick counts in QEMU's netduinoplus2, and on a board whose clocks are set up.
const CORE_HZ: u32 = 168_000_000;
/// What TIM2 counts in QEMU. On a board it is half of the core's clock.
const TIMER_HZ: u32 = 1_000_000_000;

/// Time advances in ticks of this length once a host steps it.
const TICK: Micros = Micros(100);
/// The command that asks how many bytes were taken.
const COUNT: u8 = 0;
/// The command that a new host begins with, and both bytes of its answer.
const SYNC: u8 = 255;

/// Microseconds since the start, from TIM2, which counts by itself: no interrupt that comes late
/// makes time run late.
struct Timer {
    registers: TIM2,
    high: u32,
    low: u32,
}

impl Timer {
    /// The time. To be asked at least once an hour, or a turn of the counter is missed.
    fn now(&mut self) -> Instant {
        let low = self.registers.cnt().read().bits();
        self.high += u32::from(low < self.low);
        self.low = low;
        Instant(u64::from(self.high) << 32 | u64::from(low))
    }
}

/// A command to advance that is not yet answered.
struct Step {
    ticks: u8,
    done: u8,
}

/// The timer's time until a byte comes on the clock port. After that, time advances only by commands of
/// this port; firmware/README.md has their list.
pub struct Clock<R> {
    timer: Timer,
    port: Uart<R>,
    /// The time once a host steps it.
    stepped: Option<Instant>,
    step: Option<Step>,
    /// What had moved at the last answer.
    answered: Traffic,
}

impl<R: Deref<Target = RegisterBlock>> Clock<R> {
    /// Starts to count, and to wake the core each millisecond.
    pub fn start(registers: TIM2, mut tick: SYST, port: Uart<R>) -> Self {
        registers.psc().write(|w| w.psc().set((TIMER_HZ / 1_000_000 - 1) as u16));
        registers.cr1().write(|w| w.cen().enabled());
        tick.set_clock_source(SystClkSource::Core);
        tick.set_reload(CORE_HZ / 1_000 - 1);
        tick.clear_current();
        tick.enable_interrupt();
        tick.enable_counter();
        let low = registers.cnt().read().bits();
        let timer = Timer { registers, high: 0, low };
        Clock { timer, port, stepped: None, step: None, answered: Traffic::default() }
    }

    /// The time. A host's first byte stops the timer's, even where the motors' time is behind it and
    /// [`serve`](Clock::serve) is not called: on a slow machine they would never catch up with it.
    pub fn now(&mut self) -> Instant {
        if let Some(now) = self.stepped {
            return now;
        }
        let now = self.timer.now();
        if self.port.read_ready().unwrap_or(true) {
            self.stepped = Some(now);
        }
        now
    }

    /// Obeys the clock port. To be called when everything that is due now is done; `traffic` is what
    /// has moved on the other ports. Returns whether there may be more to do at once.
    pub fn serve(&mut self, traffic: Traffic) -> bool {
        match &mut self.step {
            Some(step) if step.done < step.ticks && traffic == self.answered => {
                step.done += 1;
                self.stepped = self.stepped.map(|now| now + TICK);
            }
            Some(step) => {
                let done = step.done;
                self.step = None;
                self.answer(done, traffic);
            }
            None => {
                let mut command = [0];
                let waits = self.port.read_ready().unwrap_or(false);
                if !waits || !matches!(self.port.read(&mut command), Ok(1)) {
                    return false;
                }
                self.stepped.get_or_insert(self.timer.now());
                match command {
                    [SYNC] => self.answer(SYNC, traffic),
                    [COUNT] => self.answer(traffic.taken_since(self.answered), traffic),
                    [ticks] => self.step = Some(Step { ticks, done: 0 }),
                }
            }
        }
        true
    }

    fn answer(&mut self, answer: u8, traffic: Traffic) {
        let sent = if answer == SYNC { SYNC } else { traffic.sent_since(self.answered) };
        self.answered = traffic;
        // Writing never fails.
        let _ = self.port.write(&[answer, sent]);
    }
}
