//! Bytes to and from an autopilot: UDP, TCP, serial lines.

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs, UdpSocket};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Where an autopilot is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// It sends datagrams to this local address; answers go to where they come from.
    UdpIn(String),
    /// It receives datagrams at this address.
    UdpOut(String),
    /// It accepts a connection.
    Tcp(String),
    /// A serial line and its baud rate.
    Serial(String, u32),
}

/// Reading returns after this time without bytes.
pub const TIMEOUT: Duration = Duration::from_millis(100);

/// Longest time for a connection.
const CONNECT: Duration = Duration::from_millis(500);

/// Usual rate of telemetry ports.
const BAUD: u32 = 57_600;

impl std::str::FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "'{text}' is not a link: udpin:0.0.0.0:14550, udpout:192.168.1.10:14550, tcp:127.0.0.1:5760 or serial:/dev/ttyACM0:115200"
            )
        };
        let (kind, place) = text.split_once(':').ok_or_else(wrong)?;
        let has_port = |place: &str| {
            place.rsplit_once(':').is_some_and(|(host, port)| !host.is_empty() && port.parse::<u16>().is_ok())
        };
        match kind {
            "udpin" | "udpout" | "tcp" if !has_port(place) => Err(wrong()),
            "udpin" => Ok(Self::UdpIn(place.to_owned())),
            "udpout" => Ok(Self::UdpOut(place.to_owned())),
            "tcp" => Ok(Self::Tcp(place.to_owned())),
            "serial" if !place.is_empty() => match place.rsplit_once(':') {
                Some((path, baud)) => Ok(Self::Serial(path.to_owned(), baud.parse().map_err(|_| wrong())?)),
                None => Ok(Self::Serial(place.to_owned(), BAUD)),
            },
            _ => Err(wrong()),
        }
    }
}

/// The other side of a socket for datagrams.
#[derive(Clone, Debug, Default)]
pub struct Peer {
    address: Arc<Mutex<Option<SocketAddr>>>,
    is_fixed: bool,
}

impl Peer {
    fn fixed(address: SocketAddr) -> Self {
        Self { address: Arc::new(Mutex::new(Some(address))), is_fixed: true }
    }

    fn get(&self) -> Option<SocketAddr> {
        *self.address.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn accept(&self, address: SocketAddr) {
        self.address.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(address);
    }

    /// Accepts another sender from now on: the autopilot may have got another address.
    pub fn forget(&self) {
        if !self.is_fixed {
            *self.address.lock().unwrap_or_else(PoisonError::into_inner) = None;
        }
    }
}

/// The reading side.
pub enum Source {
    /// Datagrams, of the first sender of a message of an autopilot. Those of others are left out from then on.
    Udp {
        socket: UdpSocket,
        peer: Peer,
        /// Sender of the last datagram.
        from: Option<SocketAddr>,
    },
    Tcp(TcpStream),
    Serial(Box<dyn serialport::SerialPort>),
}

/// The writing side.
pub enum Sink {
    Udp(UdpSocket, Peer),
    Tcp(TcpStream),
    Serial(Box<dyn serialport::SerialPort>),
}

/// Opens a link.
pub fn open(address: &Address) -> io::Result<(Source, Sink)> {
    match address {
        Address::UdpIn(place) => {
            let socket = UdpSocket::bind(place)?;
            socket.set_read_timeout(Some(TIMEOUT))?;
            let (other, peer) = (socket.try_clone()?, Peer::default());
            Ok((Source::Udp { socket, peer: peer.clone(), from: None }, Sink::Udp(other, peer)))
        }
        Address::UdpOut(place) => {
            let to = place.to_socket_addrs()?.next();
            let to = to.ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "the host has no address"))?;
            let any = if to.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
            let socket = UdpSocket::bind(any)?;
            socket.set_read_timeout(Some(TIMEOUT))?;
            let (other, peer) = (socket.try_clone()?, Peer::fixed(to));
            Ok((Source::Udp { socket, peer: peer.clone(), from: None }, Sink::Udp(other, peer)))
        }
        Address::Tcp(place) => {
            let to = place.to_socket_addrs()?.next();
            let to = to.ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "the host has no address"))?;
            let stream = TcpStream::connect_timeout(&to, CONNECT)?;
            stream.set_read_timeout(Some(TIMEOUT))?;
            stream.set_write_timeout(Some(TIMEOUT))?;
            stream.set_nodelay(true)?;
            Ok((Source::Tcp(stream.try_clone()?), Sink::Tcp(stream)))
        }
        Address::Serial(path, baud) => {
            let port = serialport::new(path, *baud).timeout(TIMEOUT).open()?;
            Ok((Source::Serial(port.try_clone()?), Sink::Serial(port)))
        }
    }
}

impl Source {
    /// Takes the sender of the last bytes as the autopilot.
    pub fn accept(&self) {
        if let Self::Udp { peer, from: Some(from), .. } = self {
            peer.accept(*from);
        }
    }
}

impl Read for Source {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Udp { socket, peer, from } => {
                let (length, sender) = socket.recv_from(bytes)?;
                if peer.get().is_some_and(|known| known != sender) {
                    // A datagram of another program.
                    return Err(io::ErrorKind::WouldBlock.into());
                }
                *from = Some(sender);
                if length == 0 { Err(io::ErrorKind::WouldBlock.into()) } else { Ok(length) }
            }
            Self::Tcp(stream) => stream.read(bytes),
            Self::Serial(port) => port.read(bytes),
        }
    }
}

impl Write for Sink {
    /// Without a known receiver, bytes are dropped.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Udp(socket, peer) => match peer.get() {
                Some(to) => socket.send_to(bytes, to),
                None => Ok(bytes.len()),
            },
            Self::Tcp(stream) => stream.write(bytes),
            Self::Serial(port) => port.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Tcp(stream) => stream.flush(),
            // A serial line would wait until it has sent everything, without a limit.
            Self::Udp(..) | Self::Serial(_) => Ok(()),
        }
    }
}
