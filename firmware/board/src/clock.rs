//! The board's time.

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use motorlink_proto::time::Instant;
use stm32f4::stm32f405::TIM2;

/// What SysTick counts in QEMU's netduinoplus2, and on a board whose clocks are set up.
const CORE_HZ: u32 = 168_000_000;
/// What TIM2 counts in QEMU. On a board it is half of the core's clock.
const TIMER_HZ: u32 = 1_000_000_000;

/// Microseconds since the start, from TIM2, which counts by itself: no interrupt that comes late
/// makes time run late.
pub struct Clock {
    timer: TIM2,
    high: u32,
    low: u32,
}

impl Clock {
    /// Starts to count, and to wake the core each millisecond.
    pub fn start(timer: TIM2, mut tick: SYST) -> Self {
        timer.psc().write(|w| w.psc().set((TIMER_HZ / 1_000_000 - 1) as u16));
        timer.cr1().write(|w| w.cen().enabled());
        tick.set_clock_source(SystClkSource::Core);
        tick.set_reload(CORE_HZ / 1_000 - 1);
        tick.clear_current();
        tick.enable_interrupt();
        tick.enable_counter();
        let low = timer.cnt().read().bits();
        Clock { timer, high: 0, low }
    }

    /// The time. To be asked at least once an hour, or a turn of the counter is missed.
    pub fn now(&mut self) -> Instant {
        let low = self.timer.cnt().read().bits();
        self.high += u32::from(low < self.low);
        self.low = low;
        Instant(u64::from(self.high) << 32 | u64::from(low))
    }
}
