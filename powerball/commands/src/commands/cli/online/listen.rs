//! `powerball watch --bus`: samples of an arm that another master drives.

use super::Failure;
use powerball_bus::driver::Listener;
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_bus::transport::{self, Bus, BusUrl, Event, Interrupt};
use powerball_logs::log::LiveSample;

/// Period at which Ctrl-C is looked for, µs.
const LOOK: u64 = 100_000;
/// Without a complete cycle for this long it is reported that nothing is heard, µs.
const SILENCE: u64 = 2_000_000;

/// Hears the LWA 4P's process data and gives a sample a cycle, until Ctrl-C or `seconds` have passed; sends
/// nothing.
///
/// # Errors
/// A bus that is within this program or cannot be opened, process data that is mapped otherwise.
pub(super) fn listen(
    url: &BusUrl,
    seconds: Option<f64>,
    mut take: impl FnMut(&LiveSample),
) -> Result<(), Failure> {
    if *url == BusUrl::Virtual {
        let what = "--bus virtual exists within one program, so no other program moves its arm. Use \
            `powerball virtual-arm` on udp:239.74.163.2:43113";
        return Err(Failure::Unusable(what.to_string()));
    }
    let interrupt = Interrupt::install().map_err(|e| Failure::Refused(e.to_string()))?;
    let mut bus = transport::open(url).map_err(|e| Failure::Unusable(e.to_string()))?;
    let mut listener = Listener::new(LWA4P);
    let until = seconds.map_or(u64::MAX, |s| bus.now().saturating_add((s * 1e6) as u64));
    let (mut last, mut is_silent) = (bus.now(), false);
    while bus.now() < until && !interrupt.is_asked() {
        let gone = |e: transport::BusError| Failure::Refused(format!("{url}: {e}"));
        let event = bus.receive(until.min(bus.now() + LOOK)).map_err(gone)?;
        if let Some((_, Event::Frame(frame))) = event
            && let Some(heard) = listener.hear(&frame).map_err(|e| Failure::Refused(format!("{url}: {e}")))?
        {
            take(&LiveSample { t: heard.t, q: heard.position.to_vec(), torque: heard.torque.to_vec() });
            (last, is_silent) = (bus.now(), false);
        }
        if bus.now().saturating_sub(last) > SILENCE && !is_silent {
            is_silent = true;
            tracing::warn!("no cycle of nodes 3 to 8 was heard for {} s on {url}", SILENCE / 1_000_000);
        }
    }
    Ok(())
}
