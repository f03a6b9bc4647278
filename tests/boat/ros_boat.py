"""A boat with two thrusters in the graph of ROS 2, and hydroid-ros beside it."""

import math
import os
import threading
import time

import numpy as np
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from ros_messages import Bool, Float64, Header, Imu, NavSatFix, Quaternion, Time, Twist, TwistStamped, Vector3
from world import TICK, Plant, geographic

# One participant beside another on this computer, without multicast.
os.environ.setdefault(
    "CYCLONEDDS_URI",
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='lo' multicast='false'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<Peers><Peer address='127.0.0.1'/></Peers></Discovery></Domain></CycloneDDS>",
)


class Graph:
    """A participant of a domain, with the qualities of service that ROS 2 has by default."""

    def __init__(self, domain):
        self.participant = DomainParticipant(domain)
        self.qos = Qos(
            Policy.Reliability.Reliable(0),
            Policy.History.KeepLast(10),
            Policy.DataRepresentation(use_cdrv0_representation=True),
        )

    def _topic(self, name, of):
        return Topic(self.participant, "rt" + name, of, qos=self.qos)

    def publisher(self, name, of):
        """Writes messages of a topic."""
        return DataWriter(self.participant, self._topic(name, of), qos=self.qos)

    def subscription(self, name, of):
        """Reads messages of a topic."""
        return DataReader(self.participant, self._topic(name, of), qos=self.qos)


def stamp(seconds):
    """A time since 1970."""
    whole = math.floor(seconds)
    return Time(whole, int(1e9 * (seconds - whole)))


class Boat(threading.Thread):
    """The boat: thrust commands from -1 to 1 in, sensors out. Without commands for a second, its thrusters stop."""

    def __init__(self, domain, current=(0.0, 0.0), seed=1):
        super().__init__(daemon=True)
        graph = self.graph = Graph(domain)
        self.plant, self.ended = Plant(current), False
        self._rng = np.random.default_rng(seed)
        self._orders = {side: graph.subscription(f"/thrusters/{side}", Float64) for side in ("left", "right")}
        self._fix = graph.publisher("/gps/fix", NavSatFix)
        self._velocity = graph.publisher("/gps/vel", TwistStamped)
        self._imu = graph.publisher("/imu/data", Imu)
        self._enable = graph.publisher("/hydroid_enable", Bool)
        self.enabled, self.orders, self.heard = True, {"left": 0.0, "right": 0.0}, 0.0
        # Times and values of the commands that have arrived.
        self.received = []

    def run(self):
        """Sails until it is ended."""
        begin, k = time.time(), 0
        while not self.ended:
            now = begin + k * TICK
            time.sleep(max(now - time.time(), 0.0))
            for side, reader in self._orders.items():
                # A writer that ends leaves a sample without data.
                for order in (sample for sample in reader.take(100) if isinstance(sample, Float64)):
                    self.orders[side], self.heard = order.data, now
                    self.received.append((now, side, order.data))
            live = now - self.heard < 1.0
            pulses = [1500 + 400 * min(max(self.orders[side], -1.0), 1.0) if live else 1500 for side in ("left", "right")]
            self.plant.advance(pulses, 1.0, (0.0, 0.0))
            self._publish(now, k)
            k += 1

    def _publish(self, now, k):
        north, east, heading, *_, r = self.plant.state
        noise = self._rng.standard_normal
        header = Header(stamp(now), "base_link")
        # Angles from east, counter-clockwise; axes forward, port, up.
        half = 0.5 * (math.pi / 2 - heading + 0.005 * noise())
        self._imu.write(
            Imu(
                header,
                orientation=Quaternion(0.0, 0.0, math.sin(half), math.cos(half)),
                angular_velocity=Vector3(0.0, 0.0, -r + 0.003 * noise()),
            )
        )
        if k % 10 == 0:
            latitude, longitude = geographic(north + 0.05 * noise(), east + 0.05 * noise())
            velocity_north, velocity_east, *_ = self.plant.rates(self.plant.state)
            self._fix.write(NavSatFix(header, latitude=latitude / 1e7, longitude=longitude / 1e7))
            linear = Vector3(velocity_east + 0.03 * noise(), velocity_north + 0.03 * noise(), 0.0)
            self._velocity.write(TwistStamped(header, Twist(linear=linear)))
            self._enable.write(Bool(self.enabled))

    def stop(self):
        """Ends it."""
        self.ended = True
        self.join(5.0)
