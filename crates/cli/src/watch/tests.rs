//! The view without a terminal and without drives.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use motorlink::rmd::MotorId;
use motorlink::st::{Limits, MotorNumber, Profile, RegisterId, Request};
use motorlink::time::{Instant, Micros};
use motorlink_telemetry::acquisition::Rate;
use motorlink_telemetry::event::{Event, What};
use motorlink_telemetry::line::LineError;
use motorlink_telemetry::plan::{Poll, Read};
use motorlink_telemetry::sample::{Sample, Values};
use motorlink_telemetry::share::message::Protocol;
use motorlink_telemetry::signal::{Motor, Signal, Source};
use motorlink_telemetry::subscription::Record;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use ratatui::style::{Color, Modifier};

use super::keys::{Ask, Field, Selection, View};
use super::model::{Model, Port};
use super::row::{Row, Stop};
use super::settings::Item;
use super::values::Units;
use super::view::{self, Shown, Theme};
use crate::json::RmdUnits;
use crate::st::StUnits;

const PERIOD: Duration = Duration::from_millis(100);

fn units() -> Units {
    let st = StUnits { profile: Profile::Spec, raw: false, full_scale: None };
    Units { st, rmd: RmdUnits::default() }
}

fn st(number: u8) -> Motor {
    Motor::St(MotorNumber::new(number).unwrap())
}

fn rmd(number: u8) -> Motor {
    Motor::Rmd(MotorId::new(number).unwrap())
}

/// Two ST motors at the first port, three RMD motors at the second.
fn model() -> Model {
    let ports = vec![
        Port::new("st0".to_owned(), "./st0".to_owned(), Protocol::St),
        Port::new("can0".to_owned(), "slcan:./can0".to_owned(), Protocol::Rmd),
    ];
    let row = |port, motor, name: &str| Row::new(port, motor, name.to_owned(), PERIOD);
    let rows = vec![
        row(0, st(1), "st0:1"),
        row(0, st(2), "st0:2"),
        row(1, rmd(1), "can0:1"),
        row(1, rmd(2), "can0:2"),
        row(1, rmd(32), "can0:32"),
    ];
    let mut model = Model::new("watch 1".into(), units(), ports, rows, PERIOD);
    give(&mut model, 0, st(1), &[("STATUS", 6), ("SPEED_MEAS", 1500), ("TORQUE_MEAS", -1234)]);
    give(&mut model, 0, st(1), &[("HEATS_TEMP", 45), ("BUS_VOLTAGE", 325), ("FLAGS", 0)]);
    give(&mut model, 0, st(2), &[("STATUS", 10), ("SPEED_MEAS", 0), ("FLAGS", 0x0002_0002)]);
    give(&mut model, 1, rmd(1), &[("speed_dps", -360), ("iq_amps", 64)]);
    give(
        &mut model,
        1,
        rmd(1),
        &[("temperature_celsius", 31), ("voltage_volts", 241), ("errors", 0)],
    );
    give(&mut model, 1, rmd(2), &[("speed_dps", 0), ("errors", 0b1000)]);
    let rate = |signal, achieved| Rate {
        signal,
        asked: Micros::from(PERIOD),
        predicted: Micros::from(PERIOD),
        achieved,
    };
    model.rates(0, &[rate(Signal::named(st(1), "SPEED_MEAS").unwrap(), 9.9)]);
    model
}

/// A reply with these values.
fn give(model: &mut Model, port: usize, motor: Motor, values: &[(&str, i64)]) {
    let signals: Vec<Signal> =
        values.iter().map(|(name, _)| Signal::named(motor, name).unwrap()).collect();
    let sample = |(_, digits): &(&str, i64)| Ok(Sample { digits: *digits, value: *digits as f64 });
    let poll = Poll { motor, period: Micros::from(PERIOD), read: Read::Confirm, signals };
    let values = Values {
        poll: Arc::new(poll),
        instant: Instant(0),
        requested: Instant(0),
        replied: Instant(0),
        samples: values.iter().map(sample).collect(),
    };
    model.take(port, &Record::Values(Arc::new(values)));
}

fn happens(model: &mut Model, port: usize, what: What) {
    model.take(port, &Record::Event(Arc::new(Event { time: Instant(0), what })));
}

fn press(place: &mut Selection, code: KeyCode) -> Option<Ask> {
    press_with(place, code, KeyModifiers::NONE)
}

fn press_with(place: &mut Selection, code: KeyCode, modifiers: KeyModifiers) -> Option<Ask> {
    let list = |row| Item::of(if row < 2 { st(1) } else { rmd(1) }, &units());
    place.press(KeyEvent::new(code, modifiers), list, |item| item.unwritable(&units()))
}

fn type_in(place: &mut Selection, text: &str) {
    for letter in text.chars() {
        assert_eq!(press(place, KeyCode::Char(letter)), None, "{letter}");
    }
}

/// What is drawn.
fn drawn(model: &Model, place: &Selection, width: u16, height: u16) -> Terminal<TestBackend> {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    let read = BTreeMap::new();
    let shown = Shown { model, place, read: &read };
    terminal.draw(|frame| view::draw(frame, &shown, &Theme::plain())).unwrap();
    terminal
}

fn lines(terminal: &Terminal<TestBackend>) -> Vec<String> {
    let buffer = terminal.backend().buffer();
    let width = usize::from(buffer.area.width);
    let cells: Vec<&str> = buffer.content.iter().map(|cell| cell.symbol()).collect();
    cells.chunks(width).map(|line| line.concat().trim_end().to_owned()).collect()
}

#[test]
fn each_motor_has_a_row_with_its_values() {
    let lines = lines(&drawn(&model(), &Selection::new(5), 80, 24));
    assert_eq!(
        lines[..9],
        [
            "motorlink watch: 5 motors on 2 ports, 10.0 Hz asked for",
            " motor      state                speed     current   temp supply got/asked trend",
            ">st0:1      RUN               1500 rpm  -1234 s16A  45 °C  325 V  9.9/10.0 █",
            " st0:2      FAULT_NOW            0 rpm           -      -      -         - ▁",
            " can0:1     turning           -360 °/s     1.031 A  31 °C 24.1 V         - █",
            " can0:2     ERROR                0 °/s           -      -      -         - ▁",
            " can0:32    -                        -           -      -      -         -",
            "st0:2: present: OVER_VOLT (bus voltage too high)",
            "can0:2: over temperature protection",
        ]
    );
    assert_eq!(
        lines[22..],
        [
            "SPACE STOP ALL  up/down select  Enter details  r registers  s stop  u unlatch",
            "n new motors  ? help  q quit",
        ]
    );
}

#[test]
fn a_port_that_is_gone_and_back_is_said() {
    let mut model = model();
    happens(&mut model, 1, What::Lost(LineError::Closed.into()));
    let gone = lines(&drawn(&model, &Selection::new(5), 80, 24));
    assert!(gone[4].starts_with(" can0:1     PORT GONE 0s             -"), "{gone:?}");
    let text = "port gone, opened again when it is back: can0 for 0s";
    assert!(gone.contains(&text.to_owned()), "{gone:?}");
    let details = lines(&drawn(
        &model,
        &Selection { view: View::Details, row: 2, ..Selection::new(5) },
        80,
        24,
    ));
    assert_eq!(details[2], "port gone for 0s: the port was closed");
    happens(&mut model, 1, What::Back);
    let back = lines(&drawn(&model, &Selection::new(5), 80, 24));
    assert!(back[4].starts_with(" can0:1     turning"), "{back:?}");
    assert!(back.iter().any(|line| line.ends_with("can0: the port is back after 0s")), "{back:?}");
}

#[test]
fn a_silent_motor_has_no_present_value() {
    let mut model = model();
    happens(&mut model, 0, What::Silent(st(1), LineError::Closed.into()));
    let silent = lines(&drawn(&model, &Selection::new(5), 80, 24));
    assert!(silent[2].starts_with(">st0:1      NO ANSWER 0s             -"), "{silent:?}");
    happens(&mut model, 0, What::Answers(st(1)));
    let answers = lines(&drawn(&model, &Selection::new(5), 80, 24));
    assert!(answers[2].starts_with(">st0:1      RUN"), "{answers:?}");
}

/// Stops each motor: the last one does not confirm it.
fn stop_all_but_the_last(model: &mut Model) {
    let numbers: Vec<u64> = (0..5).map(|row| model.stopping(row)).collect();
    assert_eq!(model.state(&model.rows[0]).0, "stopping ...");
    (0..4).for_each(|row| model.stopped(row, numbers[row], Ok(())));
    model.stopped(4, numbers[4], Err("no reply".to_owned()));
}

#[test]
fn a_stop_that_is_not_confirmed_is_said_in_bold_words_in_every_view() {
    let mut model = model();
    stop_all_but_the_last(&mut model);
    let bad = "stop NOT CONFIRMED, may still be turning: can0:32";
    for view in [View::Motors, View::Details, View::Settings] {
        for shows_help in [false, true] {
            for (width, height) in [(80, 24), (200, 60), (50, 5)] {
                let place = Selection { view, shows_help, ..Selection::new(5) };
                let terminal = drawn(&model, &place, width, height);
                let lines = lines(&terminal);
                let at = lines.iter().position(|line| line == bad);
                let at = at.unwrap_or_else(|| panic!("{lines:?}"));
                let cell = terminal.backend().buffer().cell((0, at as u16)).unwrap().clone();
                assert!(cell.modifier.contains(Modifier::BOLD));
                assert_eq!(cell.fg, Color::Reset);
            }
        }
    }
    let lines = lines(&drawn(&model, &Selection::new(5), 80, 24));
    let why = "stop NOT CONFIRMED by can0:32, repeated after the next reply: no reply";
    assert!(lines.contains(&why.to_owned()), "{lines:?}");
    let good = "stop confirmed by 4 of 5: st0:1 st0:2 can0:1 can0:2";
    assert!(lines.contains(&good.to_owned()), "{lines:?}");
    assert!(lines[7].starts_with(" can0:32    NOT CONFIRMED"), "{lines:?}");
}

#[test]
fn a_stop_of_a_motor_that_the_drive_does_not_have_is_no_alarm() {
    let mut model = model();
    let number = model.stopping(0);
    model.has_no_motor(0, number);
    assert_eq!(model.rows[0].stop, Stop::None);
    assert!(model.due_stops(std::time::Instant::now()).is_empty());
    let lines = lines(&drawn(&model, &Selection::new(5), 80, 24));
    assert!(!lines.iter().any(|line| line.contains("NOT CONFIRMED")), "{lines:?}");
    assert!(
        lines.iter().any(|line| line.contains("st0:1: the drive has no such motor")),
        "{lines:?}"
    );
}

#[test]
fn a_stop_that_is_not_confirmed_is_repeated_when_the_motor_answers_until_it_is_confirmed() {
    let mut model = model();
    let later = || std::time::Instant::now() + Duration::from_secs(2);
    stop_all_but_the_last(&mut model);
    assert!(model.due_stops(later()).is_empty(), "it does not answer");
    give(&mut model, 1, rmd(32), &[("speed_dps", 360)]);
    assert!(model.due_stops(std::time::Instant::now()).is_empty(), "not too often");
    assert_eq!(model.due_stops(later()), [4]);
    let number = model.stopping(4);
    assert!(model.due_stops(later()).is_empty(), "it is under way");
    assert_eq!(model.state(&model.rows[4]).0, "NOT CONFIRMED");
    let said = model.events.len();
    model.stopped(4, number, Err("no reply".to_owned()));
    assert_eq!(model.events.len(), said, "the same result is said once");
    give(&mut model, 1, rmd(32), &[("speed_dps", 360)]);
    assert_eq!(model.due_stops(later()), [4]);
    let number = model.stopping(4);
    model.stopped(4, number, Ok(()));
    assert!(model.due_stops(later()).is_empty());
    assert_eq!(model.state(&model.rows[4]).0, "turning");
}

#[test]
fn only_the_result_of_the_last_stop_counts() {
    let mut model = model();
    let (first, second) = (model.stopping(0), model.stopping(0));
    model.stopped(0, first, Ok(()));
    assert_eq!(model.rows[0].stop, Stop::UnderWay);
    model.stopped(0, second, Err("no reply".to_owned()));
    assert_eq!(model.state(&model.rows[0]).0, "NOT CONFIRMED");
}

#[test]
fn what_does_not_fit_is_counted() {
    let mut model = model();
    for number in [1, 2, 32] {
        give(&mut model, 1, rmd(number), &[("errors", 0b1000)]);
    }
    let lines = lines(&drawn(&model, &Selection::new(5), 80, 12));
    assert!(lines.contains(&"... 2 more lines: Enter shows one motor".to_owned()), "{lines:?}");
}

#[test]
fn the_latch_is_always_in_view() {
    let mut model = model();
    happens(&mut model, 0, What::Latched("ann".into()));
    let some = lines(&drawn(&model, &Selection::new(5), 80, 24));
    assert!(
        some[1].starts_with("LATCHED (u releases it): motion of st0 is refused since ann"),
        "{some:?}"
    );
    happens(&mut model, 1, What::Latched("ann".into()));
    for view in [View::Motors, View::Details, View::Settings] {
        let place = Selection { view, ..Selection::new(5) };
        for (width, height) in [(80, 24), (200, 60), (40, 10)] {
            let lines = lines(&drawn(&model, &place, width, height));
            assert!(lines[1].starts_with("LATCHED (u releases it): every motion"), "{lines:?}");
        }
    }
    (0..2).for_each(|port| happens(&mut model, port, What::Released("ann".into())));
    assert!(model.latched().is_none());
    let place = Selection { field: Field::Release, ..Selection::new(5) };
    let lines = lines(&drawn(&model, &place, 80, 24));
    assert!(lines.contains(&"no latch is set: any key goes back _".to_owned()), "{lines:?}");
}

#[test]
fn nothing_panics_on_small_terminals_and_the_selected_motor_is_in_view() {
    let mut model = model();
    for row in 0..5 {
        let number = model.stopping(row);
        model.stopped(row, number, Err("a long story ".repeat(20)));
    }
    happens(&mut model, 0, What::Latched("ann".into()));
    for view in [View::Motors, View::Details, View::Settings] {
        for shows_help in [false, true] {
            for (width, height) in [(1, 1), (2, 3), (20, 5), (40, 10), (80, 24), (200, 60)] {
                let items = Item::of(st(1), &units());
                let place = Selection { view, shows_help, items, row: 4, ..Selection::new(5) };
                drawn(&model, &place, width, height);
            }
        }
    }
    let place = Selection { row: 4, ..Selection::new(5) };
    for (width, height) in [(20, 5), (40, 10)] {
        let lines = lines(&drawn(&model, &place, width, height));
        assert!(lines.iter().any(|line| line.starts_with(">can0:32")), "{lines:?}");
        assert!(lines.iter().any(|line| line.starts_with("SPACE STOP ALL")), "{lines:?}");
    }
}

#[test]
fn details_have_all_signals_and_the_reason_of_a_refusal() {
    let mut model = model();
    let signal = Signal { motor: st(1), source: Source::Register(RegisterId::MOTOR_POWER) };
    happens(&mut model, 0, What::Refused(vec![signal], LineError::Reply.into()));
    let place = Selection { view: View::Details, ..Selection::new(5) };
    let lines = lines(&drawn(&model, &place, 80, 24));
    assert_eq!(lines[1], "st0:1  RUN  on ./st0");
    assert_eq!(lines[2], "no fault is reported");
    assert!(lines[3].ends_with("      age   got Hz    asked possible"), "{lines:?}");
    assert!(lines[4].starts_with("STATUS        RUN (0x6)"), "{lines:?}");
    let speed = lines.iter().find(|line| line.starts_with("SPEED_MEAS    1500 rpm  ")).unwrap();
    assert!(speed.ends_with("     0.0s      9.9     10.0     10.0"), "{speed}");
    let power = lines.iter().find(|line| line.starts_with("MOTOR_POWER")).unwrap();
    assert!(power.starts_with("MOTOR_POWER   none: the reply does not fit"), "{power}");
    let trend = lines.iter().find(|line| line.starts_with("speed 1500 rpm to 1500 rpm  ")).unwrap();
    assert!(trend.ends_with(" █"), "{trend}");
    assert!(lines.iter().any(|line| line.starts_with("replies 2, silent 0 times")), "{lines:?}");
}

#[test]
fn stop_all_works_from_every_view_and_while_typing() {
    let item = Item::Register(RegisterId::SPEED_KP);
    let fields = [Field::None, Field::Search, Field::Edit(item, "12".to_owned()), Field::Release];
    let keys = [
        (KeyCode::Char(' '), KeyModifiers::NONE),
        (KeyCode::Char('!'), KeyModifiers::SHIFT),
        (KeyCode::F(12), KeyModifiers::NONE),
        (KeyCode::Char('x'), KeyModifiers::CONTROL),
    ];
    for view in [View::Motors, View::Details, View::Settings] {
        for field in &fields {
            for (code, modifiers) in keys {
                for shows_help in [false, true] {
                    let mut place = Selection { view, shows_help, ..Selection::new(5) };
                    place.field = field.clone();
                    let asked = press_with(&mut place, code, modifiers);
                    assert_eq!(asked, Some(Ask::StopAll), "{view:?} {field:?} {code:?}");
                    assert_eq!(place.field, *field);
                }
            }
        }
    }
}

#[test]
fn the_latch_is_released_after_a_y_only() {
    for (code, asked) in [
        (KeyCode::Char('y'), Some(Ask::Release)),
        (KeyCode::Char('n'), None),
        (KeyCode::Enter, None),
        (KeyCode::Esc, None),
        (KeyCode::Char('u'), None),
    ] {
        let mut place = Selection::new(5);
        assert_eq!(press(&mut place, KeyCode::Char('u')), None);
        assert_eq!(press(&mut place, code), asked, "{code:?}");
        assert_eq!(place.field, Field::None);
    }
}

#[test]
fn a_register_is_found_and_edited() {
    let mut place = Selection::new(5);
    press(&mut place, KeyCode::Char('r'));
    assert_eq!(place.view, View::Settings);
    type_in(&mut place, "/speed_k");
    assert_eq!(place.search, "speed_k");
    press(&mut place, KeyCode::Enter);
    let names: Vec<String> = place.found().iter().map(Item::name).collect();
    assert_eq!(names[..3], ["SPEED_KP", "SPEED_KI", "SPEED_KD"]);
    press(&mut place, KeyCode::Down);
    type_in(&mut place, "e8x");
    press(&mut place, KeyCode::Backspace);
    type_in(&mut place, "00");
    let item = Item::Register(RegisterId::SPEED_KI);
    assert_eq!(press(&mut place, KeyCode::Enter), Some(Ask::Write(item, "800".to_owned())));
    // An empty value and Esc write nothing.
    type_in(&mut place, "e");
    assert_eq!(press(&mut place, KeyCode::Enter), None);
    type_in(&mut place, "e12");
    assert_eq!(press(&mut place, KeyCode::Esc), None);
    assert_eq!(place.field, Field::None);
    press(&mut place, KeyCode::Esc);
    assert_eq!((place.view, place.search.as_str()), (View::Settings, ""));
    press(&mut place, KeyCode::Esc);
    assert_eq!(place.view, View::Motors);
}

#[test]
fn registers_that_move_the_motor_are_not_edited() {
    let moving = [
        RegisterId::PFC_DCBUS_REF,
        RegisterId::TARGET_MOTOR,
        RegisterId::CONTROL_MODE,
        RegisterId::TORQUE_REF,
        RegisterId::FLUX_REF,
        RegisterId::RAMP_FINAL_SPEED,
    ];
    for register in moving {
        let why = Item::Register(register).unwritable(&units()).unwrap();
        assert!(why.contains("makes the drive act"), "{why}");
    }
    for profile in Profile::ALL {
        let mut units = units();
        units.st.profile = profile;
        assert!(Item::Register(RegisterId::IQ_SPEEDMODE).unwritable(&units).is_some());
    }
    let mut place = Selection::new(5);
    type_in(&mut place, "r/CONTROL_MODE");
    press(&mut place, KeyCode::Enter);
    type_in(&mut place, "e");
    assert_eq!(place.field, Field::None);
    assert!(place.message.clone().unwrap().0.starts_with("CONTROL_MODE makes the drive act"));
    let reads = Item::Register(RegisterId::SPEED_MEAS).unwritable(&units());
    assert_eq!(reads.unwrap(), "SPEED_MEAS can only be read");
    assert_eq!(Item::Register(RegisterId::SPEED_KP).unwritable(&units()), None);
    assert_eq!(Item::Gain(0).unwritable(&units()), None);
}

#[test]
fn no_limit_applies_to_what_is_edited() {
    let limits = Limits { speed_rpm: Some(0), current_s16a: Some(0) };
    for profile in Profile::ALL {
        let mut units = units();
        units.st.profile = profile;
        for item in Item::of(st(1), &units).into_iter().filter(|it| it.unwritable(&units).is_none())
        {
            let Item::Register(register) = item else { panic!("{item:?}") };
            let write = Request::SetRegister { register, value: &[0xFF; 4] };
            assert_eq!(limits.check(&write), Ok(()), "{register}");
        }
    }
}

#[test]
fn keys_that_work_in_every_view_do_so() {
    for view in [View::Motors, View::Details, View::Settings] {
        let at = || Selection { view, ..Selection::new(5) };
        assert_eq!(press(&mut at(), KeyCode::Char('s')), Some(Ask::Stop));
        assert_eq!(press(&mut at(), KeyCode::Char('n')), Some(Ask::Find));
        assert_eq!(press(&mut at(), KeyCode::Char('q')), Some(Ask::Quit));
        let mut place = at();
        press(&mut place, KeyCode::Char('r'));
        assert_eq!(place.view, View::Settings);
        assert_eq!(place.found().len(), Item::of(st(1), &units()).len());
        let mut place = at();
        press(&mut place, KeyCode::Char('?'));
        assert!(place.shows_help);
        let mut place = at();
        press(&mut place, KeyCode::Esc);
        assert_eq!(place.view, View::Motors);
    }
}
