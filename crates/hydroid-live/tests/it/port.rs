//! The link to an autopilot as bytes.

use std::net::UdpSocket;
use std::time::Duration;

use hydroid_live::link::mavlink::port::Port;
use hydroid_live::link::mavlink::transport::Address;
use hydroid_live::link::{Port as _, UtcClock};
use mavlink::dialects::ardupilotmega::{ATTITUDE_DATA, HEARTBEAT_DATA, MavAutopilot, MavMessage};
use mavlink::{MavHeader, write_v2_msg};

fn frame(sequence: u8, message: &MavMessage) -> Vec<u8> {
    let mut bytes = Vec::new();
    let header = MavHeader { system_id: 1, component_id: 1, sequence };
    write_v2_msg(&mut bytes, header, message).unwrap();
    bytes
}

/// Frames with a wrong checksum were left out, and `damaged` stayed 0.
#[test]
fn damaged_frames_are_counted() {
    let heartbeat = MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        ..HEARTBEAT_DATA::DEFAULT
    });
    let attitude = MavMessage::ATTITUDE(ATTITUDE_DATA { time_boot_ms: 7, ..ATTITUDE_DATA::DEFAULT });
    // The first byte of the payload, of the checksum, and of the number of the message.
    for (place, damaged) in [(10, 3), (usize::MAX, 3), (7, 3), (0, 0)] {
        let free = UdpSocket::bind("127.0.0.1:0").unwrap();
        let address = free.local_addr().unwrap();
        drop(free);
        let mut port = Port::open(&Address::UdpIn(address.to_string()), None, UtcClock::start(1.0)).unwrap();
        let boat = UdpSocket::bind("127.0.0.1:0").unwrap();
        let send = |bytes: &[u8]| {
            boat.send_to(bytes, address).unwrap();
        };
        let mut received = 0;
        for k in 0..40 {
            send(&frame(k, &heartbeat));
            let mut bytes = frame(k, &attitude);
            if k % 13 == 1 && place > 0 {
                let place = place.min(bytes.len() - 1);
                bytes[place] ^= 0x55;
            }
            send(&bytes);
            while port.next(Duration::from_millis(20)).unwrap().is_some() {
                received += 1;
            }
        }
        send(&frame(40, &heartbeat));
        while port.next(Duration::from_millis(300)).unwrap().is_some() {
            received += 1;
        }
        assert_eq!(received, 81 - damaged, "byte {place}");
        assert_eq!(port.losses(), [damaged, 0], "byte {place}");
    }
}
