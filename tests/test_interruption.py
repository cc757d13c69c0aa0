"""Signals: noted by a thread, answered in time, whatever the main thread is doing."""

import signal
import subprocess
import sys
import threading
import time

import pytest

from flocsim.process import deferred
from tests.helpers.tiers import rest_slow
from tests.helpers.waiting import PATIENCE

BEGINS = """\
import sys, time
from flocsim import process
process.install()
"""

WAITS = f"""{BEGINS}
process.PATIENCE = {PATIENCE}
print("ready", flush=True)
while not process.stop_requested():
    time.sleep(0.01)
print(process.INTERRUPTION.name, flush=True)
sys.exit(process.STOPPED)
"""
"""A main thread that answers, however late it gets to it."""

DEAF = BEGINS + 'print("ready", flush=True)\n' + f"time.sleep({2 * PATIENCE})\n" * 2
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
    output, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, output, errors) == (75, f"{sign.name}\n", "")


def test_a_limit_of_cpu_time_that_is_passed_again_is_no_insistence():
    process = started(DEAF)
    for _ in range(3):
        process.send_signal(signal.SIGXCPU)
        time.sleep(0.4)
    _, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, errors) == (75, "flocsim: stopped by SIGXCPU\n")


def test_nohup_is_heeded():
    ignores = "import signal\nsignal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
    process = started(ignores + WAITS)
    process.send_signal(signal.SIGHUP)
    time.sleep(0.3)
    process.send_signal(signal.SIGTERM)
    output, _ = process.communicate(timeout=PATIENCE)
    assert (process.returncode, output) == (75, "SIGTERM\n")


def test_a_process_that_another_speaks_for_is_silent_and_goes_after_it():
    words = "import flocsim.process as i\ni.INTERRUPTION.speaks, i.HEAD_START = False, {}\n"
    speaker, silent, later = (
        started(each + DEAF) for each in ("", words.format(0.1), words.format(2 * PATIENCE))
    )
    for process in (speaker, silent, later):
        process.send_signal(signal.SIGUSR1)
    assert speaker.wait(timeout=PATIENCE) == 75
    assert silent.communicate(timeout=PATIENCE)[1] == ""
    assert silent.returncode == 75
    assert later.poll() is None, "it gives the other the time to speak"
    later.kill()
    later.communicate()
    speaker.communicate()


def test_a_second_signal_ends_it_at_once():
    process = started(f"import flocsim.process as i\ni.PATIENCE = {2 * PATIENCE}\n" + DEAF)
    while process.poll() is None:  # two of them are one where the first is not yet seen
        process.send_signal(signal.SIGINT)
        time.sleep(0.1)
    process.communicate(timeout=PATIENCE)
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
    _, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, errors) == (75, "flocsim: stopped by SIGTERM\n")


def test_a_deferred_signal_waits_for_the_end_of_the_block_whoever_receives_it(interruptible):
    ended = False
    with pytest.raises(KeyboardInterrupt), deferred(signal.SIGINT):
        other = threading.Thread(target=signal.raise_signal, args=(signal.SIGINT,))
        other.start()
        other.join()
        ended = True
    assert ended


def test_without_a_signal_nothing_is_raised_and_the_handler_is_as_before():
    before = signal.getsignal(signal.SIGINT)
    with deferred(signal.SIGINT):
        pass
    assert signal.getsignal(signal.SIGINT) is before
