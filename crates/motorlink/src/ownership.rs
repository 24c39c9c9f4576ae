//! Who owns the motors in motion. Sans I/O, for whatever is between programs and motors.
//!
//! A motor belongs to the program that last sent a request whose [`Motion`] says that it starts or changes
//! motion, or is unknown, and that the motor may have carried out. It belongs to it until another program
//! does so or takes the motor, or a stop of any program leaves the motor free. A motor that holds its
//! position after a stop stays with its owner. The owner is responsible for the end of the motion, also if
//! it has left.

use std::collections::{BTreeMap, BTreeSet};

use motorlink_proto::Motion;

/// The owners `P` of motors `M`.
#[derive(Debug, Clone)]
pub struct Ownership<M, P>(BTreeMap<M, State<P>>);

#[derive(Debug, Clone)]
struct State<P> {
    owner: Option<P>,
    /// Whether it has had an owner. Otherwise it may turn since before this value began.
    was_owned: bool,
    /// It was stopped and holds its position.
    is_held: bool,
    /// Requests under way that change its motion: whose they are, and who owns the motor after them.
    sent: Vec<(P, P)>,
    /// Programs whose requests nothing has interrupted: no stop, and no motion of another program.
    uninterrupted: BTreeSet<P>,
}

/// How a request ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Carried {
    /// The motor confirmed it.
    Out,
    /// It is unknown whether the motor has carried it out.
    Perhaps,
    /// It was refused, or not sent.
    Never,
}

impl<M, P> Default for Ownership<M, P> {
    fn default() -> Self {
        Ownership(BTreeMap::new())
    }
}

impl<P> Default for State<P> {
    fn default() -> Self {
        State {
            owner: None,
            was_owned: false,
            is_held: false,
            sent: Vec::new(),
            uninterrupted: BTreeSet::new(),
        }
    }
}

impl<M: Ord + Copy, P: Ord + Copy> Ownership<M, P> {
    /// A request of a program is sent.
    pub fn sent(&mut self, motor: M, by: P, motion: Motion) {
        let state = self.0.entry(motor).or_default();
        if motion.may_move() || motion.stops() {
            state.uninterrupted.clear();
        }
        if !motion.stops() {
            state.uninterrupted.insert(by);
        }
        if motion.may_be_owned() {
            state.sent.push((by, by));
        }
    }

    /// A request of a program is over.
    pub fn ended(&mut self, motor: M, by: P, motion: Motion, carried: Carried) {
        let state = self.0.entry(motor).or_default();
        if motion.may_be_owned()
            && let Some(at) = state.sent.iter().position(|(sender, _)| *sender == by)
        {
            let (_, owner) = state.sent.remove(at);
            // The owner stays if it was refused.
            if carried != Carried::Never {
                state.own(owner);
            }
        }
        if motion.stops() && carried == Carried::Out {
            self.stopped(motor, motion);
        }
    }

    /// The motor confirmed a stop.
    pub fn stopped(&mut self, motor: M, motion: Motion) {
        let Some(state) = self.0.get_mut(&motor) else { return };
        match motion {
            Motion::Holds => state.is_held = true,
            _ => state.owner = None,
        }
    }

    /// A stop is on its way: no request continues those before it.
    pub fn interrupt(&mut self, motor: M) {
        if let Some(state) = self.0.get_mut(&motor) {
            state.uninterrupted.clear();
        }
    }

    /// No request continues those before, of any motor.
    pub fn interrupt_all(&mut self) {
        self.0.values_mut().for_each(|state| state.uninterrupted.clear());
    }

    /// Whether nothing came between the requests of a program to this motor.
    pub fn is_uninterrupted(&self, motor: M, by: P) -> bool {
        self.0.get(&motor).is_some_and(|state| state.uninterrupted.contains(&by))
    }

    /// A program takes the motor. It turns on.
    pub fn take(&mut self, motor: M, by: P) {
        let state = self.0.entry(motor).or_default();
        state.owner = state.owner.map(|_| by);
        state.sent.iter_mut().for_each(|(_, owner)| *owner = by);
        state.uninterrupted.retain(|program| *program == by);
    }

    /// A program says that it owns a motor: it has moved it before this value began. Not if one has owned
    /// the motor since. Gives whether it owns it.
    pub fn claim(&mut self, motor: M, by: P) -> bool {
        let state = self.0.entry(motor).or_default();
        if !state.was_owned && state.sent.is_empty() {
            state.own(by);
        }
        state.owner == Some(by)
    }

    /// A program has left.
    pub fn forget(&mut self, gone: P) {
        for state in self.0.values_mut() {
            state.uninterrupted.remove(&gone);
        }
    }

    /// The motor has no owner any more. A request that is under way may give it one.
    pub fn free(&mut self, motor: M) {
        if let Some(state) = self.0.get_mut(&motor) {
            state.owner = None;
        }
    }

    /// A program lets go of all its motors, which turn on and have no owner.
    pub fn let_all_go(&mut self, by: P) {
        for state in self.0.values_mut() {
            state.owner = state.owner.filter(|owner| *owner != by);
            state.sent.retain(|(_, owner)| *owner != by);
        }
    }

    /// Who owns the motor, by the requests that are over.
    pub fn owner(&self, motor: M) -> Option<P> {
        self.0.get(&motor)?.owner
    }

    /// Whether a program owns the motor, or will by a request under way.
    pub fn is_own(&self, motor: M, by: P) -> bool {
        self.0.get(&motor).is_some_and(|state| {
            state.owner == Some(by) || state.sent.iter().any(|(_, owner)| *owner == by)
        })
    }

    /// Whether the motor is owned by a program, or will be by a request under way.
    pub fn is_owned(&self, motor: M) -> bool {
        self.owner(motor).is_some() || self.is_under_way(motor)
    }

    /// Whether a request is under way that changes the motion.
    pub fn is_under_way(&self, motor: M) -> bool {
        self.0.get(&motor).is_some_and(|state| !state.sent.is_empty())
    }

    /// Whether the motor holds its position after a stop, and nothing is under way that moves it.
    pub fn is_held(&self, motor: M) -> bool {
        self.0.get(&motor).is_some_and(|state| state.is_held && state.sent.is_empty())
    }

    /// The motors that have an owner.
    pub fn motors(&self) -> impl Iterator<Item = M> {
        self.0.iter().filter(|(_, state)| state.owner.is_some()).map(|(motor, _)| *motor)
    }

    /// The motors whose motion a program that leaves has to end: it owns them, or will by a request under
    /// way. If a program that `is_here` has a request under way, its end decides.
    pub fn left_by(&self, gone: P, is_here: impl Fn(P) -> bool) -> Vec<M> {
        let is_left = |state: &State<P>| {
            let is_own = state.owner == Some(gone) || state.sent.iter().any(|(_, it)| *it == gone);
            is_own && !state.sent.iter().any(|(_, it)| *it != gone && is_here(*it))
        };
        self.0.iter().filter(|(_, state)| is_left(state)).map(|(motor, _)| *motor).collect()
    }
}

impl<P> State<P> {
    fn own(&mut self, owner: P) {
        (self.owner, self.was_owned, self.is_held) = (Some(owner), true, false);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use Carried::{Never, Out, Perhaps};
    use Motion::{Aligns, Changes, Frees, Holds, Keeps, Starts, Unknown};

    type Motors = Ownership<u8, char>;

    fn asked(motors: &mut Motors, by: char, motion: Motion, carried: Carried) {
        motors.sent(1, by, motion);
        motors.ended(1, by, motion, carried);
    }

    #[test]
    fn whoever_last_changed_a_motion_owns_it() {
        for motion in [Starts, Changes, Unknown] {
            for carried in [Out, Perhaps] {
                let mut motors = Motors::default();
                asked(&mut motors, 'a', Starts, Out);
                asked(&mut motors, 'b', motion, carried);
                assert_eq!(motors.owner(1), Some('b'), "{motion:?} {carried:?}");
            }
            let mut motors = Motors::default();
            asked(&mut motors, 'a', Starts, Out);
            asked(&mut motors, 'b', motion, Never);
            assert_eq!(motors.owner(1), Some('a'), "{motion:?}");
        }
        for motion in [Keeps, Aligns] {
            let mut motors = Motors::default();
            asked(&mut motors, 'a', motion, Out);
            assert_eq!(motors.owner(1), None, "{motion:?}");
        }
    }

    #[test]
    fn a_confirmed_stop_of_any_program_ends_the_motion_and_a_motor_that_holds_stays_owned() {
        let after = |motion, carried| {
            let mut motors = Motors::default();
            asked(&mut motors, 'a', Starts, Out);
            asked(&mut motors, 'b', motion, carried);
            (motors.owner(1), motors.is_held(1))
        };
        assert_eq!(after(Frees, Out), (None, false));
        assert_eq!(after(Holds, Out), (Some('a'), true));
        assert_eq!(after(Frees, Perhaps), (Some('a'), false));
        assert_eq!(after(Holds, Never), (Some('a'), false));
        let mut motors = Motors::default();
        asked(&mut motors, 'b', Holds, Out);
        assert_eq!(motors.owner(1), None, "nobody owned it");
    }

    #[test]
    fn a_motion_ends_the_hold() {
        let mut motors = Motors::default();
        asked(&mut motors, 'a', Starts, Out);
        asked(&mut motors, 'a', Holds, Out);
        asked(&mut motors, 'b', Starts, Out);
        assert_eq!((motors.owner(1), motors.is_held(1)), (Some('b'), false));
    }

    #[test]
    fn who_takes_a_motor_owns_it_also_after_a_request_that_was_under_way() {
        let mut motors = Motors::default();
        motors.sent(1, 'a', Starts);
        motors.take(1, 'b');
        motors.ended(1, 'a', Starts, Out);
        assert_eq!(motors.owner(1), Some('b'));
        motors.take(2, 'b');
        assert_eq!(motors.owner(2), None, "it does not turn");
        motors.let_all_go('a');
        assert_eq!(motors.owner(1), Some('b'));
        motors.let_all_go('b');
        assert_eq!(motors.owner(1), None);
    }

    #[test]
    fn a_motor_that_was_never_owned_may_be_claimed() {
        let mut motors = Motors::default();
        assert!(!motors.is_own(1, 'a'));
        assert!(motors.claim(1, 'a'));
        assert!(motors.is_own(1, 'a') && !motors.is_own(1, 'b'));
        assert!(motors.claim(1, 'a') && !motors.claim(1, 'b'));
        asked(&mut motors, 'b', Frees, Out);
        assert!(!motors.is_own(1, 'a') && !motors.claim(1, 'a'), "it has been stopped since");
        motors.sent(2, 'a', Starts);
        assert!(motors.is_own(2, 'a') && !motors.is_own(2, 'b') && !motors.claim(2, 'b'));
        motors.ended(2, 'a', Starts, Never);
        assert!(!motors.is_own(2, 'a'), "it was not moved");
        assert!(motors.claim(2, 'b'));
    }

    #[test]
    fn a_program_that_leaves_ends_what_it_owns_and_what_it_has_begun() {
        let everybody = |_| true;
        let mut motors = Motors::default();
        asked(&mut motors, 'a', Starts, Out);
        motors.sent(2, 'a', Starts);
        motors.sent(3, 'b', Starts);
        assert_eq!(motors.left_by('a', everybody), [1, 2]);
        motors.ended(2, 'a', Starts, Perhaps);
        assert_eq!(motors.owner(2), Some('a'), "its end has to stop the motor");
        motors.sent(1, 'b', Starts);
        assert_eq!(motors.left_by('a', everybody), [2], "the end of b's request decides");
        assert_eq!(motors.left_by('a', |_| false), [1, 2], "b has left, too");
    }

    #[test]
    fn a_stop_and_the_motion_of_another_program_interrupt() {
        let mut motors = Motors::default();
        motors.sent(1, 'a', Keeps);
        motors.sent(1, 'b', Keeps);
        assert!(motors.is_uninterrupted(1, 'a') && motors.is_uninterrupted(1, 'b'));
        motors.sent(1, 'a', Starts);
        assert!(motors.is_uninterrupted(1, 'a') && !motors.is_uninterrupted(1, 'b'));
        motors.sent(1, 'b', Holds);
        assert!(!motors.is_uninterrupted(1, 'a') && !motors.is_uninterrupted(1, 'b'));
        motors.sent(1, 'a', Keeps);
        motors.interrupt(1);
        assert!(!motors.is_uninterrupted(1, 'a'));
        motors.sent(1, 'a', Keeps);
        motors.interrupt_all();
        assert!(!motors.is_uninterrupted(1, 'a'));
        motors.sent(1, 'a', Keeps);
        motors.take(1, 'b');
        assert!(!motors.is_uninterrupted(1, 'a'));
    }
}
