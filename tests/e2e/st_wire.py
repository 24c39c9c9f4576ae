"""An ST Motor Control Protocol master of its own, byte by byte, on pyserial."""

import serial

ACK, NACK = 0xF0, 0xFF
SET_REG, GET_REG, EXECUTE, SET_RAMP = 0x01, 0x02, 0x03, 0x07
BAD_FRAME_ID, SET_READ_ONLY, GET_WRITE_ONLY, WRONG_CMD = 1, 2, 3, 7
TIMEOUT, BAD_CRC, BAD_MOTOR_SELECTED = 9, 10, 11


def checksum(frame):
    """Section 3.3: the sum of all bytes, its two halves added."""
    total = sum(frame)
    return ((total >> 8) + (total & 0xFF)) & 0xFF


def frame(header, payload=b""):
    body = bytes([header, len(payload), *payload])
    return body + bytes([checksum(body)])


def nack(code):
    return frame(NACK, [code])


def header(code, motor):
    return motor << 5 | code


class Line:
    """A serial line to a drive."""

    def __init__(self, url):
        self.port = serial.serial_for_url(url, 115200, timeout=5)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.port.close()

    def send(self, data):
        self.port.write(bytes(data))

    def reply(self):
        """The next whole frame, its checksum verified."""
        start = self.port.read(2)
        assert len(start) == 2, f"no reply, only {start.hex(' ')!r}"
        rest = self.port.read(start[1] + 1)
        whole = start + rest
        assert len(rest) == start[1] + 1, f"a cut-off reply: {whole.hex(' ')}"
        assert whole[-1] == checksum(whole[:-1]), f"a wrong checksum: {whole.hex(' ')}"
        return whole

    def ask(self, data):
        """Sends a frame and gives the reply to it."""
        self.send(data)
        return self.reply()

    def get(self, register, motor=0):
        """Reads a register."""
        reply = self.ask(frame(header(GET_REG, motor), [register]))
        assert reply[0] == ACK, reply.hex(" ")
        return int.from_bytes(reply[2:-1], "little", signed=True)

    def set(self, register, value, size, motor=0):
        """Writes a register; gives the reply."""
        data = value.to_bytes(size, "little", signed=value < 0)
        return self.ask(frame(header(SET_REG, motor), [register, *data]))
