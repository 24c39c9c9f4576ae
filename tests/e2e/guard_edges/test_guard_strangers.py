"""Web pages, and who may open a Unix socket."""

import fcntl
import socket
import stat
import sys

from guarded import START, is_turning, rests, turns
from program import eventually


def tcp_guard(guard, protocol, drives):
    process = guard(protocol, drives, serve="tcp-listen:127.0.0.1:0")
    host, _, number = process.port.rpartition(":")
    return process, (host, int(number))


def test_no_web_page_starts_a_motor_wherever_its_request_is_cut(bench, guard):
    protocol = "st"
    drives = bench(protocol)
    process, address = tcp_guard(guard, protocol, drives)
    body = START[protocol] * 3
    request = b"POST / HTTP/1.1\r\nContent-Length: %d\r\n\r\n" % len(body) + body
    # The whole of what is held back, and the beginning of what follows.
    for number, cut in enumerate((0, 4), 1):
        with socket.create_connection(address, timeout=5) as page:
            page.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            if request[:cut]:
                page.sendall(request[:cut])
                eventually(lambda: unsent(page) == 0, "the first part has arrived")
            try:
                page.sendall(request[cut:])
                assert page.recv(64) == b""
            except ConnectionError:
                pass
        process.until(
            lambda: sum("its data was not passed on" in text for text in process.err) == number,
            f"browser {number} is reported",
        )
    assert not is_turning(drives, protocol)
    # A program is let in as before.
    with socket.create_connection(address, timeout=5) as program:
        program.sendall(START[protocol])
        turns(drives, protocol)
    rests(drives, protocol)


def test_the_body_behind_a_web_pages_request_does_not_reach_a_served_drive(sim, run):
    """A browser sends a longer body after the request, while the server still lets go of it."""
    drives = sim(st=("tcp",), rmd=())
    host, port = drives.st_address.split(":")
    for number in range(20):
        with socket.create_connection((host, int(port)), timeout=5) as page:
            page.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            try:
                page.sendall(b"POST / HTTP/1.1\r\nContent-Length: 40000\r\n\r\n")
                for _ in range(number % 4):
                    page.sendall(START["st"] * 10)
                page.sendall(START["st"] * 1000)
                page.recv(64)
            except ConnectionError:
                pass
    assert run("st", "-p", drives.port("tcp"), "get", "STATUS").ended(0).out.split()[1] == "IDLE"


def unsent(page):
    """Bytes that the other end's kernel has not acknowledged."""
    siocoutq = 0x5411
    return int.from_bytes(fcntl.ioctl(page, siocoutq, bytes(4)), sys.byteorder)


def test_simulated_drives_do_not_listen_to_browsers_either(sim):
    drives = sim(st=("tcp",), rmd=("tcp",))
    words = b"GET /\r\n\x23\x01\x01\x25"
    for address in (drives.st_address, drives.can_address):
        host, _, number = address.rpartition(":")
        with socket.create_connection((host, int(number)), timeout=5) as page:
            page.sendall(words)
            try:
                assert page.recv(64) == b""
            except ConnectionError:
                pass


def test_a_unix_socket_is_its_users_own_and_gone_at_the_end(bench, guard, client, run, tmp_path):
    drives = bench("rmd")
    path = tmp_path / "held.sock"
    process = guard("rmd", drives, serve=f"unix-listen:{path}")
    mode = path.stat().st_mode
    assert stat.S_ISSOCK(mode) and stat.S_IMODE(mode) == 0o600
    run("rmd", "-p", f"slcan:unix:{path}", "--timeout", "500ms", "status").ended(0)
    program = client("rmd", process.port)
    turns(drives, "rmd")
    second = run("st", "-p", f"unix:{path}", "info").ended(3)
    assert "hung up" in second.err
    program.kill()
    rests(drives, "rmd")
    process.interrupt()
    assert process.wait() == 0
    assert not path.exists()


def test_a_socket_of_a_killed_server_is_replaced_and_a_living_one_is_not(bench, guard, run, tmp_path):
    drives = bench("st")
    path = tmp_path / "held.sock"
    process = guard("st", drives, serve=f"unix-listen:{path}")
    other = run("sim", "--stdin", "--st", f"unix-listen:{path}").ended(3)
    assert "served already" in other.err
    process.kill()
    assert path.exists()
    run("st", "-p", f"unix:{path}", "info").ended(3)
    guard("st", drives, serve=f"unix-listen:{path}")
    run("st", "-p", f"unix:{path}", "info").ended(0)
