//! Buses by name, as users give them.

use std::fmt;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::str::FromStr;

/// Where a bus is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusUrl {
    /// In memory, with the built-in virtual arm on it.
    Virtual,
    /// A CAN interface of Linux.
    SocketCan(String),
    /// A serial adapter that speaks slcan, at 500 kbit/s.
    Slcan(PathBuf),
    /// A multicast group and port of python-can's `udp_multicast`.
    Udp(SocketAddr),
}

/// A text that names no bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UrlError {
    text: String,
    why: &'static str,
}

impl fmt::Display for UrlError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "\"{}\" names no bus: {}. Buses are: virtual, socketcan:can0, slcan:/dev/ttyACM0, \
                udp:239.74.163.2:43113",
            self.text, self.why
        )
    }
}

impl std::error::Error for UrlError {}

impl FromStr for BusUrl {
    type Err = UrlError;

    fn from_str(text: &str) -> Result<BusUrl, UrlError> {
        let wrong = |why| UrlError { text: text.to_string(), why };
        let (kind, rest) = text.split_once(':').unwrap_or((text, ""));
        match (kind, rest) {
            ("virtual", "") => Ok(BusUrl::Virtual),
            ("virtual", _) => Err(wrong("virtual takes nothing behind it")),
            ("socketcan", "") => Err(wrong("the interface is missing")),
            // IFNAMSIZ less its zero.
            ("socketcan", name) if name.len() > 15 => {
                Err(wrong("names of interfaces have at most 15 letters"))
            }
            ("socketcan", name) => Ok(BusUrl::SocketCan(name.to_string())),
            ("slcan", "") => Err(wrong("the serial device is missing")),
            ("slcan", path) => Ok(BusUrl::Slcan(PathBuf::from(path))),
            ("udp", group) => match group.parse::<SocketAddr>() {
                Ok(address) if address.ip().is_multicast() => Ok(BusUrl::Udp(address)),
                Ok(_) => Err(wrong("the address is no multicast group (224.0.0.0 to 239.255.255.255)")),
                Err(_) => Err(wrong("udp needs an address and a port")),
            },
            _ => Err(wrong("its first word is unknown")),
        }
    }
}

impl fmt::Display for BusUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            BusUrl::Virtual => f.write_str("virtual"),
            BusUrl::SocketCan(interface) => write!(f, "socketcan:{interface}"),
            BusUrl::Slcan(device) => write!(f, "slcan:{}", device.display()),
            BusUrl::Udp(group) => write!(f, "udp:{group}"),
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
            "udp:239.74.163.2:43113",
            "udp:[ff15:7079:7468:6f6e:6465:6d6f:6d63:6173]:43113",
        ] {
            assert_eq!(text.parse::<BusUrl>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn what_names_no_bus_is_told_what_does() {
        for text in [
            "",
            "can0",
            "virtual:1",
            "socketcan:",
            "slcan:",
            "udp:239.74.163.2",
            "udp:192.168.0.1:43113",
            "socketcan:a_very_long_name0",
        ] {
            let error = text.parse::<BusUrl>().unwrap_err().to_string();
            assert!(error.contains("slcan:/dev/ttyACM0") && error.contains(text), "{error}");
        }
    }
}
