"""Reads and switches an emulated LabJack with pymodbus, whose Modbus is not ours: labjack_client.py PORT."""
import struct
import sys
import threading

from pymodbus.client import ModbusTcpClient

port = int(sys.argv[1])


def connect():
    client = ModbusTcpClient("127.0.0.1", port=port)
    assert client.connect()
    return client


def read(client, address, form):
    n = struct.calcsize(">" + form) // 2
    answer = client.read_holding_registers(address, n)
    assert not answer.isError(), answer
    return struct.unpack(">" + form, struct.pack(f">{n}H", *answer.registers))


def write(client, address, form, *values):
    data = struct.pack(">" + form, *values)
    answer = client.write_registers(address, list(struct.unpack(f">{len(data) // 2}H", data)))
    assert not answer.isError(), answer


client = connect()
assert read(client, 55100, "I") == (0x00112233,)
assert read(client, 60000, "f") == (7,)
assert client.read_input_registers(55100, 2).registers == [0x0011, 0x2233]

# The whole of a scan as the paper's bench does it: DC source on, one switch after the other.
write(client, 1000, "f", 4.5)
write(client, 2500, "HH", 0x00FF, 0xFE00)
write(client, 2600, "HH", 0x00FF, 0xFE01)
volts = []
for sensor in range(8):
    write(client, 2500, "HH", 0x00FF & ~(1 << sensor), 0xFE00)
    volts.append(read(client, 4, "f")[0])
# G = (g0 + g1 100 N) of the eight sensors, times 1.8 kohm and 4.5 V; repeatability leaves 5 %.
slopes = [1.62, 1.85, 1.48, 1.71, 1.37, 1.56, 1.93, 1.44]
for v, slope in zip(volts, slopes):
    assert abs(v / (slope * 100e-6 * 1800 * 4.5) - 1) < 0.05, (v, slope)

# What cannot be is refused, and its reason can be read.
refused = client.write_registers(4990, [0, 1])  # a stream of nothing
assert refused.isError() and refused.exception_code == 4, refused
assert read(client, 55000, "H") == (2600,)
assert client.read_holding_registers(900, 1).exception_code == 2
assert client.read_coils(0, 1).isError()
assert client.read_holding_registers(1, 1).isError()  # half a value


# Many clients at once, each in its own time.
def hammer():
    own = connect()
    for _ in range(100):
        assert read(own, 55100, "I") == (0x00112233,)
    own.close()


threads = [threading.Thread(target=hammer) for _ in range(8)]
for t in threads:
    t.start()
for t in threads:
    t.join()
assert read(client, 60028, "I") == (470012345,)
