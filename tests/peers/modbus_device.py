"""A Modbus device for tests, written from the protocol's specification alone: TCP and RTU, tables with side effects.

    modbus_device.py tcp [PORT]      the board of tactus-devices(7) on 127.0.0.1; prints the port
    modbus_device.py rtu             the same on a pseudo-terminal; prints its path
"""
import os
import pty
import select
import socket
import struct
import sys
import termios
import time
import tty


def crc16(data):
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return struct.pack("<H", crc)


class Refused(Exception):
    """An exception reply with that code."""


class Device:
    """Answers PDUs from read(table, address, n) and write(table, address, values); tables by their function codes."""

    unit = 1

    def answer(self, pdu):
        function = pdu[0]
        try:
            if function in (1, 2, 3, 4):
                address, n = struct.unpack(">HH", pdu[1:5])
                values = self.read({1: "coil", 2: "discrete", 3: "holding", 4: "input"}[function], address, n)
                if function >= 3:
                    return struct.pack(f">BB{n}H", function, 2 * n, *values)
                packed = sum(bool(v) << i for i, v in enumerate(values)).to_bytes((n + 7) // 8, "little")
                return bytes([function, len(packed)]) + packed
            if function in (5, 6):
                address, value = struct.unpack(">HH", pdu[1:5])
                self.write("coil" if function == 5 else "holding", address, [value])
                return pdu
            if function == 16:
                address, n = struct.unpack(">HH", pdu[1:5])
                self.write("holding", address, struct.unpack(f">{n}H", pdu[6:6 + 2 * n]))
                return pdu[:5]
            raise Refused(1)
        except Refused as refused:
            return bytes([function | 0x80, refused.args[0]])


def words(form, *values):
    data = struct.pack(">" + form, *values)
    return list(struct.unpack(f">{len(data) // 2}H", data))


class Board(Device):
    """The eight-sensor board: it scans by its own clock, and what it shows says by itself of which scan it is."""

    def __init__(self, clock=time.monotonic):
        self.clock = clock
        self.holding = [0] * 13
        self.started = None
        self.base = 0

    def counter(self):
        if self.started is None:
            return self.base
        rate_hz = (self.holding[4] << 16 | self.holding[5]) / 1000
        return self.base + int((self.clock() - self.started) * rate_hz)

    @staticmethod
    def volts(counter, channel):
        """Amplitude, phase and DC of a channel in a scan: each scan has its own."""
        step = (counter % 256) / 1024
        return 0.5 + step + channel / 16, 4 - step - channel / 16, 0.25 + step + channel / 16

    def input(self):
        counter = self.counter()
        values = [0] * 160
        values[0:5] = [29793, 1, 0x0102] + words("I", 4711)
        values[100:103] = words("I", counter) + [int(self.started is not None)]
        values[104:106] = words("f", counter / 64)
        for channel in range(1, 9):
            values[104 + 6 * channel:110 + 6 * channel] = words("fff", *self.volts(counter, channel))
        values[158:160] = words("I", counter)
        return values

    def read(self, table, address, n):
        values = {"input": self.input, "holding": lambda: self.holding}.get(table)
        if values is None or address + n > len(values()):
            raise Refused(2)
        return values()[address:address + n]

    def write(self, table, address, values):
        if table != "holding" or address + len(values) > len(self.holding):
            raise Refused(2)
        self.base = self.counter()
        self.holding[address:address + len(values)] = values
        self.started = self.clock() if self.holding[0] else None


def serve_tcp(device, port=0, ready=print, loops=None):
    """One client after the other, for ever."""
    listener = socket.create_server(("127.0.0.1", port))
    ready(listener.getsockname()[1])
    while True:
        line, _ = listener.accept()
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        with line, line.makefile("rb") as stream:
            try:
                while header := stream.read(7):
                    pdu = device.answer(stream.read(struct.unpack(">H", header[4:6])[0] - 1))
                    line.sendall(header[:4] + struct.pack(">H", len(pdu) + 1) + header[6:7] + pdu)
            except (OSError, struct.error):
                pass


def open_line():
    """A pseudo-terminal as a serial line: our end, the path of the other, and its descriptor to keep it open."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs, termios.TCSANOW)
    return ours, os.ttyname(theirs), theirs


def read_rtu(line, patience_s=None):
    """One request off the line, b"" if it is not whole in that time."""
    frame = b""
    needed = 8
    while len(frame) < needed:
        if not select.select([line], [], [], patience_s if not frame else 0.05)[0]:
            return b""
        frame += os.read(line, needed - len(frame))
        if len(frame) >= 7 and frame[1] in (15, 16):
            needed = 9 + frame[6]
    return frame if crc16(frame[:-2]) == frame[-2:] else b""


def serve_rtu(device, line):
    while True:
        request = read_rtu(line)
        if request and request[0] == device.unit:
            frame = request[:1] + device.answer(request[1:-2])
            os.write(line, frame + crc16(frame))


def main():
    if sys.argv[1] == "tcp":
        serve_tcp(Board(), int(sys.argv[2]) if len(sys.argv) > 2 else 0, lambda port: print(port, flush=True))
    ours, path, _kept = open_line()
    print(path, flush=True)
    serve_rtu(Board(), ours)


if __name__ == "__main__":
    main()
