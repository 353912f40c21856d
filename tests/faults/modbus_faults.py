"""Scans through a proxy that spoils answers: nothing wrong may be printed, nothing may hang, every loss must show.

    modbus_faults.py SCANS SEED [tcp|rtu] [FAULT…]

What the device behind the proxy gives says by itself which request it answers: three groups of registers, each with the
number of the request (of all that ever came) and a check of both. The proxy knows which answers it let through whole, in
time and in turn; a printed reading of any other is wrong, however right its numbers are.

Not among the faults is a payload changed under a right length over TCP: Modbus TCP has no checksum of its own, that of
TCP guards each stretch of the way, and nothing in the answer would show it.
"""
import csv
import os
import random
import select
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "peers"))
import modbus_device  # noqa: E402

TIMEOUT_S = 0.02
START = 10  # requests that the start of a scan times: a device that is not there then is not lost but missing
HANG_S = 300  # for a whole run: what takes longer does not end at all

TCP_FAULTS = "none delay silence cut close duplicate reorder header length unit".split()
RTU_FAULTS = "none delay silence cut duplicate reorder burst unit".split()

PROFILE = """kind = "profile"
driver = "registers"
[link]
max_gap = 0
timeout_s = %g
retries = %d
baud = 115200
parity = "none"
"""
COLUMN = """[[register]]
table = "input"
address = %d
type = "%s"
column = "%s"
"""


def check_of(group, number):
    return (number * 40503 + group * 7919) & 0xFFFF


class Groups(modbus_device.Device):
    """Registers 0–3, 200–203 and 400–403: group, number of the request (two), check."""

    def __init__(self):
        self.number = 0
        self.groups = {}  # by number

    def read(self, table, address, n):
        self.number += 1
        group = address // 200
        self.groups[self.number] = group
        if table != "input" or address % 200 + n > 4:
            raise modbus_device.Refused(2)
        values = [group, self.number >> 16, self.number & 0xFFFF, check_of(group, self.number)]
        return values[address % 200:address % 200 + n]


class Proxy:
    """Between the line and the device: passes requests on, and spoils answers with a seed."""

    def __init__(self, fault, share, seed, serial):
        self.device = Groups()
        self.fault, self.share, self.serial = fault, share, serial
        self.random = random.Random(seed)
        self.bad = set()  # requests whose answer must never be believed
        self.spoiled = 0
        self.held = b""  # an answer that comes later
        self.held_number = None
        self.asked = 0  # requests that came
        self.waiting = None  # whether there is another request on the (serial) line already
        self.lock = threading.Lock()

    def frame(self, request):
        """The whole, good answer to a frame."""
        if self.serial:
            answer = request[:1] + self.device.answer(request[1:-2])
            return answer + modbus_device.crc16(answer)
        pdu = self.device.answer(request[7:])
        return request[:4] + struct.pack(">H", len(pdu) + 1) + request[6:7] + pdu

    def answer(self, request, send):
        """Sends what the fault makes of the answer; False: hang up."""
        with self.lock:
            self.asked += 1
            asked = self.asked
            whole = self.frame(request)
            number = self.device.number
        held, self.held = self.held, b""
        if held:  # in front of the present one, out of turn
            send(held)
        if asked <= START or self.fault == "none" or self.random.random() >= self.share:
            send(whole)
            return True
        self.spoiled += 1
        return getattr(self, self.fault)(whole, number, asked, send)

    # ---- the faults ----

    def delay(self, whole, number, asked, send):
        """Up to three times what the client waits; on a serial line everything behind it waits as well."""
        pause_s = self.random.uniform(0, 3 * TIMEOUT_S)

        def later():
            time.sleep(pause_s)
            with self.lock:
                if self.asked != asked or self.serial and self.waiting():
                    self.bad.add(number)
            send(whole)
        if self.serial or pause_s < TIMEOUT_S / 2:
            later()
        else:
            threading.Thread(target=later, daemon=True).start()
        return True

    def silence(self, whole, number, asked, send):
        self.bad.add(number)
        return True

    def cut(self, whole, number, asked, send):
        self.bad.add(number)
        send(whole[:self.random.randrange(1, len(whole))])
        return True

    def close(self, whole, number, asked, send):
        self.cut(whole, number, asked, send)
        return False

    def duplicate(self, whole, number, asked, send):
        send(whole + whole)
        return True

    def reorder(self, whole, number, asked, send):
        self.bad.add(number)
        self.held = whole
        return True

    def header(self, whole, number, asked, send):
        """One to three bits of transaction, protocol, length, unit, function or byte count."""
        self.bad.add(number)
        spoiled = bytearray(whole)
        for bit in self.random.sample(range(9 * 8), self.random.randint(1, 3)):
            spoiled[bit // 8] ^= 1 << bit % 8
        send(bytes(spoiled))
        return True

    def length(self, whole, number, asked, send):
        """Bytes too many or too few, with or without a header that agrees; what only has bytes behind it is whole."""
        more = self.random.choice([-4, -2, -1, 1, 2, 4])
        spoiled = bytearray(whole[:more] if more < 0 else whole + bytes(more))
        if self.random.random() < 0.5:
            spoiled[4:6] = struct.pack(">H", len(spoiled) - 6)
        if self.random.random() < 0.5:
            spoiled[8] = len(spoiled) - 9
        if not spoiled.startswith(whole):
            self.bad.add(number)
        send(bytes(spoiled))
        return True

    def unit(self, whole, number, asked, send):
        self.bad.add(number)
        if not self.serial:
            send(whole[:6] + b"\x07" + whole[7:])
            return True
        send(b"\x07" + whole[1:-2] + modbus_device.crc16(b"\x07" + whole[1:-2]))
        return True

    def burst(self, whole, number, asked, send):
        """Wrong bits within sixteen: what the checksum must catch."""
        self.bad.add(number)
        pattern = 1 | self.random.getrandbits(15) << 1
        at = self.random.randrange(8 * len(whole) - 15)
        # bits as the checksum counts them: the lowest of each byte first
        value = int.from_bytes(whole, "little") ^ pattern << at
        send(value.to_bytes(len(whole), "little"))
        return True


# ---- the line ----

def quiet(send):
    """Sending to a line that is gone is no error here."""
    def sent(data):
        try:
            send(data)
        except OSError:
            pass
    return sent


def talk_tcp(proxy, line):
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    with line, line.makefile("rb") as stream:
        try:
            while header := stream.read(7):
                request = header + stream.read(struct.unpack(">H", header[4:6])[0] - 1)
                if not proxy.answer(request, quiet(line.sendall)):
                    return
        except (OSError, struct.error):
            pass


def serve_tcp(proxy):
    listener = socket.create_server(("127.0.0.1", 0))

    def run():
        while True:
            threading.Thread(target=talk_tcp, args=(proxy, listener.accept()[0]), daemon=True).start()
    threading.Thread(target=run, daemon=True).start()
    return f"modbus-tcp://127.0.0.1:{listener.getsockname()[1]}", None


def serve_rtu(proxy):
    ours, path, theirs = modbus_device.open_line()
    proxy.waiting = lambda: bool(select.select([ours], [], [], 0)[0])

    def run():
        try:
            while True:
                request = modbus_device.read_rtu(ours)
                if request and request[0] == 1:
                    proxy.answer(request, quiet(lambda data: os.write(ours, data)))
        except OSError:  # the run is over
            pass
    threading.Thread(target=run, daemon=True).start()
    return f"modbus-rtu:{path}", theirs


# ---- one run ----

def scan(uri, scans, retries):
    with tempfile.TemporaryDirectory() as folder:
        profile = Path(folder, "groups.toml")
        text = PROFILE % (TIMEOUT_S, retries)
        for group in range(3):
            for address, form, name in ((0, "u16", "group"), (1, "u32", "number"), (3, "u16", "check")):
                text += COLUMN % (200 * group + address, form, f"{name}_{group}")
        profile.write_text(text)
        command = [os.environ.get("TACTUS", "tactus"), "scan", f"{uri}?profile={profile}", "--count", str(scans),
                   "--max-lost", "100"]
        return subprocess.run(command, capture_output=True, text=True, timeout=HANG_S, check=False)


def fail(what, run):
    sys.exit(f"{what}\n--- standard error:\n{run.stderr[-2000:]}")


def check_rows(proxy, run):
    """Every printed reading is that of an answer that was let through; returns rows and gaps."""
    rows = list(csv.DictReader(line for line in run.stdout.splitlines() if not line.startswith("#")))
    last_number, last_sequence = 0, -1
    for row in rows:
        sequence = int(row["sequence"])
        if sequence <= last_sequence:
            fail(f"sequence {sequence} after {last_sequence}", run)
        last_sequence = sequence
        for group in range(3):
            number = int(row[f"number_{group}"])
            if int(row[f"group_{group}"]) != group or int(row[f"check_{group}"]) != check_of(group, number):
                fail(f"scan {sequence}: {row} is no answer at all", run)
            if number <= last_number:
                fail(f"scan {sequence}: the answer to request {number} after that to {last_number}", run)
            if number in proxy.bad:
                fail(f"scan {sequence}: the answer to request {number} was spoiled or late, and is printed", run)
            last_number = number
    return len(rows), last_sequence + 1 - len(rows)


def try_fault(kind, fault, scans, seed):
    share = 0 if fault == "none" else 0.2 if scans <= 200 else 0.05
    for retries in (0, 2):
        proxy = Proxy(fault, share, f"{seed} {kind} {fault} {retries}", kind == "rtu")
        uri, keep = serve_rtu(proxy) if kind == "rtu" else serve_tcp(proxy)
        began_s = time.monotonic()
        run = scan(uri, scans // 2, retries)
        if run.returncode != 0:
            fail(f"{kind} {fault}: status {run.returncode}", run)
        rows, gaps = check_rows(proxy, run)
        if rows == 0 or (fault != "none" and proxy.spoiled == 0):
            fail(f"{kind} {fault}: nothing was tried", run)
        seen = "the link had faults" in run.stderr
        # Whatever cost a scan is said; a second copy that came before the next request is thrown away without a word.
        if (gaps or (proxy.spoiled and fault not in ("delay", "duplicate"))) and not seen:
            fail(f"{kind} {fault}: {gaps} scans are missing and nothing is said", run)
        said = next((line.split("(", 1)[1].rstrip(")") for line in run.stderr.splitlines() if "had faults" in line), "")
        print(f"# {kind} {fault}, {retries} retries: {rows} scans, {gaps} lost, {proxy.spoiled} answers spoiled, "
              f"{time.monotonic() - began_s:.1f} s; {said}", flush=True)
        if keep is not None:
            os.close(keep)


def main():
    scans, seed = int(sys.argv[1]), sys.argv[2]
    kinds = [sys.argv[3]] if len(sys.argv) > 3 else ["tcp", "rtu"]
    for kind in kinds:
        for fault in sys.argv[4:] or (TCP_FAULTS if kind == "tcp" else RTU_FAULTS):
            try_fault(kind, fault, scans, seed)


if __name__ == "__main__":
    main()
