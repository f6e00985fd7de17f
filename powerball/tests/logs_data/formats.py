"""Makes the logs of tests/log_formats.rs: the samples of samples.py, as others left or stored them.

    pip install numpy pyarrow mcap mcap-ros2-support mcap-protobuf-support cyclonedds rosbags zstandard h5py hdf5storage && python formats.py
"""

import datetime
import decimal
import json
import math
import os
import pathlib
import shutil
import sqlite3
import zipfile
from dataclasses import dataclass

import cyclonedds.idl.annotations as idl
import h5py
import hdf5storage
import numpy
import pyarrow
import pyarrow.parquet
import rosbags.rosbag1
import rosbags.rosbag2
import zstandard
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, sequence, uint32
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from mcap_protobuf.writer import Writer as ProtobufWriter
from mcap_ros2.writer import Writer as RosWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from samples import CHAIN, SAMPLES, START, STEP, arm, order, received, sample

TABLES = """
CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,
serialization_format TEXT NOT NULL,offered_qos_profiles TEXT NOT NULL);
CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,
timestamp INTEGER NOT NULL, data BLOB NOT NULL);
"""
PUT = "INSERT INTO messages(topic_id, timestamp, data) VALUES (?,?,?)"


def bag(name, mode):
    for ending in ("", "-wal", "-shm", "-journal"):
        if os.path.exists(name + ending):
            os.remove(name + ending)
    db = sqlite3.connect(name, isolation_level=None)
    db.execute("PRAGMA page_size = 512")
    db.execute(f"PRAGMA journal_mode = {mode}")
    db.executescript(TABLES)
    db.execute("INSERT INTO topics VALUES (1,'/joint_states','sensor_msgs/msg/JointState','cdr','')")
    return db


def put(db, samples):
    for k in samples:
        db.execute(PUT, (1, received(k), arm(k)))


def left_by_a_crash(name, db, ending):
    """The files as they are while the program still runs."""
    shutil.copy(name, "copy.db3")
    shutil.copy(name + ending, "copy.db3" + ending)
    db.close()
    for own in (name, name + ending):
        if os.path.exists(own):
            os.remove(own)
    os.rename("copy.db3", name)
    os.rename("copy.db3" + ending, name + ending)
    if os.path.exists(name + "-shm"):
        os.remove(name + "-shm")


def crashed():
    # Half of the messages are in the file, half of them next to it.
    db = bag("waiting.db3", "WAL")
    put(db, range(SAMPLES // 2))
    db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    put(db, range(SAMPLES // 2, SAMPLES))
    left_by_a_crash("waiting.db3", db, "-wal")
    # A transaction that was half written has to be taken back.
    db = bag("half_written.db3", "DELETE")
    put(db, range(SAMPLES // 2))
    db.execute("PRAGMA cache_size = 1")
    db.execute("BEGIN")
    put(db, range(SAMPLES // 2, SAMPLES))
    db.execute("UPDATE messages SET data = zeroblob(length(data))")
    left_by_a_crash("half_written.db3", db, "-journal")


RULE = "=" * 80
HEADER = f"""{RULE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{RULE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
ARM_STATE = f"""# Of an arm.
uint8 MODE_IDLE=0
uint8 MODE_RUN = 1
string<=10 note "none"
std_msgs/Header header
uint8 mode 1
string[] joint_names
float64[] position
float32[<=8] temperature
Extra extra
Point[] cloud
float64[] effort
{RULE}
MSG: arm_msgs/Extra
bool on
int16 count
float32[3] force
Empty nothing
int64 big
builtin_interfaces/Duration age
{RULE}
MSG: arm_msgs/Empty
{RULE}
MSG: arm_msgs/Point
float64 x
float64 y
{RULE}
MSG: builtin_interfaces/Duration
int32 sec
uint32 nanosec
{HEADER}"""
JOINT_STATE = f"std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n{HEADER}"


@dataclass
@idl.final
class Time(IdlStruct):
    sec: int32
    nanosec: uint32


@dataclass
@idl.final
class Header(IdlStruct):
    stamp: Time
    frame_id: str


@dataclass
@idl.final
class JointState(IdlStruct):
    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclass
@idl.appendable
class GrownPoint(IdlStruct):
    x: float64
    y: float64


@dataclass
@idl.appendable
class Grown(IdlStruct):
    """A type of its own whose writer is newer: it has a field more at its end."""

    names: sequence[str]
    points: sequence[GrownPoint]
    position: sequence[float64]
    effort: sequence[float64]
    added: str


GROWN = f"string[] names\nGrownPoint[] points\nfloat64[] position\nfloat64[] effort\n{RULE}\nMSG: arm_msgs/GrownPoint\nfloat64 x\nfloat64 y\n"


def stamp(k):
    return {"sec": START + k // 100, "nanosec": k % 100 * 10_000_000}


def turned(k):
    o, (q, dq, tau) = order(k), sample(k)
    return [CHAIN[j] for j in o], [q[j] for j in o], [dq[j] for j in o], [tau[j] for j in o]


def defined():
    """Messages of types that nobody knows beforehand."""
    with open("defined.mcap", "wb") as out:
        writer = RosWriter(out, chunk_size=20_000)
        schema = writer.register_msgdef("arm_msgs/msg/ArmState", ARM_STATE)
        for k in range(SAMPLES):
            names, q, _, tau = turned(k)
            extra = {"on": k % 2 == 0, "count": -k, "force": [1.5, -2.0, k], "nothing": {}, "big": 2**40 + k}
            message = {
                "note": "x" * (k % 7),
                "header": {"stamp": stamp(k), "frame_id": "base"},
                "mode": 1,
                "joint_names": names,
                "position": q,
                "temperature": [30.0, 31.0],
                "extra": {**extra, "age": {"sec": 1, "nanosec": 500_000_000}},
                "cloud": [{"x": 1.0, "y": 2.0}] * (k % 3),
                "effort": tau,
            }
            writer.write_message("/arm", schema, message, log_time=received(k), publish_time=received(k))
        writer.finish()
    with open("xcdr2.mcap", "wb") as out:
        writer = McapWriter(out, compression=CompressionType.ZSTD)
        writer.start()
        channels = []
        for topic, kind, text in [
            ("/final", "sensor_msgs/msg/JointState", JOINT_STATE),
            ("/grown", "arm_msgs/msg/Grown", GROWN),
        ]:
            schema = writer.register_schema(kind, "ros2msg", text.encode())
            channels.append(writer.register_channel(topic, "cdr", schema))
        for k in range(SAMPLES):
            names, q, dq, tau = turned(k)
            head = Header(Time(**stamp(k)), "base")
            final = JointState(head, names, q, dq, tau).serialize(use_version_2=True)
            grown = Grown(names, [GrownPoint(1.0, 2.0)] * (k % 3), q, tau, "new").serialize(use_version_2=True)
            for channel, data in zip(channels, [final, grown]):
                writer.add_message(channel, log_time=received(k), publish_time=received(k), data=data)
        writer.finish()


def protobuf_types():
    """An arm's state as lists with their names, and joints each with its name, as foxglove.JointStates has them."""
    kinds = {"double": 1, "float": 2, "int64": 3, "int32": 5, "bool": 8, "string": 9, "message": 11, "uint32": 13, "enum": 14}
    file = descriptor_pb2.FileDescriptorProto(
        name="arm.proto", package="arm", syntax="proto3", dependency=["google/protobuf/timestamp.proto"]
    )
    mode = file.enum_type.add(name="Mode")
    for number, name in enumerate(["IDLE", "RUN"]):
        mode.value.add(name=name, number=number)

    def message(name, fields):
        own = file.message_type.add(name=name)
        for number, (field, kind, of, repeated) in enumerate(fields, 1):
            own.field.add(name=field, number=number, type=kinds[kind], type_name=of, label=3 if repeated else 1)

    def optional(name, fields):
        for field in next(m for m in file.message_type if m.name == name).field:
            if field.name in fields:
                own = next(m for m in file.message_type if m.name == name)
                own.oneof_decl.add(name=f"_{field.name}")
                field.oneof_index, field.proto3_optional = len(own.oneof_decl) - 1, True

    time = ".google.protobuf.Timestamp"
    message("Point", [("x", "double", None, False), ("y", "float", None, False)])
    message("Header", [("stamp", "message", time, False), ("frame_id", "string", None, False)])
    message(
        "State",
        [
            ("header", "message", ".arm.Header", False),
            ("joint_names", "string", None, True),
            ("position", "double", None, True),
            ("effort", "double", None, True),
            ("mode", "enum", ".arm.Mode", False),
            ("count", "int64", None, False),
            ("force", "float", None, True),
            ("tip", "message", ".arm.Point", False),
            ("cloud", "message", ".arm.Point", True),
            ("sent", "message", time, False),
            ("on", "bool", None, False),
        ],
    )
    message(
        "Joint",
        [("name", "string", None, False), *((q, "double", None, False) for q in ("position", "velocity", "effort"))],
    )
    optional("Joint", ["velocity", "effort"])
    message("Joints", [("timestamp", "message", time, False), ("joints", "message", ".arm.Joint", True)])
    pool = descriptor_pool.DescriptorPool()
    pool.AddSerializedFile(timestamp_pb2.DESCRIPTOR.serialized_pb)
    pool.Add(file)
    return [message_factory.GetMessageClass(pool.FindMessageTypeByName(f"arm.{name}")) for name in ("State", "Joints")]


def protobuf():
    State, Joints = protobuf_types()
    with open("protobuf.mcap", "wb") as out:
        writer = ProtobufWriter(out, chunk_size=8192)
        for k in range(SAMPLES):
            names, q, _, tau = turned(k)
            at = {"seconds": START + k // 100, "nanos": k % 100 * 10_000_000}
            state = State(
                header={"stamp": at, "frame_id": "base"}, joint_names=names, position=q, effort=tau, mode=k % 2, count=-k,
                force=[1.5, -2.0, k], tip={"x": k, "y": 0.5}, cloud=[{"x": 1.0}] * (k % 3),
                sent={"seconds": 3, "nanos": 500_000_000}, on=k % 2 == 0,
            )  # fmt: skip
            # A velocity that was not measured is absent, not zero.
            joints = [{"name": n, "position": p, "effort": e} for n, p, e in zip(names, q, tau)]
            for topic, own in [("/state", state), ("/joints", Joints(timestamp=at, joints=joints))]:
                writer.write_message(topic, own, log_time=received(k), publish_time=received(k))
        writer.finish()


def json_forms():
    """Objects as foxglove.JointStates in JSON, and with names under another name and a date."""
    with open("json_forms.mcap", "wb") as out:
        writer = McapWriter(out, compression=CompressionType.ZSTD)
        writer.start()
        schema = writer.register_schema("foxglove.JointStates", "jsonschema", b"{}")
        channels = [writer.register_channel(topic, "json", schema) for topic in ("/joints", "/named")]
        zone = datetime.timezone.utc
        for k in range(SAMPLES):
            names, q, _, tau = turned(k)
            at = datetime.datetime.fromtimestamp(START, zone) + datetime.timedelta(milliseconds=10 * k)
            joints = [{"name": n, "position": p, "effort": e} for n, p, e in zip(names, q, tau)]
            forms = [
                {"timestamp": {"sec": START + k // 100, "nsec": k % 100 * 10_000_000}, "joints": joints},
                {"timestamp": at.isoformat(), "joint_names": names, "position": q, "effort": tau},
            ]
            for channel, form in zip(channels, forms):
                data = json.dumps(form).encode()
                writer.add_message(channel, log_time=received(k), publish_time=received(k), data=data)
        writer.finish()


def bag_with_definitions():
    db = bag("iron.db3", "DELETE")
    db.execute(
        "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY,topic_type TEXT NOT NULL,encoding TEXT NOT NULL,"
        "encoded_message_definition TEXT NOT NULL,type_description_hash TEXT NOT NULL)"
    )
    db.execute("INSERT INTO message_definitions VALUES (1,'arm_msgs/msg/Grown','ros2msg',?,'')", (GROWN,))
    db.execute("INSERT INTO topics VALUES (2,'/grown','arm_msgs/msg/Grown','cdr','')")
    for k in range(SAMPLES):
        names, q, _, tau = turned(k)
        data = Grown(names, [], q, tau, "new").serialize(use_version_2=False)
        db.execute(PUT, (2, received(k), data))
    db.close()


def types_of_parquet():
    """Columns of every type that holds numbers; row k of each is made of k."""
    rows = range(60)
    some = [None if k == 7 else k for k in rows]
    start = datetime.datetime(2023, 11, 14, 22, 13, 20)
    times = [start + datetime.timedelta(milliseconds=5 * k) for k in rows]
    cents = [decimal.Decimal(k) / 100 for k in rows]
    pairs = [[k, k + 0.5] for k in rows]
    columns = {
        "t": (times, pyarrow.timestamp("ns")),
        "t_us": (times, pyarrow.timestamp("us", tz="UTC")),
        "t_ms": (times, pyarrow.timestamp("ms")),
        "day": ([t.date() for t in times], pyarrow.date32()),
        "clock": ([(t - start).seconds for t in times], pyarrow.time32("s")),
        "half": ([numpy.float16(k / 8) for k in rows], pyarrow.float16()),
        "single": (some, pyarrow.float32()),
        "cents": (cents, pyarrow.decimal128(12, 2)),
        "long_cents": (cents, pyarrow.decimal256(50, 2)),
        "short_cents": (cents, pyarrow.decimal128(6, 2)),
        "on": ([k % 2 == 0 for k in rows], pyarrow.bool_()),
        "byte": ([k - 30 for k in rows], pyarrow.int8()),
        "word": ([2**63 + k for k in rows], pyarrow.uint64()),
        "some": (some, pyarrow.int32()),
        "list": ([None if k == 7 else pair for k, pair in zip(rows, pairs)], pyarrow.list_(pyarrow.float32())),
        "large": (pairs, pyarrow.large_list(pyarrow.float64())),
        "fixed": ([[numpy.float16(x) for x in pair] for pair in pairs], pyarrow.list_(pyarrow.float16(), 2)),
        "struct": ([{"a": k, "b": -k} for k in rows], pyarrow.struct([("a", pyarrow.int16()), ("b", pyarrow.float64())])),
        "word_of": (["even" if k % 2 == 0 else "odd" for k in rows], pyarrow.string()),
    }
    table = pyarrow.table({name: pyarrow.array(values, kind) for name, (values, kind) in columns.items()})
    pyarrow.parquet.write_table(table, "types.parquet", compression="zstd", row_group_size=25)


def arrays_of_numpy():
    t = numpy.array([STEP * k for k in range(SAMPLES)])
    q, tau = (numpy.array([sample(k)[i] for k in range(SAMPLES)]) for i in (0, 2))
    stamps = numpy.datetime64("2023-11-14T22:13:20", "ns") + (t * 1e9).round().astype("timedelta64[ns]")
    late = stamps.copy()
    late[5] = numpy.datetime64("NaT")
    k = numpy.arange(SAMPLES)
    # As if the archive were larger than 4 GB.
    limit, zipfile.ZIP64_LIMIT = zipfile.ZIP64_LIMIT, 16
    numpy.savez_compressed(
        "types.npz",
        time=stamps,
        q=q,
        tau=tau,
        half=(k / 8).astype(numpy.float16),
        single=(k / 8).astype(">f4"),
        on=k % 2 == 0,
        byte=(k - 60).astype(numpy.int8),
        word=(k + 2**40).astype(">u8"),
        late=late.astype("datetime64[ms]"),
        since=(t * 1e6).round().astype("timedelta64[us]"),
        names=numpy.array(CHAIN, dtype=">U10"),
    )
    zipfile.ZIP64_LIMIT = limit
    records = numpy.zeros(SAMPLES, dtype=[("t", "<f8"), ("q", ">f4", (2,)), ("mode", "<i2"), ("tau", "<f8", (2,))])
    records["t"], records["q"], records["mode"], records["tau"] = t, q, 3, tau
    numpy.save("records.npy", records)
    numpy.save("alone.npy", numpy.asfortranarray(q))


def ros2_folder(name, mode):
    """A bag in its folder with compression, by rosbags."""
    shutil.rmtree(name, ignore_errors=True)
    store = get_typestore(Stores.ROS2_FOXY)
    writer = rosbags.rosbag2.Writer(pathlib.Path(name), version=8, storage_plugin=rosbags.rosbag2.StoragePlugin.SQLITE3)
    writer.set_compression(mode, rosbags.rosbag2.CompressionFormat.ZSTD)
    with writer:
        topic = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        for k in range(SAMPLES):
            writer.write(topic, received(k), arm(k))


METADATA = """rosbag2_bagfile_information:
  version: 9
  storage_identifier: mcap
  duration:
    nanoseconds: 1190000000
  starting_time:
    nanoseconds_since_epoch: 1700000000005000000
  message_count: 240
  topics_with_message_count:
    - topic_metadata:
        name: /joint_states
        type: sensor_msgs/msg/JointState
        serialization_format: cdr
        offered_qos_profiles: ""
      message_count: 120
  compression_format: zstd
  compression_mode: FILE
  relative_file_paths:
    - split_2.mcap.zstd
    - split_10.mcap.zstd
"""


def split_folder():
    """Two files, whose numbers of topics are not the same."""
    shutil.rmtree("split", ignore_errors=True)
    os.mkdir("split")
    half = SAMPLES // 2
    for number, samples, topics in [
        (2, range(half), ["/joint_states", "/other"]),
        (10, range(half, SAMPLES), ["/other", "/joint_states"]),
    ]:
        name = f"split/split_{number}.mcap"
        with open(name, "wb") as out:
            writer = McapWriter(out, compression=CompressionType.NONE)
            writer.start()
            schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", JOINT_STATE.encode())
            ids = {topic: writer.register_channel(topic, "cdr" if topic[1] == "j" else "odd", schema) for topic in topics}
            for k in samples:
                for topic in topics:
                    writer.add_message(ids[topic], log_time=received(k), publish_time=received(k), data=arm(k))
            writer.finish()
        with open(name, "rb") as plain, open(name + ".zstd", "wb") as packed:
            packed.write(zstandard.compress(plain.read(), 19))
        os.remove(name)
    with open("split/metadata.yaml", "w") as out:
        out.write(METADATA)


def ros1(name, compression):
    if os.path.exists(name):
        os.remove(name)
    store = get_typestore(Stores.ROS1_NOETIC)
    text = "Header header\nstring[] names\nfloat32[] position\ntime at\nfloat64[] effort\nuint8[] picture\n"
    store.register(get_types_from_msg(text.replace("Header", "std_msgs/Header"), "arm_msgs/msg/State"))
    stamp, header = store.types["builtin_interfaces/msg/Time"], store.types["std_msgs/msg/Header"]
    writer = rosbags.rosbag1.Writer(name)
    writer.set_compression(compression)
    # A chunk now and then, not one for all.
    writer.chunk_threshold = 8000
    with writer:
        kinds = ["sensor_msgs/msg/JointState", "arm_msgs/msg/State"]
        topics = [writer.add_connection(f"/{kind.split('/')[2]}", kind, typestore=store) for kind in kinds]
        for k in range(SAMPLES):
            names, q, dq, tau = turned(k)
            head = header(seq=k, stamp=stamp(sec=START + k // 100, nanosec=k % 100 * 10_000_000), frame_id="base")
            arrays = [numpy.array(x) for x in (q, dq, tau)]
            states = store.types[kinds[0]](head, names, *arrays)
            own = store.types[kinds[1]](
                head, names, arrays[0].astype(numpy.float32), stamp(sec=3, nanosec=k), arrays[2],
                numpy.zeros(100, dtype=numpy.uint8),
            )  # fmt: skip
            for topic, kind, message in zip(topics, kinds, [states, own]):
                writer.write(topic, received(k), store.serialize_ros1(message, kind))


def hdf5():
    t = numpy.array([STEP * k for k in range(SAMPLES)])
    q, dq, tau = (numpy.array([sample(k)[i] for k in range(SAMPLES)]) for i in range(3))
    cells = numpy.array(CHAIN[::-1], dtype=object)
    log = {"t": t, "q": q[:, ::-1].copy(), "tau": tau[:, ::-1].T.copy(), "joints": cells, "mode": numpy.int16(3)}
    for name in ("v73.mat", "demonstrations.hdf5", "log.h5"):
        if os.path.exists(name):
            os.remove(name)
    hdf5storage.savemat("v73.mat", {"log": log, "comment": "no number"}, format="7.3", store_python_metadata=False)
    with h5py.File("demonstrations.hdf5", "w") as out:
        out.create_group("mask")["train"] = numpy.array([b"demo_0"])
        for number in (0, 1):
            demo = out.create_group(f"data/demo_{number}")
            demo.attrs["num_samples"] = SAMPLES
            demo.create_dataset("actions", data=numpy.zeros((SAMPLES, 3), numpy.float32), compression="gzip")
            demo["dones"] = (t > 1) & (t < 2)
            demo["obs/robot0_joint_pos"] = q + number
            demo["obs/picture"] = numpy.zeros((SAMPLES, 2, 2, 3), numpy.uint8)
    with h5py.File("log.h5", "w", libver=("v110", "v114")) as out:
        out.create_dataset("t", data=t, chunks=(32,), compression="gzip", shuffle=True)
        out.create_dataset("q", data=q, chunks=(32, 2), fletcher32=True)
        out["tau"] = tau.astype(">f8")
        out["names"] = CHAIN


def dates():
    """Times as dates: with a zone, as Python prints them, and as NumPy does; a clock in Berlin's summer time."""
    zone = datetime.timezone(datetime.timedelta(hours=2))
    start = datetime.datetime.fromtimestamp(START, datetime.timezone.utc)
    with open("dates.csv", "w") as out:
        out.write("iso,t,numpy,q1,q2,tau1,tau2\n")
        for k in range(SAMPLES):
            at = start + datetime.timedelta(milliseconds=10 * k)
            q, _, tau = sample(k)
            times = [at.astimezone(zone).isoformat(), str(at.replace(tzinfo=None)), numpy.datetime64(at.replace(tzinfo=None), "ns")]
            out.write(",".join([*map(str, times), *map(repr, [*q, *tau])]) + "\n")


def lerobot(folder, version, names, files):
    """A dataset as LeRobot leaves it: its description, and episodes of some samples each in files."""
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(f"{folder}/meta")
    features = {
        "observation.state": {"dtype": "float32", "shape": [3], "names": names},
        "action": {"dtype": "float32", "shape": [3], "names": names},
        "observation.effort": {"dtype": "float64", "shape": [3], "names": names},
        "timestamp": {"dtype": "float32", "shape": [1], "names": None},
    }
    episodes = sum((episodes for _, episodes in files), [])
    path = "episode_{episode_index:06d}" if version == "v2.1" else "file-{file_index:03d}"
    info = {
        "codebase_version": version,
        "robot_type": "two_joints",
        "total_episodes": len(episodes),
        "total_frames": sum(map(len, episodes)),
        "fps": 100,
        "data_path": "data/chunk-{chunk_index:03d}/" + path + ".parquet",
        "features": features,
    }
    with open(f"{folder}/meta/info.json", "w") as out:
        json.dump(info, out, indent=1)
    kinds = [
        ("observation.state", pyarrow.list_(pyarrow.float32(), 3)),
        ("action", pyarrow.list_(pyarrow.float32())),
        ("observation.effort", pyarrow.list_(pyarrow.float64())),
        ("timestamp", pyarrow.float32()),
        ("frame_index", pyarrow.int64()),
        ("episode_index", pyarrow.int64()),
        ("index", pyarrow.int64()),
        ("task_index", pyarrow.int64()),
    ]
    first = index = 0
    for name, episodes in files:
        rows = []
        for episode, samples in enumerate(episodes, first):
            for frame, k in enumerate(samples):
                q, _, tau = sample(k)
                # A gripper, then the joints from the tip.
                state = [50.0, math.degrees(q[1]), math.degrees(q[0])]
                rows.append([state, state, [0.0, tau[1], tau[0]], frame * STEP, frame, episode, index, 0])
                index += 1
        first += len(episodes)
        os.makedirs(os.path.dirname(f"{folder}/{name}"), exist_ok=True)
        columns = [pyarrow.array([row[i] for row in rows], kind) for i, (_, kind) in enumerate(kinds)]
        table = pyarrow.table(dict(zip((name for name, _ in kinds), columns)))
        pyarrow.parquet.write_table(table, f"{folder}/{name}", compression="snappy")


def datasets_of_lerobot():
    names = [f"{joint}.pos" for joint in ["gripper", *CHAIN[::-1]]]
    each = [range(40), range(40, 90), range(90, SAMPLES)]
    files = [(f"data/chunk-{k // 2:03d}/episode_{k:06d}.parquet", [samples]) for k, samples in enumerate(each)]
    lerobot("lerobot_v21", "v2.1", {"motors": names}, files)
    files = [("data/chunk-000/file-000.parquet", each[:2]), ("data/chunk-000/file-001.parquet", each[2:])]
    lerobot("lerobot_v30", "v3.0", names, files)


crashed()
defined()
bag_with_definitions()
types_of_parquet()
arrays_of_numpy()
ros2_folder("packed_file", rosbags.rosbag2.CompressionMode.FILE)
ros2_folder("packed_messages", rosbags.rosbag2.CompressionMode.MESSAGE)
split_folder()
for compression in rosbags.rosbag1.Writer.CompressionFormat:
    ros1(f"ros1_{compression.name.lower()}.bag", compression)
hdf5()
datasets_of_lerobot()
dates()
protobuf()
json_forms()
