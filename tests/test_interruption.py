"""Signals: noted by a thread, answered in time, whatever the main thread is doing."""

import signal
import subprocess
import sys
import time

import pytest

from tests.helpers.tiers import rest_slow

WAITS = """\
import sys, time
from flocsim import process
process.install()
print("ready", flush=True)
until = time.monotonic() + 20
while not process.stop_requested() and time.monotonic() < until:
    time.sleep(0.01)
print(process.INTERRUPTION.name, flush=True)
sys.exit(process.STOPPED)
"""

DEAF = WAITS[: WAITS.index("until")] + "time.sleep(20)\n" * 2
"""A main thread that hears nothing."""


def started(code):
    """A process that is ready for signals."""
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "ready\n"
    return process


@pytest.mark.parametrize(
    "sign", [signal.SIGTERM, signal.SIGINT, signal.SIGUSR1, signal.SIGHUP, signal.SIGXCPU]
)
def test_a_signal_is_a_request(sign):
    process = started(WAITS)
    process.send_signal(sign)
    output, errors = process.communicate(timeout=20)
    assert (process.returncode, output, errors) == (75, f"{sign.name}\n", "")


def test_a_limit_of_cpu_time_that_is_passed_again_is_no_insistence():
    process = started(DEAF)
    for _ in range(3):
        process.send_signal(signal.SIGXCPU)
        time.sleep(0.4)
    _, errors = process.communicate(timeout=20)
    assert (process.returncode, errors) == (75, "flocsim: stopped by SIGXCPU\n")


def test_nohup_is_heeded():
    ignores = "import signal\nsignal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
    process = started(ignores + WAITS)
    process.send_signal(signal.SIGHUP)
    time.sleep(0.3)
    process.send_signal(signal.SIGTERM)
    output, _ = process.communicate(timeout=20)
    assert (process.returncode, output) == (75, "SIGTERM\n")


def test_a_process_that_does_not_answer_is_ended_in_time():
    process = started(DEAF)
    began = time.monotonic()
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=20)
    assert time.monotonic() - began < 10.0
    assert (process.returncode, errors) == (75, "flocsim: stopped by SIGTERM\n")


def test_a_process_that_another_speaks_for_is_silent_and_goes_after_it():
    speaker = started(DEAF)
    words = "import flocsim.process as i\ni.INTERRUPTION.speaks, i.HEAD_START = False, 2.0\n"
    silent = started(words + DEAF)
    for process in (silent, speaker):
        process.send_signal(signal.SIGUSR1)
    assert speaker.wait(timeout=20) == 75
    assert silent.poll() is None
    assert silent.communicate(timeout=20)[1] == ""
    assert silent.returncode == 75
    speaker.communicate()


def test_a_second_signal_ends_it_at_once():
    process = started(DEAF)
    while process.poll() is None:  # two of them are one where the first is not yet seen
        process.send_signal(signal.SIGINT)
        time.sleep(0.1)
    process.communicate(timeout=20)
    assert process.returncode == 130


ENDLESS = """\
from flocsim import process
process.install()
from flocsim.compiler.composer import compose
def inner(x):
    while x > 0.0:
        x = x + 1.0 if x < 9.0 else x - 1.0
    return x
def entry(x):
    return inner(x)
run = compose(entry, {}, jit=JIT)
run(-1.0)
print("ready", flush=True)
run(1.0)
"""


@pytest.mark.parametrize("jit", rest_slow([True, False], bool))
def test_a_kernel_that_never_ends_is_ended_by_a_signal(jit):
    process = started(ENDLESS.replace("JIT", str(jit)))
    time.sleep(0.2)
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=20)
    assert (process.returncode, errors) == (75, "flocsim: stopped by SIGTERM\n")
