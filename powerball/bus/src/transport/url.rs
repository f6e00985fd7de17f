//! Buses by name, as users give them.

use super::slcan;
use std::fmt;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::str::FromStr;

/// The address of a bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusUrl {
    /// A bus in memory, with the built-in virtual arm on it.
    Virtual,
    /// A CAN interface of Linux.
    SocketCan(String),
    /// A serial adapter that speaks slcan, and the bit rate of its bus in bit/s.
    Slcan(PathBuf, u32),
    /// A multicast group and port of python-can's `udp_multicast`: of this machine alone, or on the network
    /// of an interface.
    Udp(SocketAddr, Option<Interface>),
}

/// A network interface of this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Interface {
    /// An interface by its own address.
    Address(Ipv4Addr),
    /// An interface by its name; Linux only.
    Name(String),
}

impl fmt::Display for Interface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Interface::Address(address) => address.fmt(f),
            Interface::Name(name) => f.write_str(name),
        }
    }
}

/// bit/s of a serial adapter where no other is given: what the LWA 4P's drives have.
const BITRATE: u32 = 500_000;
/// Longest name of an interface: IFNAMSIZ less its zero.
const NAME: usize = 15;

/// A text that names no bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UrlError {
    text: String,
    why: String,
}

impl fmt::Display for UrlError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "\"{}\" is not a bus: {}. Buses are: virtual, socketcan:can0, slcan:/dev/ttyACM0, \
                slcan:/dev/ttyACM0?bitrate=250000, udp:239.74.163.2:43113, udp:239.74.163.2:43113@eth0",
            self.text, self.why
        )
    }
}

impl std::error::Error for UrlError {}

impl FromStr for BusUrl {
    type Err = UrlError;

    fn from_str(text: &str) -> Result<BusUrl, UrlError> {
        let wrong = |why: &str| UrlError { text: text.to_string(), why: why.to_string() };
        let (kind, rest) = text.split_once(':').unwrap_or((text, ""));
        match (kind, rest) {
            ("virtual", "") => Ok(BusUrl::Virtual),
            ("virtual", _) => Err(wrong("nothing may follow virtual")),
            ("socketcan", "") => Err(wrong("the interface is missing")),
            ("socketcan", name) if name.len() > NAME => {
                Err(wrong("names of interfaces have at most 15 letters"))
            }
            ("socketcan", name) => Ok(BusUrl::SocketCan(name.to_string())),
            ("slcan", "") => Err(wrong("the serial device is missing")),
            ("slcan", rest) => {
                let (path, bitrate) = port_of(rest).map_err(|why| wrong(&why))?;
                Ok(BusUrl::Slcan(path, bitrate))
            }
            ("udp", rest) => match group_of(rest) {
                Some((group, interface)) if group.ip().is_multicast() => Ok(BusUrl::Udp(group, interface)),
                Some(_) => Err(wrong("the address is not a multicast group (224.0.0.0 to 239.255.255.255)")),
                None => Err(wrong(
                    "udp needs an address and a port, and after @ an interface by its name or its own \
                    address",
                )),
            },
            _ => Err(wrong("its first word is unknown")),
        }
    }
}

/// `/dev/ttyACM0` or `COM3` at [`BITRATE`], or with `?bitrate=250000` behind it at another.
fn port_of(text: &str) -> Result<(PathBuf, u32), String> {
    let Some((path, option)) = text.rsplit_once('?') else { return Ok((PathBuf::from(text), BITRATE)) };
    if path.is_empty() {
        return Err("the serial device is missing".to_string());
    }
    let bitrate = option.strip_prefix("bitrate=").and_then(|bitrate| bitrate.parse().ok());
    let bitrate = bitrate.ok_or("after ? slcan takes bitrate= and a number in bit/s")?;
    slcan::speed(bitrate)?;
    Ok((PathBuf::from(path), bitrate))
}

/// `239.74.163.2:43113`, or with `@` the name of the interface behind it, or its own address where the group
/// is of IPv4.
fn group_of(text: &str) -> Option<(SocketAddr, Option<Interface>)> {
    let (group, interface) = match text.split_once('@') {
        Some((group, interface)) => (group, Some(interface)),
        None => (text, None),
    };
    let group: SocketAddr = group.parse().ok()?;
    let Some(text) = interface else { return Some((group, None)) };
    let interface = match text.parse::<IpAddr>() {
        Ok(IpAddr::V4(address)) if group.is_ipv4() => Interface::Address(address),
        // Interfaces of IPv6 have names and numbers: which of its addresses is meant does not matter.
        Ok(_) => return None,
        Err(_) => {
            let plain = |c: char| c.is_ascii_graphic() && !matches!(c, '/' | ':' | '[' | ']' | '@');
            (1..=NAME).contains(&text.len()).then_some(())?;
            text.chars().all(plain).then(|| Interface::Name(text.to_string()))?
        }
    };
    Some((group, Some(interface)))
}

impl fmt::Display for BusUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            BusUrl::Virtual => f.write_str("virtual"),
            BusUrl::SocketCan(interface) => write!(f, "socketcan:{interface}"),
            BusUrl::Slcan(device, BITRATE) => write!(f, "slcan:{}", device.display()),
            BusUrl::Slcan(device, bitrate) => write!(f, "slcan:{}?bitrate={bitrate}", device.display()),
            BusUrl::Udp(group, None) => write!(f, "udp:{group}"),
            BusUrl::Udp(group, Some(interface)) => write!(f, "udp:{group}@{interface}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_as_they_are_written() {
        for text in [
            "virtual",
            "socketcan:can0",
            "slcan:/dev/ttyACM0",
            "slcan:COM3?bitrate=1000000",
            "udp:239.74.163.2:43113",
            "udp:239.74.163.2:43113@192.168.1.5",
            "udp:239.74.163.2:43113@eth0",
            "udp:[ff15:7079:7468:6f6e:6465:6d6f:6d63:6173]:43113@eth0.7",
            "udp:[ff15:7079:7468:6f6e:6465:6d6f:6d63:6173]:43113",
        ] {
            assert_eq!(text.parse::<BusUrl>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn what_names_no_bus_is_answered_with_what_does() {
        for text in [
            "",
            "can0",
            "virtual:1",
            "socketcan:",
            "slcan:",
            "slcan:?bitrate=500000",
            "slcan:/dev/ttyACM0?bitrate=300000",
            "slcan:/dev/ttyACM0?bitrate=",
            "slcan:/dev/ttyACM0?speed=500000",
            "udp:239.74.163.2",
            "udp:192.168.0.1:43113",
            "udp:239.74.163.2:43113@",
            "udp:239.74.163.2:43113@a name",
            "udp:239.74.163.2:43113@a_very_long_name0",
            "udp:239.74.163.2:43113@fd00::2",
            "udp:239.74.163.2:43113@[ff15::1]",
            "socketcan:a_very_long_name0",
        ] {
            let error = text.parse::<BusUrl>().unwrap_err().to_string();
            assert!(error.contains("slcan:/dev/ttyACM0") && error.contains(text), "{error}");
        }
        let error = "slcan:COM3?bitrate=300000".parse::<BusUrl>().unwrap_err().to_string();
        let known = "10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, 1000000";
        assert!(
            error.contains(known) && !"slcan:COM3".parse::<BusUrl>().unwrap().to_string().contains('?'),
            "{error}"
        );
    }
}
