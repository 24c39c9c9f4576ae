use super::*;

const DEADLINE: Micros = Micros::from_millis(300);

/// A page and a server on a virtual clock.
struct Bench {
    man: DeadMan,
    now: Instant,
    beat: u32,
    frame: u32,
}

impl Bench {
    /// A page that is alive.
    fn new() -> Self {
        let mut bench = Bench {
            man: DeadMan::new(DEADLINE, Arc::default()),
            now: Instant(5_000_000),
            beat: 0,
            frame: 0,
        };
        bench.live(1);
        bench
    }

    /// A page whose motor turns.
    fn turning(hold: bool) -> Self {
        let mut bench = Bench::new();
        bench.start(hold).expect("a live page may start");
        bench
    }

    fn start(&mut self, hold: bool) -> Result<(), Refusal> {
        let ticket = self.man.ticket(Some(motor(1)));
        self.man.permit(&ticket, hold, self.now)
    }

    fn wait(&mut self, ms: u32) -> Option<Lapse> {
        self.now += Micros::from_millis(ms);
        self.man.poll(self.now)
    }

    fn send_beat(&mut self) {
        self.beat = self.man.beat(self.now, 0.0).beat;
    }

    fn sign(&self, beat: u32, frame: u32, held: bool) -> Alive {
        Alive { beat, frame, held, at: 0.0 }
    }

    fn hear(&mut self, sign: Alive) -> Option<Lapse> {
        self.man.hear(&sign, self.now)
    }

    /// Beats each 50 ms and signs of life each 100 ms. The first lapse.
    fn live(&mut self, times: u32) -> Option<Lapse> {
        for _ in 0..times {
            self.send_beat();
            let lapse = self.wait(50);
            self.send_beat();
            let lapse = lapse.or(self.wait(50));
            self.frame += 6;
            let sign = self.sign(self.beat, self.frame, true);
            if let Some(lapse) = lapse.or(self.hear(sign)) {
                return Some(lapse);
            }
        }
        None
    }
}

fn motor(number: u8) -> MotorName {
    MotorName { line: "st0".to_owned(), motor: number }
}

fn reason(result: Result<(), Refusal>) -> Option<Reason> {
    result.err().map(|refusal| refusal.reason)
}

const SILENT: Option<Lapse> = Some(Lapse::Silent(DEADLINE));

#[test]
fn a_live_page_never_lapses() {
    let mut bench = Bench::turning(true);
    assert_eq!(bench.live(10_000), None);
    assert!(bench.man.beats.len() < 10, "beats that are too old are forgotten");
}

#[test]
fn without_signs_of_life_it_lapses_at_the_deadline_and_once() {
    let mut bench = Bench::turning(false);
    assert_eq!(bench.man.due(), Some(bench.now + DEADLINE));
    assert_eq!(bench.wait(299), None);
    assert_eq!(bench.wait(1), SILENT);
    assert_eq!(bench.wait(1000), None);
    assert_eq!(bench.man.due(), None);
}

#[test]
fn a_page_without_motion_has_nothing_to_lose() {
    let mut bench = Bench::new();
    assert_eq!(bench.man.due(), None);
    assert_eq!(bench.wait(10_000), None);
    assert_eq!(reason(bench.start(false)), Some(Reason::Lapsed));
}

#[test]
fn a_page_that_gave_no_sign_of_life_starts_nothing() {
    let mut man = DeadMan::new(DEADLINE, Arc::default());
    let ticket = man.ticket(None);
    assert_eq!(reason(man.permit(&ticket, false, Instant(0))), Some(Reason::Lapsed));
}

#[test]
fn a_frame_counts_once() {
    let mut bench = Bench::turning(false);
    let frame = bench.frame;
    let mut lapse = None;
    for _ in 0..6 {
        bench.send_beat();
        lapse = lapse.or(bench.wait(50));
        let sign = bench.sign(bench.beat, frame, true);
        lapse = lapse.or(bench.hear(sign));
    }
    assert_eq!(lapse, SILENT, "the browser draws nothing");
}

#[test]
fn a_beat_that_is_older_than_the_deadline_does_not_count() {
    for (age, is_dead) in [(299, false), (301, true)] {
        let mut bench = Bench::new();
        bench.send_beat();
        let old = bench.beat;
        bench.now += Micros::from_millis(age);
        let sign = bench.sign(old, bench.frame + 1, true);
        bench.hear(sign);
        assert_eq!(bench.start(false).is_err(), is_dead, "{age} ms");
    }
}

#[test]
fn a_beat_that_was_never_sent_does_not_count() {
    let mut bench = Bench::turning(false);
    bench.wait(299);
    let sign = bench.sign(bench.beat + 1, bench.frame + 1, true);
    assert_eq!(bench.hear(sign), None);
    assert_eq!(bench.wait(1), SILENT);
}

#[test]
fn a_burst_after_a_delay_does_not_revive() {
    let mut bench = Bench::turning(true);
    // Signs of life wait in a proxy for a second.
    let signs: Vec<_> = (0..10)
        .map(|at| {
            bench.send_beat();
            let sign = bench.sign(bench.beat, bench.frame + 1 + at, true);
            bench.now += Micros::from_millis(100);
            sign
        })
        .collect();
    let lapses: Vec<_> = signs.into_iter().filter_map(|sign| bench.hear(sign)).collect();
    assert_eq!(lapses, [Lapse::Silent(DEADLINE)], "it stops once, and nothing starts it again");
    assert_eq!(bench.man.due(), None);
}

#[test]
fn after_a_pause_of_the_server_the_deadline_goes_first() {
    let mut bench = Bench::turning(false);
    bench.send_beat();
    // SIGSTOP: the page went on, its signs of life wait, and poll was not called.
    bench.now += Micros::from_millis(2000);
    let sign = bench.sign(bench.beat, bench.frame + 1, true);
    assert_eq!(bench.hear(sign), SILENT);
}

#[test]
fn a_released_key_stops_what_it_held_and_nothing_else() {
    for (hold, lapse) in [(true, Some(Lapse::Released)), (false, None)] {
        let mut bench = Bench::turning(hold);
        bench.send_beat();
        let sign = bench.sign(bench.beat, bench.frame + 1, false);
        assert_eq!(bench.hear(sign), lapse);
        assert_eq!(bench.live(10), None);
    }
}

#[test]
fn a_key_that_is_up_stops_even_in_a_sign_that_is_too_late() {
    let mut bench = Bench::turning(true);
    let sign = bench.sign(0, 0, false);
    assert_eq!(bench.hear(sign), Some(Lapse::Released));
}

#[test]
fn all_motion_of_a_page_depends_on_the_key_once_some_does() {
    let mut bench = Bench::turning(true);
    bench.start(false).expect("another motor");
    let sign = bench.sign(bench.beat, bench.frame + 1, false);
    assert_eq!(bench.hear(sign), Some(Lapse::Released));
}

#[test]
fn a_command_from_before_a_lapse_moves_nothing_after_it() {
    let mut bench = Bench::turning(false);
    let ticket = bench.man.ticket(Some(motor(1)));
    assert_eq!(bench.wait(300), SILENT);
    bench.live(1);
    assert_eq!(reason(bench.man.permit(&ticket, false, bench.now)), Some(Reason::Overtaken));
    bench.start(false).expect("a new command");
}

#[test]
fn a_command_with_a_key_that_went_up_moves_nothing() {
    let mut bench = Bench::new();
    let ticket = bench.man.ticket(Some(motor(1)));
    let sign = bench.sign(bench.beat, bench.frame + 1, false);
    bench.hear(sign);
    // It is down again, but the command is from before.
    bench.live(1);
    assert_eq!(reason(bench.man.permit(&ticket, true, bench.now)), Some(Reason::Lapsed));
    bench.man.permit(&ticket, false, bench.now).expect("a command without hold-to-run");
}

#[test]
fn a_stop_overtakes_earlier_commands_to_that_motor() {
    let mut bench = Bench::new();
    let (one, two) = (bench.man.ticket(Some(motor(1))), bench.man.ticket(Some(motor(2))));
    bench.man.stop(Some(&motor(1)));
    assert_eq!(reason(bench.man.permit(&one, false, bench.now)), Some(Reason::Overtaken));
    bench.man.permit(&two, false, bench.now).expect("the other motor");
    let two = bench.man.ticket(Some(motor(2)));
    bench.man.stop(None);
    assert_eq!(reason(bench.man.permit(&two, false, bench.now)), Some(Reason::Overtaken));
}

#[test]
fn a_stop_of_another_page_overtakes_at_once_and_that_of_a_program_when_it_is_known() {
    let mut bench = Bench::new();
    let mut other = DeadMan::new(DEADLINE, Arc::clone(&bench.man.shared));
    for all in [false, true] {
        let stopped = motor(1);
        let stopped = (!all).then_some(&stopped);
        let ticket = bench.man.ticket(Some(motor(1)));
        other.stop(stopped);
        assert_eq!(reason(bench.man.permit(&ticket, false, bench.now)), Some(Reason::Overtaken));
        let ticket = bench.man.ticket(Some(motor(1)));
        bench.man.permit(&ticket, false, bench.now).expect("a command behind the stop");
        bench.man.stopped(stopped);
        assert_eq!(reason(bench.man.permit(&ticket, false, bench.now)), Some(Reason::Overtaken));
    }
}

#[test]
fn what_a_page_lets_go_stops_and_needs_a_new_command() {
    let mut bench = Bench::turning(false);
    assert_eq!(bench.man.end(Lapse::LetGo), Some(Lapse::LetGo));
    assert_eq!(bench.man.end(Lapse::LetGo), None);
    assert_eq!(bench.wait(1000), None);
}

#[test]
fn a_beat_says_when_the_page_was_heard_and_whether_it_holds_motors() {
    let mut bench = Bench::turning(false);
    bench.wait(20);
    let beat = bench.man.beat(bench.now, 7.5);
    assert_eq!((beat.wall, beat.at, beat.since, beat.holds), (7.5, Some(0.0), 20.0, true));
}
