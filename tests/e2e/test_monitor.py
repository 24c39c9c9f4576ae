"""Pages of `motorlink monitor`: their motors stop when they end, freeze or say so, and no other motors do."""

import json
import os
import signal
import struct
import subprocess

import pytest

from monitoring import Site, is_kind, kind, trusting
from program import eventually
from sharing import Client, are_still, event, speeds

#: Servers that are killed or frozen. ROUNDS=20 for more.
ROUNDS = int(os.environ.get("ROUNDS", "1"))
#: A deadline that a live page keeps on a busy machine.
DEADLINE = ("--deadline", "2s")
#: A busy machine may be late with a reply.
PATIENT = ("--timeout", "60s")
SET_SPEED = 0xA2


@pytest.fixture
def drives(sim):
    """Simulated drives on a port of each kind."""
    return sim()


@pytest.fixture
def serve(start):
    """`serve(words)`: a monitor, and its site."""

    def serve(*words):
        monitor = start("monitor", "--listen", "127.0.0.1:0", "--json", *DEADLINE, *words)
        return monitor, Site(json.loads(monitor.line(0)))

    return serve


@pytest.fixture
def monitor(serve, drives):
    return serve("-p", drives.st, "-p", f"slcan:{drives.can}", *PATIENT)


@pytest.fixture
def site(monitor):
    return monitor[1]


@pytest.fixture
def watcher(site):
    """A program beside the pages."""
    return Client(site.path, "watcher")


def turns(watcher):
    """Waits until the motors of a page turn."""
    eventually(lambda: is_turning(watcher), "motors that turn")


def is_turning(watcher):
    """Whether the motors have the speeds of a page."""
    rpm, dps = speeds(watcher)
    return rpm > 1200 and dps > 300


def rests(watcher):
    """Waits until the motors of a page rest."""
    eventually(lambda: are_still(watcher), "motors that rest")


def turns_too(watcher):
    """Turns RMD motor 1 by another program; gives what checks that it keeps turning."""
    watcher.command("rmd0", 1, SET_SPEED, 0, 0, 0, *struct.pack("<i", 9000))

    def turns_still():
        return watcher.dps(1) > 60

    def check():
        assert turns_still()

    eventually(turns_still, "a motor that turns")
    return check


def test_the_motors_of_a_page_that_hangs_stop_at_the_deadline_and_it_can_go_on(site, watcher):
    turns_on = turns_too(watcher)
    with site.page() as page:
        page.alive().turn()
        turns(watcher)
        assert page.beat["holds"]
        page.lives = False
        why = "the page gave no sign of life for 2000 ms"
        assert page.lapsed() == why
        rests(watcher)
        turns_on()
        control = f"{page.welcome['name']} (control)"
        assert watcher.until(event("left", by=control))["message"] == f"{control} left: {why}"
        answer = page.act("st0", 1, "START_MOTOR")
        assert (answer["kind"], answer["reason"]) == ("refusal", "lapsed")
        page.lives = True
        eventually(lambda: page.act("st0", 1, "START_MOTOR")["kind"] == "answer", "a page that is alive again")
        page.act_soon("rmd0", 2, "set_speed", speed_dps=360)
        turns(watcher)
        page.leave()
        rests(watcher)


def test_a_page_lets_its_motors_go(site, watcher):
    turns_on = turns_too(watcher)
    with site.page() as page, site.page() as other:
        page.alive().turn()
        turns(watcher)
        run, name = page.welcome["run"], page.welcome["name"].replace(" ", "%20")
        # Another page, another run of the server, a viewer.
        other.ask("let-go")
        for query, headers in ((f"run=0&page={name}", None), (f"run={run}&page=page%2099", None),
                               (f"run={run}&page={name}", site.viewer)):
            assert site.post(f"/api/let-go?{query}", headers)[0] == 204
        assert site.post("/api/let-go")[0] == 400
        assert page.beat["holds"] and is_turning(watcher)
        assert site.post(f"/api/let-go?run={run}&page={name}")[0] == 204
        assert page.lapsed() == "the page has let its motors go"
        rests(watcher)
        turns_on()


def test_stop_all_stops_all_motors_and_latches(site, watcher):
    turns_too(watcher)
    with site.page() as page:
        page.alive().turn()
        turns(watcher)
        stopped = {(it["line"], it["motor"]): it.get("failure") for it in page.ask("stop-all")["motors"]}
        assert stopped.items() >= {("st0", 1): None, ("rmd0", 2): None, ("rmd0", 1): None}.items()
        rests(watcher)
        watcher.until(event("latched"))
        for it in (page.act("st0", 1, "START_MOTOR"), watcher.command("st0", 1, 3, 1)):
            assert (it["kind"], it["reason"]) == ("refusal", "latched")
        assert page.ask("release")["kind"] == "answer"
        page.turn()
        turns(watcher)


def test_requests_of_a_page_about_drives_are_counted_and_delay_no_stop(site, watcher):
    turns_too(watcher)
    with site.page() as page:
        # No motor has this ID, and the share waits long for a reply.
        motor = {"line": "rmd0", "motor": 20}
        for _ in range(70):
            page.send("read", **motor, names=["temperature_celsius"])
        busy = page.until(kind("refusal"))
        assert (busy["reason"], busy["id"]) == ("busy", 65)
        assert page.ask("lines")["kind"] == "answer"
        stopped = {it["motor"]: it.get("failure") for it in page.ask("stop-all")["motors"]}
        assert stopped[1] is None and "never answered" in stopped[20]


def test_a_terminated_server_stops_all_motors_first(monitor, watcher):
    server, site = monitor
    with site.page() as page:
        page.alive().turn()
        turns(watcher)
        server.process.terminate()
        assert server.wait(60) == 0
        assert page.closed() is not None
    stopped = [json.loads(line) for line in server.out if '"stopped"' in line]
    assert {("st0", 1), ("rmd0", 2)} <= {(it["line"], it["motor"]) for it in stopped}


def test_a_server_that_was_suspended_counts_the_time(monitor, watcher):
    server, site = monitor
    with site.page() as page:
        page.alive().turn()
        turns(watcher)
        os.kill(server.process.pid, signal.SIGSTOP)
        try:
            # The page goes on, and what it says waits.
            sent = page.frame
            eventually(lambda: page.frame > sent + 25, "signs of life")
        finally:
            os.kill(server.process.pid, signal.SIGCONT)
        assert "no sign of life" in page.lapsed()
        # The share counts requests as old that may have waited.
        watcher.ask("lines")
        rests(watcher)


@pytest.fixture
def share(start, drives, tmp_path):
    """`share()`: a share of these drives, again and again at the same place."""
    path = tmp_path / "share"

    def share():
        words = ["-p", drives.st, "-p", f"slcan:{drives.can}", "--at", f"unix:{path}", *PATIENT]
        running = start("share", *words, "--json")
        running.line(0)
        return running

    share.path = path
    return share


def test_a_killed_server_of_a_running_share_leaves_nothing_turning(serve, share, run):
    share()
    watcher = Client(share.path, "watcher")
    turns_on = turns_too(watcher)
    for words in (("--share", f"unix:{share.path}"), ("-p", f"share:{share.path}/st0")) * ROUNDS:
        server, site = serve(*words)
        with site.page() as page:
            page.alive().turn()
            turns(watcher)
            server.kill()
            rests(watcher)
        turns_on()
    # Nor is a share shown as what it is not.
    words = ("monitor", "--listen", "127.0.0.1:0", "--share", f"unix:{share.path}", "--profile", "mcsdk-5.4")
    refused = run(*words).ended(2)
    assert "st0 of the share has the profile spec, not mcsdk-5.4" in refused.err


def test_a_frozen_server_of_a_running_share_leaves_nothing_turning(serve, share):
    share()
    watcher = Client(share.path, "watcher")
    turns_on = turns_too(watcher)
    for _ in range(ROUNDS):
        server, site = serve("--share", f"unix:{share.path}")
        with site.page() as page:
            page.alive().turn()
            turns(watcher)
            server.process.send_signal(signal.SIGSTOP)
            control = f"{page.welcome['name']} (control)"
            left = watcher.until(event("left", by=control))["message"]
            # Twice the deadline.
            assert left.startswith(f"{control} left: no sign of life for 4"), left
            rests(watcher)
            server.process.send_signal(signal.SIGCONT)
            assert page.lapsed()
        turns_on()
        server.kill()


def test_pages_are_told_that_the_share_is_lost_and_back(serve, share):
    running = share()
    _, site = serve("--share", f"unix:{share.path}")
    with site.page() as page:
        page.alive().turn()
        # An orderly end, which stops the motors.
        running.interrupt()
        assert running.wait(60) == 0
        page.until(lambda it: is_kind(it, "share") and it["lost"])
        page.until(kind("lapsed"))
        for ask in ("lines", "stop-all"):
            answer = page.ask(ask)
            assert (answer["kind"], answer["reason"]) == ("refusal", "line"), answer
        assert site.post("/api/stop-all")[0] == 503
        with site.page() as late:
            late.until(lambda it: is_kind(it, "share") and it["lost"])
            share()
            for one in (page, late):
                one.until(lambda it: is_kind(it, "share") and it["lost"] is None)
                assert one.ask("lines")["kind"] == "answer"
        # The stop from before was sent.
        assert page.ask("release")["kind"] == "answer"
        watcher = Client(share.path, "watcher")
        eventually(lambda: page.act("st0", 1, "START_MOTOR")["kind"] == "answer", "drives of the new share")
        page.turn()
        turns(watcher)
        assert site.post("/api/stop-all")[0] == 200
        rests(watcher)


@pytest.fixture(scope="module")
def certificate(tmp_path_factory):
    """A certificate of this machine and its key."""
    folder = tmp_path_factory.mktemp("tls")
    words = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes",
             "-days", "2", "-subj", "/CN=bench", "-addext", "subjectAltName=IP:127.0.0.1,DNS:localhost",
             "-keyout", folder / "key.pem", "-out", folder / "cert.pem"]
    subprocess.run(words, check=True, capture_output=True)
    return folder / "cert.pem", folder / "key.pem"


def test_pages_come_through_tls(start, certificate):
    cert, key = certificate
    words = ["--listen", "127.0.0.1:0", "--tls-cert", cert, "--tls-key", key, "--json", *DEADLINE]
    monitor = start("monitor", *words)
    site = Site(json.loads(monitor.line(0)), trusting(cert))
    assert site.scheme == "https"
    _, answer, _ = site.request("GET", f"/?token={site.tokens['url']}")
    assert "Secure" in answer["Set-Cookie"].split("; ")
    with site.page() as page:
        assert page.alive().ask("stop-all")["kind"] == "answer"
    assert site.post("/api/stop-all")[0] == 200


@pytest.mark.parametrize(
    "words, said",
    [
        (["--listen", "0.0.0.0:0"], "anybody can read the tokens"),
        (["--listen", "127.0.0.1:0", "--tls-cert", "CERT"], "--tls-key"),
        (["--deadline", "200ms", "--listen", "127.0.0.1:0", "--tls-cert", "CERT", "--tls-key", "CERT"], "CERT"),
        (["--listen", "127.0.0.1:0", "--tls-cert", "/nowhere", "--tls-key", "KEY"], "/nowhere"),
        (["--deadline", "100ms"], "--deadline is 200ms"),
        (["--share", "unix:x", "-p", "sim:"], "leave -p out"),
        (["-p", "share:./x/st0", "-p", "sim:"], "shown alone"),
        (["-p", "zenoh:arm1/st0"], "--fleet"),
    ],
)
def test_what_cannot_be_served_is_refused(run, certificate, words, said):
    files = {"CERT": str(certificate[0]), "KEY": str(certificate[1])}
    done = run("monitor", *(files.get(word, word) for word in words)).ended(2)
    assert files.get(said, said) in done.err


def test_pages_from_the_network_connect_to_no_address_without_a_word(start):
    # Nobody listens there.
    port = {"port": "slcan:tcp:127.0.0.1:1", "protocol": "rmd"}
    own, insecure = ["--listen", "127.0.0.1:0"], ["--listen", "0.0.0.0:0", "--insecure"]
    for words, reason in ((own, "line"), (insecure, "forbidden"), ([*insecure, "--open-addresses"], "line")):
        with Site(json.loads(start("monitor", *words, "--json").line(0))).page() as page:
            for ask in ("open", "scan"):
                assert page.ask(ask, **port)["reason"] == reason, ask


def test_the_usual_port_may_be_taken(start):
    first, second = (start("monitor", "--json") for _ in range(2))
    ports = {Site(json.loads(one.line(0))).port for one in (first, second)}
    assert len(ports) == 2 and min(ports) >= 8707
    eventually(lambda: any("is taken" in line for one in (first, second) for line in one.err), "a note")
