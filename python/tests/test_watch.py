"""The recipe of docs/watch.md on recorded bags of /joint_states.

A push is never a payload, a payload never a push.
"""

import subprocess

import numpy as np
import pytest

import powerball as pb
from conftest import BINARIES, DATA, ROOT, command, need

rosbag2 = need("rosbags.rosbag2")
typesys = need("rosbags.typesys")

STORE = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
#: The logs a model is made of, and the one that judges: xtask/src/watch/measured.rs has the same.
MODELS = {
    "ur10e": (["fourier_12a", "fourier_12b", "fourier_5", "fourier_7", "fourier_8"], ["fourier_12c"]),
    "ur5_pushes": (["no6", "no7", "no8"], ["no9"]),
}
#: Seconds that the clock of a robot begins with.
NOW = 1_790_000_000


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    """A function that explains an arm's logs once: its arm and the files for `watch`."""
    known = {}

    def of(name):
        if name not in known:
            folder = DATA / name
            if not folder.exists():
                pytest.skip(f"{folder} is not there: POWERBALL_DATA names its folder")
            arm = pb.Arm.from_toml(folder / "arm.toml")
            logs = [[folder / f"{log}.csv" for log in part] for part in MODELS[name]]
            out = tmp_path_factory.mktemp(name)
            pb.explain(arm, *logs).save(out)
            known[name] = arm, ["--arm", folder / "arm.toml", "--model", out / "model.json"]
        return known[name]

    return of


def record(arm, log, bag, plugin):
    """A bag as `ros2 bag record /joint_states` makes it of an arm that moves as in a log."""
    head = log.read_text().split("\n", 1)[0].split(",")
    rows = np.loadtxt(log, delimiter=",", skiprows=1)
    columns = {key: [head.index(f"{key}{j + 1}") for j in range(arm.dof)] for key in ("q", "dq", "i")}
    of = {key: np.ascontiguousarray(rows[:, own]) for key, own in columns.items()}
    torque_constants = np.array([row[4] for row in arm._core.limits])
    names = [f"joint{j + 1}" for j in range(arm.dof)]
    header, state = (STORE.types[kind] for kind in ("std_msgs/msg/Header", "sensor_msgs/msg/JointState"))
    with rosbag2.Writer(bag, version=9, storage_plugin=plugin) as writer:
        topic = writer.add_connection("/joint_states", state.__msgtype__, typestore=STORE)
        for k, t in enumerate(rows[:, head.index("t")]):
            nanoseconds = NOW * 10**9 + round(1e9 * t)
            stamp = STORE.types["builtin_interfaces/msg/Time"](*divmod(nanoseconds, 10**9))
            message = state(
                header(stamp, "base_link"), names, of["q"][k], of["dq"][k], torque_constants * of["i"][k]
            )
            writer.write(topic, nanoseconds, STORE.serialize_cdr(message, state.__msgtype__))


def echoed(bag):
    """What `ros2 topic echo --csv /joint_states` prints while a bag is played."""
    lines = []
    with rosbag2.Reader(bag) as reader:
        for topic, _, data in reader.messages():
            message = STORE.deserialize_cdr(data, topic.msgtype)
            stamp = message.header.stamp
            values = [stamp.sec, stamp.nanosec, message.header.frame_id, *message.name]
            values += [*message.position, *message.velocity, *message.effort]
            lines.append(",".join(str(value) for value in values) + "\n")
    return "".join(lines)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "log", "plugin", "changed"),
    [
        ("ur5_pushes", "no9", "MCAP", set()),
        ("ur5_pushes", "no9_pushed", "SQLITE3", {"collision"}),
        ("ur10e", "fourier_14", "SQLITE3", set()),
        ("ur10e", "fourier_14_load", "MCAP", {"load"}),
    ],
)
def test_a_recorded_bag_gives_the_word_of_what_changed(models, tmp_path, name, log, plugin, changed):
    arm, files = models(name)
    bag = tmp_path / "bag"
    record(arm, DATA / name / f"{log}.csv", bag, rosbag2.StoragePlugin[plugin])
    (file,) = (path for path in bag.iterdir() if path.suffix in (".db3", ".mcap"))
    read = command("powerball", "watch", *files, "--word", "--log", file)
    words = read.stdout.split()
    # Other words, as of friction that is warmer, are neither.
    assert {"load", "collision"} & set(words) == changed, words
    assert read.returncode == bool(words), read.stderr
    # The recipe: its exit code is the gate.
    script = ROOT / "examples" / "ros2" / "joint_states.awk"
    rows = subprocess.run(
        ["awk", "-f", script], input=echoed(bag), capture_output=True, text=True, check=True
    )
    watch = [BINARIES / "powerball", "watch", *files, "--word", "-"]
    piped = subprocess.run(watch, input=rows.stdout, capture_output=True, text=True)
    assert (piped.stdout, piped.returncode) == (read.stdout, read.returncode), piped.stderr
