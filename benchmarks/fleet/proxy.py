"""A TCP connection between programs of this computer that can be cut: it stays open, and nothing passes."""

import select
import socket
import threading


class Cable:
    def __init__(self, port):
        self.target = port
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.is_whole = threading.Event()
        self.is_whole.set()
        threading.Thread(target=self.accept, daemon=True).start()

    @property
    def address(self):
        return f"tcp/127.0.0.1:{self.port}"

    def accept(self):
        while True:
            near, _ = self.listener.accept()
            try:
                far = socket.create_connection(("127.0.0.1", self.target))
            except OSError:
                near.close()
                continue
            for one, other in ((near, far), (far, near)):
                threading.Thread(target=self.carry, args=(one, other), daemon=True).start()

    def carry(self, one, other):
        try:
            while True:
                select.select([one], [], [])
                self.is_whole.wait()
                data = one.recv(1 << 16)
                if not data:
                    break
                other.sendall(data)
        except OSError:
            pass
        finally:
            for end in (one, other):
                try:
                    end.shutdown(socket.SHUT_RDWR)
                except OSError:
                    pass

    def cut(self):
        self.is_whole.clear()

    def mend(self):
        self.is_whole.set()
