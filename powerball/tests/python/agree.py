#!/usr/bin/env python3
"""python-canopen against powerball, both ways.

    agree.py POWERBALL udp|slcan

As master it drives the six slaves of `powerball virtual-arm`; as slave it answers `powerball bus`. Prints what was
checked; exit code 1 with a trace where the two do not agree.
"""

import json
import os
import pty
import random
import select
import struct
import subprocess
import sys
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
        for sub, value in enumerate([4, 0x200, 2, 3, 0xCAFE]):
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


def main():
    powerball, kind = sys.argv[1:]
    for role in (python_is_master, python_is_slave):
        role(powerball, {"udp": Udp, "slcan": Slcan}[kind]())
    print(f"python-canopen {canopen.__version__} and powerball agree over {kind}")


if __name__ == "__main__":
    main()
