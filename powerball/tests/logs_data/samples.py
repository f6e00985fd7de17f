"""The samples that all logs of this folder hold, and messages of them in CDR."""

import math
import struct

SAMPLES, STEP, START = 120, 0.01, 1_700_000_000
CHAIN = ["shoulder", "elbow"]


def sample(k):
    t = STEP * k
    position = [math.sin(2 * t), math.cos(3 * t)]
    velocity = [2 * math.cos(2 * t), -3 * math.sin(3 * t)]
    return position, velocity, [5 + math.sin(7 * t), math.cos(5 * t)]


def order(k):
    return [0, 1] if k % 3 == 0 else [1, 0]


class Cdr:
    def __init__(self, little=True):
        self.bytes, self.sign = bytearray(), "<" if little else ">"
        self.head = bytes([0, 1 if little else 0, 0, 0])

    def put(self, kind, value):
        size = struct.calcsize(kind)
        self.bytes += bytes(-len(self.bytes) % size) + struct.pack(self.sign + kind, value)

    def text(self, value):
        data = value.encode() + b"\0"
        self.put("I", len(data))
        self.bytes += data

    def list(self, values, each):
        self.put("I", len(values))
        for value in values:
            each(value)

    def header(self, k):
        self.put("i", START + k // 100)
        self.put("I", k % 100 * 10_000_000)
        self.text("world")

    def done(self):
        return self.head + bytes(self.bytes)


def joint_state(k, names, columns, little=True):
    m = Cdr(little)
    m.header(k)
    m.list(names, m.text)
    for column in columns:
        m.list(column, lambda v: m.put("d", v))
    return m.done()


def arm(k, little=True):
    o = order(k)
    return joint_state(k, [CHAIN[j] for j in o], [[c[j] for j in o] for c in sample(k)], little)


def gripper(k):
    return joint_state(k, ["finger"], [[0.01], [0.0], []])


def dynamic(k):
    m = Cdr()
    m.header(k)
    o, (q, dq, tau) = order(k), sample(k)
    m.list([CHAIN[j] for j in o], m.text)

    def interface(j):
        m.list(["position", "effort", "temperature"], m.text)
        m.list([q[j], tau[j], 30.0 + j], lambda v: m.put("d", v))

    m.list(o, interface)
    return m.done()


def received(k):
    # 3 ms after it was stamped, and now and then late.
    return int(1e9 * START) + 10_000_000 * k + 3_000_000 + (2_000_000 if k % 7 == 0 else 0)
