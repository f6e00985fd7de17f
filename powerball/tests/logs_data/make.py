"""Makes the logs of this folder, each with the writer of its format: sqlite3, the package mcap, numpy.

    pip install mcap numpy lz4 zstandard scipy pyarrow && python make.py

All hold the same 120 samples of two joints at 100 Hz. `shoulder` is the first of the chain; messages name the joints in
the order of the alphabet, every third one the other way round. A gripper publishes on the same topic.
"""

import json
import os
import sqlite3

import numpy
import pyarrow
import pyarrow.parquet
import scipy.io
from mcap.writer import CompressionType, Writer
from samples import CHAIN, SAMPLES, START, STEP, arm, dynamic, gripper, joint_state, received, sample

def rosbag():
    if os.path.exists("bag.db3"):
        os.remove("bag.db3")
    db = sqlite3.connect("bag.db3")
    db.executescript(
        "PRAGMA page_size = 512;"
        "CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,"
        "serialization_format TEXT NOT NULL,offered_qos_profiles TEXT NOT NULL);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,"
        "timestamp INTEGER NOT NULL, data BLOB NOT NULL);"
        "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
    )
    for id, name, kind in [
        (1, "/joint_states", "sensor_msgs/msg/JointState"),
        (2, "/camera", "sensor_msgs/msg/Image"),
    ]:
        db.execute("INSERT INTO topics VALUES (?,?,?,'cdr','')", (id, name, kind))
    put = "INSERT INTO messages(topic_id, timestamp, data) VALUES (?,?,?)"
    for k in range(SAMPLES):
        # Long frame names would do as well: some rows are longer than a page of 512 bytes.
        db.execute(put, (1, received(k), arm(k, little=k % 2 == 0)))
        if k % 10 == 0:
            db.execute(put, (1, received(k), gripper(k)))
        if k % 40 == 0:
            db.execute(put, (2, received(k), bytes(3000)))
    db.commit()
    db.close()


def mcap(name, compression, topics):
    with open(name, "wb") as out:
        writer = Writer(out, compression=compression, chunk_size=8192)
        writer.start()
        channels = {}
        for topic, (kind, encoding, _) in topics.items():
            schema = writer.register_schema(kind, "ros2msg" if encoding == "cdr" else "jsonschema", b"{}")
            channels[topic] = writer.register_channel(topic, encoding, schema)
        for k in range(SAMPLES):
            for topic, (_, _, make) in topics.items():
                if topic == "/drives" and k % 2:
                    continue
                data = make(k)
                writer.add_message(channels[topic], log_time=received(k), publish_time=received(k), data=data)
                if topic == "/joint_states" and k % 10 == 0:
                    data = gripper(k)
                    writer.add_message(channels[topic], log_time=received(k), publish_time=received(k), data=data)
        writer.finish()


def as_json(k):
    q, dq, tau = sample(k)
    return json.dumps({"timestamp": START + STEP * k, "q": q, "dq": dq, "tau": [1000 * v for v in tau]}).encode()


def only(columns):
    def make(k):
        return joint_state(k, CHAIN, [c if keep else [] for c, keep in zip(sample(k), columns)])

    return make


state = ("sensor_msgs/msg/JointState", "cdr")
rosbag()
mcap("joint_state.mcap", CompressionType.ZSTD, {"/joint_states": (*state, arm)})
mcap(
    "dynamic.mcap",
    CompressionType.LZ4,
    {"/dynamic_joint_states": ("control_msgs/msg/DynamicJointState", "cdr", dynamic)},
)
mcap("json.mcap", CompressionType.NONE, {"/arm": ("Arm", "json", as_json)})
mcap(
    "two_topics.mcap",
    CompressionType.ZSTD,
    {"/encoders": (*state, only([1, 1, 0])), "/drives": (*state, only([0, 0, 1]))},
)
t = [STEP * k for k in range(SAMPLES)]
q, dq, tau = (numpy.array([sample(k)[i] for k in range(SAMPLES)]) for i in range(3))
numpy.savez("stored.npz", t=t, q=q, dq=dq, tau=tau)
numpy.savez_compressed(
    "packed.npz",
    time=numpy.array(t, dtype=">f8"),
    q=numpy.asfortranarray(q[:, ::-1]),
    tau=tau[:, ::-1].T.copy(),
    joints=numpy.array(CHAIN[::-1]),
    comment=numpy.array("no number"),
)
with open("log.csv", "w") as out:
    out.write("t,q1,q2,dq1,dq2,tau1,tau2\n")
    for k in range(SAMPLES):
        out.write(",".join(repr(v) for v in [STEP * k, *sum(map(list, sample(k)), [])]) + "\n")

cells = numpy.array(CHAIN[::-1], dtype=object)
scipy.io.savemat("stored.mat", {"t": t, "q": q, "dq": dq, "tau": tau, "comment": "no number"})
turned = {"time": t, "q": q[:, ::-1], "tau": tau[:, ::-1].T, "joints": cells, "mode": numpy.int16(3)}
scipy.io.savemat("packed.mat", {"log": turned}, do_compression=True)


def dataset(folder):
    """A dataset as LeRobot's of version 3: two episodes in one file, each with its own time."""
    half = SAMPLES // 2
    columns = {
        "observation.state": [row[::-1] for row in q.tolist()],
        "observation.effort": [row[::-1] for row in tau.tolist()],
        "timestamp": numpy.array([STEP * (k % half) for k in range(SAMPLES)], dtype=numpy.float32),
        "episode_index": [k // half for k in range(SAMPLES)],
    }
    os.makedirs(f"{folder}/data/chunk-000", exist_ok=True)
    os.makedirs(f"{folder}/meta", exist_ok=True)
    schema = pyarrow.schema(
        [
            ("observation.state", pyarrow.list_(pyarrow.float64(), 2)),
            ("observation.effort", pyarrow.list_(pyarrow.float64())),
            ("timestamp", pyarrow.float32()),
            ("episode_index", pyarrow.int64()),
        ]
    )
    file = f"{folder}/data/chunk-000/file-000.parquet"
    pyarrow.parquet.write_table(pyarrow.table(columns, schema=schema), file, compression="zstd")
    names = [[f"{joint}.{what}" for joint in CHAIN[::-1]] for what in ("pos", "effort")]
    features = {
        "observation.state": {"names": {"motors": names[0]}},
        "observation.effort": {"names": names[1]},
    }
    with open(f"{folder}/meta/info.json", "w") as out:
        json.dump({"codebase_version": "v3.0", "features": features}, out)
    pyarrow.parquet.write_table(
        pyarrow.table({"t": t, "q": q.tolist(), "tau": tau.tolist()}), "lists.parquet", compression="snappy"
    )


dataset("dataset")
