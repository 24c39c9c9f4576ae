"""All together.

GUARD_RUNS=200 pytest tests/e2e/guard_edges -k combinations -s    shows the distribution of 200 runs each.
"""

import os
import random
import signal
import statistics
import time

import pytest

from guarded import ENDING, PORT, PTY, SUSPENDING, is_told_to_stop, rests, turns
from program import eventually
from unread import UNREAD, Mute

#: Random combinations of each protocol.
RUNS = int(os.environ.get("GUARD_RUNS", "3"))


@pytest.mark.parametrize("protocol", PORT)
def test_random_combinations_leave_nothing_turning(bench, motorlink, client, tmp_path, protocol):
    """Signals, kills, stops and unread pipes in any order, as often as GUARD_RUNS says."""
    seed = int(os.environ.get("GUARD_SEED", time.time_ns()))
    print(f"GUARD_SEED={seed}")
    chance = random.Random(seed)
    drives = bench(protocol)
    times = []
    for number in range(RUNS):
        serve = chance.choice([f"{PTY[protocol]}:{tmp_path}/held{number}", f"unix-listen:{tmp_path}/s{number}"])
        guard = Mute(motorlink, protocol, drives, serve, chance.choice([*UNREAD.values(), os.pipe]))
        story = [serve.partition(":")[0]]
        try:
            mode = chance.choice(["hold", "poll", "flood"])
            program = client(protocol, guard.port, mode)
            turns(drives, protocol)
            story.append(mode)
            began = time.monotonic()
            acts = ["client", *chance.choices(["end", "suspend", "freeze", "wait"], k=chance.randint(0, 4))]
            chance.shuffle(acts)
            for act in acts:
                story.append(act)
                if act == "client":
                    program.send_signal(chance.choice([signal.SIGKILL, signal.SIGTERM, signal.SIGABRT]))
                elif act == "end":
                    guard.process.send_signal(chance.choice(ENDING))
                elif act == "suspend":
                    guard.process.send_signal(chance.choice(SUSPENDING))
                elif act == "freeze":
                    program.send_signal(signal.SIGSTOP)
                    program.send_signal(signal.SIGCONT)
                else:
                    time.sleep(chance.uniform(0, 0.05))
            what = f"the stop after {story} (GUARD_SEED={seed}, run {number})"
            eventually(lambda: is_told_to_stop(drives, protocol), what, within=20)
            times.append(time.monotonic() - began)
            if "end" in acts:
                assert guard.process.wait(40) == 0, f"{story} (GUARD_SEED={seed}, run {number})"
            else:
                assert guard.process.poll() is None, story
        finally:
            guard.end()
        # Whatever the guard did, this one begins at rest.
        rests(drives, protocol)
    times = sorted(1e3 * span for span in times)
    parts = statistics.quantiles(times, n=100) if len(times) > 1 else times * 99
    print(
        f"{protocol}: {len(times)} runs, 0 left turning; ms to the stop: median {parts[49]:.0f},"
        f" 90 % {parts[89]:.0f}, 99 % {parts[98]:.0f}, most {times[-1]:.0f}"
    )
