//! python-can's `udp_multicast`: each frame is a datagram to a multicast group that stays on this machine.

use super::{Bus, BusError, Clock, Event, msgpack, readable};
use crate::bus::canopen::{Frame, Micros};
use socket2::{Domain, Protocol, SockAddr, Socket, Type};
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
    clock: Clock,
}

impl UdpMulticast {
    /// Joins a multicast group.
    ///
    /// # Errors
    /// Where the system has no route to the group.
    pub fn open(group: SocketAddr) -> Result<Self, BusError> {
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
        let socket = |port: u16| -> std::io::Result<Socket> {
            let socket = Socket::new(domain, Type::DGRAM, Some(Protocol::UDP))?;
            socket.set_reuse_address(true)?;
            socket.bind(&SockAddr::from(SocketAddr::new(any, port)))?;
            Ok(socket)
        };
        let listener = socket(group.port()).map_err(failed("cannot listen"))?;
        let speaker = socket(0).map_err(failed("cannot speak"))?;
        // A hop limit of 0 keeps the frames on this machine.
        match group.ip() {
            IpAddr::V4(ip) => {
                listener.join_multicast_v4(&ip, &Ipv4Addr::UNSPECIFIED).map_err(failed("cannot join"))?;
                speaker.set_multicast_ttl_v4(0).map_err(failed("cannot set the hop limit"))?;
                speaker.set_multicast_loop_v4(true).map_err(failed("cannot loop back"))?;
            }
            IpAddr::V6(ip) => {
                listener.join_multicast_v6(&ip, 0).map_err(failed("cannot join"))?;
                speaker.set_multicast_hops_v6(0).map_err(failed("cannot set the hop limit"))?;
                speaker.set_multicast_loop_v6(true).map_err(failed("cannot loop back"))?;
            }
        }
        listener.set_nonblocking(true).map_err(failed("cannot listen"))?;
        let speaker = UdpSocket::from(speaker);
        let own_port = speaker.local_addr().map_err(failed("has no address"))?.port();
        Ok(UdpMulticast { listener: listener.into(), speaker, group, own_port, clock: Clock::start() })
    }
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
