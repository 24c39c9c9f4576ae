"""Frames of the Motor Control Protocol: codes, checksum, building, receiving."""

MAX_PAYLOAD = 128           # 3: "Allowed values range from 0 to 128 bytes"
FRAME_TIMEOUT = 0.025       # 4.1: "within 25 ms"

# Table 1: frame codes that only the master sends
SET_REG = 0x01
GET_REG = 0x02
EXECUTE_CMD = 0x03
GET_BOARD_INFO = 0x06
SET_RAMP = 0x07
GET_REVUP_DATA = 0x08
SET_REVUP_DATA = 0x09
SET_CURRENT_REF = 0x0A
GET_FW_VERSION = 0x0C
GET_DATA_ELEMENT = 0x0D
CONFIG_DYN_STRUCT = 0x0E

# Table 1, 4.2, 4.3: headers that only the slave sends (whole bytes, HOLES 1)
ACK = 0xF0
NACK = 0xFF

# Table 2: error codes of a NACK
BAD_FRAME_ID = 0x01
SET_READ_ONLY = 0x02
GET_WRITE_ONLY = 0x03
WRONG_SET = 0x05
WRONG_CMD = 0x07
OVERRUN = 0x08
TIMEOUT = 0x09
BAD_CRC = 0x0A
BAD_MOTOR_SELECTED = 0x0B
MP_NOT_ENABLED = 0x0C


class Nack(Exception):
    """Raised by a handler: the message ends with this error code (4.3)."""

    def __init__(self, code):
        super().__init__(code)
        self.code = code


def checksum(data):
    """3.3: 16-bit sum of header, length, payload; then high byte + low byte."""
    total = sum(data) & 0xFFFF
    return ((total >> 8) + (total & 0xFF)) & 0xFF


def build_frame(header, payload=b""):
    """Header, Length, Payload, Checksum (3, Figure 2)."""
    body = bytes([header, len(payload)]) + bytes(payload)
    return body + bytes([checksum(body)])


def ack(payload=b""):
    """4.2: Positive Acknowledge."""
    return build_frame(ACK, payload)


def nack(code):
    """4.3: Negative Acknowledge, one Error Code byte (Figure 4)."""
    return build_frame(NACK, bytes([code]))


class FrameReader:
    """4.1, receiving side: Header, Length, Length bytes, Checksum, in 25 ms."""

    def __init__(self, timeout=FRAME_TIMEOUT):
        self.timeout = timeout
        self.buffer = b""
        self.started = None     # when the first byte of this frame was taken

    def clear(self):
        """Forget a half-received frame."""
        self.buffer = b""
        self.started = None

    def deadline(self):
        """The moment at which the frame under way is too late, or None."""
        return None if self.started is None else self.started + self.timeout

    def feed(self, data, now):
        """Take bytes; return the whole frames they complete, in order."""
        frames = []
        if not self.buffer:
            self.started = now
        self.buffer += data
        while len(self.buffer) >= 2 and len(self.buffer) >= self.buffer[1] + 3:
            size = self.buffer[1] + 3
            frames.append(self.buffer[:size])
            self.buffer = self.buffer[size:]
            self.started = now
        if not self.buffer:
            self.started = None
        return frames
