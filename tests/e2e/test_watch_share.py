"""`motorlink watch` on the lines of a share, beside other programs."""

import signal

from program import eventually
from sharing import Client


def speed(share):
    return abs(share.drives.motor(1, f"pty:{share.drives.st}")["speed_rpm"])


def test_stop_all_stops_and_latches_the_programs_of_the_share(shares, watch):
    share = shares()
    tuner = Client(share.path, "tuner")
    tuner.command("st0", 1, 3, 1)
    eventually(lambda: speed(share) > 300, "a motor that turns")
    terminal = watch("-p", share.st, "-p", share.rmd)
    terminal.shows("6 motors on 2 ports", "RUN")
    terminal.press("!")
    terminal.shows("stop confirmed by all 6 motors", "LATCHED (u releases it): every motion is refused")
    terminal.shows_no("NOT LATCHED")
    eventually(lambda: speed(share) < 1, "a motor at rest", 30)
    refused = tuner.command("st0", 1, 3, 1)
    assert refused["reason"] == "latched" and "watch" in refused["message"]
    terminal.press("u", "y")
    terminal.shows_no("LATCHED")
    tuner.command("st0", 1, 3, 1)
    eventually(lambda: speed(share) > 300, "a motor that turns")


def test_the_kill_of_the_share_is_said_and_stop_and_latch_are_repeated_at_the_next_one(shares, watch):
    share = shares()
    tuner = Client(share.path, "tuner")
    tuner.command("st0", 1, 3, 1)
    terminal = watch("-p", share.st, "-p", share.rmd)
    terminal.shows("RUN")
    share.process.send_signal(signal.SIGKILL)
    share.wait()
    terminal.shows("PORT GONE", "port gone, opened again")
    terminal.press("!")
    terminal.shows("stop NOT CONFIRMED, may still be turning:", "NOT LATCHED for other programs of the share")
    assert terminal.bold("NOT LATCHED") and speed(share) > 300
    share = shares()
    eventually(lambda: speed(share) < 1, "a motor at rest", 30)
    terminal.shows("stop confirmed by all 6 motors", "LATCHED (u releases it)")
    terminal.shows_no("NOT LATCHED")
    assert Client(share.path, "tuner").command("st0", 1, 3, 1)["reason"] == "latched"
    terminal.press("q")
    assert terminal.wait() == 0
