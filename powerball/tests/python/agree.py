#!/usr/bin/env python3
"""python-canopen against powerball, both ways.

    agree.py POWERBALL udp|slcan|arm|reactions

As master it drives the six slaves of `powerball virtual-arm`; as slave it answers `powerball bus`. As an arm (`arm`, over
UDP) its six nodes are recorded along a trajectory, and stopped when one of them fails; `reactions` prints after how long,
for every failure. Prints what was checked; exit code 1 with a trace where the two do not agree.
"""

import json
import math
import os
import pty
import random
import select
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
import tty

import can
import canopen
from canopen import objectdictionary as od
from canopen.profiles.p402 import BaseNode402

GROUP = "239.74.163.2"


def variable(name, index, sub, kind, access="rw", default=None):
    made = od.ODVariable(name, index, sub)
    made.data_type = kind
    made.access_type = access
    made.default = default
    return made


def dictionary():
    """The part of the drive's dictionary that is used here, written down without powerball."""
    made = od.ObjectDictionary()
    u8, u16, u32 = od.UNSIGNED8, od.UNSIGNED16, od.UNSIGNED32
    i8, i16, i32, text = od.INTEGER8, od.INTEGER16, od.INTEGER32, od.VISIBLE_STRING
    for name, index, kind, access in [
        ("device type", 0x1000, u32, "ro"),
        ("error register", 0x1001, u8, "ro"),
        ("device name", 0x1008, text, "const"),
        ("producer heartbeat", 0x1017, u16, "rw"),
        ("password", 0x2008, text, "rw"),
        ("sync timeout factor", 0x200E, u8, "rw"),
        ("extended status", 0x2050, u8, "ro"),
        ("controlword", 0x6040, u16, "rw"),
        ("statusword", 0x6041, u16, "ro"),
        ("mode", 0x6060, i8, "rw"),
        ("mode display", 0x6061, i8, "ro"),
        ("following error window", 0x6065, u32, "rw"),
        ("greatest current", 0x6073, u16, "ro"),
        ("rated current", 0x6075, u32, "ro"),
        ("interpolation sub mode", 0x60C0, i16, "rw"),
        ("position", 0x6064, i32, "ro"),
        ("velocity demand", 0x606B, i32, "ro"),
        ("velocity", 0x606C, i32, "ro"),
        ("target torque", 0x6071, i16, "rw"),
        ("torque", 0x6077, i16, "ro"),
        ("target position", 0x607A, i32, "rw"),
        ("profile velocity", 0x6081, u32, "rw"),
        ("supported modes", 0x6502, u32, "ro"),
    ]:
        made.add_object(variable(name, index, 0, kind, access))
    for name, index, members in [
        ("identity", 0x1018, [("count", 0, u8), ("vendor", 1, u32), ("product", 2, u32), ("revision", 3, u32), ("serial", 4, u32)]),
        ("consumer heartbeat", 0x1016, [("count", 0, u8), ("master", 1, u32)]),
        ("position limits", 0x607D, [("count", 0, u8), ("least", 1, i32), ("greatest", 2, i32)]),
        ("interpolation data", 0x60C1, [("count", 0, u8), ("point", 1, i32)]),
        ("interpolation period", 0x60C2, [("count", 0, u8), ("value", 1, u8), ("exponent", 2, i8)]),
    ]:
        record = od.ODRecord(name, index)
        for member, sub, kind in members:
            record.add_member(variable(member, index, sub, kind))
        made.add_object(record)
    for base, count in [(0x1400, 2), (0x1800, 4)]:
        for k in range(count):
            record = od.ODRecord(f"pdo parameter {base + k:x}", base + k)
            for member, sub, kind in [("count", 0, u8), ("cob id", 1, u32), ("type", 2, u8), ("event timer", 5, u16)]:
                if base == 0x1800 or sub < 5:
                    record.add_member(variable(member, base + k, sub, kind))
            made.add_object(record)
            array = od.ODRecord(f"pdo mapping {base + k:x}", base + 0x200 + k)
            array.add_member(variable("count", base + 0x200 + k, 0, u8))
            for sub in range(1, 9):
                array.add_member(variable(f"entry {sub}", base + 0x200 + k, sub, u32))
            made.add_object(array)
    return made


def check(what, condition, detail=""):
    if not condition:
        raise AssertionError(f"{what}: {detail}")
    print(f"  {what}", flush=True)


def until(what, condition, timeout=5.0):
    end = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"{what}: not within {timeout} s")
        time.sleep(0.005)
    print(f"  {what}", flush=True)


class Udp:
    """A multicast group of this run's own."""

    def __init__(self):
        self.port = random.randint(40000, 60000)
        self.url = f"udp:{GROUP}:{self.port}"

    def bus(self):
        return can.Bus(interface="udp_multicast", channel=GROUP, port=self.port, hop_limit=0, fd=False)


class Slcan:
    """Two pseudo terminals, each of which hears what the other says."""

    def __init__(self):
        self.masters, self.names = [], []
        for _ in range(2):
            master, slave = pty.openpty()
            tty.setraw(slave)
            self.masters.append(master)
            self.names.append(os.ttyname(slave))
        self.url = f"slcan:{self.names[0]}"
        threading.Thread(target=self.forward, daemon=True).start()

    def forward(self):
        a, b = self.masters
        while True:
            for ready in select.select([a, b], [], [])[0]:
                os.write(b if ready == a else a, os.read(ready, 4096))

    def bus(self):
        return can.Bus(interface="slcan", channel=self.names[1], bitrate=500000, sleep_after_open=0.1)


def python_is_master(powerball, place):
    print("python-canopen as master of the virtual arm:")
    bus = place.bus()
    network = canopen.Network(bus)
    network.connect()
    arm = subprocess.Popen([powerball, "virtual-arm", "--bus", place.url, "--for", "60", "--commutated"])
    try:
        drive_the_arm(network)
    finally:
        arm.terminate()
        arm.wait()
        network.disconnect()


def drive_the_arm(network):
    found = lambda: sorted(network.scanner.nodes)
    until("six nodes boot", lambda: [n for n in found() if n <= 8] == [3, 4, 5, 6, 7, 8])
    node = network.add_node(BaseNode402(3, dictionary()))
    check("device type", node.sdo[0x1000].raw == 0x00020192)
    check("supported modes", node.sdo[0x6502].raw == 0x43)
    check("segmented upload", node.sdo[0x1008].raw == "PRL+ virtual", node.sdo[0x1008].raw)
    check("identity", node.sdo[0x1018][4].raw == 1003)
    for object_, code in [((0x6071, 0), 0x06020000), ((0x1018, 9), 0x06090011)]:
        try:
            node.sdo.upload(*object_)
            raise AssertionError(f"{object_} should not exist")
        except canopen.SdoAbortedError as e:
            check(f"abort 0x{code:08X}", e.code == code, hex(e.code))
    try:
        node.sdo.download(0x6041, 0, b"\0\0")
        raise AssertionError("the statusword was written")
    except canopen.SdoAbortedError as e:
        check("abort of a write to the statusword", e.code == 0x06010002, hex(e.code))
    node.sdo.download(0x2008, 0, b"a password in segments")
    check("segmented download", True)
    node.sdo[0x1017].raw = 50
    check("heartbeat", node.nmt.wait_for_heartbeat(2.0) == "PRE-OPERATIONAL")

    # TPDO 1 as it is; TPDO 2 anew; RPDO 1 for interpolated position, synchronous.
    node.tpdo.read()
    node.rpdo.read()
    names = [v.index for v in node.tpdo[1]]
    check("default mapping is read", names == [0x6041, 0x6077, 0x6064], names)
    node.tpdo[2].clear()
    node.tpdo[2].add_variable(0x606C)
    node.tpdo[2].add_variable(0x6061)
    node.tpdo[2].trans_type = 1
    node.tpdo[2].enabled = True
    node.rpdo[1].trans_type = 1
    for number in (3, 4):
        node.tpdo[number].enabled = False
    node.rpdo[2].enabled = False
    node.tpdo[2].save()
    node.rpdo[1].save()
    node.sdo[0x60C2][1].raw = 10
    mapped = [node.sdo[0x1A01][sub].raw for sub in range(3)]
    check("mapping is written", mapped == [2, 0x606C0020, 0x60610008], [hex(m) for m in mapped])
    emergencies = []
    node.emcy.add_callback(lambda e: emergencies.append(e.code))
    node.nmt.state = "OPERATIONAL"
    until("operational", lambda: node.nmt.state == "OPERATIONAL")

    seen = {}
    node.tpdo[1].add_callback(lambda pdo: seen.update({v.index: v.raw for v in pdo}))
    node.tpdo[2].add_callback(lambda pdo: seen.update({v.index: v.raw for v in pdo}))
    network.sync.transmit()
    until("both TPDOs answer a SYNC", lambda: 0x6064 in seen and 0x606C in seen)
    check("statusword in the TPDO", seen[0x6041] & 0x4F == 0x40, hex(seen[0x6041]))
    start = seen[0x6064]

    # Profile position, by SDO.
    node.sdo[0x6060].raw = 1
    for word, mask, value in [(0x06, 0x6F, 0x21), (0x07, 0x6F, 0x23), (0x0F, 0x6F, 0x27)]:
        node.sdo[0x6040].raw = word
        status = node.sdo[0x6041].raw
        check(f"controlword 0x{word:02X}", status & mask == value, hex(status))
    time.sleep(0.1)
    node.sdo[0x607A].raw = start + 5000
    node.sdo[0x6040].raw = 0x1F
    until("set-point acknowledged", lambda: node.sdo[0x6041].raw & 0x1000)
    node.sdo[0x6040].raw = 0x0F
    until("target reached", lambda: node.sdo[0x6041].raw & 0x0400)
    check("position", abs(node.sdo[0x6064].raw - start - 5000) <= 15, node.sdo[0x6064].raw)

    # Interpolated position: a point every 10 ms, with its SYNC.
    node.sdo[0x6060].raw = 7
    check("mode", node.sdo[0x6061].raw == 7)
    begin = node.sdo[0x6064].raw
    for k in range(200):
        point = begin + 25 * k
        network.send_message(0x203, struct.pack("<Hi", 0x1F, point))
        network.sync.transmit()
        time.sleep(0.01)
    check("interpolation is active", seen[0x6041] & 0x1000, hex(seen[0x6041]))
    check("the joint follows", abs(seen[0x6064] - point) < 300, (seen[0x6064], point))
    check("at the speed", abs(seen[0x606C] - 2500) < 800, seen[0x606C])
    check("without an emergency", emergencies == [], emergencies)
    until("left alone it says so", lambda: emergencies[:1] == [0x8250])
    until("and stops by itself", lambda: node.sdo[0x6041].raw & 0x4F == 0x40)


def python_is_slave(powerball, place):
    print("python-canopen as slave of powerball bus:")
    bus = place.bus()
    network = canopen.Network(bus)
    network.connect()
    try:
        node = network.create_node(10, dictionary())
        values = [(0x1000, 0x00020192), (0x1001, 0), (0x6041, 0x0237), (0x6061, 7), (0x6064, 57296), (0x606C, -1000), (0x6077, 500), (0x1017, 0)]
        for index, value in values:
            node.sdo[index].raw = value
        node.sdo[0x1008].raw = "a name of more than four letters"
        for sub, value in enumerate([4, 0x15E, 2, 3, 0xCAFE]):
            node.sdo[0x1018][sub].raw = value
        answer_the_master(powerball, place, node)
    finally:
        network.disconnect()


def answer_the_master(powerball, place, node):
    def run(*arguments, code=0):
        done = subprocess.run([powerball, "bus", *arguments, "--bus", place.url, "--json"], capture_output=True, text=True, timeout=60)
        if done.returncode != code:
            raise AssertionError(f"{arguments}: exit code {done.returncode}, {done.stdout} {done.stderr}")
        return json.loads(done.stdout) if code == 0 else done.stderr

    found = run("scan")["nodes"]
    check("scan", [n["node"] for n in found] == [10] and found[0]["serial"] == 0xCAFE, found)
    check("its name, in segments", found[0]["name"] == "a name of more than four letters", found)
    check("expedited upload", run("sdo", "read", "10", "0x6064")["value"] == 57296)
    check("a signed value", run("sdo", "read", "10", "0x606C")["value"] == -1000)
    run("sdo", "write", "10", "0x607A", "-12345")
    check("expedited download", node.sdo[0x607A].raw == -12345)
    run("sdo", "write", "10", "0x2008", "a text in segments")
    check("segmented download", node.sdo[0x2008].raw == "a text in segments")
    refused = run("sdo", "read", "10", "0x2999", code=1)
    check("an abort in words", "0x06020000" in refused and "does not exist" in refused, refused)
    state = run("state", "--node", "10")["nodes"][0]
    check("state", state["state"] == "operation enabled" and state["mode"] == "interpolated position", state)
    check("position in rad", abs(state["position"] - 1.0) < 1e-4, state)


class Drive:
    """One of six drives of python-canopen's own: LocalNode with its SDO server, NMT slave and heartbeat; the state
    machine of CiA 402 and the PDOs as mapped are written here, without powerball. The joint is where it is
    commanded to be."""

    def __init__(self, arm, number):
        self.arm, self.id = arm, number
        self.state, self.mode, self.word, self.position, self.target = 0x40, 0, 0, 0, None
        self.silent = self.stuck = False
        self.set, self.clear, self.shift = 0, 0, 0
        self.quick_stop = None
        self.node = arm.network.create_node(number, dictionary())
        for index, sub, data in [
            (0x1000, 0, 0x00020192), (0x1001, 0, 0), (0x1017, 0, 0), (0x6041, 0, 0x0240), (0x6061, 0, 0), (0x6064, 0, 0),
            (0x606C, 0, 0), (0x6077, 0, 0), (0x6073, 0, 1000), (0x6075, 0, 5000), (0x6502, 0, 0x43), (0x2050, 0, 3),
            (0x1018, 0, 4), (0x1018, 1, 0x15E), (0x1018, 2, 1), (0x1018, 3, 1), (0x1018, 4, number),
        ]:
            object_ = self.node.sdo[index][sub] if sub or index == 0x1018 else self.node.sdo[index]
            object_.raw = data
        self.mapping = {}
        self.node.add_write_callback(self.written)
        arm.network.subscribe(0x200 + number, lambda cob, data, at: self.receive(bytes(data)))
        arm.network.subscribe(0, self.manage)
        self.node.nmt.state = "PRE-OPERATIONAL"

    def manage(self, cob, data, at):
        """python-canopen's slave does not boot by itself when it is reset."""
        if data[0] in (0x81, 0x82) and data[1] in (0, self.id):
            self.state, self.mode = 0x40, 0
            self.node.nmt.state = "INITIALISING"
            self.node.nmt.state = "PRE-OPERATIONAL"

    def written(self, index, subindex, od, data):
        number = int.from_bytes(data, "little")
        if index == 0x6060:
            self.mode = data[0]
            self.node.data_store.setdefault(0x6061, {})[0] = bytes(data)
        elif index == 0x6040:
            self.control(number)
        elif 0x1400 <= index < 0x1C00:
            self.mapping[(index, subindex)] = number

    def mapped(self, base):
        """(index, sub, bytes) of the PDO whose parameters are at `base`, where it is switched on."""
        if self.mapping.get((base, 1), 1 << 31) >> 31:
            return []
        entries = [self.mapping[(base + 0x200, k + 1)] for k in range(self.mapping.get((base + 0x200, 0), 0))]
        return [(e >> 16, e >> 8 & 0xFF, (e & 0xFF) // 8) for e in entries]

    def receive(self, data):
        for index, sub, size in self.mapped(0x1400):
            part, data = data[:size], data[size:]
            if index == 0x6040:
                self.control(int.from_bytes(part, "little"))
            elif index == 0x60C1:
                self.target = int.from_bytes(part, "little", signed=True)

    def control(self, word):
        risen, self.word = word & 0x80 and not self.word & 0x80, word
        if word & 6 == 2:
            self.quick_stop = self.quick_stop or time.monotonic()
        if self.state == 0x08:
            self.state = 0x40 if risen else 0x08
        elif not word & 2:
            self.state = 0x40
        elif word & 6 == 2:
            # The quick stop: at rest at once, and held until it is switched off.
            if self.state == 0x27:
                self.state = 0x07
        elif self.state == 0x40 and word & 7 == 6:
            self.state = 0x21
        elif self.state == 0x21 and word & 7 == 7:
            self.state = 0x23
        elif self.state == 0x23 and word & 0xF == 0xF:
            self.state = 0x27
        elif self.state in (0x23, 0x27) and word & 7 == 6:
            self.state = 0x21

    def sync(self):
        if self.silent or self.node.nmt.state != "OPERATIONAL":
            return
        follows = self.state == 0x27 and self.mode == 7 and self.word & 0x110 == 0x10
        if follows and self.target is not None and not self.stuck:
            self.position = self.target
        ready = 0x10 if self.state not in (0x40, 0x08) else 0
        status = (self.state | 0x0200 | ready | (0x1000 if follows else 0)) & ~self.clear | self.set
        values = {0x6041: status, 0x6064: self.position + self.shift, 0x6061: self.mode}
        for k in range(4):
            mapped = self.mapped(0x1800 + k)
            data = b"".join((values.get(i, 0) & (1 << 8 * size) - 1).to_bytes(size, "little") for i, _, size in mapped)
            if mapped:
                self.arm.network.send_message(0x180 + 0x100 * k + self.id, data)


class PythonArm:
    """Six drives on one bus."""

    def __init__(self, place):
        self.network = canopen.Network(place.bus())
        self.network.connect()
        self.drives = [Drive(self, number) for number in range(3, 9)]
        self.network.subscribe(0x80, lambda cob, data, at: [drive.sync() for drive in self.drives])

    def close(self):
        for drive in self.drives:
            drive.node.nmt.stop_heartbeat()
        self.network.disconnect()


def trajectory(folder, seconds):
    """All joints swing by 0.2 rad, from rest to rest, once in 3 s."""
    path = os.path.join(folder, "path.csv")
    with open(path, "w") as file:
        file.write("t,q1,q2,q3,q4,q5,q6\n")
        for k in range(int(seconds / 0.005) + 1):
            q = 0.1 * (1.0 - math.cos(2.0 * math.pi * k * 0.005 / 3.0))
            file.write(f"{0.005 * k:.6f}," + ",".join([f"{q:.9f}"] * 6) + "\n")
    return path


def record(powerball, place, path, code, fail=None):
    """Records a trajectory on an arm of python's; `fail` befalls node 5 while it moves. Gives the arm, what was
    reported, and after how many ms the others had heard the quick stop, where there was one."""
    arm = PythonArm(place)
    log = path.replace("path", "log")
    command = [powerball, "record", "--trajectory", path, "--out", log, "--force", "--json", "--bus", place.url]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    arm.command = run
    try:
        failed = None
        if fail:
            victim = arm.drives[2]
            end = time.monotonic() + 20.0
            while victim.position < 5000 and time.monotonic() < end:
                time.sleep(0.002)
            failed = time.monotonic()
            fail(arm, victim)
        out, messages = run.communicate(timeout=60)
        if run.returncode != code:
            raise AssertionError(f"exit code {run.returncode}: {out} {messages}")
        stops = [drive.quick_stop for drive in arm.drives if not drive.silent]
        took = (max(stops) - failed) * 1e3 if fail and all(stops) else None
        at_rest = [drive.state not in (0x27, 0x07) for drive in arm.drives if not drive.silent]
        if not all(at_rest):
            raise AssertionError(f"not without torque: {at_rest}; {messages}")
        return arm, (json.loads(out) if code == 0 else messages), took, log
    finally:
        run.kill()
        run.wait()
        arm.close()


def emergency(arm, drive):
    arm.network.send_message(0x80 + drive.id, bytes([0x22, 0x32, 5, 0, 0, 0, 0, 0]))
    drive.state = 0x08


def silent(arm, drive):
    drive.silent = True
    drive.node.nmt.stop_heartbeat()


def foreign(identifier, data=b""):
    """Another master says this every 5 ms for a while."""

    def speak(arm, drive):
        for _ in range(20):
            arm.network.send_message(identifier, data)
            time.sleep(0.005)

    return lambda arm, drive: threading.Thread(target=speak, args=(arm, drive), daemon=True).start()


def put(name, value):
    return lambda arm, drive: setattr(drive, name, value)


FAILURES = [
    ("emergency and fault", emergency, "emcy"),
    ("node silent", silent, "node 5"),
    ("position stands still", put("stuck", True), "node 5"),
    ("position jumps by 6 degrees", put("shift", 6000), "jump"),
    ("voltage bit lost", put("clear", 0x10), "voltage"),
    ("remote bit lost", put("clear", 0x200), "obey"),
    ("internal limit", put("set", 0x800), "limit"),
    ("interpolation ended", put("clear", 0x1000), "interpol"),
    ("following error bit", put("set", 0x2000), "following"),
    ("SYNC of another master", foreign(0x80), "another master"),
    ("set-points of another master", foreign(0x205, bytes(6)), "another master"),
    ("a second node with its id", foreign(0x185, bytes([0x37, 0x12, 0, 0, 0, 0, 0, 0])), "node 5"),
    ("Ctrl-C", lambda arm, drive: arm.command.send_signal(signal.SIGINT), "asked to end"),
    ("SIGTERM", lambda arm, drive: arm.command.send_signal(signal.SIGTERM), "asked to end"),
    ("a terminal that is closed", lambda arm, drive: arm.command.send_signal(signal.SIGHUP), "asked to end"),
    ("boot-up message", lambda arm, drive: arm.network.send_message(0x700 + drive.id, b"\0"), "restarted"),
]


def python_is_the_arm(powerball, failures):
    print("python-canopen as the arm of powerball record:")
    with tempfile.TemporaryDirectory() as folder:
        path = trajectory(folder, 3.0)
        # How often python is late is a matter of what else the machine does: one good recording of three.
        for _ in range(3):
            arm, result, _, log = record(powerball, Udp(), path, 0)
            done = result["record"]
            # Where set-points came too late for their slot a sample is given again.
            again = done["samples"] + done["missing"] - 601
            check("a whole trajectory is followed", 0 <= again <= done["dropped"], done)
            if done["missing"] < 120:
                break
        check("with few cycles without data", done["missing"] < 120, done)
        check("to its end", all(abs(drive.position) <= 2 for drive in arm.drives), [d.position for d in arm.drives])
        with open(log) as file:
            rows = [line.split(",") for line in file.read().splitlines()[1:]]
        highest = max(float(row[1]) for row in rows)
        check("the log has the motion", abs(highest - 0.2) < 2e-3, highest)
        times = [float(row[0]) for row in rows]
        check("and its time", all(b > a for a, b in zip(times, times[1:])) and 2.9 < times[-1] < 5.0, times[-1])
        for name, fail, word in failures:
            _, messages, took, _ = record(powerball, Udp(), trajectory(folder, 12.0), 1, fail)
            check(f"{name}: all drives hear the stop after {took:.0f} ms", took < 500.0, messages)
            check(f"  reported: {messages.strip()[:90]}", word in messages.lower(), messages)


def main():
    powerball, kind = sys.argv[1:]
    if kind in ("arm", "reactions"):
        python_is_the_arm(powerball, FAILURES[:3] if kind == "arm" else FAILURES)
        return
    for role in (python_is_master, python_is_slave):
        role(powerball, {"udp": Udp, "slcan": Slcan}[kind]())
    print(f"python-canopen {canopen.__version__} and powerball agree over {kind}")


if __name__ == "__main__":
    main()
