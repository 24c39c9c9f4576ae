//! The model, and steps of the world beside it.

use super::*;

/// Histories of `make test`. MODEL=2000 for more.
const HISTORIES: u64 = 100;
const STEPS: usize = 16;

fn command((line, motor): (&str, u8), bytes: &[u8], own: bool) -> Ask {
    let (line, bytes) = (line.to_owned(), bytes.to_vec());
    Ask::Command { line, motor, bytes, time_to_live: 1.0, continues: false, own }
}

fn read(motor: usize) -> Vec<u8> {
    if motor == 0 { vec![2, 2] } else { vec![0x9A, 0, 0, 0, 0, 0, 0, 0] }
}

fn name(motor: usize) -> MotorName {
    MotorName { line: MOTORS[motor].0.to_owned(), motor: MOTORS[motor].1 }
}

/// What docs/SAFETY.md says.
#[derive(Debug, Clone)]
struct Model {
    does: [Does; 3],
    owner: [Option<usize>; 3],
    /// Whether a program has owned it since the share began.
    owned: [bool; 3],
    /// Whether it was stopped since its last motion, and stays with its owner.
    held: [bool; 3],
    ending: [Ending; PROGRAMS],
    latched: bool,
}

impl Model {
    /// A stop as the share sends it.
    fn stop(&mut self, motor: usize) {
        (self.does[motor], self.owner[motor]) = match motor {
            0 => (Does::Rests, None),
            _ => (Does::Holds, self.owner[motor]),
        };
        self.held[motor] = true;
    }

    /// A program is gone.
    fn gone(&mut self, program: usize) {
        for motor in 0..3 {
            if self.owner[motor] != Some(program) {
                continue;
            }
            match self.ending[program] {
                Ending::Nothing => {}
                Ending::Stop => self.stop(motor),
                Ending::Off => self.does[motor] = Does::Rests,
            }
            self.owner[motor] = None;
        }
    }

    /// A program owns a motor, which it or another one has moved.
    fn own(&mut self, motor: usize, program: usize) {
        (self.owner[motor], self.owned[motor], self.held[motor]) = (Some(program), true, false);
    }
}

/// One of `0..most`.
fn draw(random: &mut u64, most: usize) -> usize {
    *random =
        random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*random >> 33) as usize % most
}

/// Plays one history. An error has what was done until then.
fn history(seed: u64) -> Result<(), String> {
    let mut random = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x5DEE_CE66;
    let motors = Mutex::new([Does::Rests; 3]);
    let clock = Clock::virtual_time();
    let drives = Arc::new(Drives { motors, is_cut: Mutex::default(), clock });
    let mut world = World::new(&drives);
    let mut model = Model {
        does: [Does::Rests; 3],
        owner: [None; 3],
        owned: [false; 3],
        held: [false; 3],
        ending: [Ending::Stop; PROGRAMS],
        latched: false,
    };
    let mut done: Vec<String> = Vec::new();
    for _ in 0..STEPS {
        let (p, m) = (draw(&mut random, PROGRAMS), draw(&mut random, 3));
        let what = draw(&mut random, 17);
        if world.programs[p].is_none() {
            world.join(p);
            model.ending[p] = [Ending::Stop, Ending::Off, Ending::Nothing][draw(&mut random, 3)];
            world.ask(p, Ask::Ending { motion: model.ending[p] }).unwrap();
            let silence = Some(SILENCE);
            world.ask(p, Ask::Deadline { silence, motion: None }).unwrap();
            done.push(format!("p{p} joins, ending {:?}", model.ending[p]));
        }
        done.push(step(&mut world, &mut model, (p, m, what)));
        world.run(0.1);
        let does = *drives.motors.lock().unwrap();
        if does != model.does {
            return Err(format!("{done:#?}\nthe motors do {does:?}, not {:?}", model.does));
        }
        for (program, motor) in (0..PROGRAMS).flat_map(|it| [0, 1, 2].map(|motor| (it, motor))) {
            if world.programs[program].is_some() {
                let asked = world.ask(program, command(MOTORS[motor], &read(motor), true));
                let owns = model.owner[motor] == Some(program);
                // After a line was cut a read may fail.
                if (asked == Err(Reason::Held)) == owns {
                    let why = format!("p{program} owns {:?}: {owns}, not {asked:?}", name(motor));
                    return Err(format!("{done:#?}\n{why}"));
                }
            }
        }
    }
    std::mem::forget(world);
    Ok(())
}

/// One step of the world and of the model. Gives what it was.
fn step(world: &mut World, model: &mut Model, (p, m, what): (usize, usize, usize)) -> String {
    let is_st = m == 0;
    match what {
        // A start, a ramp, a reference, or 0x88.
        0..=5 => {
            let (bytes, does): (&[u8], _) = match (is_st, what % 2) {
                (true, 0) => (&[3, 1], Does::Turns),
                (true, _) => (&[7, 220, 5, 0, 0, 100, 0], model.does[m]),
                (false, 0) => (&[0xA2, 0, 0, 0, 0, 4, 0, 0], Does::Turns),
                (false, _) => (&[0x88, 0, 0, 0, 0, 0, 0, 0], Does::Turns),
            };
            let asked = world.ask(p, command(MOTORS[m], bytes, false));
            if model.latched {
                assert_eq!(asked, Err(Reason::Latched));
            } else {
                assert!(asked.is_ok(), "{asked:?}");
                model.does[m] = does;
                model.own(m, p);
            }
            format!("p{p} moves {:?} with {bytes:x?}", MOTORS[m])
        }
        // A command whose reply is lost with the line: it is unknown whether the motor has it.
        6 => {
            *world.drives.is_cut.lock().unwrap() = [true; 2];
            let bytes: &[u8] = if is_st { &[3, 1] } else { &[0xA2, 0, 0, 0, 0, 4, 0, 0] };
            let asked = world.ask(p, command(MOTORS[m], bytes, false));
            *world.drives.is_cut.lock().unwrap() = [false; 2];
            world.run(0.5);
            match asked {
                Err(Reason::Latched) => assert!(model.latched),
                Err(Reason::Silent) => model.own(m, p),
                other => panic!("{other:?}"),
            }
            format!("p{p} moves {:?} on a line that is cut", MOTORS[m])
        }
        // Stops: of the protocol, and of the share.
        7 | 8 => {
            let bytes: &[u8] = match (is_st, what) {
                (true, _) => &[3, 2],
                (false, 7) => &[0x80, 0, 0, 0, 0, 0, 0, 0],
                (false, _) => &[0x81, 0, 0, 0, 0, 0, 0, 0],
            };
            world.ask(p, command(MOTORS[m], bytes, false)).unwrap();
            match bytes[0] {
                0x80 => (model.does[m], model.owner[m]) = (Does::Rests, None),
                _ => model.stop(m),
            }
            format!("p{p} sends {:?} {bytes:x?}", MOTORS[m])
        }
        9 => {
            world.ask(p, Ask::Stop { motor: Some(name(m)) }).unwrap();
            model.stop(m);
            format!("p{p} stops {:?}", MOTORS[m])
        }
        10 => {
            let ask = if model.latched { Ask::Release } else { Ask::Latch };
            world.ask(p, ask.clone()).unwrap();
            model.latched = !model.latched;
            format!("p{p} asks for {ask:?}")
        }
        11 => {
            let asked = world.ask(p, Ask::Claim { motor: name(m) });
            if !model.owned[m] {
                model.own(m, p);
            }
            match model.owner[m] == Some(p) {
                true => assert_eq!(asked, Ok(Answer::Claim)),
                false => assert_eq!(asked, Err(Reason::Held)),
            }
            format!("p{p} claims {:?}", MOTORS[m])
        }
        12 => {
            world.drop(p);
            model.gone(p);
            format!("p{p} is killed")
        }
        // The line is cut when it is killed, and back later. Another program may stop the motor meanwhile.
        13 => {
            let q = (p + 1) % PROGRAMS;
            let is_off = model.owner[m] == Some(p) && model.ending[p] == Ending::Off && !is_st;
            *world.drives.is_cut.lock().unwrap() = [true; 2];
            world.drop(p);
            world.run(0.1);
            model.gone(p);
            if world.programs[q].is_some() {
                world.ask(q, Ask::Stop { motor: Some(name(m)) }).unwrap();
                if !is_off {
                    model.stop(m);
                }
            }
            world.run(1.0);
            *world.drives.is_cut.lock().unwrap() = [false; 2];
            world.run(3.0);
            format!(
                "p{p} is killed while the lines are cut; p{q} stops {:?} if it is there",
                MOTORS[m]
            )
        }
        14 => {
            let turns = |motor: usize| model.owner[motor] == Some(p) && !model.held[motor];
            let owns = (0..3).any(turns) && model.ending[p] != Ending::Nothing;
            world.programs[p].as_mut().unwrap().lives = false;
            world.run(SILENCE + 0.2);
            let lapsed = world.hub.borrow_mut().take_lapsed();
            assert_eq!(lapsed.len(), usize::from(owns), "{lapsed:?}");
            match owns {
                true => {
                    world.programs[p] = None;
                    model.gone(p);
                }
                false => world.programs[p].as_mut().unwrap().lives = true,
            }
            format!("p{p} is frozen")
        }
        // A stop whose reply is lost with the line. It is sent again when the motor answers again.
        15 => {
            let ask = match ((p + m) % 2 == 0, is_st) {
                (true, _) => Ask::Stop { motor: Some(name(m)) },
                (false, true) => command(MOTORS[m], &[3, 2], false),
                (false, false) => command(MOTORS[m], &[0x81, 0, 0, 0, 0, 0, 0, 0], false),
            };
            *world.drives.is_cut.lock().unwrap() = [true; 2];
            let asked = world.ask(p, ask.clone());
            *world.drives.is_cut.lock().unwrap() = [false; 2];
            let confirmed = world.ask(p, command(MOTORS[m], &read(m), false));
            world.run(3.0);
            model.stop(m);
            format!(
                "p{p} stops {:?} on a line that is cut: {asked:?}, then reads: {confirmed:?}",
                MOTORS[m]
            )
        }
        // The share is killed, and started again.
        _ => {
            let new = World::new(&Arc::clone(&world.drives));
            // One that is dropped would stop the motors.
            std::mem::forget(std::mem::replace(world, new));
            (model.owner, model.owned, model.latched) = ([None; 3], [false; 3], false);
            "the share is killed and started again".to_owned()
        }
    }
}

#[test]
fn random_histories_end_as_the_model_says() {
    let histories = std::env::var("MODEL").map_or(HISTORIES, |it| it.parse().unwrap());
    for seed in 0..histories {
        if let Err(why) = history(seed) {
            panic!("history {seed}: {why}");
        }
    }
}
