//! One node: network management, heartbeats, emergencies, and the drive behind its dictionary.

use super::arm::Module;
use super::dictionary::{Dictionary, Value};
use super::drive::{Drive, Inputs, Trip};
use super::process::{self, Pdos};
use super::server::{Objects, Server};
use super::{DEGREE, Fault, Sample};
use powerball_bus::canopen::emcy::Emcy;
use powerball_bus::canopen::nmt;
use powerball_bus::canopen::sdo::AbortCode;
use powerball_bus::canopen::{Cob, Frame, Micros, NodeId, Object, objects};
use powerball_bus::cia402::{Controlword, Mode, State, objects as drive_objects, schunk};
use std::collections::VecDeque;

/// Time from reset to boot-up, µs.
const BOOT_TIME: Micros = 50_000;

/// Emergency codes that the node sends by itself.
const EMCY_HEARTBEAT: u16 = 0x8130;
const EMCY_PDO_LENGTH: u16 = 0x8210;
const EMCY_STARVED: u16 = 0x8250;
const EMCY_FOLLOWING: u16 = 0x8611;
const EMCY_SUPPLY: u16 = 0x3222;

/// One entry of the heartbeat consumer 0x1016.
#[derive(Clone, Copy, Debug, Default)]
struct Watched {
    /// When it was last heard; `None` until the first time.
    heard: Option<Micros>,
    lost: bool,
}

/// One drive on the bus.
#[derive(Clone, Debug)]
pub struct Node {
    module: Module,
    /// Tuning of its servo: inertia, kg·m², and Coulomb friction, N·m.
    tuned: [f64; 2],
    nmt: nmt::State,
    dictionary: Dictionary,
    server: Server,
    pdos: Pdos,
    pub(super) drive: Drive,
    watched: [Watched; 3],
    /// Receive PDOs that wait for the SYNC, with their identifiers.
    waiting: Vec<Frame>,
    fresh: bool,
    syncs: u64,
    next_heartbeat: Micros,
    boots_at: Option<Micros>,
    sample: Sample,
    /// The commands of the drive, as they were when the dictionary was last written.
    inputs: Inputs,
    /// The injected faults.
    silent: bool,
    mute_heartbeat: bool,
    refused: Option<Mode>,
    garbage: Option<u16>,
    out: VecDeque<Frame>,
}

impl Node {
    pub(super) fn new(module: Module, tuned: [f64; 2]) -> Self {
        let dictionary = fresh_dictionary(&module);
        let mut node = Node {
            module,
            tuned,
            nmt: nmt::State::PreOperational,
            pdos: Pdos::read(&dictionary),
            dictionary,
            server: Server::default(),
            drive: Drive::new(module, tuned),
            watched: [Watched::default(); 3],
            waiting: Vec::new(),
            fresh: false,
            syncs: 0,
            next_heartbeat: 0,
            boots_at: Some(BOOT_TIME),
            sample: Sample::default(),
            silent: false,
            mute_heartbeat: false,
            refused: None,
            garbage: None,
            out: VecDeque::new(),
            inputs: Inputs::default(),
        };
        node.inputs = node.read_inputs();
        node
    }

    /// The node's number.
    pub fn id(&self) -> NodeId {
        self.module.node
    }

    /// The module that it is.
    pub fn module(&self) -> &Module {
        &self.module
    }

    /// The node's state in network management.
    pub fn nmt_state(&self) -> nmt::State {
        self.nmt
    }

    /// The drive's state.
    pub fn state(&self) -> State {
        self.drive.state()
    }

    /// The drive's mode.
    pub fn mode(&self) -> Mode {
        self.drive.mode()
    }

    /// Whether the brake is closed.
    pub fn brake_closed(&self) -> bool {
        self.drive.brake_closed()
    }

    /// The demanded motion of the joint: position, rad, and velocity, rad/s.
    pub fn demand(&self) -> [f64; 2] {
        [self.drive.reference.position, self.drive.reference.velocity]
    }

    /// The object dictionary with its present values.
    pub fn dictionary(&self) -> &Dictionary {
        &self.dictionary
    }

    pub(super) fn transmit(&mut self) -> Option<Frame> {
        self.out.pop_front()
    }

    /// Makes something go wrong, or right again.
    pub(super) fn fault(&mut self, fault: Fault, now: Micros) {
        match fault {
            Fault::Silent(on) => {
                self.silent = on;
                self.out.clear();
            }
            Fault::Reboot => self.reset(now),
            Fault::Emergency { code, register } => self.emergency(code, register, true),
            Fault::Supply(there) => {
                self.drive.supply = there;
                if !there {
                    self.drive.lose_commutation();
                    self.emergency(EMCY_SUPPLY, 0x04, true);
                }
            }
            Fault::RefuseMode(mode) => self.refused = mode,
            Fault::Statusword(word) => self.garbage = word,
            Fault::BrakeStuck(on) => self.drive.brake_stuck = on,
            Fault::NoHeartbeat(on) => self.mute_heartbeat = on,
        }
    }

    fn reset(&mut self, now: Micros) {
        // A module that lost no motor power knows its commutation still.
        let module = Module { commutated: self.drive.is_commutated(), ..self.module };
        let supply = self.drive.supply;
        *self =
            Node { silent: self.silent, boots_at: Some(now + BOOT_TIME), ..Node::new(module, self.tuned) };
        self.drive.supply = supply;
    }

    fn is_on(&self) -> bool {
        self.boots_at.is_none() && !self.silent
    }

    /// A frame from the bus.
    pub(super) fn receive(&mut self, frame: &Frame, now: Micros) {
        if !self.is_on() {
            return;
        }
        if let Some(command) = nmt::Command::decode(frame, self.id()) {
            return self.manage(command, now);
        }
        if let Some((node, _)) = nmt::State::decode(frame) {
            return self.heard(node, now);
        }
        let id = frame.raw_id();
        if id == Cob::SdoRequest(self.id()).id() && self.nmt != nmt::State::Stopped {
            let mut server = std::mem::take(&mut self.server);
            let answer = server.answer(frame.bytes(), self);
            self.server = server;
            let own = Cob::SdoResponse(self.id()).id();
            self.out.extend(answer.and_then(|answer| Frame::from_raw(own, &answer.encode())));
        } else if i64::from(id) == self.dictionary.get(objects::SYNC_COB_ID) & 0x7FF {
            if self.nmt == nmt::State::Operational {
                self.synchronise();
            }
        } else if self.nmt == nmt::State::Operational
            && let Some(pdo) = self.pdos.receive.iter().find(|pdo| pdo.id == id)
        {
            if pdo.kind <= 240 {
                self.waiting.retain(|waiting| waiting.raw_id() != id);
                self.waiting.push(*frame);
            } else {
                self.process(frame);
            }
        }
    }

    fn manage(&mut self, command: nmt::Command, now: Micros) {
        let before = self.nmt;
        match command {
            nmt::Command::Start => {
                self.pdos = Pdos::read(&self.dictionary);
                self.nmt = nmt::State::Operational;
            }
            nmt::Command::Stop => self.nmt = nmt::State::Stopped,
            nmt::Command::EnterPreOperational => self.nmt = nmt::State::PreOperational,
            nmt::Command::ResetNode | nmt::Command::ResetCommunication => return self.reset(now),
        }
        if before == nmt::State::Operational && self.nmt != before {
            // Set-points come no more.
            self.waiting.clear();
            self.drive.quick_stop();
        }
    }

    fn heard(&mut self, node: NodeId, now: Micros) {
        for (sub, watched) in (1..).zip(&mut self.watched) {
            let setting = self.dictionary.get(Object::new(0x1016, sub));
            if setting >> 16 == i64::from(node.raw()) && setting & 0xFFFF != 0 {
                *watched = Watched { heard: Some(now), lost: false };
            }
        }
    }

    /// SYNC: set-points take effect, measurements go out.
    fn synchronise(&mut self) {
        self.syncs += 1;
        for frame in std::mem::take(&mut self.waiting) {
            self.process(&frame);
        }
        self.drive.sync(&self.inputs, std::mem::take(&mut self.fresh));
        self.publish();
        for pdo in &self.pdos.transmit {
            if pdo.due(self.syncs) {
                self.out.extend(pdo.frame(&self.dictionary));
            }
        }
    }

    /// The objects of a receive PDO.
    fn process(&mut self, frame: &Frame) {
        let Some(pdo) = self.pdos.receive.iter().find(|pdo| pdo.id == frame.raw_id()).copied() else {
            return;
        };
        let Some(values) = pdo.mapping.unpack(frame.bytes()) else {
            return self.emergency(EMCY_PDO_LENGTH, 0x10, false);
        };
        for (entry, raw) in values {
            // A value that its object refuses is left out, as the drive has no way to answer.
            if let Ok(value) =
                self.dictionary.check(entry.object, &raw.to_le_bytes()[..usize::from(entry.bits / 8)])
            {
                self.dictionary.store(entry.object, value);
                self.written(entry.object);
            }
        }
    }

    /// Applies a new value of an object.
    fn written(&mut self, object: Object) {
        match object {
            drive_objects::CONTROLWORD => {
                let word = self.dictionary.get(object) as u16;
                let before = self.drive.state();
                self.drive.control(Controlword(word));
                if before == State::Fault && self.drive.state() != State::Fault {
                    self.emergency(0, 0, false);
                }
            }
            drive_objects::MODE => {
                let mode = Mode::from_code(self.dictionary.get(object) as i8);
                if self.refused != Some(mode) && self.offers(mode) {
                    self.drive.set_mode(mode);
                }
            }
            drive_objects::INTERPOLATION_SETPOINT => self.fresh = true,
            _ => {}
        }
        self.inputs = self.read_inputs();
    }

    fn offers(&self, mode: Mode) -> bool {
        let supported = self.dictionary.get(drive_objects::SUPPORTED_MODES) as u32;
        // There is no homing behind its bit: the position is absolute.
        mode == Mode::None
            || self.module.current_mode.is_some_and(|current| current.mode == mode.code())
            || mode.is_in(supported) == Some(true) && mode != Mode::Homing
    }

    fn emergency(&mut self, code: u16, register: u8, fault: bool) {
        if fault {
            self.drive.fault();
        }
        let detail = (code & 0xFF) as u8;
        self.dictionary.set(objects::ERROR_REGISTER, i64::from(register | u8::from(code != 0)));
        self.dictionary
            .set(objects::MANUFACTURER_STATUS, if code == 0 { 0 } else { 0x8800 | i64::from(detail) });
        if code != 0 {
            let history = |sub| Object::new(0x1003, sub);
            let last = self.dictionary.get(history(1));
            let count = (self.dictionary.get(history(0)) + 1).min(2);
            self.dictionary.set(history(2), last);
            self.dictionary.set(history(1), i64::from(code));
            self.dictionary.store(history(0), Value::Number(count));
            self.dictionary.set_real(schunk::ERROR_DETAIL, f32::from(detail));
            self.dictionary.set_text(schunk::ERROR_FILE, "virtual_arm/slave/node.rs");
            self.dictionary.set(schunk::ERROR_LINE, i64::from(line!()));
        }
        if self.is_on() && self.nmt != nmt::State::Stopped {
            self.out.push_back(
                Emcy { code, register: register | u8::from(code != 0), vendor: [detail, 0, 0, 0, 0] }
                    .frame(self.id()),
            );
        }
    }

    /// Time: boot-up, heartbeats, and the drive's tick of `h` s. Gives the torque, N·m.
    pub(super) fn tick(&mut self, h: f64, now: Micros, actual: [f64; 2]) -> f64 {
        if self.boots_at.is_some_and(|at| now >= at) {
            self.boots_at = None;
            self.next_heartbeat = now;
            if !self.silent {
                self.out.push_back(nmt::State::BootUp.frame(self.id()));
            }
        }
        if self.is_on() {
            self.beat(now);
            self.watch(now);
        }
        let torque = self.drive.tick(h, &self.inputs, actual);
        match self.drive.trip.take() {
            Some(Trip::Following) => self.emergency(EMCY_FOLLOWING, 0x20, false),
            Some(Trip::Starved) => self.emergency(EMCY_STARVED, 0x10, false),
            None => {}
        }
        torque
    }

    fn beat(&mut self, now: Micros) {
        let period = self.dictionary.get(objects::PRODUCER_HEARTBEAT) as Micros * 1000;
        if period == 0 {
            self.next_heartbeat = now;
        } else if now >= self.next_heartbeat {
            self.next_heartbeat = now.max(self.next_heartbeat + period);
            if !self.mute_heartbeat {
                self.out.push_back(self.nmt.frame(self.id()));
            }
        }
    }

    fn watch(&mut self, now: Micros) {
        for sub in 1..=3u8 {
            let limit = (self.dictionary.get(Object::new(0x1016, sub)) & 0xFFFF) as Micros * 1000;
            let watched = &mut self.watched[usize::from(sub) - 1];
            let late = watched.heard.is_some_and(|heard| limit > 0 && now > heard + limit);
            if late && !watched.lost {
                watched.lost = true;
                watched.heard = None;
                self.emergency(EMCY_HEARTBEAT, 0x10, false);
                self.drive.quick_stop();
                if self.nmt == nmt::State::Operational {
                    self.nmt = nmt::State::PreOperational;
                }
            }
        }
    }

    /// The commands of the dictionary to the drive.
    fn read_inputs(&self) -> Inputs {
        let number = |object| self.dictionary.get(object) as f64;
        let angle = |object| number(object) * DEGREE;
        let per_mille = self.module.rated_torque / 1000.0;
        let vl_unit = number(drive_objects::VL_FACTOR_DENOMINATOR)
            / number(drive_objects::VL_FACTOR_NUMERATOR).max(1.0)
            / 6000.0;
        let current = self.module.current_mode.filter(|c| c.mode == self.drive.mode().code());
        let torque = current.map_or(drive_objects::TORQUE_OFFSET, |current| current.target);
        let outputs = self.dictionary.get(drive_objects::OUTPUTS);
        Inputs {
            target: angle(drive_objects::TARGET_POSITION),
            velocity: angle(drive_objects::VL_TARGET_VELOCITY) * vl_unit,
            point: angle(drive_objects::INTERPOLATION_SETPOINT),
            period: (number(drive_objects::INTERPOLATION_PERIOD)
                * 10f64.powi(self.dictionary.get(drive_objects::INTERPOLATION_PERIOD_EXPONENT) as i32))
            .clamp(1e-3, 1.0),
            patience: number(schunk::SYNC_TIMEOUT_FACTOR),
            torque: number(torque) * per_mille,
            profile: [
                angle(drive_objects::PROFILE_VELOCITY),
                angle(drive_objects::PROFILE_ACCELERATION).max(1e-3),
            ],
            limits: [angle(drive_objects::POSITION_LIMIT_MIN), angle(drive_objects::POSITION_LIMIT_MAX)],
            window: match number(drive_objects::FOLLOWING_ERROR_WINDOW) * DEGREE {
                0.0 => f64::INFINITY,
                window => window,
            },
            torque_limit: self.module.torque.min(number(drive_objects::MAX_CURRENT) * per_mille.abs()),
            brake: outputs & 1 != 0,
        }
    }

    /// Takes a sample of the encoder and the current sensor.
    pub(super) fn measure(&mut self, sample: Sample) {
        self.sample = sample;
    }

    /// Brings the objects that live up to date.
    fn publish(&mut self) {
        let inputs = self.inputs;
        let Sample { position, velocity, torque } = self.sample;
        let actual = [position, velocity];
        let remote = self.nmt == nmt::State::Operational;
        let word = self.garbage.unwrap_or(self.drive.statusword(&inputs, actual, remote).0);
        let vl_unit =
            DEGREE * number_or(inputs.velocity, self.dictionary.get(drive_objects::VL_TARGET_VELOCITY));
        let [demand, demand_velocity] = self.demand();
        let count = |value: f64| (value / DEGREE).round() as i64;
        let extended =
            if self.drive.is_commutated() { schunk::COMMUTATED | schunk::POSITION_VERIFIED } else { 0 };
        let set = [
            (drive_objects::STATUSWORD, i64::from(word)),
            (drive_objects::MODE_DISPLAY, i64::from(self.drive.mode().code())),
            (drive_objects::POSITION, count(position)),
            (drive_objects::VELOCITY, count(velocity)),
            (drive_objects::POSITION_DEMAND, count(demand)),
            (drive_objects::VELOCITY_DEMAND, count(demand_velocity)),
            (drive_objects::FOLLOWING_ERROR, count(demand - position)),
            (drive_objects::TORQUE, (1000.0 * torque / self.module.rated_torque).round() as i64),
            (Object::new(0x6043, 0), (demand_velocity / vl_unit).round() as i64),
            (Object::new(0x6044, 0), (velocity / vl_unit).round() as i64),
            (schunk::EXTENDED_STATUS, i64::from(extended)),
        ];
        for (object, value) in set {
            self.dictionary.set(object, value);
        }
    }
}

/// Units of the velocity mode: rad/s of one count over a milli-degree a second, 1 where the target is 0.
fn number_or(velocity: f64, counts: i64) -> f64 {
    if counts == 0 || velocity == 0.0 { 1.0 } else { velocity / (counts as f64 * DEGREE) }
}

/// The dictionary of a module: what the maker leaves in it, with the joint's own limits.
fn fresh_dictionary(module: &Module) -> Dictionary {
    let mut dictionary = Dictionary::new(module.node, module.identity);
    let count = |value: f64| (value / DEGREE).round() as i64;
    for (object, value) in [
        (drive_objects::POSITION_LIMIT_MIN, count(module.limits[0])),
        (drive_objects::POSITION_LIMIT_MAX, count(module.limits[1])),
        (drive_objects::PROFILE_ACCELERATION, count(module.acceleration)),
        (drive_objects::RATED_CURRENT, i64::from(module.rated_current)),
        (drive_objects::MAX_CURRENT, (1000.0 * module.torque / module.rated_torque.abs()).round() as i64),
    ] {
        dictionary.set(object, value);
    }
    dictionary.set_real(schunk::BOARD_TEMPERATURE, 31.5);
    if let Some(current) = module.current_mode {
        dictionary.add_setpoint(current.target);
        let supported = dictionary.get(drive_objects::SUPPORTED_MODES);
        let bit = if (1..=16).contains(&current.mode) { 1 << (current.mode - 1) } else { 0 };
        dictionary.set(drive_objects::SUPPORTED_MODES, supported | bit);
    }
    dictionary
}

impl Objects for Node {
    fn read(&mut self, object: Object) -> Result<Vec<u8>, AbortCode> {
        self.publish();
        self.dictionary.read(object)
    }

    fn write(&mut self, object: Object, bytes: &[u8]) -> Result<(), AbortCode> {
        let value = self.dictionary.check(object, bytes)?;
        if let Value::Number(number) = value {
            process::check(&self.dictionary, object, number, self.nmt == nmt::State::PreOperational)?;
            if object == drive_objects::MODE && !self.offers(Mode::from_code(number as i8)) {
                return Err(AbortCode::VALUE);
            }
        }
        self.dictionary.store(object, value);
        self.written(object);
        Ok(())
    }
}
