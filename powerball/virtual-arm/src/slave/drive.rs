//! The drive behind the bus: CiA 402 state machine, modes, brake, commutation search.

use super::arm::Module;
use super::process::{Reference, spline};
use crate::simulation::{Gains, Servo};
use powerball_bus::cia402::{Command, Controlword, Mode, State, Statusword};

/// A brake bites and lets go after this time, s.
const BRAKE_TIME: f64 = 0.02;
/// A quick stop brakes this many times as hard as a joint usually may.
const QUICK: f64 = 2.0;
/// Below this velocity a joint stands still, rad/s.
const STILL: f64 = 2e-3;
/// The commutation search: how long, s, and how far the joint jerks, rad.
const SEARCH: (f64, f64) = (0.4, 2e-3);
/// A profile position has arrived within this, rad.
const ARRIVED: f64 = 2e-4;

/// The commands from the bus to the drive, read from its dictionary at each tick.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Inputs {
    /// Target of profile position, rad.
    pub(super) target: f64,
    /// Target of the velocity mode, rad/s.
    pub(super) velocity: f64,
    /// Interpolation set-point, rad, and its period, s.
    pub(super) point: f64,
    pub(super) period: f64,
    /// Periods without a fresh set-point that are borne; 0 for any number.
    pub(super) patience: f64,
    /// Torque that is fed forward, or the target of the current mode, N·m.
    pub(super) torque: f64,
    /// Profile velocity and acceleration, rad/s and rad/s².
    pub(super) profile: [f64; 2],
    /// Software limits, rad; no limits where both are equal.
    pub(super) limits: [f64; 2],
    /// Following error that is borne, rad.
    pub(super) window: f64,
    /// Torque limit, N·m.
    pub(super) torque_limit: f64,
    /// The brake is commanded to close by 0x60FE.
    pub(super) brake: bool,
}

/// Why a drive trips by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Trip {
    /// Following error too large: a fault.
    Following,
    /// No fresh set-point: a quick stop.
    Starved,
}

/// One drive.
#[derive(Clone, Debug)]
pub(super) struct Drive {
    module: Module,
    state: State,
    word: Controlword,
    mode: Mode,
    servo: Servo,
    pub(super) reference: Reference,
    /// The last four interpolation points, and the time since the last of them began to count, s.
    points: [f64; 4],
    phase: f64,
    starving: f64,
    interpolating: bool,
    /// Remaining time of the commutation search, s; `search_from` is the position at which it began.
    search: f64,
    search_from: Option<f64>,
    /// Profile position: where to, what follows, whether the hand has been shaken.
    profile: Option<f64>,
    next: Option<f64>,
    acknowledged: bool,
    limited: bool,
    halted: bool,
    /// Time since the brake was commanded to another state than its own, s.
    brake_wait: f64,
    brake_closed: bool,
    /// The brake bites and does not let go.
    pub(super) brake_stuck: bool,
    /// Motor supply is there.
    pub(super) supply: bool,
    /// The cause that tripped the drive, if it was not reported yet.
    pub(super) trip: Option<Trip>,
    /// Torque of the last tick, N·m.
    pub(super) torque: f64,
}

impl Drive {
    pub(super) fn new(module: Module, [inertia, friction]: [f64; 2]) -> Self {
        let servo = Servo::new(Gains::for_inertia(inertia, module.torque, friction));
        let search = if module.commutated { 0.0 } else { SEARCH.0 };
        Drive {
            module,
            state: State::SwitchOnDisabled,
            word: Controlword::default(),
            mode: Mode::None,
            servo,
            reference: Reference::default(),
            points: [0.0; 4],
            phase: 0.0,
            starving: 0.0,
            interpolating: false,
            search,
            search_from: None,
            profile: None,
            next: None,
            acknowledged: false,
            limited: false,
            halted: false,
            brake_wait: 0.0,
            brake_closed: true,
            brake_stuck: false,
            supply: true,
            trip: None,
            torque: 0.0,
        }
    }

    pub(super) fn state(&self) -> State {
        self.state
    }

    pub(super) fn mode(&self) -> Mode {
        self.mode
    }

    pub(super) fn brake_closed(&self) -> bool {
        self.brake_closed
    }

    pub(super) fn is_commutated(&self) -> bool {
        self.search <= 0.0
    }

    /// The motor lost its supply: it must find its commutation again.
    pub(super) fn lose_commutation(&mut self) {
        (self.search, self.search_from) = (SEARCH.0, None);
    }

    /// Changes the mode; the joint keeps its velocity until the new mode says otherwise.
    pub(super) fn set_mode(&mut self, mode: Mode) {
        if mode != self.mode {
            self.mode = mode;
            self.interpolating = false;
            (self.profile, self.next, self.acknowledged) = (None, None, false);
        }
    }

    /// A controlword from the bus.
    pub(super) fn control(&mut self, word: Controlword) {
        let command = word.decode(self.word);
        self.word = word;
        self.state = match (self.state, command) {
            (State::Fault, Command::FaultReset) if self.supply => State::SwitchOnDisabled,
            (State::SwitchOnDisabled, Command::Shutdown) => State::ReadyToSwitchOn,
            (State::ReadyToSwitchOn, Command::SwitchOn | Command::EnableOperation) if self.supply => {
                State::SwitchedOn
            }
            (State::SwitchedOn, Command::EnableOperation) if self.supply => State::OperationEnabled,
            (State::SwitchedOn | State::OperationEnabled, Command::Shutdown) => State::ReadyToSwitchOn,
            (State::OperationEnabled, Command::SwitchOn) => State::SwitchedOn,
            (State::OperationEnabled, Command::QuickStop) => State::QuickStopActive,
            (State::ReadyToSwitchOn | State::SwitchedOn, Command::QuickStop | Command::DisableVoltage)
            | (State::OperationEnabled | State::QuickStopActive, Command::DisableVoltage) => {
                State::SwitchOnDisabled
            }
            (state, _) => state,
        };
    }

    /// Stops the joint quickly, where it has torque.
    pub(super) fn quick_stop(&mut self) {
        if self.state == State::OperationEnabled {
            self.state = State::QuickStopActive;
        }
    }

    /// Into fault: with torque by way of the fault reaction.
    pub(super) fn fault(&mut self) {
        let braking = matches!(self.state, State::OperationEnabled | State::QuickStopActive) && self.supply;
        self.state = if braking { State::FaultReactionActive } else { State::Fault };
    }

    /// A SYNC: the next interpolation period begins; `fresh` where a set-point came since the last one.
    pub(super) fn sync(&mut self, inputs: &Inputs, fresh: bool) {
        let wanted = self.state == State::OperationEnabled
            && self.mode == Mode::InterpolatedPosition
            && self.word.has(Controlword::MODE_4)
            && !self.word.has(Controlword::HALT);
        if !wanted {
            self.interpolating = false;
            return;
        }
        if !self.interpolating {
            self.interpolating = true;
            self.points = [self.reference.position; 4];
            self.starving = 0.0;
        }
        if fresh {
            self.starving = 0.0;
        }
        if self.is_commutated() {
            let point = if fresh { self.within(inputs.point, inputs.limits) } else { self.points[3] };
            self.points = [self.points[1], self.points[2], self.points[3], point];
        }
        self.phase = 0.0;
    }

    fn within(&mut self, wanted: f64, limits: [f64; 2]) -> f64 {
        let inside = if limits[0] < limits[1] { wanted.clamp(limits[0], limits[1]) } else { wanted };
        self.limited = inside != wanted;
        inside
    }

    /// One tick of `h` s: the torque for the joint, N·m, from where it is, rad and rad/s.
    pub(super) fn tick(&mut self, h: f64, inputs: &Inputs, actual: [f64; 2]) -> f64 {
        let before = self.state;
        self.halted = self.word.has(Controlword::HALT);
        self.refer(h, inputs, actual);
        match self.state {
            State::QuickStopActive if self.stands(actual) => self.state = State::SwitchOnDisabled,
            State::FaultReactionActive if self.stands(actual) || !self.supply => self.state = State::Fault,
            State::OperationEnabled if (self.reference.position - actual[0]).abs() > inputs.window => {
                self.trip = Some(Trip::Following);
                self.fault();
            }
            _ => {}
        }
        self.brake(h, inputs);
        self.torque = if !self.state.has_torque() || !self.supply {
            self.servo.reset();
            0.0
        } else if self.in_current_mode() && before == State::OperationEnabled {
            inputs.torque.clamp(-inputs.torque_limit, inputs.torque_limit)
        } else {
            self.servo.gains.limit = inputs.torque_limit;
            let forward = if before == State::OperationEnabled { inputs.torque } else { 0.0 };
            self.servo.torque(h, [self.reference.position, self.reference.velocity], actual, forward)
        };
        self.torque
    }

    pub(super) fn in_current_mode(&self) -> bool {
        self.module.current_mode.is_some_and(|current| current.mode == self.mode.code())
    }

    /// Moves the reference as state and mode say.
    fn refer(&mut self, h: f64, inputs: &Inputs, actual: [f64; 2]) {
        let gentle = inputs.profile[1].min(self.module.acceleration);
        let quick = QUICK * self.module.acceleration;
        match self.state {
            State::OperationEnabled if self.search > 0.0 && self.mode != Mode::None && !self.brake_closed => {
                // The motor turns its field until it knows its rotor: a small jerk.
                let from = *self.search_from.get_or_insert(self.reference.position);
                self.search -= h;
                let wave = (1.0 - self.search / SEARCH.0).clamp(0.0, 1.0) * std::f64::consts::TAU;
                self.reference = Reference { position: from + SEARCH.1 * wave.sin(), velocity: 0.0 };
                if self.search <= 0.0 {
                    self.reference.position = from;
                    self.points = [from; 4];
                }
                self.starving = 0.0;
            }
            State::OperationEnabled if self.halted => self.reference.stop(h, gentle.max(quick)),
            State::OperationEnabled => self.follow(h, inputs, actual, gentle),
            State::QuickStopActive | State::FaultReactionActive => self.reference.stop(h, quick),
            _ => {
                // Without torque the target is where the joint is: nothing jumps when it is enabled.
                self.reference = Reference { position: actual[0], velocity: 0.0 };
                self.interpolating = false;
                (self.profile, self.next) = (None, None);
            }
        }
    }

    fn follow(&mut self, h: f64, inputs: &Inputs, actual: [f64; 2], gentle: f64) {
        match self.mode {
            Mode::InterpolatedPosition if self.interpolating => {
                self.reference = spline(self.points, self.phase, inputs.period);
                self.phase += h / inputs.period;
                self.starving += h;
                if inputs.patience > 0.0 && self.starving > (inputs.patience + 0.5) * inputs.period {
                    self.trip = Some(Trip::Starved);
                    self.quick_stop();
                }
            }
            Mode::Velocity => {
                let ramp = Controlword::MODE_4 | Controlword::MODE_5 | Controlword::MODE_6;
                let wanted = if self.word.has(ramp) { inputs.velocity } else { 0.0 };
                let wanted = wanted.clamp(-self.module.velocity, self.module.velocity);
                self.limited = !self.reference.cruise(h, wanted, self.module.acceleration, inputs.limits);
            }
            Mode::ProfilePosition => {
                self.shake_hands(inputs);
                match self.profile {
                    Some(target) => {
                        let velocity = inputs.profile[0].min(self.module.velocity);
                        if self.reference.approach(h, target, velocity, gentle) {
                            self.profile = self.next.take();
                        }
                    }
                    None => self.reference.stop(h, gentle),
                }
            }
            _ if self.in_current_mode() => {
                self.reference = Reference { position: actual[0], velocity: actual[1] }
            }
            _ => self.reference.stop(h, QUICK * self.module.acceleration),
        }
    }

    /// New set-points of profile position: taken at a rising edge of bit 4, acknowledged until it falls.
    fn shake_hands(&mut self, inputs: &Inputs) {
        let asked = self.word.has(Controlword::MODE_4);
        if asked && !self.acknowledged {
            let from = if self.word.has(Controlword::MODE_6) { self.reference.position } else { 0.0 };
            let target = self.within(from + inputs.target, inputs.limits);
            if self.profile.is_none() || self.word.has(Controlword::MODE_5) {
                (self.profile, self.next) = (Some(target), None);
            } else {
                self.next = Some(target);
            }
        }
        self.acknowledged = asked;
    }

    fn stands(&self, actual: [f64; 2]) -> bool {
        self.reference.velocity == 0.0 && actual[1].abs() < STILL
    }

    /// The brake follows its command with its delay.
    fn brake(&mut self, h: f64, inputs: &Inputs) {
        let halted = self.halted && self.reference.velocity == 0.0;
        let close = !self.state.has_torque() || !self.supply || halted || inputs.brake || self.brake_stuck;
        self.brake_wait = if close == self.brake_closed { 0.0 } else { self.brake_wait + h };
        if self.brake_wait >= BRAKE_TIME {
            (self.brake_closed, self.brake_wait) = (close, 0.0);
        }
    }

    /// The statusword, with the joint at `actual`; `remote` where the node is operational.
    pub(super) fn statusword(&self, inputs: &Inputs, actual: [f64; 2], remote: bool) -> Statusword {
        let mut word = self.state.pattern();
        let mut set = |bit: u16, on: bool| word |= if on { bit } else { 0 };
        set(Statusword::VOLTAGE_ENABLED, self.supply);
        set(Statusword::REMOTE, remote);
        set(Statusword::INTERNAL_LIMIT, self.limited);
        let reached = match self.mode {
            _ if self.halted => self.stands(actual),
            Mode::ProfilePosition => {
                self.profile.is_none() && (self.reference.position - actual[0]).abs() < ARRIVED
            }
            Mode::Velocity => self.reference.velocity == inputs.velocity,
            _ => false,
        };
        set(Statusword::TARGET_REACHED, reached && self.state == State::OperationEnabled);
        set(
            Statusword::MODE_12,
            match self.mode {
                Mode::ProfilePosition => self.acknowledged,
                Mode::InterpolatedPosition => self.interpolating && self.state == State::OperationEnabled,
                _ => false,
            },
        );
        Statusword(word)
    }
}
