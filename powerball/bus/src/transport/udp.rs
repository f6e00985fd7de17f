//! python-can's `udp_multicast`: each frame is a datagram to a multicast group that stays on this machine.
//!
//! Senders are not authenticated. So only datagrams to the group are taken, and, unless an interface is
//! named, only those whose sender is this machine itself.

use super::{Bus, BusError, Clock, Event, Interface, msgpack, readable};
use crate::canopen::{Frame, Micros};
use socket2::{Domain, InterfaceIndexOrAddress, Protocol, SockAddr, Socket, Type};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::time::{SystemTime, UNIX_EPOCH};

/// A bus that python-can's programs see as `can.Bus(interface="udp_multicast", channel=group, port=port)`.
#[derive(Debug)]
pub struct UdpMulticast {
    listener: UdpSocket,
    /// Sends from a port of its own, by which own datagrams are known when they come back.
    speaker: UdpSocket,
    group: SocketAddr,
    own_port: u16,
    /// Others than this machine may speak.
    open: bool,
    /// The last sender that was checked, and whether it is this machine.
    sender: Option<(IpAddr, bool)>,
    clock: Clock,
}

impl UdpMulticast {
    /// Joins a multicast group.
    ///
    /// # Errors
    /// Where the system has no route to the group.
    pub fn open(group: SocketAddr) -> Result<Self, BusError> {
        UdpMulticast::open_on(group, None)
    }

    /// Joins a multicast group on the network of an interface. Its datagrams reach that network (hop limit
    /// 1), and whoever is on it can speak: fence it.
    ///
    /// # Errors
    /// Those of [`open`](Self::open), and where this machine has no such interface.
    pub fn open_on(group: SocketAddr, interface: Option<&Interface>) -> Result<Self, BusError> {
        let failed = |what: &'static str| {
            move |e: std::io::Error| {
                let hint = "without a network: ip link set lo up; ip route add 239.0.0.0/8 dev lo";
                BusError::Io(format!("udp:{group}: {what}: {e} ({hint})"))
            }
        };
        let (domain, any): (_, IpAddr) = match group.ip() {
            IpAddr::V4(_) => (Domain::IPV4, Ipv4Addr::UNSPECIFIED.into()),
            IpAddr::V6(_) => (Domain::IPV6, Ipv6Addr::UNSPECIFIED.into()),
        };
        let socket = |address: SocketAddr| -> std::io::Result<Socket> {
            let socket = Socket::new(domain, Type::DGRAM, Some(Protocol::UDP))?;
            socket.set_reuse_address(true)?;
            socket.bind(&SockAddr::from(address))?;
            Ok(socket)
        };
        // Bound to the group: what is sent to this machine's own addresses is not taken.
        let listener = socket(group).map_err(failed("cannot listen"))?;
        let speaker = socket(SocketAddr::new(any, 0)).map_err(failed("cannot speak"))?;
        let hops = u32::from(interface.is_some());
        let on = match interface {
            Some(Interface::Address(own)) => *own,
            _ => Ipv4Addr::UNSPECIFIED,
        };
        // A socket that is bound to a device sends and receives there, whatever the routes are; 0 is any
        // interface.
        let index = match interface {
            Some(Interface::Name(name)) => bind_device(name, &[&listener, &speaker]).map_err(|e| {
                BusError::Io(format!(
                    "udp:{group}@{name}: there is no such interface, or it is not allowed: {e}"
                ))
            })?,
            _ => 0,
        };
        // A hop limit of 0 keeps the frames on this machine.
        match group.ip() {
            IpAddr::V4(ip) => {
                let place = match index {
                    0 => InterfaceIndexOrAddress::Address(on),
                    index => InterfaceIndexOrAddress::Index(index),
                };
                listener.join_multicast_v4_n(&ip, &place).map_err(failed("cannot join"))?;
                if !on.is_unspecified() {
                    speaker.set_multicast_if_v4(&on).map_err(failed("has no such interface"))?;
                }
                speaker.set_multicast_ttl_v4(hops).map_err(failed("cannot set the hop limit"))?;
                speaker.set_multicast_loop_v4(true).map_err(failed("cannot loop back"))?;
            }
            IpAddr::V6(ip) => {
                listener.join_multicast_v6(&ip, index).map_err(failed("cannot join"))?;
                speaker.set_multicast_hops_v6(hops).map_err(failed("cannot set the hop limit"))?;
                speaker.set_multicast_loop_v6(true).map_err(failed("cannot loop back"))?;
            }
        }
        listener.set_nonblocking(true).map_err(failed("cannot listen"))?;
        let speaker = UdpSocket::from(speaker);
        let own_port = speaker.local_addr().map_err(failed("has no address"))?.port();
        let (listener, clock) = (listener.into(), Clock::start());
        Ok(UdpMulticast {
            listener,
            speaker,
            group,
            own_port,
            open: interface.is_some(),
            sender: None,
            clock,
        })
    }

    /// Whether a datagram of `from` is taken. An address is this machine's where a socket can be bound to it.
    fn takes(&mut self, from: IpAddr) -> bool {
        if self.open || from.is_loopback() {
            return true;
        }
        if let Some((_, own)) = self.sender.filter(|(known, _)| *known == from) {
            return own;
        }
        let own = UdpSocket::bind(SocketAddr::new(from, 0)).is_ok();
        self.sender = Some((from, own));
        own
    }
}

/// Binds sockets to an interface by name; its index.
#[cfg(target_os = "linux")]
fn bind_device(name: &str, sockets: &[&Socket]) -> std::io::Result<u32> {
    let mut index = 0;
    for socket in sockets {
        index = rustix::net::netdevice::name_to_index(socket, name)?;
        socket.bind_device(Some(name.as_bytes()))?;
    }
    Ok(index)
}

#[cfg(not(target_os = "linux"))]
fn bind_device(_: &str, _: &[&Socket]) -> std::io::Result<u32> {
    Err(std::io::Error::other("names of interfaces work only on Linux: give the interface's own address"))
}

impl Bus for UdpMulticast {
    fn now(&self) -> Micros {
        self.clock.now()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let timestamp = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |t| t.as_secs_f64());
        match self.speaker.send_to(&msgpack::encode(frame, timestamp), self.group) {
            Ok(_) => Ok(()),
            Err(e) if e.kind() == std::io::ErrorKind::WouldBlock => Err(BusError::Full),
            Err(e) => Err(BusError::io(format_args!("udp:{}", self.group), e)),
        }
    }

    fn receive(&mut self, until: Micros) -> Result<Option<(Micros, Event)>, BusError> {
        let mut buffer = [0; 512];
        loop {
            match self.listener.recv_from(&mut buffer) {
                Ok((_, from)) if from.port() == self.own_port => {}
                Ok((_, from)) if !self.takes(from.ip()) => {}
                Ok((len, _)) => {
                    if let Some(frame) = buffer.get(..len).and_then(msgpack::decode) {
                        return Ok(Some((self.now(), Event::Frame(frame))));
                    }
                }
                Err(e) if e.kind() == std::io::ErrorKind::WouldBlock => {
                    let left = self.clock.left(until);
                    if left.is_zero() {
                        return Ok(None);
                    }
                    readable(&self.listener, left)?;
                }
                Err(e) => return Err(BusError::io(format_args!("udp:{}", self.group), e)),
            }
        }
    }

    /// Datagrams are gone at once; there is nothing to flush.
    fn flush(&mut self) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_this_machine_is_heard_unless_an_interface_is_named() {
        let Ok(mut bus) = UdpMulticast::open("239.74.163.9:43198".parse().unwrap()) else {
            println!("skipped: this machine has no route to 239.0.0.0/8");
            return;
        };
        let own = [IpAddr::from([127, 0, 0, 1]), IpAddr::from([127, 1, 2, 3])];
        // TEST-NET-3: an address that is never assigned.
        let other = IpAddr::from([203, 0, 113, 7]);
        assert!(own.iter().all(|from| bus.takes(*from)) && !bus.takes(other) && !bus.takes(other));
        bus.open = true;
        assert!(bus.takes(other));
    }

    /// By any interface's name that this machine can multicast on, both ways; a name that it does not have is
    /// reported.
    #[cfg(target_os = "linux")]
    #[test]
    fn an_interface_is_found_by_its_name() {
        let group: SocketAddr = "239.74.163.9:43197".parse().unwrap();
        let open = |name: &str| UdpMulticast::open_on(group, Some(&Interface::Name(name.to_string())));
        let text = open("nonet7").unwrap_err().to_string();
        assert!(text.contains("@nonet7") && text.contains("no such interface"), "{text}");
        let names = std::fs::read_dir("/sys/class/net").into_iter().flatten().flatten();
        let met = names.filter_map(|name| name.file_name().into_string().ok()).any(|name| {
            let (Ok(mut a), Ok(mut b)) = (open(&name), open(&name)) else { return false };
            let frame = Frame::from_raw(0x203, &[1, 2, 3]).unwrap();
            let until = b.now() + 200_000;
            a.send(&frame).is_ok()
                && b.receive(until).unwrap().map(|(_, event)| event) == Some(Event::Frame(frame))
        });
        if !met {
            println!("skipped: this machine has no interface that carries multicast");
        }
    }

    #[test]
    fn two_doors_to_one_group_hear_each_other_and_not_themselves() {
        let group = "239.74.163.9:43199".parse().unwrap();
        let (Ok(mut a), Ok(mut b)) = (UdpMulticast::open(group), UdpMulticast::open(group)) else {
            println!("skipped: this machine has no route to 239.0.0.0/8");
            return;
        };
        for id in 1..50 {
            let frame = Frame::from_raw(id, &[id as u8; 8]).unwrap();
            a.send(&frame).unwrap();
            let until = b.now() + 1_000_000;
            assert_eq!(b.receive(until).unwrap().map(|(_, event)| event), Some(Event::Frame(frame)));
        }
        let until = a.now() + 1_000;
        assert_eq!(a.receive(until).unwrap(), None);
        assert!(a.now() >= until && a.now() < until + 20_000);
    }
}
