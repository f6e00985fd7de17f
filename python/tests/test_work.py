"""Long computations: Ctrl-C, progress, other threads."""

import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import powerball as pb
from conftest import ROOT, need

PUMA = ROOT / "dyngen" / "tests" / "urdf" / "puma.urdf"
LWA4P = ROOT / "powerball" / "lwa4p.toml"

INTERRUPTED = """
import os, signal, sys, threading, time
import powerball as pb

arm = pb.Arm.from_toml(sys.argv[1])
threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT)).start()
try:
    pb.excite(arm, evaluations=20_000_000)
except KeyboardInterrupt:
    print("interrupted", flush=True)
os._exit(0)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="sends a POSIX signal")
def test_ctrl_c_ends_a_computation():
    started = time.monotonic()
    command = [sys.executable, "-c", INTERRUPTED, str(LWA4P)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "interrupted", done.stderr
    assert done.stderr == "" and time.monotonic() - started < 20


def test_an_exception_of_the_progress_function_ends_it():
    arm = pb.Arm.from_toml(LWA4P)

    def refuse(what):
        raise LookupError(what)

    with pytest.raises(LookupError, match="deriving and proving"):
        pb.excite(arm, evaluations=100, progress=refuse)


def test_progress_with_tqdm_and_without(capsys):
    need("tqdm")
    arm = pb.Arm.from_toml(LWA4P)
    pb.excite(arm, evaluations=100, progress=True)
    assert "searching" in capsys.readouterr().err


def test_what_is_being_done_is_logged(caplog):
    with caplog.at_level("INFO", logger="powerball"):
        pb.excite(pb.Arm.from_toml(LWA4P), evaluations=100)
    assert any("searching" in record.message for record in caplog.records)


def test_batches_let_other_threads_work():
    arm = pb.Arm.from_urdf(PUMA)
    q = np.random.default_rng(0).uniform(-1, 1, (400_000, 6))
    arm.regressor(q[:1], q[:1], q[:1])
    spent = {}

    def work():
        began = time.monotonic()
        arm.regressor(q, q, q)
        spent["batch"] = time.monotonic() - began

    thread = threading.Thread(target=work)
    thread.start()
    longest, last = 0.0, time.monotonic()
    while thread.is_alive():
        time.sleep(0.001)
        now = time.monotonic()
        longest, last = max(longest, now - last), now
    thread.join()
    # With the interpreter's lock held nothing runs in all that time but the look at the arguments.
    assert longest < 0.5 * spent["batch"], (longest, spent)
