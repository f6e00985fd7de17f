use powerball::bus::*;
use powerball::canopen::*;
use powerball::driver::lwa4p::LWA4P;
use powerball::driver::*;
use powerball::virtual_arm::*;
#[derive(Debug)]
struct T<B>(B);
impl<B: Bus> Bus for T<B> {
    fn now(&self) -> Micros {
        self.0.now()
    }
    fn send(&mut self, f: &Frame) -> Result<(), BusError> {
        if [0, 0x701].contains(&f.raw_id()) {
            println!("{} -> {f}", self.0.now());
        }
        self.0.send(f)
    }
    fn receive(&mut self, u: Micros) -> Result<Option<(Micros, Event)>, BusError> {
        let r = self.0.receive(u);
        if let Ok(Some((at, Event::Frame(f)))) = &r {
            if f.raw_id() > 0x700 || (f.raw_id() > 0x80 && f.raw_id() < 0x100) {
                println!("{at} <- {f}");
            }
        }
        r
    }
    fn flush(&mut self) {
        println!("flush");
        self.0.flush()
    }
}
fn main() {
    let arm = VirtualArm::new(powerball::virtual_arm::lwa4p::setup([0.1; 6], 1).unwrap()).unwrap();
    let mut m = Master::new(Driver::new(LWA4P).unwrap(), T(Memory::new(arm, LWA4P.bitrate)));
    m.driver_mut().start(ControlMode::InterpolatedPosition, false).unwrap();
    println!("{:?}", m.wait_for(Phase::Ready, 60_000_000));
    println!("{} ready", m.bus().now());
    m.driver_mut().enable().unwrap();
    println!("{:?}", m.wait_for(Phase::Running, 60_000_000));
    println!("{:?} {}", m.driver().counters(), m.bus().now());
    for n in m.driver().notes() {
        println!("{n:?}");
    }
}
